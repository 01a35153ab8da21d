//! Maps of the unfiltered year: hours, days, months, clock times and margins of each pixel, and the
//! same numbers of one point.

pub(in crate::glare) mod bounds;
pub(in crate::glare) mod lengths;
pub(in crate::glare) mod maps;
pub(in crate::glare) mod receiver;
pub(in crate::glare) mod year_tiles;

pub use bounds::{HourBounds, HourCounter, each_slice};
pub use lengths::Lengths;
pub use maps::{YearMap, YearRows, year};
pub use receiver::{Run, SpotGlare, margins, runs, spot};
pub use year_tiles::YearTiles;
