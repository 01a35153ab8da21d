//! A shard: chunks one behind the other, then the index, as `sharding_indexed` has it with
//! `index_location: end` and index codecs `bytes` (little-endian), `crc32c`.

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;

use super::Error;
use super::chunk::CHECKSUM_BYTES;
use crate::checksum::{crc32c, crc32c_append};

/// Bytes of one entry of the index: offset and length, u64 each.
pub const ENTRY_BYTES: u64 = 16;
const EMPTY: u64 = u64::MAX;

/// Where a chunk lies in its shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// First byte, from the start of the file.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u64,
}

/// Bytes of the index of a shard of `chunks` chunks, its checksum included.
pub fn index_bytes(chunks: usize) -> u64 {
    chunks as u64 * ENTRY_BYTES + CHECKSUM_BYTES as u64
}

/// Writes a shard, chunk by chunk in the order of the index.
pub struct Writer<W> {
    out: W,
    at: u64,
    index: Vec<u8>,
}

/// What became of a shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Length of the file.
    pub bytes: u64,
    /// CRC-32C of the index: the lengths of all chunks, by which a shard of something else shows.
    pub index_crc: u32,
}

impl<W: Write> Writer<W> {
    /// Begins a shard.
    pub fn new(out: W) -> Self {
        Self { out, at: 0, index: Vec::new() }
    }

    /// Appends the next chunk, as it was encoded.
    ///
    /// # Errors
    /// What the writer says.
    pub fn push(&mut self, encoded: &[u8]) -> Result<(), Error> {
        self.out.write_all(encoded)?;
        let bytes = encoded.len() as u64;
        self.index.extend_from_slice(&self.at.to_le_bytes());
        self.index.extend_from_slice(&bytes.to_le_bytes());
        self.at += bytes;
        Ok(())
    }

    /// Leaves `count` chunks out: readers take the fill value for them.
    pub fn skip(&mut self, count: usize) {
        let length = self.index.len();
        self.index.resize(length + 2 * size_of::<u64>() * count, 0xff);
    }

    /// Writes the index.
    ///
    /// # Errors
    /// What the writer says.
    pub fn finish(mut self) -> Result<(W, Written), Error> {
        let index_crc = crc32c(&self.index);
        self.index.extend_from_slice(&index_crc.to_le_bytes());
        self.out.write_all(&self.index)?;
        let bytes = self.at + self.index.len() as u64;
        Ok((self.out, Written { bytes, index_crc }))
    }
}

/// Reads the whole index of a shard of `file_bytes` bytes, holds it against its checksum and
/// hands each entry (`None`: left out) to `each`. Returns the index's CRC-32C.
///
/// # Errors
/// [`Error::Damaged`]; what the file system says.
pub fn read_index(
    file: &File,
    file_bytes: u64,
    chunks: usize,
    mut each: impl FnMut(usize, Option<Entry>),
) -> Result<u32, Error> {
    let length = index_bytes(chunks);
    let Some(start) = file_bytes.checked_sub(length) else {
        return Err(Error::damaged(format!(
            "expected at least {length} bytes (the index of {chunks} chunks), found {file_bytes}"
        )));
    };
    let mut block = vec![0u8; (1 << 16).min(chunks * 16)];
    let (mut at, mut sum, mut done) = (start, 0, 0);
    while done < chunks {
        let count = (chunks - done).min(block.len() / 16);
        let bytes = &mut block[..count * 16];
        file.read_exact_at(bytes, at)?;
        sum = if done == 0 { crc32c(bytes) } else { crc32c_append(sum, bytes) };
        for (i, entry) in bytes.chunks_exact(16).enumerate() {
            each(done + i, parse(entry));
        }
        at += bytes.len() as u64;
        done += count;
    }
    let mut stored = [0u8; CHECKSUM_BYTES];
    file.read_exact_at(&mut stored, at)?;
    if u32::from_le_bytes(stored) != sum {
        return Err(Error::damaged("the checksum of its index doesn't hold"));
    }
    Ok(sum)
}

/// Reads `out.len()` entries from entry `first` on, of an index that [`read_index`] has checked.
///
/// # Errors
/// What the file system says.
pub fn read_entries(
    file: &File,
    file_bytes: u64,
    chunks: usize,
    first: usize,
    out: &mut [Option<Entry>],
) -> Result<(), Error> {
    let start = file_bytes.checked_sub(index_bytes(chunks)).ok_or_else(|| {
        Error::damaged(format!("found {file_bytes} bytes, too few for its index"))
    })?;
    let mut bytes = vec![0u8; out.len() * 16];
    file.read_exact_at(&mut bytes, start + first as u64 * ENTRY_BYTES)?;
    for (entry, bytes) in out.iter_mut().zip(bytes.chunks_exact(16)) {
        *entry = parse(bytes);
    }
    Ok(())
}

fn parse(bytes: &[u8]) -> Option<Entry> {
    let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|k| bytes[at + k]));
    let entry = Entry { offset: number(0), bytes: number(8) };
    (entry.offset != EMPTY || entry.bytes != EMPTY).then_some(entry)
}

/// Reads one chunk's bytes into `out` (resized).
///
/// # Errors
/// An entry that points outside the shard or claims more than `most` bytes.
pub fn read_chunk(
    file: &File,
    file_bytes: u64,
    chunks: usize,
    entry: Entry,
    most: usize,
    out: &mut Vec<u8>,
) -> Result<(), Error> {
    let end = entry.offset.checked_add(entry.bytes);
    let room = file_bytes.saturating_sub(index_bytes(chunks));
    let length = usize::try_from(entry.bytes).ok().filter(|&n| n <= most);
    let (Some(length), true) = (length, end.is_some_and(|end| end <= room)) else {
        return Err(Error::damaged(format!(
            "the index claims {} bytes at {}, allowed are {most} inside the first {room}",
            entry.bytes, entry.offset
        )));
    };
    out.resize(length, 0);
    file.read_exact_at(out, entry.offset)?;
    Ok(())
}
