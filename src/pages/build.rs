//! From partitions of photons to the store: sort each within memory, cut into leaves, compress on all
//! cores, write in order, once.
//!
//! The bytes depend on the photons alone. So leaves are cut by counting photons in cells, never by
//! what fits into memory; photons are sorted by everything that tells them apart; sums are added page by
//! page in their order. Memory decides only how many partitions are sorted at once, and whether one is
//! partitioned again first. Every few seconds it is noted which photons are in pages, all of them up to
//! a Morton code: a build that was killed goes on from there.

use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use glintmap_formats::checksum::crc32c;
use glintmap_formats::{gmp, header, seal};
use rayon::prelude::*;

use super::Error;
use super::partition::Partition;
use super::store_header::{About, Header, Layout, Sums};

use super::build_checkpoint::{self, Checkpoints};
use super::cube::Cube;
use super::packed::Packed;
use super::page;
use super::partitioner::{Partitioner, SPLIT_LEVELS, SPLIT_PREFIX};
use super::sort::Sorted;
use super::spill::{SpillSummary, buffer_bytes, discard};
use super::tree::{Cell, Leaf, cut, nodes};
use crate::base::morton::LEVELS;
use crate::base::{ExternalSort, Progress};

/// Memory that a photon takes while it is sorted, cut and compressed: 32 itself, 16 its key, the
/// rest for its page in columns and in bytes, and what the allocator keeps of the batch before.
const BYTES_PER_PHOTON: u64 = 96;
/// Memory that doesn't depend on the batch: buffers of files, tables of partitions.
const FIXED_BYTES: u64 = 6 << 20;
/// Memory that each thread takes for the page at work: photons, columns, zstd.
const THREAD_BYTES: u64 = 3 << 20;
/// Bytes by which the header may grow when the counts are known.
const HEADER_SLACK: usize = 1024;
/// Building that a killed run loses at most, beside the batch that it was in.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);

/// What a build made.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StoreSummary {
    /// Number of photons.
    pub photons: u64,
    /// Number of pages.
    pub pages: u64,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Sum of the photons' flux, W.
    pub flux_w: f64,
}

/// Sorts the photons of a completed spill into the store `store`, which appears whole or not at
/// all. The same photons give the same bytes, whatever the memory, the threads, and the order in
/// which they came. Killed or interrupted, the next build of the same goes on where this one was
/// some seconds earlier. The spill is left as it is; see [`discard`](super::discard).
///
/// # Errors
/// [`Error::Unfinished`] for a spill that isn't complete, [`Error::Damaged`] for one that changed
/// since, [`Error::Photon`], [`Error::Interrupted`], [`Error::Busy`], or what the file system says.
pub fn build(
    spill_dir: &Path,
    store: &Path,
    about: &About,
    memory_bytes: u64,
    progress: &dyn Progress,
) -> Result<StoreSummary, Error> {
    let fixed_bytes = FIXED_BYTES + THREAD_BYTES * rayon::current_num_threads() as u64;
    let size = Size {
        page_photons: gmp::PAGE_PHOTONS_MAX,
        batch_photons: (memory_bytes.saturating_sub(fixed_bytes) / BYTES_PER_PHOTON)
            .clamp(4 * gmp::PAGE_PHOTONS_MAX as u64, 1 << 31),
        buffer_bytes: buffer_bytes(memory_bytes),
        checkpoint_every: CHECKPOINT_EVERY,
    };
    build_sized(spill_dir, store, about, size, progress)
}

/// Sizes that tests make small, so that every seam is crossed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// Photons that a page holds at most.
    pub page_photons: usize,
    /// Photons that are in memory at once.
    pub batch_photons: u64,
    /// Bytes to buffer where a partition is partitioned again.
    pub buffer_bytes: usize,
    /// Time between two notes of how far the build has come.
    pub checkpoint_every: Duration,
}

pub(super) fn build_sized(
    spill_dir: &Path,
    store: &Path,
    about: &About,
    size: Size,
    progress: &dyn Progress,
) -> Result<StoreSummary, Error> {
    let spill = SpillSummary::read(spill_dir)?;
    let growing = seal::growing(store);
    let out = open_alone(&growing)?;
    progress.begin("pages", spill.photons, "photons");
    let result = (|| {
        let mut builder = Builder::new(out, &growing, about, spill_dir, &spill, size, progress)?;
        builder.cell(spill_dir, &spill.partitions, Cell::ROOT)?;
        builder.finish(store)
    })();
    if result.as_ref().is_err_and(|e| !matches!(e, Error::Interrupted(_))) {
        // The error that matters is the first one; a leftover .tmp is overwritten next time.
        let _ = fs::remove_file(&growing);
    }
    progress.finish();
    result
}

/// Opens the growing file, unless another process does the same.
fn open_alone(growing: &Path) -> Result<File, Error> {
    let file = build_checkpoint::open(growing)?;
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        return Err(Error::Busy { path: growing.to_owned() });
    }
    // A file system without locks is no reason to stop.
    Ok(file)
}

struct Builder<'a> {
    out: BufWriter<File>,
    growing: &'a Path,
    about: &'a About,
    cube: Cube,
    size: Size,
    progress: &'a dyn Progress,
    reserved: usize,
    offset: u64,
    pages: Vec<gmp::PageEntry>,
    sums: Sums,
    checkpoints: Checkpoints<'a>,
    /// All photons up to this Morton code were in the pages when the build began.
    done: Option<u64>,
}

/// Sorted photons, and which of their leaves to write.
struct Unit {
    partitions: Range<usize>,
    leaf: Leaf,
}

/// Photons for one page.
struct Job<I> {
    photons: I,
    first: u64,
    last: u64,
}

struct Encoded {
    bytes: Vec<u8>,
    sums: Sums,
    first: u64,
    last: u64,
}

impl<'a> Builder<'a> {
    fn new(
        mut out: File,
        growing: &'a Path,
        about: &'a About,
        spill_dir: &'a Path,
        spill: &SpillSummary,
        size: Size,
        progress: &'a dyn Progress,
    ) -> Result<Self, Error> {
        // The header's facts are known at the end, but it stands first: keep its place free.
        let mut draft = Vec::new();
        let nothing = Header::new(about, &Sums::NONE, layout(spill.cube, size, 0, 0, &[], &[]));
        let length = header::write(&mut draft, gmp::NAME, gmp::VERSION, &nothing)
            .map_err(Error::io(growing, "writing the header"))?;
        let reserved = (length + HEADER_SLACK).next_multiple_of(HEADER_SLACK);
        let of = crc32c(&[draft, serde_json::to_vec(spill).unwrap_or_default()].concat());
        let checkpoints = Checkpoints::new(spill_dir, of, size.checkpoint_every);
        let resumed = checkpoints.resume(&mut out);
        if resumed.is_none() {
            checkpoints.forget();
            // /dev/full can't be truncated.
            let _ = out.set_len(0);
        }
        let mut builder = Self {
            out: BufWriter::with_capacity(1 << 20, out),
            growing,
            about,
            cube: spill.cube,
            size,
            progress,
            reserved,
            offset: 0,
            pages: Vec::new(),
            sums: Sums::NONE,
            checkpoints,
            done: None,
        };
        if let Some((half, pages)) = resumed {
            builder.offset = pages.last().map_or(0, |p| p.offset + u64::from(p.length));
            (builder.done, builder.sums, builder.pages) = (half.done, half.sums, pages);
            progress.say(&format!("goes on after {} photons in pages", half.sums.photons));
            progress.advance(half.sums.photons);
        } else {
            builder.put(&vec![0; reserved], "the header")?;
        }
        Ok(builder)
    }

    fn put(&mut self, bytes: &[u8], what: &str) -> Result<(), Error> {
        let (growing, at) = (self.growing, self.reserved as u64 + self.offset);
        self.out.write_all(bytes).map_err(|e| {
            let doing = format!("writing {what}, {} bytes at byte {at}", bytes.len());
            Error::io(growing, doing)(e)
        })
    }

    fn header(&self, nodes: &[gmp::Node], directory: &[u8]) -> Header {
        let pages = self.pages.len() as u64;
        let layout = layout(self.cube, self.size, pages, self.offset, nodes, directory);
        Header::new(self.about, &self.sums, layout)
    }

    /// Notes how far it has come, if that is some time ago: all photons up to a Morton code are in
    /// the pages.
    fn checkpoint(&mut self, done: u64) -> Result<(), Error> {
        if !self.checkpoints.due() {
            return Ok(());
        }
        self.out.flush().map_err(Error::io(self.growing, "writing pages"))?;
        self.checkpoints.write(self.out.get_mut(), done, &self.sums, &self.pages)
    }

    /// Writes all photons of a cell, whose partitions lie in `dir`.
    fn cell(&mut self, dir: &Path, partitions: &[Partition], cell: Cell) -> Result<(), Error> {
        let count = |first, last| {
            let start = partitions.partition_point(|p| p.cell().first() < first);
            let inside = partitions[start..].iter().take_while(|p| p.cell().last() <= last);
            inside.map(|p| p.photons).sum()
        };
        let deepest = (cell.level + SPLIT_LEVELS).min(LEVELS);
        let mut leaves = Vec::new();
        cut(cell, deepest, self.size.page_photons as u64, &count, &mut leaves);

        let mut batch: Vec<Unit> = Vec::new();
        let mut batched = 0;
        let mut next = 0;
        for leaf in leaves {
            let start = next;
            while partitions.get(next).is_some_and(|p| p.cell().last() <= leaf.last) {
                next += 1;
            }
            if self.done.is_some_and(|done| leaf.last <= done) {
                continue;
            }
            if batched + leaf.photons > self.size.batch_photons {
                self.batch(dir, partitions, &std::mem::take(&mut batch))?;
                batched = 0;
            }
            let open = leaf.photons > self.size.page_photons as u64;
            if open && leaf.photons > self.size.batch_photons {
                self.large(dir, &partitions[start])?;
            } else {
                batched += leaf.photons;
                batch.push(Unit { partitions: start..next, leaf });
            }
        }
        self.batch(dir, partitions, &batch)
    }

    /// Writes a partition that doesn't fit into memory: partitions it again, or, where it can't be
    /// cut any further, sorts it on disk.
    fn large(&mut self, dir: &Path, partition: &Partition) -> Result<(), Error> {
        let (cell, about) = (partition.cell(), self.about);
        if cell.level == LEVELS {
            return self.deepest(dir, partition);
        }
        let split = dir.join(format!("{SPLIT_PREFIX}{:02}-{:x}", cell.level, cell.code));
        let (photons, buffer_bytes) = (partition.photons, self.size.buffer_bytes);
        let mut again = Partitioner::create(&split, self.cube, cell, photons, buffer_bytes)?;
        partition.read(dir, |photon| {
            check(photon, about)?;
            again.push(photon)
        })?;
        let partitions = again.finish()?;
        self.cell(&split, &partitions, cell)?;
        discard(&split)
    }

    /// Writes a partition of the deepest level that doesn't fit into memory.
    fn deepest(&mut self, dir: &Path, partition: &Partition) -> Result<(), Error> {
        let (about, limit) = (self.about, self.size.batch_photons);
        let sorting = || Error::io(dir, format!("sorting {} photons on disk", partition.photons));
        let mut sorted = ExternalSort::new(limit * size_of::<Packed>() as u64, dir.to_owned());
        partition.read(dir, |photon| {
            check(photon, about)?;
            sorted.push(*photon).map_err(sorting())
        })?;
        sorted.sort();
        let (first, last) = (partition.cell().first(), partition.cell().last());
        let capacity = self.size.page_photons;
        // As many pages at a time as memory holds, and all threads have some.
        let together = (limit as usize / capacity).clamp(1, 64) * capacity;
        let mut merged = sorted.iter().map_err(sorting())?;
        loop {
            let some = merged.by_ref().take(together).collect::<std::io::Result<Vec<Packed>>>();
            let some = some.map_err(sorting())?;
            if some.is_empty() {
                return Ok(());
            }
            let pages = some.chunks(capacity);
            self.encode(pages.map(|page| Job { photons: page.iter(), first, last }).collect())?;
        }
    }

    fn batch(&mut self, dir: &Path, partitions: &[Partition], units: &[Unit]) -> Result<(), Error> {
        if units.is_empty() {
            return Ok(());
        }
        let (about, cube) = (self.about, &self.cube);
        let sorted: Vec<Sorted> = units
            .par_iter()
            .map(|u| {
                Sorted::read(dir, &partitions[u.partitions.clone()], cube, |p| check(p, about))
            })
            .collect::<Result<_, _>>()?;
        let capacity = self.size.page_photons;
        let written = self.done;
        let mut jobs = Vec::new();
        for (unit, sorted) in units.iter().zip(&sorted) {
            let mut leaves = Vec::new();
            if unit.leaf.photons <= capacity as u64 {
                leaves.push(unit.leaf);
            } else {
                let partition = &partitions[unit.partitions.start];
                let count = |first, last| sorted.count(first, last);
                cut(partition.cell(), LEVELS, capacity as u64, &count, &mut leaves);
            }
            let mut start = 0;
            for leaf in leaves {
                let end = start + leaf.photons as usize;
                if written.is_some_and(|done| leaf.last <= done) {
                    start = end;
                }
                while start < end {
                    let stop = end.min(start + capacity);
                    let photons = sorted.photons(start, stop);
                    jobs.push(Job { photons, first: leaf.first, last: leaf.last });
                    start = stop;
                }
            }
        }
        self.encode(jobs)?;
        let done = units.last().map_or(0, |u| u.leaf.last);
        self.checkpoint(done)
    }

    /// Compresses pages on all cores and writes them in order.
    fn encode<'p, I>(&mut self, jobs: Vec<Job<I>>) -> Result<(), Error>
    where
        I: Iterator<Item = &'p Packed> + Send,
    {
        let encoded: Vec<Encoded> = jobs
            .into_par_iter()
            .map_init(gmp::Encoder::new, |encoder, job| {
                let encoder = match encoder {
                    Ok(encoder) => encoder,
                    Err(_) => &mut gmp::Encoder::new()?,
                };
                // Side by side, because they are gone through several times.
                let photons: Vec<Packed> = job.photons.copied().collect();
                let columns = page::columns(&photons);
                let sums = page::sums(&columns, &photons);
                let bytes = encoder.page(&columns)?;
                Ok(Encoded { bytes, sums, first: job.first, last: job.last })
            })
            .collect::<Result<_, Error>>()?;
        for page in encoded {
            self.put(&page.bytes, "a page")?;
            self.pages.push(gmp::PageEntry {
                min: page.sums.bounds.min.to_array(),
                max: page.sums.bounds.max.to_array(),
                first_photon: self.sums.photons,
                offset: self.offset,
                length: page.bytes.len() as u32,
                photons: page.sums.photons as u32,
                first_cell: page.first,
                last_cell: page.last,
                checksum: u32::from_le_bytes(page.bytes[..4].try_into().unwrap_or_default()),
                reserved: 0,
            });
            self.offset += page.bytes.len() as u64;
            self.sums.add(&page.sums);
            self.progress.advance(page.sums.photons);
        }
        Ok(self.progress.check()?)
    }

    fn finish(mut self, store: &Path) -> Result<StoreSummary, Error> {
        let nodes = nodes(&self.pages);
        let directory = gmp::encode_directory(&nodes, &self.pages)?;
        self.put(&directory, "the directory")?;
        let header = self.header(&nodes, &directory);
        let mut head = Vec::new();
        let reserved = self.reserved;
        let (growing, pages) = (self.growing, self.pages.len() as u64);
        let doing = || Error::io(growing, format!("writing the header, {reserved} bytes"));
        let length = header::write_padded(&mut head, gmp::NAME, gmp::VERSION, &header, reserved)
            .map_err(doing())?;
        if length != reserved {
            let what = format!("header of {length} bytes, {reserved} reserved");
            return Err(doing()(std::io::Error::other(what)));
        }
        self.out
            .seek(SeekFrom::Start(0))
            .and_then(|_| self.out.write_all(&head))
            .and_then(|()| self.out.flush())
            .and_then(|()| seal::seal(self.out.get_ref(), growing, store))
            .map_err(doing())?;
        self.checkpoints.forget();
        Ok(StoreSummary {
            photons: self.sums.photons,
            pages,
            bytes: reserved as u64 + self.offset + directory.len() as u64,
            flux_w: self.sums.flux_w,
        })
    }
}

fn layout(
    cube: Cube,
    size: Size,
    pages: u64,
    pages_bytes: u64,
    nodes: &[gmp::Node],
    directory: &[u8],
) -> Layout {
    Layout {
        cube,
        page_photons: size.page_photons as u32,
        pages,
        nodes: nodes.len() as u64,
        pages_bytes,
        directory_bytes: directory.len() as u64,
        directory_crc32c: crc32c(directory),
    }
}

fn check(photon: &Packed, about: &About) -> Result<(), Error> {
    if photon.timestep < about.timesteps && usize::from(photon.surface) < about.surfaces.len() {
        return Ok(());
    }
    Err(Error::Photon {
        timestep: photon.timestep,
        surface: photon.surface,
        timesteps: about.timesteps,
        surfaces: about.surfaces.len(),
    })
}

/// Where a spill for a store lies while it is made: beside it.
pub fn spill_dir(store: &Path) -> PathBuf {
    let mut name = store.as_os_str().to_owned();
    name.push(".spill");
    PathBuf::from(name)
}
