use std::io;
use std::path::PathBuf;

use super::event::Event;
use super::runs::{Fixed, Runs};

/// The glare events of an analysis, sorted by first and last timestep, voxels, pixels, then the
/// smallest voxel. What doesn't fit into memory lies in a temporary file.
#[derive(Debug)]
pub struct Events(Runs<Kept>);

/// An event in the order of the list.
#[derive(Clone, Debug)]
struct Kept(Event);

impl Kept {
    fn key(&self) -> (u32, u32, u64, u64, u64) {
        let Event { first, last, voxels, pixels, smallest_voxel, .. } = self.0;
        (first, last, voxels, pixels, smallest_voxel)
    }
}

impl PartialEq for Kept {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Kept {}

impl PartialOrd for Kept {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Kept {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key().cmp(&other.key())
    }
}

impl Fixed for Kept {
    const BYTES: usize = 64;

    fn put(&self, out: &mut Vec<u8>) {
        let e = &self.0;
        for number in [e.first, e.last, e.peak_timestep, e.peak_row, e.peak_column] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        out.extend_from_slice(&e.peak_w_m2.to_le_bytes());
        for number in [e.voxels, e.pixels, e.smallest_voxel] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        for number in [e.centroid_row, e.centroid_column] {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn get(bytes: &[u8]) -> Self {
        let small = |i: usize| {
            bytes[i * 4..i * 4 + 4].iter().rev().fold(0, |n: u32, b| n << 8 | u32::from(*b))
        };
        let large = |i: usize| u64::from(small(i + 1)) << 32 | u64::from(small(i));
        Self(Event {
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
        })
    }
}

impl Events {
    /// A list that keeps about `bytes` in memory, the rest in a file in `folder`.
    pub(in crate::glare) fn new(bytes: u64, folder: PathBuf) -> Self {
        Self(Runs::new(bytes, folder))
    }

    pub(in crate::glare) fn push(&mut self, event: Event) -> io::Result<()> {
        self.0.push(Kept(event))
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
        self.0.len() == 0
    }

    /// All events in order, as often as wanted.
    ///
    /// # Errors
    /// What the file system says; so does each item.
    pub fn iter(&self) -> io::Result<impl Iterator<Item = io::Result<Event>>> {
        Ok(self.0.iter()?.map(|kept| kept.map(|kept| kept.0)))
    }

    /// All events in memory, in order: 72 bytes each, which no limit bounds.
    ///
    /// # Errors
    /// What the file system says.
    pub fn to_vec(&self) -> io::Result<Vec<Event>> {
        self.iter()?.collect()
    }
}
