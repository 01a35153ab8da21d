//! A partition: one octree cell's photons in a file, before they are sorted.

use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use glintmap_formats::checksum::crc32c_append;
use glintmap_formats::records::{Packer, Unpacker};

use super::Error;
use super::packed::{Packed, RECORD_BYTES};
use super::tree::Cell;

pub(super) const SUFFIX: &str = "photons";

/// Photons of a block at most: what a reader holds of a file.
const BLOCK_PHOTONS: usize = 1 << 15;
/// Bytes before a block: its photons, and the bytes that they are packed in.
const HEAD_BYTES: usize = 8;

/// One file of photons: those of one octree cell, in the order in which they came, in packed
/// blocks.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Partition {
    /// Depth of the cell in the octree.
    pub level: u32,
    /// The cell: a Morton code of `3 * level` bits.
    pub cell: u64,
    /// Number of photons.
    pub photons: u64,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Checksum of the file.
    pub crc32c: u32,
}

impl Partition {
    pub fn path(&self, dir: &Path) -> PathBuf {
        dir.join(format!("{:02}-{:x}.{SUFFIX}", self.level, self.cell))
    }

    /// Nothing yet of a cell.
    pub fn empty(cell: Cell) -> Self {
        Self { level: cell.level, cell: cell.code, photons: 0, bytes: 0, crc32c: 0 }
    }

    /// Its cell.
    pub fn cell(&self) -> Cell {
        Cell { level: self.level, code: self.cell }
    }

    fn damaged(&self, dir: &Path, what: String) -> Error {
        Error::Damaged {
            path: self.path(dir),
            byte: 0,
            part: "photons before they are sorted".to_owned(),
            what,
            stage: "trace",
        }
    }

    /// Opens the file, if it is as long as it was.
    pub fn open(&self, dir: &Path) -> Result<File, Error> {
        let path = self.path(dir);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let what = format!("the file is missing; {} photons expected", self.photons);
                return Err(self.damaged(dir, what));
            }
            Err(e) => return Err(Error::io(&path, "opening")(e)),
        };
        let length = file.metadata().map_err(Error::io(&path, "asking its length"))?.len();
        if self.bytes != length {
            let what = format!("{} bytes expected, {length} found", self.bytes);
            return Err(self.damaged(dir, what));
        }
        Ok(file)
    }

    /// Appends records to the file.
    pub fn append(&mut self, dir: &Path, records: &[u8], packer: &mut Packer) -> io::Result<()> {
        let mut file = OpenOptions::new().create(true).append(true).open(self.path(dir))?;
        for block in records.chunks(BLOCK_PHOTONS * RECORD_BYTES) {
            let packed = packer.pack::<RECORD_BYTES>(block)?;
            let photons = (block.len() / RECORD_BYTES) as u32;
            let mut head = [0; HEAD_BYTES];
            head[..4].copy_from_slice(&photons.to_le_bytes());
            head[4..].copy_from_slice(&(packed.len() as u32).to_le_bytes());
            file.write_all(&head)?;
            file.write_all(packed)?;
            self.crc32c = crc32c_append(crc32c_append(self.crc32c, &head), packed);
            self.bytes += (HEAD_BYTES + packed.len()) as u64;
        }
        Ok(())
    }

    /// Reads the photons in pieces and checks length, number and checksum.
    pub fn read(
        &self,
        dir: &Path,
        mut each: impl FnMut(&Packed) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let path = self.path(dir);
        let mut file = BufReader::with_capacity(1 << 16, self.open(dir)?);
        let mut unpacker = Unpacker::new().map_err(Error::io(&path, "unpacking photons"))?;
        let (mut packed, mut records) = (Vec::new(), Vec::new());
        let (mut photons, mut left, mut sum) = (self.photons, self.bytes, 0);
        let word = |head: &[u8; HEAD_BYTES], at: usize| {
            u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])
        };
        while left > 0 {
            let mut head = [0; HEAD_BYTES];
            file.read_exact(&mut head).map_err(Error::io(&path, "reading photons"))?;
            let (count, length) = (u64::from(word(&head, 0)), u64::from(word(&head, 4)));
            let fits = count <= photons.min(BLOCK_PHOTONS as u64)
                && length.checked_add(HEAD_BYTES as u64).is_some_and(|bytes| bytes <= left);
            if !fits {
                let what = format!(
                    "a block of {count} photons in {length} bytes, where {photons} photons and {left} bytes are left"
                );
                return Err(self.damaged(dir, what));
            }
            packed.resize(length as usize, 0);
            file.read_exact(&mut packed).map_err(Error::io(&path, "reading photons"))?;
            sum = crc32c_append(crc32c_append(sum, &head), &packed);
            unpacker
                .unpack::<RECORD_BYTES>(&packed, count as usize, &mut records)
                .map_err(|e| self.damaged(dir, e.to_string()))?;
            records.iter().try_for_each(|record| each(&Packed::read(record)))?;
            photons -= count;
            left -= length + HEAD_BYTES as u64;
        }
        if sum != self.crc32c || photons > 0 {
            let what = format!(
                "checksum {:08x} expected, {sum:08x} found; {photons} photons are missing",
                self.crc32c
            );
            return Err(self.damaged(dir, what));
        }
        Ok(())
    }
}
