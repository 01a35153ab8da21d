use std::cmp::Ordering;
use std::io;
use std::path::PathBuf;

use super::event::Event;
use crate::base::{ExternalSort, Record};

/// The glare events of an analysis, sorted by first and last timestep, voxels, pixels, then the
/// smallest voxel. What doesn't fit into memory lies in a temporary file.
#[derive(Debug)]
pub struct Events(ExternalSort<Event>);

impl Record for Event {
    const BYTES: usize = 64;

    fn put(&self, out: &mut Vec<u8>) {
        let peak = [self.peak_timestep, self.peak_row, self.peak_column, self.peak_w_m2.to_bits()];
        for number in [self.first, self.last].into_iter().chain(peak) {
            out.extend_from_slice(&number.to_le_bytes());
        }
        let centroid = [self.centroid_row, self.centroid_column].map(f64::to_bits);
        for number in [self.voxels, self.pixels, self.smallest_voxel].into_iter().chain(centroid) {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn get(bytes: &[u8]) -> Self {
        let small = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k]));
        let large = |i: usize| u64::from(small(i + 1)) << 32 | u64::from(small(i));
        Self {
            first: small(0),
            last: small(1),
            peak_timestep: small(2),
            peak_row: small(3),
            peak_column: small(4),
            peak_w_m2: f32::from_bits(small(5)),
            voxels: large(6),
            pixels: large(8),
            smallest_voxel: large(10),
            centroid_row: f64::from_bits(large(12)),
            centroid_column: f64::from_bits(large(14)),
        }
    }

    fn order(&self, other: &Self) -> Ordering {
        let key = |e: &Self| (e.first, e.last, e.voxels, e.pixels, e.smallest_voxel);
        key(self).cmp(&key(other))
    }
}

impl Events {
    /// A list that keeps about `bytes` in memory, the rest in a file in `folder`.
    pub(in crate::glare) fn new(bytes: u64, folder: PathBuf) -> Self {
        Self(ExternalSort::new(bytes, folder))
    }

    pub(in crate::glare) fn push(&mut self, event: Event) -> io::Result<()> {
        self.0.push(event)
    }

    pub(in crate::glare) fn sort(&mut self) {
        self.0.sort();
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        usize::try_from(self.0.len()).unwrap_or(usize::MAX)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// All events in order, as often as wanted.
    ///
    /// # Errors
    /// What the file system says; so does each item.
    pub fn iter(&self) -> io::Result<impl Iterator<Item = io::Result<Event>>> {
        self.0.iter()
    }

    /// All events in memory, in order: 72 bytes each, which no limit bounds.
    ///
    /// # Errors
    /// What the file system says.
    pub fn to_vec(&self) -> io::Result<Vec<Event>> {
        self.iter()?.collect()
    }
}
