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
//! [`Slices`] → `smooth` → `threshold` → `label` → `duration`, `event`; `rules` judge.

mod counts;
mod duration;
mod error;
mod event;
mod events;
mod kernel;
mod label;
mod lengths;
mod paged;
mod passes;
mod plan;
mod regular;
pub mod rules;
mod runs;
mod session;
mod settings;
mod sheet;
mod slab;
mod slices;
mod smooth;
mod spot;
mod stream;
mod strip;
mod threshold;
mod tile_batch;
mod track;
mod vector;
mod wave;
mod window;
mod year;
mod year_tiles;

pub use error::Error;
pub use event::Event;
pub use events::Events;
pub use kernel::Kernel;
pub use lengths::Lengths;
pub use plan::Plan;
pub use regular::Regular;
pub use session::Session;
pub use settings::{Connectivity, Settings};
pub use sheet::write_events;
pub use slices::{Calendar, ReadFailure, Slices};
pub use spot::{Run, SpotGlare, margins, runs, spot};
pub use stream::{Analysis, Filtered, analyse, analyse_planned, plan};
pub use tile_batch::TileBatch;
pub use year::{YearMap, YearRows, year};
pub use year_tiles::YearTiles;
