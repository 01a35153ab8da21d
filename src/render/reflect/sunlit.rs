//! A measured BSDF under the sun's disc.
//!
//! A file is piecewise constant, and its cells have sharp borders: half a degree of sun may lie on
//! one side, on the other, or on both, and then a hundred times more light may go one way than the
//! other. Points of the disc would count cells to one point's share. So the disc is cut instead:
//! along parallel lines, on which the places where a border is crossed are found by halving. What is
//! left is a sum over incident cells with their share of the disc, each weighed with the incident
//! cosine.
//!
//! The lines run askew, between the plane of incidence and the direction across it. Borders of all
//! kinds of files run along rings of polar angle or away from the normal, and a line that crosses
//! borders at an angle measures their shares to second order of the lines' distance; one that runs
//! beside a border would count all of its breadth or nothing.
//!
//! An isotropic tree's values turn with the azimuth of the light. There each cell's share is cut once
//! more, into slices of azimuth that are narrow beside the outgoing cells.
//!
//! How far the values differ over a set of outgoing directions is known exactly from the cells that
//! the set touches ([`SunlitFile::span`]): whoever integrates splits until that is little.

use glam::DVec3;

use super::disc::Disc;
use crate::site::bsdf::{Cone, Incidence, Measured};

/// Lines through the disc: shares of straight borders are good to 1e-3 of the disc, as a test holds.
const LINES: u32 = 24;
/// Places on a line between which borders are looked for.
const STEPS: u32 = 8;
/// Halvings that find a border on a line: a thousandth of a step.
const HALVINGS: u32 = 10;
/// Slices of azimuth for each outgoing cell that they turn values over, and how many at least and
/// at most.
const SLICES_PER_CELL: f64 = 4.0;
const SLICES: [f64; 2] = [6.0, 48.0];

/// A term of a measured BSDF and a sun.
#[derive(Clone, Debug)]
pub(in crate::render) struct SunlitFile<'a> {
    measured: &'a Measured,
    parts: Vec<DiscPart>,
    /// By outgoing patch, where the file has patches: the sum over the parts.
    row: Vec<f64>,
}

/// A part of the disc whose light scatters alike.
#[derive(Clone, Copy, Debug)]
struct DiscPart {
    of: Incidence,
    /// Its share of the disc, times the incident cosine, times the term's share of the area.
    weight: f64,
    /// Turns around the normal from the disc's middle, of the slice it lies in.
    slice: u32,
}

impl<'a> SunlitFile<'a> {
    /// `share`: of the area that scatters as the file says; `sun`: to the disc's middle, in the frame
    /// of the PV. What of the disc stands below the PV's horizon doesn't count.
    pub(in crate::render) fn new(
        measured: &'a Measured,
        share: f64,
        sun: DVec3,
        disc: &Disc,
    ) -> Self {
        let mut parts: Vec<DiscPart> = Vec::new();
        let slices = Slices::of(measured, sun, disc);
        let mut add = |of: Incidence, weight: f64, slice: u32| {
            let alike = |part: &&mut DiscPart| part.of.is_like(&of) && part.slice == slice;
            match parts.iter_mut().find(alike) {
                Some(part) => part.weight += weight,
                None => parts.push(DiscPart { of, weight, slice }),
            }
        };
        let at =
            |direction: DVec3| (direction.z > 0.0).then(|| measured.incidence(direction)).flatten();
        let alike = |a: &Option<Incidence>, b: &Option<Incidence>| match (a, b) {
            (Some(a), Some(b)) => a.is_like(b),
            (a, b) => a.is_none() && b.is_none(),
        };
        for line in disc.askew_lines(sun, LINES) {
            let place = |t: f64| (line.middle + line.way * t).normalize();
            let mut from = (-1.0, at(place(-1.0)));
            for step in 1..=STEPS {
                let end = 2.0 * f64::from(step) / f64::from(STEPS) - 1.0;
                let to = (end, at(place(end)));
                // One border at most is looked for on each step.
                let mut border = [from.0, to.0];
                if !alike(&from.1, &to.1) {
                    for _ in 0..HALVINGS {
                        let middle = 0.5 * (border[0] + border[1]);
                        let before = alike(&at(place(middle)), &from.1);
                        border[usize::from(!before)] = middle;
                    }
                } else {
                    border = [to.0, to.0];
                }
                let border = 0.5 * (border[0] + border[1]);
                for (low, high, own) in [(from.0, border, from.1), (border, to.0, to.1)] {
                    let middle = place(0.5 * (low + high));
                    if let Some(own) = own.filter(|_| high > low && middle.z > 0.0) {
                        let weight = share * line.share * 0.5 * (high - low) * middle.z;
                        // The cell's values, turned by the azimuth of this very place.
                        let turned = measured.incidence(middle).filter(|i| i.is_like(&own));
                        add(turned.unwrap_or(own), weight, slices.number(middle));
                    }
                }
                from = to;
            }
        }
        let patches = measured.patches();
        let row = |o| parts.iter().map(|p| p.weight * measured.patch_value(&p.of, o)).sum();
        let row = (0..patches).map(row).collect();
        Self { measured, parts, row }
    }

    /// Mean over the disc of `f cos_i`, 1/sr, to a direction in the frame of the PV.
    #[inline]
    pub(in crate::render) fn value(&self, out: DVec3) -> f64 {
        if out.z <= 0.0 {
            return 0.0;
        }
        if !self.row.is_empty() {
            return self.measured.outgoing_patch(out).map_or(0.0, |o| self.row[o]);
        }
        self.parts.iter().map(|p| p.weight * self.measured.value(&p.of, out)).sum()
    }

    /// Smallest and largest of these values among the directions of a cone, or beyond.
    pub(in crate::render) fn span(&self, out: &Cone) -> [f64; 2] {
        let mut span = [f64::INFINITY, 0.0_f64];
        if !self.row.is_empty() {
            self.measured.patches_within(out, |o| {
                span = [span[0].min(self.row[o]), span[1].max(self.row[o])];
            });
            return [span[0].min(span[1]), span[1]];
        }
        self.parts.iter().fold([0.0, 0.0], |[low, high], part| {
            let [least, most] = self.measured.values_within(&part.of, out);
            [low + part.weight * least.min(most), high + part.weight * most]
        })
    }

    /// By outgoing patch: the values, where the file has patches.
    pub(in crate::render) fn row(&self) -> &[f64] {
        &self.row
    }
}

/// Slices of the disc by azimuth.
struct Slices {
    sun: DVec3,
    per_turn: f64,
}

impl Slices {
    fn of(measured: &Measured, sun: DVec3, disc: &Disc) -> Self {
        let Some(cell) = measured.turning_cell() else { return Self { sun, per_turn: 0.0 } };
        let sine = libm::hypot(sun.x, sun.y).max(1e-9);
        // Half of the disc's azimuths, rad; all of them where the normal stands in it.
        let half = if sine > disc.radius_rad {
            libm::asin(disc.radius_rad / sine)
        } else {
            std::f64::consts::PI
        };
        let [least, most] = SLICES;
        let count = (SLICES_PER_CELL * 2.0 * half / cell).clamp(least, most);
        Self { sun, per_turn: count / (2.0 * half) }
    }

    fn number(&self, place: DVec3) -> u32 {
        if self.per_turn == 0.0 {
            return 0;
        }
        let (cross, dot) = (
            self.sun.x * place.y - self.sun.y * place.x,
            self.sun.x * place.x + self.sun.y * place.y,
        );
        let turned = libm::atan2(cross, dot) + std::f64::consts::PI;
        (turned * self.per_turn) as u32
    }
}
