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

use std::f64::consts::PI;

use glam::DVec3;

use super::disc::Disc;
use crate::base::Frame;
use crate::bsdf::{Cone, Incidence, Measured, on_circle};

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
/// Corners of a polygon around the disc: where all of them and the middle lie in one incident cell, the
/// disc does.
const RIM: u32 = 16;

/// A part of the disc whose light scatters alike.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct DiscPart {
    pub of: Incidence,
    /// Its share of the disc, times the incident cosine.
    pub weight: f64,
}

/// The parts of the disc around `sun`, which is in the frame of the PV. What of it stands below the
/// PV's horizon doesn't count.
pub(in crate::render) fn disc_parts(measured: &Measured, sun: DVec3, disc: &Disc) -> Vec<DiscPart> {
    let at =
        |direction: DVec3| (direction.z > 0.0).then(|| measured.incidence(direction)).flatten();
    let slices = Slices::of(measured, sun, disc);
    if slices.per_turn == 0.0
        && let Some(of) = within_one_cell(sun, disc, &at)
    {
        // The mean cosine over the disc, to second order.
        let weight = sun.z * (1.0 - 0.25 * disc.radius_rad * disc.radius_rad);
        return vec![DiscPart { of, weight }];
    }
    let mut numbers: Vec<u32> = Vec::new();
    let mut parts: Vec<DiscPart> = Vec::new();
    for line in disc.askew_lines(sun, LINES) {
        let place = |t: f64| (line.middle + line.way * t).normalize();
        let mut before = (-1.0, at(place(-1.0)));
        for step in 1..=STEPS {
            let end = 2.0 * f64::from(step) / f64::from(STEPS) - 1.0;
            let after = (end, at(place(end)));
            // One border at most is looked for on each step.
            let mut border = [end, end];
            if !alike(&before.1, &after.1) {
                border[0] = before.0;
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (border[0] + border[1]);
                    border[usize::from(!alike(&at(place(middle)), &before.1))] = middle;
                }
            }
            let border = 0.5 * (border[0] + border[1]);
            for (low, high, own) in [(before.0, border, before.1), (border, end, after.1)] {
                let middle = place(0.5 * (low + high));
                let Some(own) = own.filter(|_| high > low && middle.z > 0.0) else { continue };
                let weight = line.share * 0.5 * (high - low) * middle.z;
                // Values turn by the azimuth of this very place.
                let here = measured.incidence(middle).filter(|i| i.is_like(&own)).unwrap_or(own);
                let number = slices.number(middle);
                let known = |(part, n): (&DiscPart, &u32)| part.of.is_like(&here) && *n == number;
                match parts.iter().zip(&numbers).position(known) {
                    Some(i) => parts[i].weight += weight,
                    None => {
                        parts.push(DiscPart { of: here, weight });
                        numbers.push(number);
                    }
                }
            }
            before = after;
        }
    }
    parts
}

/// The incident cell that all of the disc lies in.
fn within_one_cell(
    sun: DVec3,
    disc: &Disc,
    at: &impl Fn(DVec3) -> Option<Incidence>,
) -> Option<Incidence> {
    let middle = at(sun)?;
    let frame = Frame::around(sun);
    let radius = libm::tan(disc.radius_rad) / libm::cos(PI / f64::from(RIM));
    let on_rim = |i: u32| {
        let (x, y) = on_circle(f64::from(i) / f64::from(RIM));
        (sun + frame.x * (radius * x) + frame.y * (radius * y)).normalize()
    };
    (0..RIM).all(|i| at(on_rim(i)).is_some_and(|i| i.is_like(&middle))).then_some(middle)
}

fn alike(a: &Option<Incidence>, b: &Option<Incidence>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.is_like(b),
        (a, b) => a.is_none() && b.is_none(),
    }
}

/// A term of a measured BSDF and a sun.
#[derive(Clone, Debug)]
pub(in crate::render) struct SunlitFile<'a> {
    measured: &'a Measured,
    parts: Vec<DiscPart>,
    /// By outgoing patch, where the file has patches: the sum over the parts.
    row: Vec<f64>,
}

impl<'a> SunlitFile<'a> {
    /// `share`: of the area that scatters as the file says; `sun`: to the disc's middle, in the frame
    /// of the PV.
    pub(in crate::render) fn new(
        measured: &'a Measured,
        share: f64,
        sun: DVec3,
        disc: &Disc,
    ) -> Self {
        let mut parts = disc_parts(measured, sun, disc);
        parts.iter_mut().for_each(|part| part.weight *= share);
        let row = |o| parts.iter().map(|p| p.weight * measured.patch_value(&p.of, o)).sum();
        let row = (0..measured.patches()).map(row).collect();
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
        if !self.row.is_empty() {
            let mut span = [f64::INFINITY, 0.0_f64];
            self.measured.patches_within(out, |o| {
                span = [span[0].min(self.row[o]), span[1].max(self.row[o])];
            });
            return [span[0].min(span[1]), span[1]];
        }
        span_of(self.measured, &self.parts, out)
    }
}

/// Smallest and largest sum over parts of the disc among the directions of a cone, or beyond.
pub(in crate::render) fn span_of(measured: &Measured, parts: &[DiscPart], out: &Cone) -> [f64; 2] {
    parts.iter().fold([0.0, 0.0], |[low, high], part| {
        let [least, most] = measured.values_within(&part.of, out);
        [low + part.weight * least.min(most), high + part.weight * most]
    })
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
        let half = if sine > disc.radius_rad { libm::asin(disc.radius_rad / sine) } else { PI };
        let [least, most] = SLICES;
        let count = (SLICES_PER_CELL * 2.0 * half / cell).clamp(least, most);
        Self { sun, per_turn: count / (2.0 * half) }
    }

    fn number(&self, place: DVec3) -> u32 {
        if self.per_turn == 0.0 {
            return 0;
        }
        let cross = self.sun.x * place.y - self.sun.y * place.x;
        let dot = self.sun.x * place.x + self.sun.y * place.y;
        ((libm::atan2(cross, dot) + PI) * self.per_turn) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};
    use crate::bsdf::{Bsdf, on_hemisphere, samples};

    /// The disc's parts against 4,096 points of it.
    #[test]
    fn parts_of_the_disc_are_what_counting_points_gives() {
        let mut random = Stream::new(21, Purpose::Survey, 0);
        let disc = Disc::new(0.533);
        let (mut crossed, mut worst) = (0, [0.0_f64; 2]);
        for bsdf in samples() {
            let Bsdf::Measured(measured) = &bsdf else { continue };
            for _ in 0..60 {
                let sun = on_hemisphere(random.uniform(), random.uniform());
                let sunlit = SunlitFile::new(measured, 1.0, sun, &disc);
                crossed += usize::from(sunlit.parts.len() > 1);
                let frame = Frame::around(sun);
                let count = 4096;
                let points: Vec<DVec3> = (0..count)
                    .map(|i| {
                        let r = disc.radius_rad * ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
                        let (x, y) = on_circle((f64::from(i) * 0.618_033_988_749_895) % 1.0);
                        (sun + frame.x * (r * x) + frame.y * (r * y)).normalize()
                    })
                    .collect();
                for _ in 0..20 {
                    let out = on_hemisphere(random.uniform(), random.uniform());
                    let values = points.iter().filter(|s| s.z > 0.0).map(|s| {
                        let value = s.z * measured.evaluate(*s, out);
                        value / f64::from(count)
                    });
                    let (mut sum, mut most) = (0.0, 0.0_f64);
                    for value in values {
                        sum += value;
                        most = most.max(value * f64::from(count));
                    }
                    // Beside the largest value in the disc: shares count.
                    let miss = (sunlit.value(out) - sum).abs();
                    let worst = &mut worst[usize::from(measured.turning_cell().is_some())];
                    *worst = worst.max(miss / most.max(1e-6));
                    let [low, high] = sunlit.span(&Cone::new(out, 1e-3));
                    assert!(low <= sunlit.value(out) && sunlit.value(out) <= high);
                }
            }
        }
        println!("{crossed} discs across borders, {worst:?} at worst");
        // Points count to some thousandths. Where values turn with azimuth, a slice of the disc is
        // looked at through one place of it: half of one may lie on the other side of a border.
        assert!(crossed > 100 && worst[0] < 0.01 && worst[1] < 0.2, "{crossed} {worst:?}");
    }
}
