//! The time series of a view: irradiance by timestep, row and column.
//!
//! ```text
//!            TileSink::put                     Volume::read
//!  render ───── tile by tile ──▶ series.zarr ── slice by slice ──▶ glare
//!                                     ▲ │
//!                              import │ ▼ export
//!                                    .npy
//! ```
//! The writer takes one tile of 32 x 32 pixels with all its timesteps at a time and seals it as one
//! shard; the reader takes 16 timesteps of all tiles at a time. Chunks of 16 x 32 x 32 numbers serve
//! both, and those that are all 0 (most of them) take no room and no time. What lies on disk is
//! described in [`glintmap_formats::zarr`]; a volume may be an `.npy` file as well.

mod axis;
mod document;
mod fault;
mod layout;
mod read;
mod rounded;
mod survey;
mod tiles;
mod transfer;
mod write;

pub use axis::{TimeAxis, read_segments, segments_from_numbers};
pub use fault::Error;
pub use layout::CHUNK_TIMESTEPS;
pub use read::Volume;
pub use rounded::Rounded;
pub use survey::Survey;
pub use transfer::{export_npy, import_npy};
pub use write::{Summary, Writer};
