//! The noise-free twin of the photons: for one reflection the irradiance at a receiver is an integral
//! over the PV alone.
//!
//! Whether a part of the PV sees a sun doesn't depend on the receiver, whether it sees the receiver
//! doesn't depend on time. [`PvSight`] asks the first once; [`Direct::year`] integrates the PV's
//! scattering over its cells for one receiver and all suns, finer where a lobe is narrow, with a
//! bound of the error. Ideal mirrors are exact: the share of the sun's disc in a polygon.
//! [`direct_series`] does so for all pixels of a view.

mod fused;
mod integral;
mod kernel;
mod lobe;
mod quadrature;
mod receiver;
mod rule;
mod scene;
mod series;
mod sight;
mod specular;
mod suns;
#[cfg(test)]
mod tests;
mod visible;
mod year;

pub use fused::FusedDirect;
pub use scene::{Direct, DirectScene, DirectScratch};
pub use series::{DirectSinks, DirectSummary, TileYear, direct_series};
pub use sight::PvSight;
pub use year::DirectYear;
