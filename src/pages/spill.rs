//! Photons on their way to the store: partitioned on disk as they come, with checkpoints to go on from.
//!
//! Photons come in the order of emission and are needed in the order of space, and there are more of them
//! than memory holds. So each goes into the file of its octree cell, which the build then sorts one by
//! one. Buffers take a fixed share of memory; what they hold is compressed as it is written. A checkpoint
//! is the length and checksum of every file: going on from it means cutting the files back.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use glintmap_formats::seal;

use super::Error;
use super::cube::Cube;
use super::packed::Packed;
use super::partition::Partition;
use super::partitioner::{CHECKPOINT, Partitioner, SPLIT_LEVELS, SUMMARY, remove_files};
use super::tree::Cell;
use crate::base::{Aabb, Photon, PhotonSink, Progress, SinkError};

const VERSION: u32 = 3;
/// Bytes of a summary that are read: 4,096 partitions take less than one.
const SUMMARY_BYTES_MAX: u64 = 64 << 20;

/// What a completed spill holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpillSummary {
    version: u32,
    /// Number of photons.
    pub photons: u64,
    pub(super) cube: Cube,
    /// The partitions that hold any, in Morton order.
    #[serde(rename = "buckets")]
    pub(super) partitions: Vec<Partition>,
}

/// A spill at some moment, and what its owner said then.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Checkpoint {
    note: String,
    spill: SpillSummary,
}

/// Collects photons on disk until [`build`](super::build) sorts them. Memory stays within the
/// budget however many come. Unit vectors are rounded as the store does, all else is exact.
///
/// What a checkpoint or the summary vouches for is on the disk before either is written, so that a
/// power failure takes no more than a killed process loses. Checksums notice it where a disk lied.
pub struct Spill {
    partitioner: Partitioner,
}

impl Spill {
    /// Begins a spill in the folder `dir`; an older one in it is removed. `bounds`: the box of the
    /// scene in metres (photons outside are kept as well, but slow searches down). `expected`: how
    /// many photons will come, for messages. `memory_bytes`: what the whole program may use, of
    /// which buffers take an eighth.
    ///
    /// # Errors
    /// [`Error::Bounds`] for bounds that aren't finite, or what the file system says.
    pub fn create(
        dir: &Path,
        bounds: Aabb,
        expected: u64,
        memory_bytes: u64,
    ) -> Result<Self, Error> {
        let cube = Cube::around(bounds);
        if !cube.is_sound() {
            let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
            return Err(Error::Bounds { min, max });
        }
        let buffer_bytes = buffer_bytes(memory_bytes);
        Ok(Self {
            partitioner: Partitioner::create(dir, cube, Cell::ROOT, expected, buffer_bytes)?,
        })
    }

    /// Writes what came so far to the files, and seals how long they are together with `note`, the
    /// caller's own account of what came: [`Self::resume`] goes back to here. Waits for the disk.
    ///
    /// # Errors
    /// What the file system says.
    pub fn checkpoint(&mut self, note: &str) -> Result<(), Error> {
        self.partitioner.flush()?;
        make_durable(&self.partitioner.dir)?;
        let some = self.partitioner.partitions.iter().map(|(_, b)| *b).filter(|b| b.photons > 0);
        let checkpoint = Checkpoint {
            note: note.to_owned(),
            spill: SpillSummary {
                version: VERSION,
                photons: self.partitioner.photons,
                cube: self.partitioner.cube,
                partitions: some.collect(),
            },
        };
        write_json(&self.partitioner.dir.join(CHECKPOINT), &checkpoint)
    }

    /// Goes on with an interrupted spill in `dir` from its last checkpoint; what came later is
    /// cut off. Delivers the checkpoint's note. `None` where there is no checkpoint, it belongs to
    /// other bounds, `accept` refuses its note, or files are shorter than it says: then nothing
    /// was touched. The other arguments are those of [`Self::create`].
    ///
    /// # Errors
    /// What the file system says.
    pub fn resume(
        dir: &Path,
        bounds: Aabb,
        expected: u64,
        memory_bytes: u64,
        accept: impl FnOnce(&str) -> bool,
    ) -> Result<Option<(Self, String)>, Error> {
        let Ok(file) = File::open(dir.join(CHECKPOINT)) else { return Ok(None) };
        let mut text = Vec::new();
        let read = file.take(SUMMARY_BYTES_MAX).read_to_end(&mut text);
        let Ok(Checkpoint { note, spill }) = serde_json::from_slice(&text) else { return Ok(None) };
        let long_enough = |partition: &Partition| {
            let length = fs::metadata(partition.path(dir)).map_or(0, |m| m.len());
            partition.bytes <= length
        };
        let usable = read.is_ok()
            && spill.is_sound()
            && spill.cube == Cube::around(bounds)
            && accept(&note)
            && spill.partitions.iter().all(long_enough);
        if !usable {
            return Ok(None);
        }
        let doing = "going back to a checkpoint";
        let summary = dir.join(SUMMARY);
        if summary.exists() {
            fs::remove_file(&summary).map_err(Error::io(&summary, doing))?;
        }
        let buffer_bytes = buffer_bytes(memory_bytes);
        let mut partitioner =
            Partitioner::new(dir, spill.cube, Cell::ROOT, expected, buffer_bytes)?;
        partitioner.photons = spill.photons;
        for partition in &spill.partitions {
            partitioner.partitions[partition.cell as usize].1 = *partition;
        }
        for (_, partition) in &partitioner.partitions {
            let path = partition.path(dir);
            let cut = match OpenOptions::new().write(true).open(&path) {
                Ok(_) if partition.photons == 0 => fs::remove_file(&path),
                Ok(file) => file.set_len(partition.bytes),
                Err(e) if partition.photons == 0 && e.kind() == io::ErrorKind::NotFound => Ok(()),
                Err(e) => Err(e),
            };
            cut.map_err(Error::io(&path, doing))?;
        }
        Ok(Some((Self { partitioner }, note)))
    }

    /// Writes what is left and seals the summary: from now on the spill is complete.
    ///
    /// # Errors
    /// What the file system says; the spill is then not complete.
    pub fn finish(self) -> Result<SpillSummary, Error> {
        let (dir, cube, photons) =
            (self.partitioner.dir.clone(), self.partitioner.cube, self.partitioner.photons);
        let partitions = self.partitioner.finish()?;
        make_durable(&dir)?;
        let summary = SpillSummary { version: VERSION, photons, cube, partitions };
        write_json(&dir.join(SUMMARY), &summary)?;
        Ok(summary)
    }
}

impl PhotonSink for Spill {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        for photon in photons {
            let finite = photon.position.is_finite()
                && photon.normal.is_finite()
                && photon.direction.is_finite()
                && photon.flux_w.is_finite();
            if !finite || photon.flux_w < 0.0 {
                let what = format!("a photon that can't be: {photon:?}");
                return Err(io::Error::new(io::ErrorKind::InvalidData, what).into());
            }
            self.partitioner.push(&Packed::of(photon))?;
        }
        Ok(())
    }
}

impl SpillSummary {
    /// The summary of a completed spill.
    ///
    /// # Errors
    /// [`Error::Unfinished`] where there is none, [`Error::Damaged`] where it doesn't hold.
    pub fn read(dir: &Path) -> Result<Self, Error> {
        let path = dir.join(SUMMARY);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Err(Error::Unfinished { path: dir.to_owned() });
            }
            Err(e) => return Err(Error::io(&path, "opening")(e)),
        };
        let damaged = |what: String| Error::Damaged {
            path: path.clone(),
            byte: 0,
            part: "summary of the photons before they are sorted".to_owned(),
            what,
            stage: "trace",
        };
        let mut text = Vec::new();
        file.take(SUMMARY_BYTES_MAX)
            .read_to_end(&mut text)
            .map_err(Error::io(&path, "reading the summary"))?;
        let summary: Self = serde_json::from_slice(&text).map_err(|e| damaged(e.to_string()))?;
        if summary.version != VERSION {
            return Err(damaged(format!("version {}, expected {VERSION}", summary.version)));
        }
        if !summary.is_sound() {
            return Err(damaged("buckets and counts contradict each other".to_owned()));
        }
        Ok(summary)
    }

    /// Whether its parts agree.
    fn is_sound(&self) -> bool {
        let sum = self.partitions.iter().try_fold(0u64, |n, b| n.checked_add(b.photons));
        self.version == VERSION
            && sum == Some(self.photons)
            && self.partitions.iter().all(|b| b.level == SPLIT_LEVELS && b.cell < 1 << 12)
            && self.partitions.windows(2).all(|w| w[0].cell < w[1].cell)
            && self.cube.is_sound()
    }
}

/// Joins completed spills of the same scene into one in `into`, where an older one is removed; the
/// parts are left as they are. The store that is built from it is the same as if all photons had
/// come into one spill.
///
/// # Errors
/// [`Error::Unfinished`] and [`Error::Damaged`] for parts that don't hold, [`Error::Damaged`] for
/// parts of different scenes, or what the file system says.
pub fn join(
    parts: &[PathBuf],
    into: &Path,
    memory_bytes: u64,
    progress: &dyn Progress,
) -> Result<SpillSummary, Error> {
    let summaries: Vec<SpillSummary> =
        parts.iter().map(|dir| SpillSummary::read(dir)).collect::<Result<_, _>>()?;
    let photons = summaries.iter().map(|s| s.photons).sum();
    let Some(first) = summaries.first() else {
        return Err(Error::Unfinished { path: into.to_owned() });
    };
    for (dir, summary) in parts.iter().zip(&summaries) {
        if summary.cube != first.cube {
            return Err(Error::Damaged {
                path: dir.join(SUMMARY),
                byte: 0,
                part: "cube of the scene".to_owned(),
                what: format!("{:?} expected, {:?} found", first.cube, summary.cube),
                stage: "trace",
            });
        }
    }
    let buffer_bytes = buffer_bytes(memory_bytes);
    let mut partitioner = Partitioner::create(into, first.cube, Cell::ROOT, photons, buffer_bytes)?;
    progress.begin("joining shards", photons, "photons");
    let copied = parts.iter().zip(&summaries).try_for_each(|(dir, summary)| {
        summary.partitions.iter().try_for_each(|partition| {
            progress.check()?;
            progress.advance(partition.photons);
            partition.read(dir, |photon| partitioner.push(photon))
        })
    });
    progress.finish();
    copied?;
    Spill { partitioner }.finish()
}

/// Waits until all files in `dir` are on the disk. One call for the file system: thousands of
/// files, most of them written long ago, would each cost a turn of the disk.
fn make_durable(dir: &Path) -> Result<(), Error> {
    let doing = "waiting until the photons are on the disk";
    let folder = File::open(dir).map_err(Error::io(dir, doing))?;
    #[cfg(target_os = "linux")]
    return rustix::fs::syncfs(&folder).map_err(|e| Error::io(dir, doing)(e.into()));
    #[cfg(not(target_os = "linux"))]
    {
        for entry in fs::read_dir(dir).map_err(Error::io(dir, doing))? {
            let path = entry.map_err(Error::io(dir, doing))?.path();
            let sync = || File::open(&path)?.sync_all();
            sync().map_err(Error::io(&path, doing))?;
        }
        folder.sync_all().map_err(Error::io(dir, doing))
    }
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), Error> {
    let doing = "writing the summary";
    let text = serde_json::to_vec_pretty(value).map_err(|e| Error::io(path, doing)(e.into()))?;
    seal::write_bytes(path, &text).map_err(Error::io(path, doing))
}

/// What a partitioner may buffer, bytes. Half of the buffers' share of an eighth: a growing Vec may
/// hold twice what is in it.
pub(super) fn buffer_bytes(memory_bytes: u64) -> usize {
    (memory_bytes / 16).clamp(1 << 16, 128 << 20) as usize
}

/// Removes a spill once its store is sealed: its files, and the folder if nothing else is in it.
///
/// # Errors
/// What the file system says.
pub fn discard(dir: &Path) -> Result<(), Error> {
    if !dir.exists() {
        return Ok(());
    }
    remove_files(dir)?;
    match fs::remove_dir(dir) {
        Err(e) if e.kind() != io::ErrorKind::DirectoryNotEmpty => {
            Err(Error::io(dir, "removing the folder")(e))
        }
        _ => Ok(()),
    }
}
