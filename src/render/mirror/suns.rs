use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::render::Error;
use crate::sky::{self, FarHorizon, Place, SunModel};

/// Edge of the rows of altitude into which suns are sorted, degrees.
const ROW_DEG: f64 = 0.5;
const ROWS: usize = 180;

/// Which suns the mirror rule looks at: point suns of a whole year, always clear.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorTimes {
    /// Where on Earth.
    pub place: Place,
    /// Which formulas.
    pub model: SunModel,
    /// The year.
    pub year: i32,
    /// Seconds from one instant to the next; divides the day. The rule's: 60.
    pub step_s: u32,
    /// Whether the air lifts the sun; the rule's own suns are geometric.
    pub refraction: bool,
    /// Ridges beyond the scene.
    pub horizon: Option<FarHorizon>,
}

impl MirrorTimes {
    /// Instants of a day, night included.
    pub fn per_day(&self) -> u32 {
        86_400 / self.step_s.max(1)
    }

    /// Instants of the year, nights included.
    pub fn instants(&self) -> u32 {
        self.per_day() * sky::days_in_year(self.year)
    }

    fn check(&self) -> Result<(), Error> {
        if !(10..=3600).contains(&self.step_s) || 86_400 % self.step_s != 0 {
            return Err(Error::Settings {
                what: format!(
                    "the step is {} s, expected 10 s to 1 h, a whole part of the day (10s, 30s, 1min, 5min)",
                    self.step_s
                ),
            });
        }
        if !(1583..6000).contains(&self.year) {
            return Err(Error::Settings {
                what: format!("the year is {}, expected 1583 to 5999", self.year),
            });
        }
        Ok(())
    }
}

/// All suns above the horizon, sorted into rows of altitude and by azimuth within a row, so that
/// the suns in a patch of the sky are found without looking at the others.
#[derive(Debug)]
pub(super) struct Suns {
    /// Towards the sun.
    pub directions: Vec<DVec3>,
    /// Azimuth, degrees, rising within a row.
    azimuths: Vec<f64>,
    /// Number of the instant: `day * per_day + of_day`.
    pub instants: Vec<u32>,
    rows: Vec<Range<usize>>,
}

impl Suns {
    pub(super) fn of(times: &MirrorTimes) -> Result<Self, Error> {
        times.check()?;
        let per_day = times.per_day();
        let days: Vec<Vec<(usize, f64, u32, DVec3)>> = (0..sky::days_in_year(times.year))
            .into_par_iter()
            .map(|day| {
                let at = |i| (i, f64::from(i * times.step_s) / 3600.0);
                let sun = |(i, hour)| {
                    let geometric =
                        sky::sun_direction(&times.place, times.model, times.year, day, hour);
                    let sun = if times.refraction { sky::refracted(geometric) } else { geometric };
                    let shown = sun.z > 0.0 && times.horizon.as_ref().is_none_or(|h| h.shows(sun));
                    let (altitude, azimuth) = sky::altitude_azimuth_deg(sun);
                    shown.then_some((row_of(altitude), azimuth, day * per_day + i, sun))
                };
                (0..per_day).map(at).filter_map(sun).collect()
            })
            .collect();
        let mut all: Vec<_> = days.into_iter().flatten().collect();
        if all.is_empty() {
            return Err(Error::Settings { what: "the sun never stands above the horizon".into() });
        }
        all.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        });
        let rows = (0..ROWS)
            .map(|row| all.partition_point(|s| s.0 < row)..all.partition_point(|s| s.0 <= row))
            .collect();
        Ok(Self {
            directions: all.iter().map(|s| s.3).collect(),
            azimuths: all.iter().map(|s| s.1).collect(),
            instants: all.iter().map(|s| s.2).collect(),
            rows,
        })
    }

    /// Calls `visit` with ranges of suns that hold all those inside the triangle of directions
    /// `corners` (any lengths; less than a half space), and some others.
    pub(super) fn around(&self, corners: &[DVec3; 3], mut visit: impl FnMut(Range<usize>)) {
        let patch = Patch::around(corners);
        if patch.high_deg < 0.0 {
            return;
        }
        for row in &self.rows[row_of(patch.low_deg)..=row_of(patch.high_deg)] {
            let azimuths = &self.azimuths[row.clone()];
            let mut between = |from: f64, to: f64| {
                let first = azimuths.partition_point(|&a| a < from);
                let last = azimuths.partition_point(|&a| a <= to);
                if first < last {
                    visit(row.start + first..row.start + last);
                }
            };
            let (from, width) = (patch.from_deg, patch.width_deg);
            if width >= 360.0 {
                between(0.0, 360.0);
            } else {
                between(from, from + width);
                if from + width > 360.0 {
                    between(0.0, from + width - 360.0);
                }
            }
        }
    }
}

fn row_of(altitude_deg: f64) -> usize {
    // The cast saturates: below the horizon is row 0.
    ((altitude_deg / ROW_DEG) as usize).min(ROWS - 1)
}

/// Bounds of a triangle of directions, degrees.
struct Patch {
    low_deg: f64,
    high_deg: f64,
    /// 0 to below 360.
    from_deg: f64,
    width_deg: f64,
}

/// Room for rounding, degrees.
const MARGIN_DEG: f64 = 1e-6;

impl Patch {
    fn around(corners: &[DVec3; 3]) -> Self {
        let angles = corners.map(sky::altitude_azimuth_deg);
        let mut low_deg = angles.iter().fold(90.0, |low: f64, a| low.min(a.0));
        let mut high_deg = angles.iter().fold(-90.0, |high: f64, a| high.max(a.0));
        // Around the zenith (or the nadir) azimuths run full circle: all edges pass it on the
        // same side.
        let edges = [0, 1, 2].map(|i| (corners[i], corners[(i + 1) % 3]));
        let sides = edges.map(|(a, b)| a.cross(b).z);
        let full = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
        for (a, b) in edges {
            // An arc's highest point may lie between its ends.
            let across = a.cross(b);
            let top = DVec3::Z * across.length_squared() - across * across.z;
            if a.cross(top).dot(across) > 0.0 && top.cross(b).dot(across) > 0.0 {
                high_deg = high_deg.max(sky::altitude_azimuth_deg(top).0);
            }
        }
        let (mut from_deg, mut width_deg) = (0.0, 360.0);
        if full {
            high_deg = if corners.iter().any(|c| c.z > 0.0) { 90.0 } else { high_deg };
        } else {
            // Less than half a circle: azimuths unfold around the first corner's.
            let turns = angles.map(|a| {
                let turn = (a.1 - angles[0].1).rem_euclid(360.0);
                if turn > 180.0 { turn - 360.0 } else { turn }
            });
            let first = turns.iter().fold(0.0, |m: f64, t| m.min(*t)) - MARGIN_DEG;
            let last = turns.iter().fold(0.0, |m: f64, t| m.max(*t)) + MARGIN_DEG;
            from_deg = (angles[0].1 + first).rem_euclid(360.0);
            width_deg = last - first;
        }
        if low_deg < 0.0 {
            low_deg = 0.0;
        }
        Self {
            low_deg: (low_deg - MARGIN_DEG).max(0.0),
            high_deg: high_deg + MARGIN_DEG,
            from_deg,
            width_deg,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    #[test]
    fn finds_every_sun_of_a_patch() {
        let times = MirrorTimes {
            place: Place {
                latitude_deg: 20.0,
                longitude_deg: 8.3,
                meridian_deg: 15.0,
                elevation_m: 0.0,
            },
            model: SunModel::Gensky,
            year: 2025,
            step_s: 1800,
            refraction: false,
            horizon: None,
        };
        let suns = Suns::of(&times).expect("suns");
        let (mut inside_all, mut looked) = (0, 0);
        for i in 0..2000 {
            let mut random = Stream::new(1, Purpose::Survey, i);
            let mut one = || random.uniform() - 0.5;
            let middle = DVec3::new(one(), one(), one() + 0.3);
            let size = if i % 3 == 0 { 1.2 } else { 0.3 };
            let mut corners = [0; 3].map(|_| middle + DVec3::new(one(), one(), one()) * size);
            let inside =
                |c: &[DVec3; 3], s: DVec3| (0..3).all(|i| c[i].cross(c[(i + 1) % 3]).dot(s) >= 0.0);
            if corners[0].dot(corners[1].cross(corners[2])) < 0.0 {
                corners.swap(0, 1);
            }
            let mut found = vec![false; suns.directions.len()];
            suns.around(&corners, |range| {
                looked += range.len();
                range.for_each(|i| found[i] = true);
            });
            for (i, sun) in suns.directions.iter().enumerate() {
                if inside(&corners, *sun) {
                    inside_all += 1;
                    assert!(found[i], "sun {sun} in {corners:?}");
                }
            }
        }
        assert!(inside_all > 100_000, "{inside_all}");
        assert!(looked < 2000 * suns.directions.len() / 3, "{looked}");
    }
}
