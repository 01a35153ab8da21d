//! From photons to irradiance: the photons around each hit of a view, summed up for the year and
//! for each timestep.

pub(in crate::render) mod annual;
pub(in crate::render) mod batches;
pub(in crate::render) mod candidates;
pub(in crate::render) mod confidence;
pub(in crate::render) mod error;
pub(in crate::render) mod estimator;
pub(in crate::render) mod flux;
pub(in crate::render) mod photon_set;
pub(in crate::render) mod series;
pub(in crate::render) mod settings;
pub(in crate::render) mod share;
pub(in crate::render) mod surfaces;
pub(in crate::render) mod virtual_sensors;

pub use annual::{Annual, annual};
pub use batches::Fused;
pub use confidence::{DECIDED, undecided};
pub use error::Error;
pub use estimator::{Estimator, Kernel, MIN_RADIUS_M};
pub use series::{Series, SeriesSummary, series};
pub use settings::Gather;
pub use surfaces::Surfaces;
pub use virtual_sensors::{SensorSeries, VirtualSensors};
