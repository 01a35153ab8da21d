//! Photons in their order: by Morton code, then by everything that tells them apart. So the order
//! in which they came, and the parting of the work, leave no trace in the store.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::Error;
use super::bucket::Bucket;
use super::cube::Cube;
use super::packed::{Packed, RECORD_BYTES};

/// Photons of some neighbouring buckets, sorted.
pub(super) struct Sorted {
    photons: Vec<Packed>,
    keys: Vec<(u64, u32)>,
}

impl Sorted {
    /// Reads and sorts buckets; `check` sees every photon. At most 2^32 photons.
    pub fn read(
        dir: &Path,
        buckets: &[Bucket],
        cube: &Cube,
        check: impl Fn(&Packed) -> Result<(), Error>,
    ) -> Result<Self, Error> {
        let mut photons = Vec::new();
        for bucket in buckets {
            bucket.open(dir)?;
            photons.reserve_exact(bucket.photons as usize);
            bucket.read(dir, |photon| {
                check(photon)?;
                photons.push(*photon);
                Ok(())
            })?;
        }
        let mut keys: Vec<(u64, u32)> =
            photons.iter().zip(0..).map(|(p, i)| (cube.code(p.position), i)).collect();
        keys.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then_with(|| content(&photons[a.1 as usize], &photons[b.1 as usize]))
        });
        Ok(Self { photons, keys })
    }

    /// Number of photons with codes from `first` to `last`.
    pub fn count(&self, first: u64, last: u64) -> u64 {
        let start = self.keys.partition_point(|k| k.0 < first);
        let end = self.keys.partition_point(|k| k.0 <= last);
        (end - start) as u64
    }

    /// Photons `start..end` in order.
    pub fn photons(&self, start: usize, end: usize) -> impl Iterator<Item = &Packed> {
        self.keys[start..end].iter().map(|k| &self.photons[k.1 as usize])
    }
}

/// The order of photons in one cell. Position first: where millions lie in a cell that can't be
/// cut further, their pages are slabs that a search can tell apart.
pub(super) fn content(a: &Packed, b: &Packed) -> Ordering {
    let (at, other) = (a.position.to_array(), b.position.to_array());
    let axes = at.iter().zip(&other).map(|(x, y)| x.total_cmp(y));
    axes.fold(Ordering::Equal, Ordering::then)
        .then_with(|| a.timestep.cmp(&b.timestep))
        .then_with(|| a.surface.cmp(&b.surface))
        .then_with(|| a.flux_w.total_cmp(&b.flux_w))
        .then_with(|| (a.normal, a.direction).cmp(&(b.normal, b.direction)))
}

/// Photons of one cell that are too many for memory and can't be parted by place any more:
/// sorted in runs on disk, which are merged as they are read.
pub(super) struct Merged {
    runs: Vec<Run>,
    /// The next photon of each run, the first in order on top.
    heads: BinaryHeap<Reverse<Head>>,
    left: u64,
}

struct Head {
    photon: Packed,
    run: usize,
}

impl Ord for Head {
    fn cmp(&self, other: &Self) -> Ordering {
        content(&self.photon, &other.photon).then(self.run.cmp(&other.run))
    }
}

impl PartialOrd for Head {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Head {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Head {}

struct Run {
    path: PathBuf,
    file: BufReader<File>,
    left: u64,
}

impl Merged {
    /// Sorts the photons of `bucket` in runs of `limit`; the runs go into `dir`.
    pub fn read(
        from: &Path,
        bucket: &Bucket,
        dir: &Path,
        limit: usize,
        check: impl Fn(&Packed) -> Result<(), Error>,
    ) -> Result<Self, Error> {
        fs::create_dir_all(dir).map_err(Error::io(dir, "making the folder"))?;
        let mut run = Vec::new();
        let mut runs = Vec::new();
        let mut spill = |run: &mut Vec<Packed>| -> Result<(), Error> {
            run.par_sort_unstable_by(content);
            let path = dir.join(format!("run-{}", runs.len()));
            let doing =
                format!("writing {} photons, {} bytes", run.len(), run.len() * RECORD_BYTES);
            let write = || {
                let mut out = BufWriter::new(File::create(&path)?);
                let mut bytes = Vec::with_capacity(RECORD_BYTES);
                for photon in run.iter() {
                    bytes.clear();
                    photon.write(&mut bytes);
                    out.write_all(&bytes)?;
                }
                out.flush()?;
                File::open(&path)
            };
            let file = BufReader::new(write().map_err(Error::io(&path, doing))?);
            runs.push(Run { path, file, left: run.len() as u64 });
            run.clear();
            Ok(())
        };
        bucket.read(from, |photon| {
            check(photon)?;
            run.push(*photon);
            if run.len() >= limit { spill(&mut run) } else { Ok(()) }
        })?;
        if !run.is_empty() {
            spill(&mut run)?;
        }
        let mut merged = Self { runs, heads: BinaryHeap::new(), left: bucket.photons };
        for run in 0..merged.runs.len() {
            merged.advance(run)?;
        }
        Ok(merged)
    }

    /// The next photons in order, at most `count`; none at the end.
    pub fn take(&mut self, count: usize) -> Result<Vec<Packed>, Error> {
        let mut out = Vec::with_capacity(self.left.min(count as u64) as usize);
        while out.len() < count {
            let Some(Reverse(head)) = self.heads.pop() else { break };
            out.push(head.photon);
            self.advance(head.run)?;
        }
        self.left -= out.len() as u64;
        Ok(out)
    }

    fn advance(&mut self, run: usize) -> Result<(), Error> {
        if let Some(photon) = self.runs[run].next()? {
            self.heads.push(Reverse(Head { photon, run }));
        }
        Ok(())
    }
}

impl Run {
    fn next(&mut self) -> Result<Option<Packed>, Error> {
        if self.left == 0 {
            return Ok(None);
        }
        let mut bytes = [0; RECORD_BYTES];
        self.file.read_exact(&mut bytes).map_err(Error::io(&self.path, "reading photons back"))?;
        self.left -= 1;
        Ok(Some(Packed::read(&bytes)))
    }
}
