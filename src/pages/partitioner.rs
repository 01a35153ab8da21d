//! Photons partitioned by octree cell, one file each, within a bound on what waits in memory.

use std::fs;
use std::path::{Path, PathBuf};

use glintmap_formats::records::Packer;

use super::Error;
use super::build_checkpoint::NAME as BUILDING;
use super::cube::Cube;
use super::packed::{Packed, RECORD_BYTES};
use super::partition::{Partition, SUFFIX};
use super::tree::Cell;
use crate::base::Record;
use crate::base::morton::LEVELS;

/// The file that says that a spill is complete.
pub(super) const SUMMARY: &str = "spill.json";
/// The file that says how far a spill that isn't complete can be trusted.
pub(super) const CHECKPOINT: &str = "checkpoint.json";

/// Levels of the octree by which photons are partitioned at once: 4,096 files.
pub(super) const SPLIT_LEVELS: u32 = 4;
/// How folders are called in which a partition is partitioned once more.
pub(super) const SPLIT_PREFIX: &str = "split-";

/// Partitions photons by the cells some levels of the octree below one cell.
pub(super) struct Partitioner {
    pub dir: PathBuf,
    pub cube: Cube,
    /// Depth of the cells of its partitions.
    level: u32,
    /// For each cell what waits in memory, and what is in its file.
    pub partitions: Vec<(Vec<u8>, Partition)>,
    packer: Packer,
    buffered: usize,
    buffer_bytes: usize,
    pub photons: u64,
    expected: u64,
}

impl Partitioner {
    /// Partitions the photons of `cell` by the cells [`SPLIT_LEVELS`] further down, as files in
    /// `dir`, which is emptied of older ones. `expected`: how many will come, for messages.
    pub fn create(
        dir: &Path,
        cube: Cube,
        cell: Cell,
        expected: u64,
        buffer_bytes: usize,
    ) -> Result<Self, Error> {
        fs::create_dir_all(dir).map_err(Error::io(dir, "making the folder"))?;
        remove_files(dir)?;
        Self::new(dir, cube, cell, expected, buffer_bytes)
    }

    /// The same, with what lies in `dir` left as it is.
    pub fn new(
        dir: &Path,
        cube: Cube,
        cell: Cell,
        expected: u64,
        buffer_bytes: usize,
    ) -> Result<Self, Error> {
        let packer = Packer::new().map_err(Error::io(dir, "making ready to pack photons"))?;
        let empty = |cell| (Vec::new(), Partition::empty(cell));
        Ok(Self {
            dir: dir.to_owned(),
            cube,
            level: cell.level + SPLIT_LEVELS.min(LEVELS - cell.level),
            partitions: cell.cut(SPLIT_LEVELS).map(empty).collect(),
            packer,
            buffered: 0,
            buffer_bytes,
            photons: 0,
            expected,
        })
    }

    pub fn push(&mut self, photon: &Packed) -> Result<(), Error> {
        let cell = self.cube.code(photon.position) >> (3 * (LEVELS - self.level));
        // Photons of other cells aren't given; the mask keeps the index in range all the same.
        let last = self.partitions.len() - 1;
        let (buffer, partition) = &mut self.partitions[cell as usize & last];
        photon.put(buffer);
        partition.photons += 1;
        self.photons += 1;
        self.buffered += RECORD_BYTES;
        if self.buffered >= self.buffer_bytes { self.flush() } else { Ok(()) }
    }

    /// Writes what waits to the files.
    pub fn flush(&mut self) -> Result<(), Error> {
        for (buffer, partition) in &mut self.partitions {
            if buffer.is_empty() {
                continue;
            }
            partition.append(&self.dir, buffer, &mut self.packer).map_err(Error::io(
                &partition.path(&self.dir),
                format!(
                    "appending {} photons; {} of {} so far, which need up to {} bytes in all",
                    buffer.len() / RECORD_BYTES,
                    self.photons,
                    self.expected,
                    self.expected.max(self.photons).saturating_mul(RECORD_BYTES as u64)
                ),
            ))?;
            // Freed, not cleared: partitions that stay quiet must not keep what they once needed.
            *buffer = Vec::new();
        }
        self.buffered = 0;
        Ok(())
    }

    /// Writes what is left; the partitions that hold any photons, in Morton order.
    pub fn finish(mut self) -> Result<Vec<Partition>, Error> {
        self.flush()?;
        Ok(self.partitions.into_iter().map(|(_, b)| b).filter(|b| b.photons > 0).collect())
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
