//! What a view shows: rays, what they hit first, the irradiance there, and the picture behind it.
//!
//! A [`View`] turns pixels into rays exactly as Radiance's `vwrays` does. [`hits`] writes down what
//! each pixel sees, once per view, for everyone else. [`annual`] and [`series`] ask the photon
//! store for the photons around each hit and turn them into irradiance; [`background`] paints the
//! scene by daylight, so that a planner recognises the house. [`sensors`] are points with normals
//! instead of pixels; where they stand in free air, [`Passed`] counts the photons that pass.
#![doc = ""]
#![doc = include_str!("../docs/estimators.md")]

mod background;
mod candidates;
mod confidence;
mod direct;
mod error;
mod estimate;
pub mod eye;
mod facet;
mod fixed;
mod fused;
mod gather;
mod hits;
mod loaded;
mod lobe;
mod mirror;
pub mod moment;
mod order;
mod palette;
mod passed;
pub mod samples;
mod seen;
pub mod sensors;
mod series;
mod share;
mod surfaces;
mod view;
mod view_options;

pub use background::{background, representative_suns};
pub use confidence::{DECIDED, undecided};
pub use direct::{
    Direct, DirectScene, DirectScratch, DirectSinks, DirectSummary, DirectYear, FusedDirect,
    PvSight, TileYear, direct_series,
};
pub use error::Error;
pub use estimate::{Estimate, Estimator, Kernel, MIN_COS, MIN_RADIUS_M, estimate};
pub use fused::Fused;
pub use gather::{Annual, Gather, annual};
pub use hits::{Hit, HitKind, HitMap, hits};
pub use mirror::{
    Anywhere, Lit, MirrorDay, MirrorReceiver, MirrorRule, MirrorRun, MirrorSummary, MirrorTimes,
    MirrorYear, SEPARATION_DEG,
};
pub use passed::{Passed, PassedSeries};
pub use series::{Quantity, Series, SeriesSummary, series};
pub use surfaces::Surfaces;
pub use view::{Projection, View, ViewRay};
