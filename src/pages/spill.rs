//! Photons on their way to the store: appended to one file per octree cell, as they come.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use glam::Vec3;
use glintmap_formats::checksum::crc32c_append;
use glintmap_formats::seal;

use super::Error;
use super::morton::{Cube, LEVELS};
use crate::base::{Aabb, Photon, PhotonSink, Progress, SinkError};

/// The file that says that a spill is complete.
pub(super) const SUMMARY: &str = "spill.json";
/// The file that says how far a spill that isn't complete can be trusted.
const CHECKPOINT: &str = "checkpoint.json";
/// Bytes of a photon in a bucket: all its fields, little endian.
pub(super) const RECORD_BYTES: usize = 46;
/// Levels of the octree by which photons are parted at once: 4,096 buckets.
pub(super) const SPLIT_LEVELS: u32 = 4;
/// How folders are called in which a bucket is parted once more.
pub(super) const SPLIT_PREFIX: &str = "split-";
const VERSION: u32 = 1;
const SUFFIX: &str = "photons";
const SUMMARY_BYTES_MAX: u64 = 64 << 20;

/// What a completed spill holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpillSummary {
    version: u32,
    /// Number of photons.
    pub photons: u64,
    pub(super) cube: Cube,
    /// The buckets that hold any, in Morton order.
    pub(super) buckets: Vec<Bucket>,
}

/// A spill at some moment, and what its owner said then.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Checkpoint {
    note: String,
    spill: SpillSummary,
}

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
        mut each: impl FnMut(&Photon) -> Result<(), Error>,
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
            for record in piece[..n].chunks_exact(RECORD_BYTES) {
                each(&photon(record))?;
            }
        }
        if sum != self.crc32c {
            let what = format!("checksum {:08x} expected, {sum:08x} found", self.crc32c);
            return Err(self.damaged(dir, what));
        }
        Ok(())
    }
}

pub(super) fn record(photon: &Photon, out: &mut Vec<u8>) {
    for v in [photon.position, photon.normal, photon.direction] {
        for component in v.to_array() {
            out.extend_from_slice(&component.to_le_bytes());
        }
    }
    out.extend_from_slice(&photon.flux_w.to_le_bytes());
    out.extend_from_slice(&photon.timestep.to_le_bytes());
    out.extend_from_slice(&photon.surface.to_le_bytes());
}

pub(super) fn photon(record: &[u8]) -> Photon {
    let word = |at: usize| [record[at], record[at + 1], record[at + 2], record[at + 3]];
    let float = |at| f32::from_le_bytes(word(at));
    let vector = |at| Vec3::new(float(at), float(at + 4), float(at + 8));
    Photon {
        position: vector(0),
        normal: vector(12),
        direction: vector(24),
        flux_w: float(36),
        timestep: u32::from_le_bytes(word(40)),
        surface: u16::from_le_bytes([record[44], record[45]]),
    }
}

/// Parts photons by the cells of some levels of the octree below one cell.
pub(super) struct Parting {
    dir: PathBuf,
    cube: Cube,
    level: u32,
    buckets: Vec<(Vec<u8>, Bucket)>,
    buffered: usize,
    buffer_bytes: usize,
    photons: u64,
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
        Ok(Self::new(dir, cube, (level, cell), expected, buffer_bytes))
    }

    fn new(
        dir: &Path,
        cube: Cube,
        (level, cell): (u32, u64),
        expected: u64,
        buffer_bytes: usize,
    ) -> Self {
        let down = SPLIT_LEVELS.min(LEVELS - level);
        let level = level + down;
        let first = cell << (3 * down);
        let bucket = |i| Bucket { level, cell: first + i, photons: 0, crc32c: 0 };
        let buckets = (0..1 << (3 * down)).map(|i| (Vec::new(), bucket(i))).collect();
        let dir = dir.to_owned();
        Self { dir, cube, level, buckets, buffered: 0, buffer_bytes, photons: 0, expected }
    }

    pub fn push(&mut self, photon: &Photon) -> Result<(), Error> {
        let cell = self.cube.code(photon.position) >> (3 * (LEVELS - self.level));
        // Photons of other cells aren't given; the mask keeps the index in range all the same.
        let last = self.buckets.len() - 1;
        let (buffer, bucket) = &mut self.buckets[cell as usize & last];
        record(photon, buffer);
        bucket.photons += 1;
        self.photons += 1;
        self.buffered += RECORD_BYTES;
        if self.buffered >= self.buffer_bytes { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), Error> {
        for (buffer, bucket) in &mut self.buckets {
            if buffer.is_empty() {
                continue;
            }
            let path = bucket.path(&self.dir);
            OpenOptions::new()
                .create(true)
                .append(true)
                .open(&path)
                .and_then(|mut file| file.write_all(buffer))
                .map_err(Error::io(
                    &path,
                    format!(
                        "appending {} bytes; {} of {} photons so far, {} bytes needed in all",
                        buffer.len(),
                        self.photons,
                        self.expected,
                        self.expected.max(self.photons).saturating_mul(RECORD_BYTES as u64)
                    ),
                ))?;
            bucket.crc32c = crc32c_append(bucket.crc32c, buffer);
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
fn remove_files(dir: &Path) -> Result<(), Error> {
    let doing = "removing an older spill";
    for entry in fs::read_dir(dir).map_err(Error::io(dir, doing))? {
        let path = entry.map_err(Error::io(dir, doing))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if name.starts_with(SPLIT_PREFIX) && path.is_dir() {
            fs::remove_dir_all(&path).map_err(Error::io(&path, doing))?;
            continue;
        }
        let ours =
            path.extension().is_some_and(|e| e == SUFFIX) || name == SUMMARY || name == CHECKPOINT;
        if ours {
            fs::remove_file(&path).map_err(Error::io(&path, doing))?;
        }
    }
    Ok(())
}

/// Collects photons on disk until [`build`](super::build) sorts them. Memory stays within the
/// budget however many come; records are exact.
///
/// The files are scratch: they aren't flushed one by one. The summary, written last, marks the
/// spill as complete and holds their checksums, so that what a power failure takes is noticed.
pub struct Spill {
    parting: Parting,
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
        Ok(Self { parting: Parting::create(dir, cube, (0, 0), expected, buffer_bytes)? })
    }

    /// Writes what came so far to the files, and seals how long they are together with `note`, the
    /// caller's own account of what came: [`Self::resume`] goes back to here. Costs some 0.1 s.
    ///
    /// # Errors
    /// What the file system says.
    pub fn checkpoint(&mut self, note: &str) -> Result<(), Error> {
        self.parting.flush()?;
        let some = self.parting.buckets.iter().map(|(_, b)| *b).filter(|b| b.photons > 0);
        let checkpoint = Checkpoint {
            note: note.to_owned(),
            spill: SpillSummary {
                version: VERSION,
                photons: self.parting.photons,
                cube: self.parting.cube,
                buckets: some.collect(),
            },
        };
        write_json(&self.parting.dir.join(CHECKPOINT), &checkpoint)
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
        let long_enough = |bucket: &Bucket| {
            let length = fs::metadata(bucket.path(dir)).map_or(0, |m| m.len());
            bucket.photons.checked_mul(RECORD_BYTES as u64).is_some_and(|bytes| bytes <= length)
        };
        let usable = read.is_ok()
            && spill.is_sound()
            && spill.cube == Cube::around(bounds)
            && accept(&note)
            && spill.buckets.iter().all(long_enough);
        if !usable {
            return Ok(None);
        }
        let doing = "going back to a checkpoint";
        let summary = dir.join(SUMMARY);
        if summary.exists() {
            fs::remove_file(&summary).map_err(Error::io(&summary, doing))?;
        }
        let buffer_bytes = buffer_bytes(memory_bytes);
        let mut parting = Parting::new(dir, spill.cube, (0, 0), expected, buffer_bytes);
        parting.photons = spill.photons;
        for bucket in &spill.buckets {
            parting.buckets[bucket.cell as usize].1 = *bucket;
        }
        for (_, bucket) in &parting.buckets {
            let path = bucket.path(dir);
            let cut = match OpenOptions::new().write(true).open(&path) {
                Ok(_) if bucket.photons == 0 => fs::remove_file(&path),
                Ok(file) => file.set_len(bucket.photons * RECORD_BYTES as u64),
                Err(e) if bucket.photons == 0 && e.kind() == io::ErrorKind::NotFound => Ok(()),
                Err(e) => Err(e),
            };
            cut.map_err(Error::io(&path, doing))?;
        }
        Ok(Some((Self { parting }, note)))
    }

    /// Writes what is left and seals the summary: from now on the spill is complete.
    ///
    /// # Errors
    /// What the file system says; the spill is then not complete.
    pub fn finish(self) -> Result<SpillSummary, Error> {
        let (dir, cube, photons) =
            (self.parting.dir.clone(), self.parting.cube, self.parting.photons);
        let buckets = self.parting.finish()?;
        let summary = SpillSummary { version: VERSION, photons, cube, buckets };
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
            self.parting.push(photon)?;
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
        let sum = self.buckets.iter().try_fold(0u64, |n, b| n.checked_add(b.photons));
        self.version == VERSION
            && sum == Some(self.photons)
            && self.buckets.iter().all(|b| b.level == SPLIT_LEVELS && b.cell < 1 << 12)
            && self.buckets.windows(2).all(|w| w[0].cell < w[1].cell)
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
    let mut parting = Parting::create(into, first.cube, (0, 0), photons, buffer_bytes)?;
    progress.begin("joining shards", photons, "photons");
    let copied = parts.iter().zip(&summaries).try_for_each(|(dir, summary)| {
        summary.buckets.iter().try_for_each(|bucket| {
            progress.check()?;
            progress.advance(bucket.photons);
            bucket.read(dir, |photon| parting.push(photon))
        })
    });
    progress.finish();
    copied?;
    Spill { parting }.finish()
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), Error> {
    let doing = "writing the summary";
    let text = serde_json::to_vec_pretty(value).map_err(|e| Error::io(path, doing)(e.into()))?;
    seal::write_bytes(path, &text).map_err(Error::io(path, doing))
}

/// Half of the buffers' share: a growing Vec may hold twice what is in it.
fn buffer_bytes(memory_bytes: u64) -> usize {
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
