#![doc = include_str!("gmp.md")]

use std::io;

use bincode::{Decode, Encode};

use crate::checksum::crc32c;

/// The name in the text header.
pub const NAME: &str = "photons";
/// The version that this program writes and reads.
pub const VERSION: u32 = 1;
/// Photons that a page holds at most.
pub const PAGE_PHOTONS_MAX: usize = 8192;
/// Bytes of a [`Node`].
pub const NODE_BYTES: usize = 44;
/// Bytes of a [`PageEntry`].
pub const ENTRY_BYTES: usize = 72;
/// Bytes at the start of a page, before its planes.
pub const PAGE_HEAD_BYTES: usize = 140;
/// Bits of an f32 that the flux loses.
pub const FLUX_SHIFT: u32 = 12;

const PLANES: usize = 25;
const PLANES_AT: usize = 40;
const NORMAL_TABLE_PLANES: usize = 4;
const FLAG_EQUAL_FLUX: u32 = 1;
const LEVEL: i32 = 1;
/// Largest flux code: that of the largest finite f32.
const FLUX_CODE_MAX: u32 = 0x7F7F_FFFF >> FLUX_SHIFT;

const _: () = assert!(PAGE_HEAD_BYTES == PLANES_AT + 4 * PLANES);

/// Why bytes can't be a page or a directory.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The bytes contradict the format.
    #[error("field `{field}`: {what}")]
    Field {
        /// The field of the format page.
        field: &'static str,
        /// Expected and found.
        what: String,
    },
    /// The compressor failed.
    #[error("zstd: {0}")]
    Zstd(#[from] io::Error),
}

fn field<T>(field: &'static str, what: String) -> Result<T, Error> {
    Err(Error::Field { field, what })
}

/// A node of the octree, as the directory holds it.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct Node {
    /// Smallest corner of the box around all photons below, metres.
    pub min: [f32; 3],
    /// Largest corner.
    pub max: [f32; 3],
    /// Depth; 0 is the cube.
    pub level: u32,
    /// Number of the first child, 0 for a leaf.
    pub first_child: u32,
    /// Number of children, 0 for a leaf.
    pub children: u32,
    /// First page below.
    pub first_page: u32,
    /// Number of pages below.
    pub pages: u32,
}

/// What the directory says about a page.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct PageEntry {
    /// Smallest corner of the box around its photons, metres.
    pub min: [f32; 3],
    /// Largest corner.
    pub max: [f32; 3],
    /// Store index of its first photon.
    pub first_photon: u64,
    /// Where it begins, bytes from the end of the header.
    pub offset: u64,
    /// Its length, bytes.
    pub length: u32,
    /// Number of photons.
    pub photons: u32,
    /// First Morton code that it covers.
    pub first_cell: u64,
    /// Last Morton code that it covers.
    pub last_cell: u64,
    /// CRC-32C of its bytes behind its own checksum.
    pub checksum: u32,
    /// 0.
    pub reserved: u32,
}

/// The directory's bytes.
///
/// # Errors
/// None that can happen with these types; bincode's signature has one.
pub fn encode_directory(nodes: &[Node], pages: &[PageEntry]) -> Result<Vec<u8>, Error> {
    let mut out = vec![0; nodes.len() * NODE_BYTES + pages.len() * ENTRY_BYTES];
    let (first, second) = out.split_at_mut(nodes.len() * NODE_BYTES);
    let failed =
        |e: bincode::error::EncodeError| Error::Field { field: "directory", what: e.to_string() };
    for (node, bytes) in nodes.iter().zip(first.chunks_exact_mut(NODE_BYTES)) {
        bincode::encode_into_slice(node, bytes, bincode::config::legacy()).map_err(failed)?;
    }
    for (page, bytes) in pages.iter().zip(second.chunks_exact_mut(ENTRY_BYTES)) {
        bincode::encode_into_slice(page, bytes, bincode::config::legacy()).map_err(failed)?;
    }
    Ok(out)
}

/// Nodes and pages from the directory's bytes. Allocates in proportion to `bytes`, whatever the
/// counts claim.
///
/// # Errors
/// If the counts don't fit the length.
pub fn decode_directory(
    bytes: &[u8],
    nodes: u64,
    pages: u64,
) -> Result<(Vec<Node>, Vec<PageEntry>), Error> {
    let need = u128::from(nodes) * NODE_BYTES as u128 + u128::from(pages) * ENTRY_BYTES as u128;
    if need != bytes.len() as u128 {
        return field(
            "directory",
            format!("{nodes} nodes and {pages} pages need {need} bytes, found {}", bytes.len()),
        );
    }
    // `nodes` is bounded by the length now, so it fits.
    let (first, second) = bytes.split_at(nodes as usize * NODE_BYTES);
    let nodes = records::<Node, NODE_BYTES>(first, "node")?;
    Ok((nodes, records::<PageEntry, ENTRY_BYTES>(second, "page entry")?))
}

fn records<T: Decode<()>, const BYTES: usize>(
    bytes: &[u8],
    name: &'static str,
) -> Result<Vec<T>, Error> {
    let config = bincode::config::legacy().with_limit::<BYTES>();
    let mut out = Vec::with_capacity(bytes.len() / BYTES);
    for record in bytes.chunks_exact(BYTES) {
        match bincode::decode_from_slice(record, config) {
            Ok((value, _)) => out.push(value),
            Err(e) => return field(name, e.to_string()),
        }
    }
    Ok(out)
}

/// The flux of a page's photons.
#[derive(Clone, Debug, PartialEq)]
pub enum Flux {
    /// All the same: the bits of an f32.
    Equal(u32),
    /// One code a photon: bits of an f32, rounded, shifted right by [`FLUX_SHIFT`].
    Codes(Vec<u32>),
}

/// A page as columns of integers, one entry a photon (but for the normal table).
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// Where the integer positions begin, metres.
    pub origin: [f32; 3],
    /// Their step, metres.
    pub step: f32,
    /// Morton codes of 48 bits, ascending.
    pub position: Vec<u64>,
    /// The different normals, octahedral.
    pub normal_table: Vec<[i16; 2]>,
    /// Index into the normal table.
    pub normal: Vec<u16>,
    /// Directions, octahedral.
    pub direction: Vec<[i16; 2]>,
    /// Flux.
    pub flux: Flux,
    /// Timesteps.
    pub timestep: Vec<u32>,
    /// PV surfaces.
    pub surface: Vec<u16>,
}

/// Encodes pages; keeps its buffers from page to page.
pub struct Encoder {
    zstd: zstd::bulk::Compressor<'static>,
    plane: Vec<u8>,
    packed: Vec<u8>,
}

impl Encoder {
    /// A new encoder.
    ///
    /// # Errors
    /// If zstd can't make its context.
    pub fn new() -> Result<Self, Error> {
        Ok(Self {
            zstd: zstd::bulk::Compressor::new(LEVEL)?,
            plane: Vec::new(),
            packed: Vec::new(),
        })
    }

    /// A page's bytes; the first four are its checksum.
    ///
    /// # Errors
    /// If the columns differ in length, are empty, too long, or not in order.
    pub fn page(&mut self, columns: &Columns) -> Result<Vec<u8>, Error> {
        let count = columns.position.len();
        let lengths = [
            columns.normal.len(),
            columns.direction.len(),
            columns.timestep.len(),
            columns.surface.len(),
            match &columns.flux {
                Flux::Equal(_) => count,
                Flux::Codes(codes) => codes.len(),
            },
        ];
        if count == 0 || count > PAGE_PHOTONS_MAX || lengths.iter().any(|&n| n != count) {
            return field("photons", format!("columns of {count}, {lengths:?} photons"));
        }
        if columns.normal_table.is_empty() || columns.normal_table.len() > count {
            return field("normals", format!("{} for {count}", columns.normal_table.len()));
        }
        if columns.position.windows(2).any(|w| w[0] > w[1])
            || columns.position[count - 1] >> 48 != 0
        {
            return field("position", "codes of 48 bits in ascending order expected".to_owned());
        }
        let flux = match &columns.flux {
            Flux::Equal(bits) => *bits,
            Flux::Codes(codes) => codes.iter().copied().min().unwrap_or(0),
        };
        let timestep = columns.timestep.iter().copied().min().unwrap_or(0);
        let flags = if matches!(columns.flux, Flux::Equal(_)) { FLAG_EQUAL_FLUX } else { 0 };
        let mut out = Vec::with_capacity(PAGE_HEAD_BYTES + count * 12);
        for word in [0, count as u32, columns.normal_table.len() as u32, flags] {
            out.extend_from_slice(&word.to_le_bytes());
        }
        for value in columns.origin.iter().chain([&columns.step]) {
            out.extend_from_slice(&value.to_le_bytes());
        }
        for word in [flux, timestep] {
            out.extend_from_slice(&word.to_le_bytes());
        }
        out.resize(PAGE_HEAD_BYTES, 0);

        let mut sizes = Vec::with_capacity(PLANES);
        let axes = |pair: [i16; 2]| u64::from(pair[0] as u16) | u64::from(pair[1] as u16) << 16;
        let table = columns.normal_table.iter().map(|&n| axes(n));
        self.column(&mut out, &mut sizes, 4, table)?;
        let mut before = 0;
        let position = columns.position.iter().map(|&code| {
            let difference = code - before;
            before = code;
            difference
        });
        self.column(&mut out, &mut sizes, 6, position)?;
        self.column(&mut out, &mut sizes, 2, columns.normal.iter().map(|&n| u64::from(n)))?;
        self.column(&mut out, &mut sizes, 4, columns.direction.iter().map(|&d| axes(d)))?;
        match &columns.flux {
            Flux::Equal(_) => {
                self.column(&mut out, &mut sizes, 3, std::iter::repeat_n(0, count))?;
            }
            Flux::Codes(codes) => {
                let codes = codes.iter().map(|&c| u64::from(c - flux));
                self.column(&mut out, &mut sizes, 3, codes)?;
            }
        }
        let steps = columns.timestep.iter().map(|&t| u64::from(t - timestep));
        self.column(&mut out, &mut sizes, 4, steps)?;
        self.column(&mut out, &mut sizes, 2, columns.surface.iter().map(|&s| u64::from(s)))?;

        for (size, bytes) in sizes.iter().zip(out[PLANES_AT..].chunks_exact_mut(4)) {
            bytes.copy_from_slice(&size.to_le_bytes());
        }
        let sum = crc32c(&out[4..]);
        out[..4].copy_from_slice(&sum.to_le_bytes());
        Ok(out)
    }

    fn column(
        &mut self,
        out: &mut Vec<u8>,
        sizes: &mut Vec<u32>,
        bytes: u32,
        values: impl Iterator<Item = u64>,
    ) -> Result<(), Error> {
        let values: Vec<u64> = values.collect();
        for byte in 0..bytes {
            self.plane.clear();
            self.plane.extend(values.iter().map(|v| (v >> (8 * byte)) as u8));
            let before = out.len();
            if self.plane.iter().all(|b| *b == self.plane[0]) {
                out.push(self.plane[0]);
            } else {
                self.packed.clear();
                self.packed.reserve(zstd::zstd_safe::compress_bound(self.plane.len()));
                self.zstd.compress_to_buffer(&self.plane, &mut self.packed)?;
                let packed = self.packed.len() < self.plane.len() && self.packed.len() > 1;
                out.extend_from_slice(if packed { &self.packed } else { &self.plane });
            }
            sizes.push((out.len() - before) as u32);
        }
        Ok(())
    }
}

/// Decodes pages; keeps its buffers from page to page.
pub struct Decoder {
    zstd: zstd::bulk::Decompressor<'static>,
    planes: Vec<u8>,
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// The checksum that a page's bytes should begin with, or `None` for less than a page's head.
pub fn page_checksum(bytes: &[u8]) -> Option<u32> {
    (bytes.len() >= PAGE_HEAD_BYTES).then(|| crc32c(&bytes[4..]))
}

impl Decoder {
    /// A new decoder.
    ///
    /// # Errors
    /// If zstd can't make its context.
    pub fn new() -> Result<Self, Error> {
        Ok(Self { zstd: zstd::bulk::Decompressor::new()?, planes: Vec::new() })
    }

    /// The columns of a page. Checks the checksum and everything that the format promises.
    ///
    /// # Errors
    /// Names the field that doesn't hold.
    pub fn page(&mut self, bytes: &[u8]) -> Result<Columns, Error> {
        let Some(sum) = page_checksum(bytes) else {
            return field("photons", format!("a page of {} bytes", bytes.len()));
        };
        if word(bytes, 0) != sum {
            let what = format!("stored {:08x}, computed {sum:08x}", word(bytes, 0));
            return field("checksum", what);
        }
        let count = word(bytes, 4) as usize;
        let normals = word(bytes, 8) as usize;
        let flags = word(bytes, 12);
        if count == 0 || count > PAGE_PHOTONS_MAX {
            return field("photons", format!("{count}, expected 1 to {PAGE_PHOTONS_MAX}"));
        }
        if normals == 0 || normals > count {
            return field("normals", format!("{normals}, expected 1 to {count}"));
        }
        if flags & !FLAG_EQUAL_FLUX != 0 {
            return field("flags", format!("{flags:#x}, this program knows 1 only"));
        }
        self.unpack(bytes, count, normals)?;
        let float = |at| f32::from_bits(word(bytes, at));
        let origin = [float(16), float(20), float(24)];
        let step = float(28);
        if origin.iter().any(|v| !v.is_finite()) {
            return field("origin", format!("{origin:?} m"));
        }
        if !(step.is_finite() && step >= 0.0) {
            return field("step", format!("{step} m"));
        }
        let (flux, timestep) = (word(bytes, 32), word(bytes, 36));

        let mut planes = Planes(&self.planes);
        let axes = |v: u64| [v as u16 as i16, (v >> 16) as u16 as i16];
        let normal_table = planes.take(4, normals).map(axes).collect();
        let mut code = 0u64;
        let position: Vec<u64> = planes
            .take(6, count)
            .map(|difference| {
                // 8,192 differences of 48 bits don't overflow 64.
                code += difference;
                code
            })
            .collect();
        if code >> 48 != 0 {
            return field("position", "codes beyond 48 bits".to_owned());
        }
        let normal: Vec<u16> = planes.take(2, count).map(|v| v as u16).collect();
        if let Some(n) = normal.iter().find(|&&n| usize::from(n) >= normals) {
            return field("normal", format!("index {n} into {normals} normals"));
        }
        let direction = planes.take(4, count).map(axes).collect();
        let codes = planes.take(3, count);
        let flux = if flags & FLAG_EQUAL_FLUX == 0 {
            let codes: Vec<u32> = codes.map(|c| flux.saturating_add(c as u32)).collect();
            if let Some(code) = codes.iter().find(|&&c| c > FLUX_CODE_MAX) {
                return field("flux", format!("code {code:#x} is no finite flux"));
            }
            Flux::Codes(codes)
        } else if flux <= f32::MAX.to_bits() {
            Flux::Equal(flux)
        } else {
            return field("flux", format!("bits {flux:#x} are no finite flux"));
        };
        let mut timesteps = Vec::with_capacity(count);
        for difference in planes.take(4, count) {
            match timestep.checked_add(difference as u32) {
                Some(t) => timesteps.push(t),
                None => return field("timestep", "beyond 32 bits".to_owned()),
            }
        }
        let surface = planes.take(2, count).map(|v| v as u16).collect();
        Ok(Columns {
            origin,
            step,
            position,
            normal_table,
            normal,
            direction,
            flux,
            timestep: timesteps,
            surface,
        })
    }

    /// Fills `self.planes` with all planes, one behind the other.
    fn unpack(&mut self, bytes: &[u8], count: usize, normals: usize) -> Result<(), Error> {
        let rows = |plane| if plane < NORMAL_TABLE_PLANES { normals } else { count };
        self.planes.clear();
        self.planes.reserve((0..PLANES).map(rows).sum());
        let mut rest = &bytes[PAGE_HEAD_BYTES..];
        for plane in 0..PLANES {
            let rows = rows(plane);
            let length = word(bytes, PLANES_AT + 4 * plane) as usize;
            let Some((here, after)) = rest.split_at_checked(length) else {
                return field(
                    "planes",
                    format!("plane {plane} of {length} bytes, {} are left", rest.len()),
                );
            };
            rest = after;
            let end = self.planes.len() + rows;
            match *here {
                [byte] => self.planes.resize(end, byte),
                _ if length == rows => self.planes.extend_from_slice(here),
                _ => {
                    // A frame that would become longer than the column is refused by zstd.
                    let start = self.planes.len();
                    self.planes.resize(end, 0);
                    let got = self
                        .zstd
                        .decompress_to_buffer(here, &mut self.planes[start..])
                        .or_else(|e| field("planes", format!("plane {plane}: {e}")))?;
                    if got != rows {
                        return field("planes", format!("plane {plane}: {got} of {rows} bytes"));
                    }
                }
            }
        }
        if !rest.is_empty() {
            return field("planes", format!("{} bytes behind the last plane", rest.len()));
        }
        Ok(())
    }
}

struct Planes<'a>(&'a [u8]);

impl<'a> Planes<'a> {
    fn take(&mut self, bytes: usize, rows: usize) -> impl Iterator<Item = u64> + use<'a> {
        let (here, rest) = self.0.split_at(bytes * rows);
        self.0 = rest;
        (0..rows).map(move |row| {
            (0..bytes)
                .fold(0, |value, byte| value | u64::from(here[byte * rows + row]) << (8 * byte))
        })
    }
}

#[cfg(test)]
mod tests;
