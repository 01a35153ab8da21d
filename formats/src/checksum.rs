//! CRC-32C (Castagnoli), as Zarr's `crc32c` codec and our own formats use it.

/// CRC-32C of some bytes.
pub fn crc32c(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes)
}

/// CRC-32C of `first` followed by `bytes`, where `first` is the checksum of what came before.
pub fn crc32c_append(first: u32, bytes: &[u8]) -> u32 {
    crc32c::crc32c_append(first, bytes)
}
