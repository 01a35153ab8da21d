#![doc = include_str!("zarr.md")]

pub mod chunk;
pub mod ledger;
pub mod metadata;
pub mod shard;

mod fault;

pub use fault::Error;
