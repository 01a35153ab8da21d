//! From photons to irradiance: the photons around each hit of a view, summed up for the year and for
//! each timestep.

pub(in crate::render) mod annual;
pub(in crate::render) mod candidates;
pub(in crate::render) mod confidence;
pub(in crate::render) mod estimate;
pub(in crate::render) mod fixed;
pub(in crate::render) mod fused;
pub(in crate::render) mod loaded;
pub(in crate::render) mod passed;
pub(in crate::render) mod series;
pub(in crate::render) mod share;
pub(in crate::render) mod surfaces;

pub use annual::{Annual, Gather, annual};
pub use confidence::{DECIDED, undecided};
pub use estimate::{Estimate, Estimator, Kernel, MIN_COS, MIN_RADIUS_M, estimate};
pub use fused::Fused;
pub use passed::{Passed, PassedSeries};
pub use series::{Quantity, Series, SeriesSummary, series};
pub use surfaces::Surfaces;
