//! Photons in their order: by Morton code, then by everything that tells them apart. So the order
//! in which they came, and how the work was cut, leave no trace in the store.

use std::path::Path;

use rayon::prelude::*;

use super::Error;
use super::cube::Cube;
use super::packed::Packed;
use super::partition::Partition;
use crate::base::Record;

/// Photons of some neighbouring partitions, sorted.
pub(super) struct Sorted {
    photons: Vec<Packed>,
    keys: Vec<(u64, u32)>,
}

impl Sorted {
    /// Reads and sorts partitions; `check` sees every photon. At most 2^32 photons.
    pub fn read(
        dir: &Path,
        partitions: &[Partition],
        cube: &Cube,
        check: impl Fn(&Packed) -> Result<(), Error>,
    ) -> Result<Self, Error> {
        let mut photons = Vec::new();
        for partition in partitions {
            partition.open(dir)?;
            photons.reserve_exact(partition.photons as usize);
            partition.read(dir, |photon| {
                check(photon)?;
                photons.push(*photon);
                Ok(())
            })?;
        }
        let mut keys: Vec<(u64, u32)> =
            photons.iter().zip(0..).map(|(p, i)| (cube.code(p.position), i)).collect();
        keys.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then_with(|| photons[a.1 as usize].order(&photons[b.1 as usize]))
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
