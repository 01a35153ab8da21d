//! What a measured reflection is like: totals by angle, reciprocity, how wide its cells are.

use glam::DVec3;

use super::block::Table;
use super::{Measured, on_circle, on_hemisphere};
use crate::base::{Purpose, Stream};

/// Incidence angles at which totals are told, degrees: glare happens at the last ones.
pub const ANGLES_DEG: [f64; 5] = [10.0, 30.0, 60.0, 75.0, 85.0];
/// Pairs of directions that are compared.
const PAIRS: u64 = 20_000;
/// Azimuths that a total is taken over.
const AROUND: u32 = 64;
/// Share of the light in one cell from which on the cell decides the lobe's width.
const CONCENTRATED: f64 = 0.2;
/// The sun's disc; no reflection of it is narrower.
const SUN_DEG: f64 = 0.53;

/// How far values are from `f(a, b) = f(b, a)`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Reciprocity {
    /// Mean of `|f(a, b) - f(b, a)|` in the mean of f, over directions even in projected solid
    /// angle.
    pub mean: f64,
    /// Largest `|f(a, b) - f(b, a)| / (f(a, b) + f(b, a))` of any pair looked at.
    pub most: f64,
}

pub(super) fn from_angle(polar_deg: f64, turns: f64) -> DVec3 {
    let (cos, sin) = on_circle(turns);
    let polar = polar_deg.to_radians();
    let radius = libm::sin(polar);
    DVec3::new(radius * cos, radius * sin, libm::cos(polar))
}

impl Reciprocity {
    /// Compares 20,000 pairs of directions both ways.
    pub fn of(value: impl Fn(DVec3, DVec3) -> f64) -> Self {
        let (mut difference, mut sum, mut most) = (0.0, 0.0, 0.0_f64);
        for n in 0..PAIRS {
            let mut random = Stream::new(0, Purpose::Survey, n);
            let mut next = || {
                let (u, v) = (random.uniform(), random.uniform());
                on_hemisphere(u, v)
            };
            let (a, b) = (next(), next());
            let (there, back) = (value(a, b), value(b, a));
            let off = (there - back).abs();
            difference += off;
            sum += 0.5 * (there + back);
            if there + back > 0.0 {
                most = most.max(off / (there + back));
            }
        }
        Self { mean: if sum > 0.0 { difference / sum } else { 0.0 }, most }
    }
}

impl Measured {
    /// Share of the light from a polar angle that is scattered: smallest, mean and largest over
    /// the azimuths.
    pub fn total_at(&self, polar_deg: f64) -> [f64; 3] {
        let mut out = [f64::INFINITY, 0.0, 0.0_f64];
        for i in 0..AROUND {
            let total = self.reflectance(from_angle(polar_deg, f64::from(i) / f64::from(AROUND)));
            out = [out[0].min(total), out[1] + total / f64::from(AROUND), out[2].max(total)];
        }
        out
    }

    /// Width of the cells that light from a polar angle is scattered into about its mirror
    /// direction, degrees, and the largest share of the light in one of them.
    pub fn cell_at(&self, polar_deg: f64) -> (f64, f64) {
        match self.table() {
            Table::Matrix(m) => {
                let share = (0..AROUND)
                    .filter_map(|i| {
                        let from = from_angle(polar_deg, f64::from(i) / f64::from(AROUND));
                        m.incident_patch(from).map(|i| m.peak_share(i))
                    })
                    .fold(0.0, f64::max);
                (m.outgoing.width_deg(polar_deg), share)
            }
            Table::Tree(t) => {
                // A cell of the square about the mirror direction, in the plane of incidence.
                let half = 1.0 / f64::from(1_u32 << t.levels().min(20));
                let sin = libm::sin(polar_deg.to_radians());
                let width = libm::asin((sin + half).min(1.0)) - libm::asin((sin - half).max(-1.0));
                let share = (0..AROUND)
                    .map(|i| t.peak_share(from_angle(polar_deg, f64::from(i) / f64::from(AROUND))))
                    .fold(0.0, f64::max);
                (width.to_degrees(), share)
            }
        }
    }

    /// What someone should know who maps glare with it.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for polar_deg in ANGLES_DEG {
            let (width_deg, share) = self.cell_at(polar_deg);
            if share > CONCENTRATED && width_deg > SUN_DEG {
                notes.push(format!(
                    "at {polar_deg} degrees of incidence up to {:.0} % of the scattered light lies in one cell, {width_deg:.1} degrees wide (the sun: {SUN_DEG}): the reflection is narrower than the file can say, glare comes out wider and weaker",
                    100.0 * share
                ));
                break;
            }
        }
        if let Table::Matrix(m) = self.table() {
            let end_deg = m.incident.rings().last().map_or(0.0, |r| r.to_deg);
            if end_deg < 90.0 {
                let cos = libm::cos(end_deg.to_radians());
                notes.push(format!(
                    "nothing is known beyond {end_deg} degrees of incidence: {:.1} % of light from all directions scatters nothing",
                    100.0 * cos * cos
                ));
            }
        }
        notes
    }
}
