#![doc = include_str!("ledger.md")]

use std::io::{self, Read, Write};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::Error;
use crate::checksum::crc32c;
use crate::header;

/// The name in the ledger's first line.
pub const NAME: &str = "zarr-tiles";
/// The version that this program writes and reads.
pub const VERSION: u32 = 1;
/// Bytes of a record.
pub const RECORD_BYTES: usize = 32;

/// What is known of one tile that was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Number of the tile, row by row.
    pub tile: u32,
    /// CRC-32C of the shard's index; 0 where the tile has no shard.
    pub index_crc: u32,
    /// Length of the shard file; 0 where the tile has no shard because all of it is 0.
    pub bytes: u64,
    /// Numbers that are not 0.
    pub nonzero: u64,
    /// Chunks that are not left out.
    pub chunks: u32,
}

impl Record {
    /// The record's bytes.
    pub fn to_bytes(&self) -> [u8; RECORD_BYTES] {
        let mut out = [0u8; RECORD_BYTES];
        out[0..4].copy_from_slice(&self.tile.to_le_bytes());
        out[4..8].copy_from_slice(&self.index_crc.to_le_bytes());
        out[8..16].copy_from_slice(&self.bytes.to_le_bytes());
        out[16..24].copy_from_slice(&self.nonzero.to_le_bytes());
        out[24..28].copy_from_slice(&self.chunks.to_le_bytes());
        let sum = crc32c(&out[..28]);
        out[28..32].copy_from_slice(&sum.to_le_bytes());
        out
    }

    /// The record that some bytes hold; `None` where its checksum doesn't hold.
    pub fn from_bytes(bytes: &[u8; RECORD_BYTES]) -> Option<Self> {
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[at + k]));
        let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
        (word(28) == crc32c(&bytes[..28])).then(|| Self {
            tile: word(0),
            index_crc: word(4),
            bytes: long(8),
            nonzero: long(16),
            chunks: word(24),
        })
    }
}

/// Writes the head of a ledger.
///
/// # Errors
/// What the writer says.
pub fn write_header<T: Serialize>(out: &mut impl Write, facts: &T) -> io::Result<usize> {
    header::write(out, NAME, VERSION, facts)
}

/// Writes a finished ledger: `records` in the order of their tiles.
///
/// # Errors
/// What the writer says.
pub fn write<T: Serialize>(out: &mut impl Write, facts: &T, records: &[Record]) -> io::Result<()> {
    write_header(out, facts)?;
    records.iter().try_for_each(|record| out.write_all(&record.to_bytes()))
}

/// A ledger as it was read.
#[derive(Clone, Debug)]
pub struct Ledger<T> {
    /// The facts of its header.
    pub facts: T,
    /// Records in the order in which they were written, up to the first that doesn't hold.
    pub records: Vec<Record>,
    /// Length of header and good records, bytes: where to go on writing.
    pub good_bytes: u64,
    /// Whether bytes follow that are no good record: the tail of a write that was cut off.
    pub torn: bool,
}

/// Reads a ledger, finished or growing. `most` bounds the number of records.
///
/// # Errors
/// A header that can't be used; more records than `most`.
pub fn read<T: DeserializeOwned>(input: &mut impl Read, most: usize) -> Result<Ledger<T>, Error> {
    let (facts, length) = header::read::<T>(input, NAME, VERSION)?;
    let mut records = Vec::new();
    let mut torn = false;
    loop {
        let mut bytes = Vec::with_capacity(RECORD_BYTES);
        input.take(RECORD_BYTES as u64).read_to_end(&mut bytes)?;
        if bytes.is_empty() {
            break;
        }
        let record = <&[u8; RECORD_BYTES]>::try_from(bytes.as_slice()).ok();
        let Some(record) = record.and_then(Record::from_bytes) else {
            torn = true;
            break;
        };
        if records.len() == most {
            return Err(Error::damaged(format!("more than {most} records of tiles")));
        }
        records.push(record);
    }
    let good_bytes = (length + records.len() * RECORD_BYTES) as u64;
    Ok(Ledger { facts, records, good_bytes, torn })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_and_the_code_say_the_same() {
        let page = include_str!("ledger.md");
        let record = Record {
            tile: 0x0403_0201,
            index_crc: 0x0807_0605,
            bytes: 0x100f_0e0d_0c0b_0a09,
            nonzero: 0x1817_1615_1413_1211,
            chunks: 0x1c1b_1a19,
        };
        let bytes = record.to_bytes();
        // Each row of the page's table names its bytes; the record counts them up.
        let fields = ["tile", "index_crc", "bytes", "nonzero", "chunks"];
        let at = [0..4, 4..8, 8..16, 16..24, 24..28];
        for (name, at) in fields.into_iter().zip(at) {
            let row = format!("| {}..{} | `{name}` | u{} |", at.start, at.end, at.len() * 8);
            assert!(page.contains(&row), "the page lacks `{row}`");
            for i in at {
                assert_eq!(usize::from(bytes[i]), i + 1, "byte {i} of `{name}`");
            }
        }
        assert!(page.contains("| 28..32 | `crc32c` | u32 |"));
        assert!(page.contains(&format!("`glintmap {NAME} {VERSION} ")));
        assert!(page.contains(&format!("{RECORD_BYTES} bytes each")));
        assert_eq!(Record::from_bytes(&bytes), Some(record));
    }

    #[test]
    fn a_torn_tail_ends_the_good_part() {
        let mut bytes = Vec::new();
        let records = [Record { tile: 3, ..Record::default() }, Record::default()];
        write(&mut bytes, &7u32, &records).expect("writes");
        let whole: Ledger<u32> = read(&mut bytes.as_slice(), 2).expect("reads");
        assert_eq!((whole.records.as_slice(), whole.torn), (records.as_slice(), false));
        assert!(read::<u32>(&mut bytes.as_slice(), 1).is_err(), "more records than allowed");
        for cut in 1..RECORD_BYTES {
            let short: Ledger<u32> = read(&mut &bytes[..bytes.len() - cut], 2).expect("reads");
            assert_eq!((short.records.len(), short.torn), (1, true));
            assert_eq!(short.good_bytes, (bytes.len() - RECORD_BYTES) as u64);
        }
        let last = bytes.len() - 9;
        bytes[last] ^= 4;
        let flipped: Ledger<u32> = read(&mut bytes.as_slice(), 2).expect("reads");
        assert_eq!((flipped.records.len(), flipped.torn), (1, true));
    }
}
