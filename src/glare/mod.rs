//! The glare analysis: the time series, smoothed in time and space, held against a threshold; how
//! long each pixel stays above it, and which glare events there are.
//!
//! Everything streams: a window of a few timesteps slides over the volume, so memory doesn't
//! depend on the length of the year, and the result is that of
//! `tools/oracles/glare_reference.py` (SciPy, the whole volume in memory): the same integers, and
//! the same bits of the filtered volume.
//!
#![doc = include_str!("../docs/glare.md")]
//!
//! [`Slices`] → filter → threshold → slabs → events, step by step as [`Session`] drives it.

mod analysis;
mod error;
pub mod events;
pub mod filter;
mod plan;
mod regular;
mod schedule;
mod session;
mod settings;
mod slices;
mod stream;
mod tile_batch;
mod wave;
pub mod year;

pub use analysis::{Analysis, Filtered};
pub use error::{Error, ReadFailure};
pub use events::{Event, EventRow, EventTimes, Events, ListedEvent, write_events};
pub use filter::Kernel;
pub use plan::Plan;
pub use regular::Regular;
pub use session::Session;
pub use settings::{Connectivity, Settings};
pub use slices::{Calendar, Slices};
pub use stream::{analyse, analyse_planned, plan};
pub use tile_batch::TileBatch;
pub use year::{
    HourBounds, HourCounter, Lengths, Run, SpotGlare, YearMap, YearRows, YearTiles, each_slice,
    margins, runs, spot, year,
};
