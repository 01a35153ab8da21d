//! The suns of a year for the mirror rule, sorted by where they stand: so a receiver asks only for those
//! that a PV surface can mirror into it, instead of going through every minute of the year.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::render::view::error::Error;
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
        if !(1..=3600).contains(&self.step_s) || 86_400 % self.step_s != 0 {
            return Err(Error::Settings {
                what: format!(
                    "the step is {} s, expected 1 s to 1 h, a whole part of the day (1s, 10s, 1min, 5min)",
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
    /// All suns of the year: what those that are near are held against.
    #[cfg(test)]
    pub(super) fn of(times: &MirrorTimes) -> Result<Self, Error> {
        times.check()?;
        let all = Self::at(times, &(0..times.instants()).collect::<Vec<_>>(), 0.0);
        if all.directions.is_empty() {
            return Err(Error::Settings { what: "the sun never stands above the horizon".into() });
        }
        Ok(all)
    }

    /// The suns of some instants, as far as they stand above `lowest_deg`; only where that is the
    /// horizon do ridges count.
    fn at(times: &MirrorTimes, instants: &[u32], lowest_deg: f64) -> Self {
        let per_day = times.per_day();
        let lowest = libm::sin(lowest_deg.to_radians());
        let sun = |&instant: &u32| {
            let (day, of_day) = (instant / per_day, instant % per_day);
            let hour = f64::from(of_day * times.step_s) / 3600.0;
            let geometric = sky::sun_direction(&times.place, times.model, times.year, day, hour);
            let sun = if times.refraction { sky::refracted(geometric) } else { geometric };
            let ridges = times.horizon.as_ref().filter(|_| lowest_deg >= 0.0);
            let shown = sun.z > lowest && ridges.is_none_or(|h| h.shows(sun));
            let (altitude, azimuth) = sky::altitude_azimuth_deg(sun);
            shown.then_some((row_of(altitude), azimuth, instant, sun))
        };
        let mut all: Vec<(usize, f64, u32, DVec3)> =
            instants.par_iter().with_min_len(256).filter_map(sun).collect();
        all.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        });
        let rows = (0..ROWS)
            .map(|row| all.partition_point(|s| s.0 < row)..all.partition_point(|s| s.0 <= row))
            .collect();
        Self {
            directions: all.iter().map(|s| s.3).collect(),
            azimuths: all.iter().map(|s| s.1).collect(),
            instants: all.iter().map(|s| s.2).collect(),
            rows,
        }
    }

    /// Calls `visit` with ranges of suns that hold all those inside the triangle of directions
    /// `corners` (any lengths; less than a half space), and some others.
    pub(super) fn around(&self, corners: &[DVec3; 3], visit: impl FnMut(Range<usize>)) {
        self.inside(&Patch::around(corners), visit);
    }

    fn inside(&self, patch: &Patch, mut visit: impl FnMut(Range<usize>)) {
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

/// Between the suns that are worked out first, s.
const COARSE_S: u32 = 300;
/// The sun moves by up to 15 degrees an hour; more where the air lifts it unevenly, near the
/// horizon.
const FASTEST_DEG_PER_S: f64 = 1.3 * 15.0 / 3600.0;
/// Formulas that know the day alone let the sun jump at midnight by up to this much.
const MIDNIGHT_DEG: f64 = 0.5;

/// A year of suns of which only those are worked out that may stand in some patch of the sky: first
/// one every five minutes, then the steps around those that come near.
#[derive(Debug)]
pub(super) struct Ahead {
    times: MirrorTimes,
    /// Steps from one coarse sun to the next.
    stride: u32,
    coarse: Suns,
    /// How far a sun may be from the nearest coarse one, degrees.
    margin_deg: f64,
    /// Suns of the year that are shown, as far as the coarse ones tell.
    pub shown: usize,
}

impl Ahead {
    pub(super) fn of(times: &MirrorTimes) -> Result<Self, Error> {
        times.check()?;
        let stride = (COARSE_S / times.step_s).max(1);
        let half_s = 0.5 * f64::from(stride * times.step_s);
        let margin_deg = FASTEST_DEG_PER_S * half_s + MIDNIGHT_DEG;
        let last = times.instants() - 1;
        let instants = (0..last).step_by(stride as usize).chain([last]);
        let coarse = Suns::at(times, &instants.collect::<Vec<_>>(), -margin_deg);
        if coarse.directions.is_empty() {
            return Err(Error::Settings { what: "the sun never stands above the horizon".into() });
        }
        let shows =
            |sun: &&DVec3| sun.z > 0.0 && times.horizon.as_ref().is_none_or(|h| h.shows(**sun));
        let shown = coarse.directions.iter().filter(shows).count() * stride as usize;
        Ok(Self { times: times.clone(), stride, coarse, margin_deg, shown })
    }

    /// Marks the coarse suns that come near a triangle of directions.
    pub(super) fn mark(&self, corners: &[DVec3; 3], near: &mut [bool]) {
        let patch = Patch::around(corners).widened(self.margin_deg);
        self.coarse.inside(&patch, |range| near[range].fill(true));
    }

    /// How many coarse suns there are.
    pub(super) fn len(&self) -> usize {
        self.coarse.directions.len()
    }

    /// All suns around the coarse ones that are marked.
    pub(super) fn around(&self, near: &[bool]) -> Suns {
        let instants = self.times.instants();
        let mut asked = vec![false; instants.div_ceil(self.stride) as usize];
        for (&instant, _) in self.coarse.instants.iter().zip(near).filter(|(_, near)| **near) {
            // Between the coarse sun before and that behind.
            let own = (instant / self.stride) as usize;
            asked[own] = true;
            asked[own.saturating_sub(1)] = true;
        }
        let spans = (0..asked.len() as u32).filter(|span| asked[*span as usize]);
        let of = |span: u32| span * self.stride..((span + 1) * self.stride).min(instants);
        Suns::at(&self.times, &spans.flat_map(of).collect::<Vec<_>>(), 0.0)
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
    /// With all that lies up to an angle beside it.
    fn widened(self, by_deg: f64) -> Self {
        let high_deg = self.high_deg + by_deg;
        // A small circle of this radius reaches that far in azimuth.
        let ratio =
            libm::sin(by_deg.to_radians()) / libm::cos(self.high_deg.to_radians()).max(1e-9);
        let turn_deg = if ratio < 1.0 { libm::asin(ratio).to_degrees() } else { 180.0 };
        // Below the horizon altitudes are 0 here.
        let low_deg = (self.low_deg - by_deg).max(0.0);
        let width_deg = self.width_deg + 2.0 * turn_deg;
        let from_deg = (self.from_deg - turn_deg).rem_euclid(360.0);
        Self { low_deg, high_deg, from_deg, width_deg }
    }

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
