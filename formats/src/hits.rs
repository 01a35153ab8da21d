#![doc = include_str!("hits.md")]

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::checksum::{crc32c, crc32c_append};
use crate::records::{Packer, Unpacker};
use crate::{header, seal};

/// The name in the header.
pub const NAME: &str = "hits";
/// The version of this page.
pub const VERSION: u32 = 1;
/// Bytes of a pixel, uncompressed.
pub const RECORD_BYTES: usize = 37;
/// Rows per block.
pub const BLOCK_ROWS: usize = 64;
/// The names of the kinds, by number.
pub const KINDS: [&str; 6] = ["receiver", "sky", "pv", "clipped", "beyond", "hidden"];

/// Bytes before a block: first row, rows, bytes of the content, checksum.
const FRAME: usize = 16;
const MAX_EDGE: usize = 65_536;
const MAX_PIXELS: usize = 64_000_000;

/// Why a file of hits can't be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The header can't be used.
    #[error(transparent)]
    Header(#[from] header::Error),
    /// A block is damaged.
    #[error("hits, byte {byte} (row {row}): {what}; make the file again")]
    Damaged {
        /// Where the block begins in the file.
        byte: u64,
        /// The row that was expected there.
        row: usize,
        /// What doesn't hold.
        what: String,
    },
}

impl Error {
    /// Whether the file is damaged (and not the file system at fault).
    pub fn is_damage(&self) -> bool {
        !matches!(self, Self::Io(_) | Self::Header(header::Error::Io(_)))
    }
}

/// What the header says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facts {
    /// Width, pixels.
    pub columns: usize,
    /// Height, pixels.
    pub rows: usize,
    /// Rows per block; see [`BLOCK_ROWS`].
    pub block_rows: usize,
    /// The path limit, m.
    pub max_path_m: f64,
    /// The view as Radiance's options.
    pub view: String,
    /// See [`KINDS`].
    pub kinds: Vec<String>,
    /// `m`.
    pub units: String,
    /// Who made it from what.
    pub provenance: serde_json::Value,
}

impl Facts {
    /// Facts of this version.
    pub fn new(
        columns: usize,
        rows: usize,
        max_path_m: f64,
        view: String,
        provenance: serde_json::Value,
    ) -> Self {
        Self {
            columns,
            rows,
            block_rows: BLOCK_ROWS,
            max_path_m,
            view,
            kinds: KINDS.map(str::to_owned).to_vec(),
            units: "m".to_owned(),
            provenance,
        }
    }
}

/// One pixel, as it lies in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Position, m.
    pub position_m: [f32; 3],
    /// Unit normal to the viewer.
    pub normal: [f32; 3],
    /// Object, `u32::MAX` for none.
    pub object: u32,
    /// Face, `u32::MAX` for none.
    pub face: u32,
    /// Distance to the nearest visible PV point, m; 0 where there is none.
    pub pv_distance_m: f32,
    /// Index into [`KINDS`].
    pub kind: u8,
}

impl Record {
    fn to_bytes(self) -> [u8; RECORD_BYTES] {
        let floats = self.position_m.into_iter().chain(self.normal).map(f32::to_bits);
        let words = floats.chain([self.object, self.face, self.pv_distance_m.to_bits()]);
        let mut out = [0; RECORD_BYTES];
        for (bytes, word) in out.chunks_exact_mut(4).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        out[RECORD_BYTES - 1] = self.kind;
        out
    }

    fn from_bytes(bytes: &[u8; RECORD_BYTES]) -> Self {
        let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k]));
        let vector = |first: usize| std::array::from_fn(|axis| f32::from_bits(word(first + axis)));
        Self {
            position_m: vector(0),
            normal: vector(3),
            object: word(6),
            face: word(7),
            pv_distance_m: f32::from_bits(word(8)),
            kind: bytes[RECORD_BYTES - 1],
        }
    }

    fn is_sound(&self) -> bool {
        let floats = self.position_m.iter().chain(&self.normal).chain([&self.pv_distance_m]);
        usize::from(self.kind) < KINDS.len() && floats.into_iter().all(|v| v.is_finite())
    }
}

/// Writes and seals a file; `record(i)` gives pixel `i`, row-major.
///
/// # Errors
/// Whatever the file system says.
pub fn write(path: &Path, facts: &Facts, record: impl Fn(usize) -> Record) -> Result<(), Error> {
    seal::write(path, |out| {
        header::write(out, NAME, VERSION, facts)?;
        let mut packer = Packer::new()?;
        for first in (0..facts.rows).step_by(BLOCK_ROWS) {
            let rows = BLOCK_ROWS.min(facts.rows - first);
            let pixels = first * facts.columns..(first + rows) * facts.columns;
            let records: Vec<u8> = pixels.flat_map(|i| record(i).to_bytes()).collect();
            let packed = packer.pack::<RECORD_BYTES>(&records)?;
            let too_long = |_| io::Error::other("a block of hits does not fit into 4 GiB");
            let mut frame = Vec::with_capacity(FRAME);
            for number in [first, rows, packed.len()] {
                frame.extend(u32::try_from(number).map_err(too_long)?.to_le_bytes());
            }
            frame.extend(crc32c_append(crc32c(&frame), packed).to_le_bytes());
            out.write_all(&frame)?;
            out.write_all(packed)?;
        }
        Ok(())
    })
}

/// Reads a file: `begin` is told the header's facts, then `each` gets every pixel, row-major.
///
/// # Errors
/// See [`Error`]; `each` may have seen pixels before an error is found.
pub fn read(
    path: &Path,
    begin: impl FnOnce(&Facts),
    mut each: impl FnMut(Record),
) -> Result<Facts, Error> {
    let file = File::open(path)?;
    let mut left = file.metadata()?.len();
    let mut input = BufReader::with_capacity(1 << 18, file);
    let (facts, length): (Facts, usize) = header::read(&mut input, NAME, VERSION)?;
    let mut byte = length as u64;
    left = left.saturating_sub(byte);
    check(&facts)?;
    begin(&facts);
    let (mut unpacker, mut records) = (Unpacker::new()?, Vec::new());
    let mut row = 0;
    while row < facts.rows {
        let fault = |what: String| Error::Damaged { byte, row, what };
        if left < FRAME as u64 {
            return Err(fault(format!("the file ends, expected {} more rows", facts.rows - row)));
        }
        let mut frame = [0u8; FRAME];
        input.read_exact(&mut frame)?;
        left -= FRAME as u64;
        let number =
            |i: usize| u32::from_le_bytes([frame[i], frame[i + 1], frame[i + 2], frame[i + 3]]);
        let rows = facts.block_rows.min(facts.rows - row);
        let found = (number(0) as usize, number(4) as usize);
        if found != (row, rows) {
            return Err(fault(format!(
                "expected a block of {rows} rows from row {row}, found {} from row {}",
                found.1, found.0
            )));
        }
        let packed_bytes = u64::from(number(8));
        if packed_bytes > left {
            return Err(fault(format!("the block claims {packed_bytes} bytes, {left} are left")));
        }
        let n = rows * facts.columns;
        let bound = zstd::zstd_safe::compress_bound(n * RECORD_BYTES) as u64;
        if packed_bytes > bound {
            return Err(fault(format!(
                "the block claims {packed_bytes} bytes, expected at most {bound}"
            )));
        }
        let mut packed = vec![0u8; packed_bytes as usize];
        input.read_exact(&mut packed)?;
        left -= packed_bytes;
        if crc32c_append(crc32c(&frame[..12]), &packed) != number(12) {
            return Err(fault("the block's checksum doesn't hold".to_owned()));
        }
        unpacker
            .unpack::<RECORD_BYTES>(&packed, n, &mut records)
            .map_err(|e| fault(format!("the block can't be unpacked: {e}")))?;
        for (i, record) in records.iter().map(Record::from_bytes).enumerate() {
            if !record.is_sound() {
                let (r, c) = (row + i / facts.columns, i % facts.columns);
                return Err(fault(format!(
                    "the pixel at row {r}, column {c} holds a value that is not finite or kind {}",
                    record.kind
                )));
            }
            each(record);
        }
        byte += FRAME as u64 + packed_bytes;
        row += rows;
    }
    if left > 0 {
        let what = format!("{left} bytes lie behind the last block");
        return Err(Error::Damaged { byte, row, what });
    }
    Ok(facts)
}

fn check(facts: &Facts) -> Result<(), Error> {
    let edge = 1..=MAX_EDGE;
    let damaged = |what: String| Error::Header(header::Error::Damaged { name: NAME, what });
    if !edge.contains(&facts.columns) || !edge.contains(&facts.rows) {
        return Err(damaged(format!("a view of {} x {} pixels", facts.columns, facts.rows)));
    }
    if facts.columns * facts.rows > MAX_PIXELS {
        return Err(damaged(format!("more than {MAX_PIXELS} pixels")));
    }
    if facts.block_rows != BLOCK_ROWS {
        return Err(damaged(format!("{} rows per block, not {BLOCK_ROWS}", facts.block_rows)));
    }
    if facts.kinds != KINDS {
        return Err(damaged(format!("unknown kinds {:?}", facts.kinds)));
    }
    Ok(())
}

/// Checks a whole file and lists what is wrong with it; empty for a sound file.
///
/// # Errors
/// When the file can't be read at all.
pub fn verify(path: &Path) -> io::Result<Vec<String>> {
    match read(path, |_| {}, |_| {}) {
        Ok(_) => Ok(Vec::new()),
        Err(Error::Io(e) | Error::Header(header::Error::Io(e))) => Err(e),
        Err(e) => Ok(vec![e.to_string()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(i: usize) -> Record {
        let v = i as f32 * 0.37 - 20.0;
        Record {
            position_m: [v, -v, 0.5],
            normal: [0.0, 0.6, 0.8],
            object: if i.is_multiple_of(3) { u32::MAX } else { 7 },
            face: i as u32,
            pv_distance_m: v.abs(),
            kind: (i % KINDS.len()) as u8,
        }
    }

    fn written(name: &str, columns: usize, rows: usize) -> (std::path::PathBuf, Vec<u8>) {
        let folder = std::env::temp_dir().join(format!("glintmap-hits-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("creates");
        let path = folder.join(name);
        let facts = Facts::new(columns, rows, 100.0, "-vtl".to_owned(), serde_json::Value::Null);
        write(&path, &facts, sample).expect("writes");
        let bytes = std::fs::read(&path).expect("reads");
        (path, bytes)
    }

    #[test]
    fn what_was_written_is_read() {
        for (columns, rows) in [(1, 1), (5, 64), (7, 65), (3, 200)] {
            let (path, _) = written(&format!("{columns}x{rows}"), columns, rows);
            let mut found = Vec::new();
            let facts = read(&path, |_| {}, |r| found.push(r)).expect("reads");
            assert_eq!((facts.columns, facts.rows), (columns, rows));
            assert_eq!(found, (0..columns * rows).map(sample).collect::<Vec<_>>());
            assert_eq!(verify(&path).expect("reads"), Vec::<String>::new());
            std::fs::remove_file(&path).expect("removes");
        }
    }

    /// Reads a file by the tables of the page alone: offsets and sizes as printed there.
    #[test]
    fn the_page_and_the_code_agree() {
        let page = include_str!("hits.md");
        for (name, row) in [
            ("record", format!("`{RECORD_BYTES} * n` bytes")),
            ("block rows", format!("rows per block, {BLOCK_ROWS};")),
            ("version", format!("name `{NAME}`, version {VERSION}")),
            ("kinds", format!("`{}`", KINDS.join(" "))),
            ("level", format!("zstd level {}", crate::records::LEVEL)),
        ] {
            assert!(page.contains(&row), "the page doesn't say the {name} as `{row}`");
        }
        let offset = |what: &str| -> usize {
            let line = page.lines().find(|l| l.starts_with('|') && l.contains(what)).expect(what);
            let cell = line.split('|').nth(1).expect("a cell").trim();
            cell.trim_matches('`').trim_end_matches(" n").parse().expect("a number")
        };
        let (columns, rows) = (3, 70);
        let (path, bytes) = written("page", columns, rows);
        std::fs::remove_file(&path).expect("removes");
        let text = String::from_utf8_lossy(&bytes[..40]).into_owned();
        let header: usize = text.split(' ').nth(3).expect("length")[..8].parse().expect("number");
        let mut at = header;
        let mut pixel = 0;
        while at < bytes.len() {
            let u = |o: usize| {
                u32::from_le_bytes(bytes[at + o..at + o + 4].try_into().expect("4 bytes")) as usize
            };
            assert_eq!(u(offset("first row of the block")), pixel / columns);
            let n = u(offset("u32, rows in the block")) * columns;
            let long = u(offset("bytes of the compressed content"));
            let from = at + offset("the content, compressed");
            let content =
                zstd::bulk::decompress(&bytes[from..from + long], 37 * n).expect("unpacks");
            for i in 0..n {
                let word = |what: &str| {
                    let plane = offset(what) * n;
                    u32::from_le_bytes(std::array::from_fn(|k| content[plane + k * n + i]))
                };
                let expected = sample(pixel);
                assert_eq!(f32::from_bits(word("f32 position x")), expected.position_m[0]);
                assert_eq!(f32::from_bits(word("f32 position y")), expected.position_m[1]);
                assert_eq!(f32::from_bits(word("f32 position z")), expected.position_m[2]);
                assert_eq!(f32::from_bits(word("f32 normal x")), expected.normal[0]);
                assert_eq!(f32::from_bits(word("f32 normal y")), expected.normal[1]);
                assert_eq!(f32::from_bits(word("f32 normal z")), expected.normal[2]);
                assert_eq!(word("u32 object"), expected.object);
                assert_eq!(word("u32 face"), expected.face);
                assert_eq!(f32::from_bits(word("f32 distance")), expected.pv_distance_m);
                assert_eq!(content[offset("u8 kind") * n + i], expected.kind);
                pixel += 1;
            }
            at = from + long;
        }
        assert_eq!(pixel, columns * rows);
    }

    #[test]
    fn every_flipped_bit_and_every_shortened_file_is_found() {
        let (path, bytes) = written("broken", 4, 66);
        for at in 0..bytes.len() {
            let mut broken = bytes.clone();
            broken[at] ^= 1 << (at % 8);
            std::fs::write(&path, &broken).expect("writes");
            let findings = verify(&path).expect("reads");
            assert!(!findings.is_empty(), "a flipped bit in byte {at} went unnoticed");
        }
        for length in (0..bytes.len()).step_by(97) {
            std::fs::write(&path, &bytes[..length]).expect("writes");
            assert!(!verify(&path).expect("reads").is_empty(), "cut at {length}");
        }
        let mut long = bytes.clone();
        long.push(0);
        std::fs::write(&path, &long).expect("writes");
        assert!(verify(&path).expect("reads")[0].contains("behind the last block"));
        std::fs::remove_file(&path).expect("removes");
    }
}
