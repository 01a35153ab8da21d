//! The photon store: photons as they come, sorted and in pages on disk, and found again.
//!
//! [`Spill`] takes photons and partitions them on disk by octree cell; [`build`] sorts each partition
//! within the memory it is given and writes the store, whose bytes depend on the photons alone;
//! [`Store`] maps it, keeps decompressed pages in a cache weighed in bytes, and delivers the k
//! nearest photons of a query point, those in a box, or all. What they mean is for others to say. The
//! file is described in [`glintmap_formats::gmp`].
#![doc = include_str!("../docs/photons.md")]

mod build;
mod build_checkpoint;
mod cache;
mod candidates;
mod cube;
mod error;
mod inspect;
mod mapped;
mod packed;
mod page;
mod partition;
mod partitioner;
mod quantise;
mod query;
mod search;
mod sort;
mod spill;
mod store;
mod store_header;
mod tree;
mod verify;

#[cfg(test)]
mod tests;

pub use build::{StoreSummary, build, spill_dir};
pub use cache::CacheStats;
pub use error::Error;
pub use inspect::{LevelStats, Share};
pub use mapped::Access;
pub use page::Light;
pub use query::{ALWAYS, Neighbour, Query};
pub use search::Neighbours;
pub use spill::{Spill, SpillSummary, discard, join};
pub use store::{OpenOptions, Store};
pub use store_header::{About, RADIUS_RULE, StoreInfo};
pub use verify::verify;
