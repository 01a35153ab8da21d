use std::ops::Range;

use glam::DVec3;

/// The months, January first.
pub const MONTHS: [&str; 12] = [
    "January",
    "February",
    "March",
    "April",
    "May",
    "June",
    "July",
    "August",
    "September",
    "October",
    "November",
    "December",
];

/// What part of the spectrum watts stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SpectralBasis {
    /// The whole solar spectrum.
    Broadband,
    /// Radiance's visible watts, 179 lm each.
    Visible,
}

impl SpectralBasis {
    /// Lumens of a watt of sunlight. Of broadband direct sun it is 95 to 110 lm/W for high suns and
    /// 70 for one at 10 degrees (Littlefair 1988, Lighting Res. Technol. 20, 177): 100 is taken for
    /// all, so that luminances of low suns come out rather too large.
    pub fn lm_per_w(self) -> f64 {
        match self {
            Self::Broadband => 100.0,
            Self::Visible => 179.0,
        }
    }
}

/// One instant of the year that is computed, with its sun above the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timestep {
    /// Day of year, 0 is 1 January.
    pub day: u32,
    /// Hour of day, local standard time of the meridian, h.
    pub hour: f64,
    /// Unit vector to the sun's centre; x east, y north, z up.
    pub sun: DVec3,
    /// Direct normal irradiance, W/m2.
    pub irradiance_w_m2: f64,
    /// How many hours of the year it stands for, h.
    pub weight_h: f64,
    /// Number of its segment: a maximal run of timesteps, each a time step after the one before.
    pub segment: u32,
}

/// All timesteps of a run in chronological order.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// The timesteps, chronological.
    pub steps: Vec<Timestep>,
    /// Time between two timesteps of a day, h; the shortest where they differ.
    pub step_h: f64,
    /// The year that days of the year mean.
    pub year: i32,
    /// Equation (1): half a year stands for the year, so that dates of the mirrored half are not
    /// known.
    pub half_year: bool,
    /// Diameter of the sun's disc, degrees.
    pub sun_diameter_deg: f64,
    /// What the irradiance's watts are.
    pub basis: SpectralBasis,
}

impl Timeline {
    /// The timesteps of each segment, in order.
    pub fn segments(&self) -> Vec<Range<usize>> {
        let mut out: Vec<Range<usize>> = Vec::new();
        for (i, step) in self.steps.iter().enumerate() {
            match out.last_mut() {
                Some(last) if self.steps[last.start].segment == step.segment => last.end = i + 1,
                _ => out.push(i..i + 1),
            }
        }
        out
    }
}
