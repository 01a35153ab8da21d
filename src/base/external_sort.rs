//! Lists that are longer than memory and end up sorted.
//!
//! Classic external merge sort: what doesn't fit into memory is sorted and written into a file without
//! a name, one part after the other; whoever reads the list merges the parts and what memory still
//! holds. The photon store needs it where more photons lie in one smallest cell than memory takes, the
//! glare analysis for its events and for counts that wait until their segment ends.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use rayon::prelude::*;

/// Bytes that are read or written at a time: a few pages of the disk.
const BUFFER_BYTES: usize = 1 << 16;
/// Bytes that are read ahead while parts are merged, for all of them together.
const MERGE_BYTES: usize = 8 << 20;

/// What can be written down in a fixed number of bytes, and has an order.
pub trait Record: Clone + Send {
    /// Bytes of one record.
    const BYTES: usize;
    /// Appends exactly [`Self::BYTES`] bytes.
    fn put(&self, out: &mut Vec<u8>);
    /// The record that such bytes hold.
    fn get(bytes: &[u8]) -> Self;
    /// The order of the list. Records that are equal in it must be equal in everything.
    fn order(&self, other: &Self) -> Ordering;
}

/// A list that ends up sorted, whatever its length.
#[derive(Debug)]
pub struct ExternalSort<T> {
    items: Vec<T>,
    /// Items that are kept in memory.
    most: usize,
    folder: PathBuf,
    /// The parts that were written.
    parts: Vec<Part>,
    file: Option<File>,
}

/// Where a sorted part begins in the file, and how many items it has.
#[derive(Clone, Copy, Debug)]
struct Part {
    start: u64,
    items: u64,
}

impl<T: Record> ExternalSort<T> {
    /// A list that keeps about `bytes` in memory, and the rest in a file without a name in
    /// `folder`.
    pub fn new(bytes: u64, folder: PathBuf) -> Self {
        let most = usize::try_from(bytes / size_of::<T>() as u64).unwrap_or(usize::MAX).max(1);
        Self { items: Vec::new(), most, folder, parts: Vec::new(), file: None }
    }

    /// Number of items.
    pub fn len(&self) -> u64 {
        self.parts.iter().map(|part| part.items).sum::<u64>() + self.items.len() as u64
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds an item.
    ///
    /// # Errors
    /// What the file system says.
    pub fn push(&mut self, item: T) -> io::Result<()> {
        if self.items.len() >= self.most {
            self.flush()?;
        }
        if self.items.len() == self.items.capacity() {
            // Doubling, but never beyond what may be kept.
            let more = self.items.len().clamp(16, (self.most - self.items.len()).max(16));
            self.items.reserve_exact(more);
        }
        self.items.push(item);
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sort();
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile_in(&self.folder)?),
        };
        let start = file.seek(SeekFrom::End(0))?;
        let mut out = BufWriter::with_capacity(BUFFER_BYTES, file);
        let mut bytes = Vec::with_capacity(T::BYTES);
        for item in &self.items {
            bytes.clear();
            item.put(&mut bytes);
            out.write_all(&bytes)?;
        }
        out.flush()?;
        self.parts.push(Part { start, items: self.items.len() as u64 });
        self.items.clear();
        Ok(())
    }

    /// Sorts what is in memory; to be called before [`Self::iter`].
    pub fn sort(&mut self) {
        self.items.par_sort_unstable_by(T::order);
    }

    /// All items in order, as often as wanted.
    ///
    /// # Errors
    /// What the file system says; so does each item.
    pub fn iter(&self) -> io::Result<Merged<'_, T>> {
        let mut merged = Merged { heads: BinaryHeap::new(), parts: Vec::new(), rest: &self.items };
        let Some(file) = &self.file else { return Ok(merged) };
        // Many small parts share what few large ones would take.
        let buffer = (MERGE_BYTES / self.parts.len().max(1)).clamp(T::BYTES, BUFFER_BYTES);
        for (number, part) in self.parts.iter().enumerate() {
            let source = PartSource { file, at: part.start, left: part.items * T::BYTES as u64 };
            merged.parts.push(BufReader::with_capacity(buffer, source));
            merged.refill(number)?;
        }
        Ok(merged)
    }

    /// Forgets all items.
    ///
    /// # Errors
    /// What the file system says.
    pub fn clear(&mut self) -> io::Result<()> {
        self.items.clear();
        self.parts.clear();
        self.file.as_mut().map_or(Ok(()), |file| file.set_len(0))
    }
}

/// A stretch of a file that others read too.
struct PartSource<'a> {
    file: &'a File,
    at: u64,
    left: u64,
}

impl Read for PartSource<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        use std::os::unix::fs::FileExt;
        let most = usize::try_from(self.left).unwrap_or(usize::MAX).min(out.len());
        let read = self.file.read_at(&mut out[..most], self.at)?;
        self.at += read as u64;
        self.left -= read as u64;
        Ok(read)
    }
}

/// The items of an [`ExternalSort`], in order.
pub struct Merged<'a, T> {
    /// The next item of each part that has any left, the first in order on top.
    heads: BinaryHeap<Head<T>>,
    parts: Vec<BufReader<PartSource<'a>>>,
    /// Those that are in memory.
    rest: &'a [T],
}

struct Head<T> {
    item: T,
    part: usize,
}

impl<T: Record> Ord for Head<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap has the greatest on top.
        other.item.order(&self.item).then(other.part.cmp(&self.part))
    }
}

impl<T: Record> PartialOrd for Head<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T: Record> PartialEq for Head<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<T: Record> Eq for Head<T> {}

impl<T: Record> Merged<'_, T> {
    fn refill(&mut self, part: usize) -> io::Result<()> {
        let source = &mut self.parts[part];
        if source.get_ref().left == 0 && source.buffer().is_empty() {
            return Ok(());
        }
        let mut bytes = vec![0; T::BYTES];
        source.read_exact(&mut bytes)?;
        self.heads.push(Head { item: T::get(&bytes), part });
        Ok(())
    }
}

impl<T: Record> Iterator for Merged<'_, T> {
    type Item = io::Result<T>;

    fn next(&mut self) -> Option<Self::Item> {
        let in_memory = self.rest.first();
        let from_disk = self
            .heads
            .peek()
            .filter(|head| in_memory.is_none_or(|first| head.item.order(first).is_lt()));
        if from_disk.is_some() {
            let Head { item, part } = self.heads.pop()?;
            return Some(self.refill(part).map(|()| item));
        }
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(Ok(first.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    impl Record for u32 {
        const BYTES: usize = 4;
        fn put(&self, out: &mut Vec<u8>) {
            out.extend_from_slice(&self.to_le_bytes());
        }
        fn get(bytes: &[u8]) -> Self {
            bytes.iter().rev().fold(0, |sum, byte| sum << 8 | Self::from(*byte))
        }
        fn order(&self, other: &Self) -> Ordering {
            self.cmp(other)
        }
    }

    #[test]
    fn lists_come_back_sorted_whatever_fits_into_memory() {
        let folder = tempfile::tempdir().unwrap();
        let mut random = Stream::new(1, Purpose::Survey, 0);
        for length in [0, 1, 2, 63, 64, 65, 1000, 40_000] {
            let items: Vec<u32> = (0..length).map(|_| (random.uniform() * 5e4) as u32).collect();
            let mut sorted = items.clone();
            sorted.sort_unstable();
            for bytes in [0, 4, 256, 4096, 1 << 30] {
                if length / 1000 * 4 > bytes {
                    continue;
                }
                let mut list = ExternalSort::new(bytes, folder.path().to_owned());
                for _ in 0..2 {
                    items.iter().for_each(|item| list.push(*item).unwrap());
                    list.sort();
                    assert_eq!(list.len(), length);
                    for _ in 0..2 {
                        let found: Vec<u32> = list.iter().unwrap().map(Result::unwrap).collect();
                        assert!(found == sorted, "{length} items, {bytes} bytes");
                    }
                    list.clear().unwrap();
                }
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a file is left");
    }
}
