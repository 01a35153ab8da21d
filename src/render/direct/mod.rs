//! The noise-free twin of the photons: for one reflection the irradiance at a spot is an integral
//! over the PV alone.
//!
//! Whether a part of the PV sees a sun doesn't depend on the spot, whether it sees the spot
//! doesn't depend on time. [`Direct`] asks the first once; [`Direct::year`] integrates the PV's
//! scattering over its cells for one spot and all suns, finer where a lobe is narrow, with a
//! bound of the error. Ideal mirrors are exact: the share of the sun's disc in a polygon.
//! [`direct_series`] does so for all pixels of a view.

mod cells;
mod disc;
mod integral;
mod kernel;
mod scene;
mod series;
mod specular;
#[cfg(test)]
mod tests;

pub use integral::DirectYear;
pub use scene::{Direct, DirectScene, DirectScratch};
pub use series::{DirectSummary, TileYear, direct_series};
