//! Bytes and nothing else: the formats that glintmap reads and writes.
//!
//! Nothing in here knows what a photon or an irradiance is for; it knows how they lie in a file.
//! Formats of our own have a page (`.md`) each, which is also the module's documentation.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod checksum;
pub mod fault;
pub mod gmp;
pub mod header;
pub mod hits;
pub mod npy;
pub mod records;
pub mod seal;
pub mod zarr;
