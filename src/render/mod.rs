//! What a view shows: rays, what they hit first, the irradiance there, and the picture behind it.
//!
//! A [`View`] turns pixels into rays exactly as Radiance's `vwrays` does. [`hits`] writes down what
//! each pixel sees, once per view, for everyone else. [`annual`] and [`series`] ask the photon
//! store for the photons around each hit and turn them into irradiance; [`background`] paints the
//! scene by daylight, so that a planner recognises the house. [`sensors`] are points with normals
//! instead of pixels; where they stand in free air, [`VirtualSensors`] count the photons that pass.
#![doc = ""]
#![doc = include_str!("../docs/estimators.md")]

pub mod gather;
pub mod paint;
pub mod reflect;
pub mod view;

pub use gather::{
    Annual, DECIDED, Error as GatherError, Estimator, Fused, Gather, Kernel, MIN_RADIUS_M,
    SensorSeries, Series, SeriesSummary, Surfaces, VirtualSensors, annual, series, undecided,
};
pub use paint::{background, moment, representative_suns};
pub use reflect::{
    Anywhere, Direct, DirectScene, DirectScratch, DirectSinks, DirectSummary, DirectYear,
    FusedDirect, Lit, MirrorDay, MirrorReceiver, MirrorRule, MirrorRun, MirrorSummary, MirrorTimes,
    MirrorYear, PvSight, SEPARATION_DEG, TileYear, direct_series, eye,
};
pub use view::{
    Error, Hit, HitKind, HitMap, Projection, PvInView, View, ViewRay, hits, samples, sensors,
};
