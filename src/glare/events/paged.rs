use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

use super::event::Growing;
use super::label::find;
use crate::base::{ExternalSort, Record};

/// Counts of events at pixels that had no room in memory, on disk until their segment ends. Events
/// of which something is here have a serial number, and wait here when they are over: only in the
/// end is it known at how many different pixels they were, and how long at each.
#[derive(Debug)]
pub(in crate::glare) struct Paged {
    counts: ExternalSort<Count>,
    /// For each serial number one of the same event; itself for the one that the event goes by.
    parents: Vec<u32>,
    over: BTreeMap<u32, Growing>,
}

/// Timesteps of an event at a pixel; there may be several of the same that add up.
#[derive(Clone, Debug)]
struct Count {
    pixel: u32,
    serial: u32,
    count: u32,
}

impl Record for Count {
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

    fn order(&self, other: &Self) -> Ordering {
        let key = |c: &Self| (c.pixel, c.serial, c.count);
        key(self).cmp(&key(other))
    }
}

impl Paged {
    /// Keeps about `bytes` in memory, the rest in a file in `folder`.
    pub fn new(bytes: u64, folder: PathBuf) -> Self {
        let counts = ExternalSort::new(bytes, folder);
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
            let (a, b) = (find(&mut self.parents, a), find(&mut self.parents, b));
            self.parents[b as usize] = a;
        }
        a.or(b)
    }

    /// An event has `count` timesteps at a pixel, besides others that may be here.
    pub fn add(&mut self, pixel: u32, serial: u32, count: u32) -> io::Result<()> {
        self.counts.push(Count { pixel, serial, count })
    }

    /// An event with a serial number is over.
    pub fn end(&mut self, serial: u32, event: Growing) {
        let root = find(&mut self.parents, serial);
        self.over.insert(root, event);
    }

    /// Bytes in memory beyond those of the counts.
    pub fn bytes(&self) -> usize {
        self.parents.capacity() * 4 + self.over.len() * 2 * size_of::<Growing>()
    }

    /// The segment is over: tells `settle` for each pixel and event how long the event was there, in
    /// timesteps, and returns the events that were waiting.
    pub fn settle(&mut self, mut settle: impl FnMut(u32, u32)) -> io::Result<Vec<Growing>> {
        if self.parents.is_empty() {
            return Ok(Vec::new());
        }
        // Every number points at the one that its event goes by.
        for serial in 0..self.parents.len() as u32 {
            self.parents[serial as usize] = find(&mut self.parents, serial);
        }
        let Self { counts, over, parents } = self;
        counts.sort();
        let mut settle_pixel = |here: &mut Vec<Count>| {
            here.sort_unstable_by(Record::order);
            for same in here.chunk_by(|a, b| a.serial == b.serial) {
                settle(same[0].pixel, same.iter().map(|here| here.count).sum());
                if let Some(event) = over.get_mut(&same[0].serial) {
                    event.pixels -= same.len() as u64 - 1;
                }
            }
            here.clear();
        };
        let mut here: Vec<Count> = Vec::new();
        for count in counts.iter()? {
            let count = count?;
            if here.first().is_some_and(|first| first.pixel != count.pixel) {
                settle_pixel(&mut here);
            }
            here.push(Count { serial: parents[count.serial as usize], ..count });
        }
        settle_pixel(&mut here);
        counts.clear()?;
        parents.clear();
        Ok(std::mem::take(over).into_values().collect())
    }
}
