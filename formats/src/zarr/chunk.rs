//! One chunk: `bytes` (little-endian), `zstd`, `crc32c`.

use super::Error;
use crate::checksum::crc32c;

/// What follows on the `bytes` codec.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pipeline {
    /// Compressed by zstd.
    pub zstd: bool,
    /// Followed by a checksum.
    pub crc32c: bool,
}

impl Pipeline {
    /// What we write.
    pub const OURS: Self = Self { zstd: true, crc32c: true };
}

/// The zstd level of everything that is written: sparse smooth floats gain little from more.
pub const ZSTD_LEVEL: i32 = 1;
/// Bytes of the checksum behind a chunk.
pub const CHECKSUM_BYTES: usize = 4;

/// The most bytes that a chunk of `plain_bytes` can take: a longer one is a false claim.
pub fn encoded_bound(plain_bytes: usize) -> usize {
    zstd::zstd_safe::compress_bound(plain_bytes).max(plain_bytes) + CHECKSUM_BYTES
}

/// Encodes chunks; keeps its memory from one to the next. The bytes don't depend on what was
/// encoded before.
pub struct Encoder {
    zstd: zstd::bulk::Compressor<'static>,
    out: Vec<u8>,
}

impl Encoder {
    /// An encoder of the codecs that we write.
    ///
    /// # Errors
    /// When zstd can't get its memory.
    pub fn new() -> Result<Self, Error> {
        Ok(Self { zstd: zstd::bulk::Compressor::new(ZSTD_LEVEL)?, out: Vec::new() })
    }

    /// The bytes of a chunk, good until the next call.
    ///
    /// # Errors
    /// When zstd fails.
    pub fn encode(&mut self, plain: &[u8]) -> Result<&[u8], Error> {
        self.out.clear();
        self.out.reserve(encoded_bound(plain.len()));
        self.zstd.compress_to_buffer(plain, &mut self.out)?;
        let sum = crc32c(&self.out);
        self.out.extend_from_slice(&sum.to_le_bytes());
        Ok(&self.out)
    }
}

/// Decodes chunks.
pub struct Decoder {
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Decoder {
    /// A decoder.
    ///
    /// # Errors
    /// When zstd can't get its memory.
    pub fn new() -> Result<Self, Error> {
        Ok(Self { zstd: zstd::bulk::Decompressor::new()? })
    }

    /// Decodes a chunk that must hold exactly `plain.len()` bytes.
    ///
    /// # Errors
    /// [`Error::Damaged`].
    pub fn decode(
        &mut self,
        pipeline: Pipeline,
        encoded: &[u8],
        plain: &mut [u8],
    ) -> Result<(), Error> {
        let mut body = encoded;
        if pipeline.crc32c {
            let Some((rest, sum)) = encoded.split_last_chunk::<CHECKSUM_BYTES>() else {
                return Err(Error::damaged(format!("{} bytes, no checksum", encoded.len())));
            };
            if crc32c(rest) != u32::from_le_bytes(*sum) {
                return Err(Error::damaged("its checksum doesn't hold"));
            }
            body = rest;
        }
        let found = if pipeline.zstd {
            self.zstd
                .decompress_to_buffer(body, plain)
                .map_err(|e| Error::damaged(format!("zstd says: {e}")))?
        } else {
            let fits = body.len().min(plain.len());
            plain[..fits].copy_from_slice(&body[..fits]);
            body.len()
        };
        if found != plain.len() {
            let expected = plain.len();
            return Err(Error::damaged(format!("expected {expected} bytes, found {found}")));
        }
        Ok(())
    }
}
