//! One octree cell's photons in a file, before they are sorted.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use glintmap_formats::checksum::crc32c_append;

use super::Error;
use super::morton::LEVELS;
use super::packed::{Packed, RECORD_BYTES};

pub(super) const SUFFIX: &str = "photons";

/// One file of photons: those of one octree cell, in the order in which they came.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bucket {
    /// Depth of the cell in the octree.
    pub level: u32,
    /// The cell: a Morton code of `3 * level` bits.
    pub cell: u64,
    /// Number of photons.
    pub photons: u64,
    /// Checksum of the file.
    pub crc32c: u32,
}

impl Bucket {
    pub fn path(&self, dir: &Path) -> PathBuf {
        dir.join(format!("{:02}-{:x}.{SUFFIX}", self.level, self.cell))
    }

    /// First and last Morton code of its cell.
    pub fn codes(&self) -> (u64, u64) {
        let shift = 3 * (LEVELS - self.level);
        (self.cell << shift, ((self.cell + 1) << shift) - 1)
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

    /// Opens the file, if it is as long as its photons are many: from then on their number may
    /// size an allocation.
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
        if self.photons.checked_mul(RECORD_BYTES as u64) != Some(length) {
            let what = format!("{} photons expected, {length} bytes found", self.photons);
            return Err(self.damaged(dir, what));
        }
        Ok(file)
    }

    /// Reads the photons in pieces and checks length and checksum.
    pub fn read(
        &self,
        dir: &Path,
        mut each: impl FnMut(&Packed) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let path = self.path(dir);
        let mut file = self.open(dir)?;
        let mut piece = vec![0; RECORD_BYTES * (self.photons.min(1 << 13) as usize)];
        let mut left = self.photons * RECORD_BYTES as u64;
        let mut sum = 0;
        while left > 0 {
            let n = left.min(piece.len() as u64) as usize;
            file.read_exact(&mut piece[..n]).map_err(Error::io(&path, "reading photons"))?;
            left -= n as u64;
            sum = crc32c_append(sum, &piece[..n]);
            for record in piece[..n].as_chunks().0 {
                each(&Packed::read(record))?;
            }
        }
        if sum != self.crc32c {
            let what = format!("checksum {:08x} expected, {sum:08x} found", self.crc32c);
            return Err(self.damaged(dir, what));
        }
        Ok(())
    }
}
