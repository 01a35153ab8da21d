//! Records of one size, compressed in blocks: what waits on disk to be sorted. A block holds its
//! records byte plane by byte plane (all first bytes, all second bytes, ...), which puts what is
//! alike side by side, as one zstd frame.

use std::io;

/// Fast: noise of a mantissa is found out at once, the rest shrinks well at any level.
pub(crate) const LEVEL: i32 = 1;

/// Packs blocks.
pub struct Packer {
    zstd: zstd::bulk::Compressor<'static>,
    planes: Vec<u8>,
    packed: Vec<u8>,
}

impl Packer {
    /// A packer; it keeps its buffers.
    ///
    /// # Errors
    /// If zstd can't make its context.
    pub fn new() -> io::Result<Self> {
        let zstd = zstd::bulk::Compressor::new(LEVEL)?;
        Ok(Self { zstd, planes: Vec::new(), packed: Vec::new() })
    }

    /// A block of records of `SIZE` bytes each; bytes that fill no record are left out.
    ///
    /// # Errors
    /// What zstd says.
    pub fn pack<const SIZE: usize>(&mut self, records: &[u8]) -> io::Result<&[u8]> {
        let records = records.as_chunks::<SIZE>().0;
        self.planes.clear();
        for at in 0..SIZE {
            self.planes.extend(records.iter().map(|record| record[at]));
        }
        self.packed.clear();
        self.packed.reserve(zstd::zstd_safe::compress_bound(self.planes.len()));
        self.zstd.compress_to_buffer(&self.planes, &mut self.packed)?;
        Ok(&self.packed)
    }
}

/// Unpacks blocks.
pub struct Unpacker {
    zstd: zstd::bulk::Decompressor<'static>,
    planes: Vec<u8>,
}

impl Unpacker {
    /// An unpacker; it keeps its buffers.
    ///
    /// # Errors
    /// If zstd can't make its context.
    pub fn new() -> io::Result<Self> {
        Ok(Self { zstd: zstd::bulk::Decompressor::new()?, planes: Vec::new() })
    }

    /// The `count` records of a block, into `records`, which is emptied first. The caller bounds
    /// `count`: it sizes what is allocated.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidData`] for a block that doesn't hold just as many.
    pub fn unpack<const SIZE: usize>(
        &mut self,
        packed: &[u8],
        count: usize,
        records: &mut Vec<[u8; SIZE]>,
    ) -> io::Result<()> {
        self.planes.clear();
        self.planes.reserve(count * SIZE);
        let wrong = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
        self.zstd
            .decompress_to_buffer(packed, &mut self.planes)
            .map_err(|e| wrong(format!("a block that doesn't decompress: {e}")))?;
        if self.planes.len() != count * SIZE {
            let found = self.planes.len();
            return Err(wrong(format!(
                "{count} records of {SIZE} bytes expected, {found} bytes found"
            )));
        }
        records.clear();
        records.resize(count, [0; SIZE]);
        for (at, plane) in self.planes.chunks_exact(count.max(1)).enumerate() {
            for (record, &byte) in records.iter_mut().zip(plane) {
                record[at] = byte;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back_and_what_is_alike_shrinks() {
        let mut packer = Packer::new().expect("a context");
        let mut unpacker = Unpacker::new().expect("a context");
        let mut out = vec![[7; 5]];
        for count in [0_u32, 1, 2, 1000] {
            let noise = |i: u32| i.wrapping_mul(2_654_435_761).to_le_bytes()[2];
            let records: Vec<[u8; 5]> = (0..count).map(|i| [3, noise(i), 0, 9, 1]).collect();
            let packed = packer.pack::<5>(records.as_flattened()).expect("packs").to_vec();
            unpacker.unpack(&packed, count as usize, &mut out).expect("unpacks");
            assert_eq!(out, records);
            if count == 1000 {
                assert!(packed.len() < 1200, "{} bytes", packed.len());
                let mut damaged = packed.clone();
                damaged[0] ^= 1;
                assert!(unpacker.unpack(&damaged, 1000, &mut out).is_err());
                let more = unpacker.unpack(&packed, 1001, &mut out).expect_err("too few");
                assert_eq!(more.kind(), io::ErrorKind::InvalidData);
                assert!(unpacker.unpack(&packed, 999, &mut out).is_err(), "too many");
            }
        }
    }
}
