//! What is kept of it for people and verdicts.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::points::Kind;
use crate::glare::SpotGlare;
use crate::render::PvInView;

/// `receivers.json`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Received {
    /// Which clock `between_h` means: the site's time zone.
    pub clock: String,
    /// In the order of the points.
    pub groups: Vec<GroupReceived>,
}

/// What arrives at an observer, a region, or a file of sensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupReceived {
    /// As in the project file.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Why nothing can be said; then all that follows means nothing.
    pub not_evaluated: Option<String>,
    /// What a reader should know of how it was made.
    pub notes: Vec<String>,
    /// Points on surfaces and in free air; those on the PV are left out.
    pub points: usize,
    /// How many of them stand in free air.
    #[serde(default, skip_serializing_if = "is_none")]
    pub in_air: usize,
    /// The area that they stand for, m2; 0 where they stand for none.
    pub area_m2: f64,
    /// What the point nearest to the PV, or that with the widest view of it, sees.
    pub pv: Option<PvInView>,
    /// Largest radiant exposure of the year, Wh/m2.
    pub annual_max_wh_m2: f64,
    /// The same, averaged over the area (over the points where they have none).
    pub annual_mean_wh_m2: f64,
    /// Largest irradiance, W/m2.
    pub peak_w_m2: f64,
    /// Its timestep.
    pub peak_at: usize,
    /// The irradiance that is exceeded for 30 minutes on the worst day, W/m2.
    pub exceeded_30min_w_m2: f64,
    /// The irradiance that is exceeded for 50 hours of the year, W/m2.
    pub exceeded_50h_w_m2: f64,
    /// Share of the flux near its brightest points, by PV surface.
    pub surfaces: BTreeMap<String, f64>,
    /// In the order of the project's thresholds.
    pub thresholds: Vec<AtThreshold>,
}

/// A value and the band in which it lies by the noise of its photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Banded {
    /// The value.
    pub value: f64,
    /// Where all irradiances are two standard errors lower.
    pub low: f64,
    /// Where all irradiances are two standard errors higher.
    pub high: f64,
}

impl Banded {
    /// A value without noise.
    pub fn exactly(value: f64) -> Self {
        Self { value, low: value, high: value }
    }
}

/// Glare above one threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtThreshold {
    /// W/m2.
    pub threshold_w_m2: f64,
    /// Hours of the year at the point with the most, h.
    pub hours: Banded,
    /// The longest run at the point with the longest, h.
    pub longest_run_h: Banded,
    /// The most glare of one day at the point with the most, h.
    pub longest_day_h: Banded,
    /// That day, 0 is 1 January.
    pub longest_day: u32,
    /// Months with glare at the point with the most of them.
    pub months: usize,
    /// Hours of the year after the filter in time, at the point with the most, h.
    pub filtered_hours: f64,
    /// The longest run after the filter in time, at the point with the longest, h.
    pub filtered_run_h: f64,
    /// Of the area that is dazzled at any time, m2; of points without area 0.
    pub area_m2: f64,
    /// Share of the points that are dazzled at any time.
    pub share: f64,
    /// Times at which any of its points is dazzled.
    pub anywhere: SpotGlare,
    /// The longest of these times.
    pub episodes: Vec<Episode>,
}

/// A time without a break during which some point of a group is dazzled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// First timestep.
    pub first: usize,
    /// Last timestep, inclusive.
    pub last: usize,
    /// Largest irradiance, W/m2.
    pub peak_w_m2: f64,
    /// The PV surface that sends most of it, and its share.
    pub surface: Option<(String, f64)>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn is_none(count: &usize) -> bool {
    *count == 0
}
