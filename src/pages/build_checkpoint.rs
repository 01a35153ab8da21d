//! How far a store has come that isn't complete: what a build that was killed goes on from.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, Instant};

use glintmap_formats::checksum::crc32c;
use glintmap_formats::{gmp, seal};

use super::Error;
use super::store_header::Sums;

/// The file, in the folder of the spill that the store is built from: [`BuildCheckpoint`] as a line of
/// JSON, the pages as in a store's directory, a CRC-32C of both.
pub(super) const NAME: &str = "building.checkpoint";
/// Of the note; another one is of no use.
const VERSION: u32 = 1;
/// Bytes of a note that are read: 14 million pages, more than any store has.
const BYTES_MAX: u64 = 1 << 30;

/// The pages of a growing store that are on the disk.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BuildCheckpoint {
    version: u32,
    /// What is built, from what: checksum of the draft header and the spill's summary.
    of: u32,
    /// All photons up to this Morton code are in the pages; `None`: none are.
    pub done: Option<u64>,
    /// Length of the file so far, bytes.
    length: u64,
    pub sums: Sums,
    pages: u64,
}

/// Says now and then how far a build has come.
pub(super) struct Checkpoints<'a> {
    dir: &'a Path,
    of: u32,
    every: Duration,
    last: Instant,
}

impl<'a> Checkpoints<'a> {
    /// `dir`: the spill's folder; `of`: see [`BuildCheckpoint`]; `every`: the time between two.
    pub fn new(dir: &'a Path, of: u32, every: Duration) -> Self {
        Self { dir, of, every, last: Instant::now() }
    }

    pub fn due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Seals how far `out` has come, once all of it is on the disk.
    pub fn write(
        &mut self,
        out: &mut File,
        done: u64,
        sums: &Sums,
        pages: &[gmp::PageEntry],
    ) -> Result<(), Error> {
        let path = self.dir.join(NAME);
        let doing = || Error::io(&path, "noting how far the store has come");
        let directory = gmp::encode_directory(&[], pages)?;
        let length = out.stream_position().map_err(doing())?;
        out.sync_data().map_err(doing())?;
        let half = BuildCheckpoint {
            version: VERSION,
            of: self.of,
            done: Some(done),
            length,
            sums: *sums,
            pages: pages.len() as u64,
        };
        let mut bytes = serde_json::to_vec(&half).map_err(io::Error::from).map_err(doing())?;
        bytes.push(b'\n');
        bytes.extend(directory);
        bytes.extend(crc32c(&bytes).to_le_bytes());
        seal::write_bytes(&path, &bytes).map_err(doing())?;
        self.last = Instant::now();
        Ok(())
    }

    /// What an earlier build left: its state and its pages. `out` is cut to what is vouched for,
    /// and stands at its end. `None` where there is nothing to go on from: then `out` is as it was.
    pub fn resume(&self, out: &mut File) -> Option<(BuildCheckpoint, Vec<gmp::PageEntry>)> {
        let mut bytes = Vec::new();
        File::open(self.dir.join(NAME)).ok()?.take(BYTES_MAX).read_to_end(&mut bytes).ok()?;
        let (bytes, checksum) = bytes.split_last_chunk::<4>()?;
        let end = bytes.iter().position(|&b| b == b'\n')?;
        let half: BuildCheckpoint = serde_json::from_slice(&bytes[..end]).ok()?;
        let directory = &bytes[end + 1..];
        let fits = half.version == VERSION
            && half.of == self.of
            && crc32c(bytes) == u32::from_le_bytes(*checksum)
            && out.metadata().is_ok_and(|m| m.len() >= half.length);
        if !fits {
            return None;
        }
        let (_, pages) = gmp::decode_directory(directory, 0, half.pages).ok()?;
        out.set_len(half.length).ok()?;
        out.seek(SeekFrom::End(0)).ok()?;
        Some((half, pages))
    }

    /// Takes the note away: the store is complete, or won't be.
    pub fn forget(&self) {
        // Without its growing file the note says nothing; that it stays does no harm.
        let _ = fs::remove_file(self.dir.join(NAME));
    }
}

/// Opens the growing file as it is, or empty if it is new.
pub(super) fn open(growing: &Path) -> Result<File, Error> {
    OpenOptions::new()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(growing)
        .map_err(Error::io(growing, "creating"))
}
