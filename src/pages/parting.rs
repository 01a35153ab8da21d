//! Photons parted by octree cell, one file each, within a bound on what waits in memory.

use std::fs;
use std::path::{Path, PathBuf};

use glintmap_formats::records::Packer;

use super::Error;
use super::bucket::{Bucket, SUFFIX};
use super::cube::Cube;
use super::half_built::NAME as BUILDING;
use super::packed::{Packed, RECORD_BYTES};
use super::spill::{CHECKPOINT, SUMMARY};
use crate::base::morton::LEVELS;

/// Levels of the octree by which photons are parted at once: 4,096 buckets.
pub(super) const SPLIT_LEVELS: u32 = 4;
/// How folders are called in which a bucket is parted once more.
pub(super) const SPLIT_PREFIX: &str = "split-";

/// Parts photons by the cells of some levels of the octree below one cell.
pub(super) struct Parting {
    pub dir: PathBuf,
    pub cube: Cube,
    level: u32,
    pub buckets: Vec<(Vec<u8>, Bucket)>,
    packer: Packer,
    buffered: usize,
    buffer_bytes: usize,
    pub photons: u64,
    expected: u64,
}

impl Parting {
    /// Parts the photons of one cell into the cells `SPLIT_LEVELS` further down, as files in
    /// `dir`, which is emptied of older ones.
    pub fn create(
        dir: &Path,
        cube: Cube,
        (level, cell): (u32, u64),
        expected: u64,
        buffer_bytes: usize,
    ) -> Result<Self, Error> {
        fs::create_dir_all(dir).map_err(Error::io(dir, "making the folder"))?;
        remove_files(dir)?;
        Self::new(dir, cube, (level, cell), expected, buffer_bytes)
    }

    /// The same, with what lies in `dir` left as it is.
    pub fn new(
        dir: &Path,
        cube: Cube,
        (level, cell): (u32, u64),
        expected: u64,
        buffer_bytes: usize,
    ) -> Result<Self, Error> {
        let packer = Packer::new().map_err(Error::io(dir, "making ready to pack photons"))?;
        let down = SPLIT_LEVELS.min(LEVELS - level);
        let level = level + down;
        let first = cell << (3 * down);
        let bucket = |i| Bucket { level, cell: first + i, photons: 0, bytes: 0, crc32c: 0 };
        let buckets = (0..1 << (3 * down)).map(|i| (Vec::new(), bucket(i))).collect();
        let dir = dir.to_owned();
        let (buffered, photons) = (0, 0);
        Ok(Self { dir, cube, level, buckets, packer, buffered, buffer_bytes, photons, expected })
    }

    pub fn push(&mut self, photon: &Packed) -> Result<(), Error> {
        let cell = self.cube.code(photon.position) >> (3 * (LEVELS - self.level));
        // Photons of other cells aren't given; the mask keeps the index in range all the same.
        let last = self.buckets.len() - 1;
        let (buffer, bucket) = &mut self.buckets[cell as usize & last];
        photon.write(buffer);
        bucket.photons += 1;
        self.photons += 1;
        self.buffered += RECORD_BYTES;
        if self.buffered >= self.buffer_bytes { self.flush() } else { Ok(()) }
    }

    /// Writes what waits to the files.
    pub fn flush(&mut self) -> Result<(), Error> {
        for (buffer, bucket) in &mut self.buckets {
            if buffer.is_empty() {
                continue;
            }
            bucket.append(&self.dir, buffer, &mut self.packer).map_err(Error::io(
                &bucket.path(&self.dir),
                format!(
                    "appending {} photons; {} of {} so far, which need up to {} bytes in all",
                    buffer.len() / RECORD_BYTES,
                    self.photons,
                    self.expected,
                    self.expected.max(self.photons).saturating_mul(RECORD_BYTES as u64)
                ),
            ))?;
            // Freed, not cleared: buckets that stay quiet must not keep what they once needed.
            *buffer = Vec::new();
        }
        self.buffered = 0;
        Ok(())
    }

    /// Writes what is left; the buckets that hold any photons, in Morton order.
    pub fn finish(mut self) -> Result<Vec<Bucket>, Error> {
        self.flush()?;
        Ok(self.buckets.into_iter().map(|(_, b)| b).filter(|b| b.photons > 0).collect())
    }
}

/// Removes the files of a spill, and nothing else.
pub(super) fn remove_files(dir: &Path) -> Result<(), Error> {
    let doing = "removing an older spill";
    for entry in fs::read_dir(dir).map_err(Error::io(dir, doing))? {
        let path = entry.map_err(Error::io(dir, doing))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if name.starts_with(SPLIT_PREFIX) && path.is_dir() {
            fs::remove_dir_all(&path).map_err(Error::io(&path, doing))?;
            continue;
        }
        let ours = path.extension().is_some_and(|e| e == SUFFIX)
            || [SUMMARY, CHECKPOINT, BUILDING].contains(&name);
        if ours {
            fs::remove_file(&path).map_err(Error::io(&path, doing))?;
        }
    }
    Ok(())
}
