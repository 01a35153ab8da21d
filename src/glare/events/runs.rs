use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

/// Bytes that are read or written at a time.
const BUFFER_BYTES: usize = 1 << 16;
/// Bytes that are read ahead while parts are merged, for all of them together.
const MERGE_BYTES: usize = 8 << 20;

/// What can be written down in a fixed number of bytes. Its order is the order of the list.
pub(in crate::glare) trait Fixed: Ord + Sized {
    /// Bytes of one item.
    const BYTES: usize;
    /// Appends exactly [`Self::BYTES`] bytes.
    fn put(&self, out: &mut Vec<u8>);
    /// The item that such bytes hold.
    fn get(bytes: &[u8]) -> Self;
}

/// A list that ends up sorted, whatever its length: what doesn't fit into memory goes into a
/// temporary file, some sorted items at a time, and is merged when the list is read.
#[derive(Debug)]
pub(in crate::glare) struct Runs<T> {
    items: Vec<T>,
    /// Items that are kept in memory.
    most: usize,
    folder: PathBuf,
    /// Where each part that was written begins, and how many items it has.
    parts: Vec<(u64, u64)>,
    file: Option<File>,
    written: u64,
}

impl<T: Fixed> Runs<T> {
    /// A list that keeps about `bytes` in memory, and the rest in a file without a name in
    /// `folder`.
    pub fn new(bytes: u64, folder: PathBuf) -> Self {
        let most = usize::try_from(bytes / size_of::<T>() as u64).unwrap_or(usize::MAX).max(1);
        Self { items: Vec::new(), most, folder, parts: Vec::new(), file: None, written: 0 }
    }

    pub fn len(&self) -> u64 {
        self.written + self.items.len() as u64
    }

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
        self.items.sort_unstable();
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
        let items = self.items.len() as u64;
        self.parts.push((start, items));
        self.written += items;
        self.items.clear();
        Ok(())
    }

    /// Sorts what is in memory; to be called before [`Self::iter`].
    pub fn sort(&mut self) {
        self.items.sort_unstable();
    }

    /// All items in order.
    pub fn iter(&self) -> io::Result<Merged<'_, T>> {
        let mut merged = Merged { heap: BinaryHeap::new(), parts: Vec::new(), rest: &self.items };
        let Some(file) = &self.file else { return Ok(merged) };
        // Many small parts share what few large ones would take.
        let buffer = (MERGE_BYTES / self.parts.len().max(1)).clamp(T::BYTES, BUFFER_BYTES);
        for (number, (start, items)) in self.parts.iter().enumerate() {
            let source = PartSource { file, at: *start, left: items * T::BYTES as u64 };
            merged.parts.push(BufReader::with_capacity(buffer, source));
            merged.refill(number)?;
        }
        Ok(merged)
    }

    /// Forgets all items.
    pub fn clear(&mut self) -> io::Result<()> {
        self.items.clear();
        self.parts.clear();
        self.written = 0;
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

/// The items of [`Runs`], in order.
pub(in crate::glare) struct Merged<'a, T> {
    /// The next item of each part that has any left.
    heap: BinaryHeap<std::cmp::Reverse<(T, usize)>>,
    parts: Vec<BufReader<PartSource<'a>>>,
    /// Those that are in memory.
    rest: &'a [T],
}

impl<T: Fixed> Merged<'_, T> {
    fn refill(&mut self, part: usize) -> io::Result<()> {
        let source = &mut self.parts[part];
        if source.get_ref().left == 0 && source.buffer().is_empty() {
            return Ok(());
        }
        let mut bytes = vec![0; T::BYTES];
        source.read_exact(&mut bytes)?;
        self.heap.push(std::cmp::Reverse((T::get(&bytes), part)));
        Ok(())
    }
}

impl<T: Fixed + Clone> Iterator for Merged<'_, T> {
    type Item = io::Result<T>;

    fn next(&mut self) -> Option<Self::Item> {
        let on_disk = self.heap.peek().map(|std::cmp::Reverse((item, _))| item);
        match (on_disk, self.rest.split_first()) {
            (None, None) => None,
            (disk, Some((first, rest))) if disk.is_none_or(|disk| first <= disk) => {
                self.rest = rest;
                Some(Ok(first.clone()))
            }
            _ => {
                let std::cmp::Reverse((item, part)) = self.heap.pop()?;
                Some(self.refill(part).map(|()| item))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    impl Fixed for u32 {
        const BYTES: usize = 4;
        fn put(&self, out: &mut Vec<u8>) {
            out.extend_from_slice(&self.to_le_bytes());
        }
        fn get(bytes: &[u8]) -> Self {
            bytes.iter().rev().fold(0, |sum, byte| sum << 8 | Self::from(*byte))
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
                let mut runs = Runs::new(bytes, folder.path().to_owned());
                for _ in 0..2 {
                    items.iter().for_each(|item| runs.push(*item).unwrap());
                    runs.sort();
                    assert_eq!(runs.len(), length);
                    for _ in 0..2 {
                        let found: Vec<u32> = runs.iter().unwrap().map(Result::unwrap).collect();
                        assert!(found == sorted, "{length} items, {bytes} bytes");
                    }
                    runs.clear().unwrap();
                }
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "a file is left");
    }
}
