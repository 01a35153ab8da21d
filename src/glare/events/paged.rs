use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

use super::duration::Durations;
use super::event::Growing;
use super::runs::{Fixed, Runs};

/// Counts of events at pixels that had no room in memory, on disk until their segment ends. Events
/// of which something is here have a serial number, and wait here when they are over: only in the
/// end is it known at how many different pixels they were, and how long at each.
#[derive(Debug)]
pub(in crate::glare) struct Paged {
    counts: Runs<Count>,
    /// For each serial number one of the same event; itself for the one that the event goes by.
    parents: Vec<u32>,
    over: BTreeMap<u32, Growing>,
}

/// Timesteps of an event at a pixel; there may be several of the same that add up.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Count {
    pixel: u32,
    serial: u32,
    count: u32,
}

impl Fixed for Count {
    const BYTES: usize = 12;

    fn put(&self, out: &mut Vec<u8>) {
        for number in [self.pixel, self.serial, self.count] {
            out.extend_from_slice(&number.to_le_bytes());
        }
    }

    fn get(bytes: &[u8]) -> Self {
        let number =
            |at: usize| bytes[at..at + 4].iter().rev().fold(0, |n, b| n << 8 | u32::from(*b));
        Self { pixel: number(0), serial: number(4), count: number(8) }
    }
}

impl Paged {
    /// Keeps about `bytes` in memory, the rest in a file in `folder`.
    pub fn new(bytes: u64, folder: PathBuf) -> Self {
        let counts = Runs::new(bytes, folder);
        Self { counts, parents: Vec::new(), over: BTreeMap::new() }
    }

    /// Whether anything is here, so that the end of a segment should be waited for.
    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// A serial number for an event that has none.
    pub fn serial(&mut self) -> u32 {
        let serial = self.parents.len() as u32;
        self.parents.push(serial);
        serial
    }

    /// The serial number of two events that are one.
    pub fn join(&mut self, a: Option<u32>, b: Option<u32>) -> Option<u32> {
        if let (Some(a), Some(b)) = (a, b) {
            let (a, b) = (self.find(a), self.find(b));
            self.parents[b as usize] = a;
        }
        a.or(b)
    }

    fn find(&mut self, mut serial: u32) -> u32 {
        while self.parents[serial as usize] != serial {
            let above = self.parents[self.parents[serial as usize] as usize];
            self.parents[serial as usize] = above;
            serial = above;
        }
        serial
    }

    /// An event has `count` timesteps at a pixel, besides others that may be here.
    pub fn add(&mut self, pixel: u32, serial: u32, count: u32) -> io::Result<()> {
        self.counts.push(Count { pixel, serial, count })
    }

    /// An event with a serial number is over.
    pub fn end(&mut self, serial: u32, event: Growing) {
        let root = self.find(serial);
        self.over.insert(root, event);
    }

    /// Bytes in memory beyond those of the counts.
    pub fn bytes(&self) -> usize {
        self.parents.capacity() * 4 + self.over.len() * 2 * size_of::<Growing>()
    }

    /// The segment is over: settles the pixels, and returns the events that were waiting.
    pub fn settle(&mut self, durations: &mut Durations) -> io::Result<Vec<Growing>> {
        if self.parents.is_empty() {
            return Ok(Vec::new());
        }
        let Self { counts, over, parents } = self;
        counts.sort();
        // Every number points at the one that its event goes by.
        for serial in 0..parents.len() {
            let mut root = parents[serial];
            while parents[root as usize] != root {
                root = parents[root as usize];
            }
            parents[serial] = root;
        }
        let mut here: Vec<(u32, u32)> = Vec::new();
        let mut settle = |pixel: u32, here: &mut Vec<(u32, u32)>| {
            here.sort_unstable();
            for same in here.chunk_by(|a, b| a.0 == b.0) {
                durations.bring_back(pixel, same.iter().map(|(_, count)| count).sum());
                if let Some(event) = over.get_mut(&same[0].0) {
                    event.pixels -= same.len() as u64 - 1;
                }
            }
            here.clear();
        };
        let mut present = None;
        for count in counts.iter()? {
            let Count { pixel, serial, count } = count?;
            if let Some(before) = present.filter(|before| *before != pixel) {
                settle(before, &mut here);
            }
            present = Some(pixel);
            here.push((parents[serial as usize], count));
        }
        if let Some(pixel) = present {
            settle(pixel, &mut here);
        }
        counts.clear()?;
        parents.clear();
        Ok(std::mem::take(over).into_values().collect())
    }
}
