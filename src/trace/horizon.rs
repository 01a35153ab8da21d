//! Horizons: under which elevation anything can be hit from a piece of PV, by compass direction.
//!
//! The question is asked millions of times: can a photon that starts anywhere in this box and flies
//! anywhere into this cone hit anything within the path limit? A ray can't answer it for a cone,
//! and the answer no must be proved, as what it leaves out is never sampled. So all triangles are
//! rasterised into columns of a quadtree ([`super::skyline`]), each with its highest point, and for
//! every piece and each of 512 directions the largest tangent of the elevation to any column is
//! kept.
//!
//! [`super::reach`] holds the same as a pyramid of pictures, azimuth by elevation, in which a pixel
//! is the set of pieces that may reach something there: a cone is answered for all pieces by a few
//! look-ups.

use glam::DVec3;

use super::compass::{BINS, compass};
use super::emitter::{Emitter, Piece, Pieces, reach_m};
use super::reach::Reach;
use super::skyline::{Column, Skyline};
use crate::base::VirtualSensor;
use crate::bsdf::Cone;
use crate::site::Site;

/// A column this small against its distance is not looked into further.
const FINE_ENOUGH: f64 = 0.03;
/// Triangles looked at over all emitters; emitters beyond have no horizon and trace every ray.
const MOST_WORK: u64 = 2_000_000_000;

/// Under which elevation anything within the path limit can be seen from each piece of an emitter,
/// by compass direction. Conservative: a direction above it reaches nothing.
///
/// Proof: a photon starts in the box of its piece and leaves upwards from its plane, so it can hit
/// only what lies above that plane, within the limit. Each hit point lies in some column of the
/// skyline, at or below its top. For every column, the tangent of the elevation from any point of
/// the box to any point of the column is at most (top - lowest start) over the smallest horizontal
/// distance if that is positive, over the largest (within the limit) if not; the compass
/// directions lie between those of the corners of the difference of the two rectangles. Boxes and
/// columns are larger than they are by a margin that covers the rounding of rays to f32.
#[derive(Debug)]
pub(super) struct Horizon {
    /// Tangent of the elevation, [`BINS`] for each piece.
    tangents: Vec<f32>,
    reach: Reach,
    /// The same of what is mirrored at the horizontal: where all that can be reached is small, it
    /// lies above something, too.
    floor: Option<Box<Self>>,
}

/// Smallest and largest corner of a box, m.
pub(super) type Span = (DVec3, DVec3);

/// The horizons of all emitters. With an infinite limit they tell where the sun and the open sky
/// are; those are coarser, because all that they spare is a ray.
pub(super) fn horizons(site: &Site, emitters: &[Emitter], max_path_m: f64) -> Vec<Option<Horizon>> {
    use rayon::prelude::*;
    let depth = match emitters.len() {
        0..=32 => 9,
        33..=256 => 8,
        _ => 7,
    } - u32::from(max_path_m.is_infinite());
    let allowed = (MOST_WORK / (site.triangles.len() as u64).max(1)) as usize;
    let fine = emitters.len() <= 32 && max_path_m.is_finite();
    let rasters = if fine { (256, 128) } else { (64, 32) };
    emitters
        .par_iter()
        .enumerate()
        .map(|(i, emitter)| {
            let build = || Horizon::build(site, emitter, depth, rasters, max_path_m);
            (i < allowed).then(build)
        })
        .collect()
}

/// The horizons of all emitters where virtual sensors are all that can be reached.
pub(super) fn sensor_horizons(
    site: &Site,
    emitters: &[Emitter],
    sensors: &[VirtualSensor],
    max_path_m: f64,
) -> Vec<Option<Horizon>> {
    use rayon::prelude::*;
    let spans: Vec<(VirtualSensor, Span)> =
        sensors.iter().map(|sensor| (*sensor, span_of(sensor))).collect();
    let work = |emitter: &Emitter| (emitter.pieces.len() * sensors.len()) as u64;
    let mut left = MOST_WORK / 8;
    let allowed: Vec<bool> = emitters
        .iter()
        .map(|emitter| {
            let enough = work(emitter) <= left;
            left = left.saturating_sub(work(emitter));
            enough
        })
        .collect();
    let rasters = if emitters.len() <= 32 { (256, 128) } else { (64, 32) };
    emitters
        .par_iter()
        .zip(allowed)
        .map(|(emitter, allowed)| {
            allowed.then(|| Horizon::around(site, emitter, &spans, rasters, max_path_m))
        })
        .collect()
}

/// The box of a virtual sensor.
pub(super) fn span_of(sensor: &VirtualSensor) -> Span {
    let n = sensor.normal;
    let half = (DVec3::ONE - n * n).max(DVec3::ZERO).map(f64::sqrt) * sensor.radius_m;
    (sensor.centre - half, sensor.centre + half)
}

impl Horizon {
    fn build(
        site: &Site,
        emitter: &Emitter,
        depth: u32,
        rasters: (usize, usize),
        max_path_m: f64,
    ) -> Self {
        let margin_m = margin_m(site);
        let boxes = boxes(emitter, margin_m);
        let all = boxes
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), &(c, d)| (a.min(c), b.max(d)));
        let (low, high) = (site.bounds.min.as_dvec3(), site.bounds.max.as_dvec3());
        let low = [0, 1].map(|i| (all.0[i] - max_path_m).max(low[i]) - margin_m);
        let high = [0, 1].map(|i| (all.1[i] + max_path_m).min(high[i]) + margin_m);
        let plane = (emitter.frame.z, emitter.floor_m);
        let skyline = Skyline::build(&site.triangles, plane, (low, high), depth, margin_m);
        let mut tangents = Vec::with_capacity(boxes.len() * BINS);
        for span in boxes {
            tangents.extend(seen_from(&skyline, span, max_path_m + margin_m));
        }
        let reach = Reach::of(&tangents, rasters);
        Self { tangents, reach, floor: None }
    }

    /// The horizon where virtual sensors are all that can be reached. `virtual sensors` are boxes
    /// around them.
    fn around(
        site: &Site,
        emitter: &Emitter,
        sensors: &[(VirtualSensor, Span)],
        rasters: (usize, usize),
        max_path_m: f64,
    ) -> Self {
        let margin_m = margin_m(site);
        let boxes = boxes(emitter, margin_m);
        let side = |mirrored: bool| {
            let flip = |span: &Span| if mirrored { mirror(*span) } else { *span };
            let mut tangents = vec![f32::NEG_INFINITY; boxes.len() * BINS];
            for (span, tangents) in boxes.iter().zip(tangents.chunks_mut(BINS)) {
                for (sensor, around) in sensors {
                    if !emitter.faces(around) || !lies_before(sensor, span, margin_m) {
                        continue;
                    }
                    let (low, high) = flip(around);
                    let (low, high) = (low - margin_m, high + margin_m);
                    let plan = ([low.x, low.y], [high.x, high.y]);
                    let view = View::at(plan, high.z, flip(span), max_path_m + margin_m);
                    let Some(view) = view else { continue };
                    for bin in view.bins() {
                        tangents[bin] = tangents[bin].max(view.tangent);
                    }
                }
            }
            Self { reach: Reach::of(&tangents, rasters), tangents, floor: None }
        };
        Self { floor: Some(Box::new(side(true))), ..side(false) }
    }

    /// The pieces from which a direction may reach something.
    #[inline]
    pub(super) fn reaching(&self, direction: DVec3) -> Pieces {
        let level = (direction.x * direction.x + direction.y * direction.y).sqrt();
        let column = self.reach.column(direction.x, direction.y, 0.0) as usize;
        let below = self.reach.at(0, column, self.reach.row(direction.z, level));
        match &self.floor {
            None => below,
            Some(floor) => below & floor.reaching(upside_down(direction)),
        }
    }

    /// The pieces from which any direction of a cone may reach something.
    pub(super) fn reaching_cone(&self, cone: &Cone) -> Pieces {
        let below = self.reaching_cone_below(cone);
        match &self.floor {
            Some(floor) if below != 0 => {
                below & floor.reaching_cone_below(&cone.about(upside_down(cone.axis)))
            }
            _ => below,
        }
    }

    fn reaching_cone_below(&self, cone: &Cone) -> Pieces {
        let d = cone.axis;
        let level = d.x.hypot(d.y);
        // Sine and cosine of the lowest elevation.
        let sine = d.z * cone.cos - level * cone.sin;
        let cosine = level * cone.cos + d.z * cone.sin;
        let (sine, cosine) =
            if cosine <= 0.0 || cone.cos <= 0.0 { (-1.0, 0.0) } else { (sine, cosine) };
        let row = self.reach.row(sine, cosine);
        if cone.cos <= 0.0 || cone.sin >= level {
            return self.reach.all_around(row);
        }
        // The azimuths end where the cone touches a vertical plane.
        let sin = (cone.sin / level + 1e-9).min(1.0);
        let cos = (1.0 - sin * sin).sqrt();
        let from = self.reach.column(d.x * cos + d.y * sin, d.y * cos - d.x * sin, -1e-6);
        let to = self.reach.column(d.x * cos - d.y * sin, d.y * cos + d.x * sin, 1e-6);
        self.reach.between(from, to, row)
    }

    /// Whether a direction reaches nothing from anywhere on a piece.
    #[inline]
    pub(super) fn clears(&self, piece: usize, direction: DVec3) -> bool {
        clears(&self.tangents[piece * BINS..(piece + 1) * BINS], direction)
            || self.floor.as_ref().is_some_and(|f| f.clears(piece, upside_down(direction)))
    }
}

/// A direction, mirrored at the horizontal.
fn upside_down(d: DVec3) -> DVec3 {
    DVec3::new(d.x, d.y, -d.z)
}

fn mirror((low, high): Span) -> Span {
    (DVec3::new(low.x, low.y, -high.z), DVec3::new(high.x, high.y, -low.z))
}

/// By how much boxes are larger than they are, m: more than the rounding of rays to f32.
fn margin_m(site: &Site) -> f64 {
    (1e-6 * reach_m(site)).max(1e-3)
}

/// Boxes around where photons start from each piece.
fn boxes(emitter: &Emitter, margin_m: f64) -> Vec<Span> {
    let around = |piece: &Piece| {
        let corners = piece.triangles.iter().flatten().map(|&p| emitter.lifted(p));
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| {
            (a.min(p - margin_m), b.max(p + margin_m))
        })
    };
    emitter.pieces.iter().map(around).collect()
}

/// Whether any point of a box lies on the side of a virtual sensor that light is counted on.
fn lies_before(sensor: &VirtualSensor, (low, high): &Span, margin_m: f64) -> bool {
    let n = sensor.normal;
    let farthest = DVec3::select(n.cmpgt(DVec3::ZERO), *high, *low);
    n.dot(farthest - sensor.centre) > -margin_m
}

#[inline]
fn clears(tangents: &[f32], d: DVec3) -> bool {
    let bin = (compass(d.x, d.y) * (BINS as f64 / 4.0)) as usize & (BINS - 1);
    let level = (d.x * d.x + d.y * d.y).sqrt();
    let tangent = f64::from(tangents[bin]);
    // Straight up where something is overhead is infinity times zero: not above, so not cleared.
    // Where nothing is seen at all every direction is above.
    tangent == f64::NEG_INFINITY || d.z > tangent * level
}

/// The horizon's tangents from any point of a box.
fn seen_from(skyline: &Skyline, span: Span, max_path_m: f64) -> Vec<f32> {
    let mut tangents = vec![f32::NEG_INFINITY; BINS];
    let mut stack: Vec<Column> = vec![skyline.whole()];
    while let Some(column) = stack.pop() {
        let Some(view) = View::of(skyline, column, span, max_path_m) else { continue };
        // Not above what is seen already: the parts can't be either.
        if view.bins().all(|bin| tangents[bin] >= view.tangent) {
            continue;
        }
        let parts = skyline.parts(column).filter(|_| view.edge_m > FINE_ENOUGH * view.distance_m);
        match parts {
            Some(parts) => stack.extend(parts),
            None => {
                for bin in view.bins() {
                    tangents[bin] = tangents[bin].max(view.tangent);
                }
            }
        }
    }
    tangents
}

/// How a column may look from a box.
struct View {
    tangent: f32,
    first_bin: usize,
    bin_count: usize,
    distance_m: f64,
    edge_m: f64,
}

impl View {
    fn of(skyline: &Skyline, column: Column, span: Span, max_path_m: f64) -> Option<Self> {
        let top_m = skyline.top_m(column);
        if top_m == f64::NEG_INFINITY {
            return None;
        }
        Self::at(skyline.square_m(column), top_m, span, max_path_m)
    }

    /// How what lies over a rectangle of the map, at or below `top_m`, may look from a box.
    fn at(
        (low, high): ([f64; 2], [f64; 2]),
        top_m: f64,
        span: Span,
        max_path_m: f64,
    ) -> Option<Self> {
        // The differences of any point of the column and any of the box.
        let low_x = low[0] - span.1.x;
        let high_x = high[0] - span.0.x;
        let low_y = low[1] - span.1.y;
        let high_y = high[1] - span.0.y;
        let near_x = low_x.max(-high_x).max(0.0);
        let near_y = low_y.max(-high_y).max(0.0);
        let far_x = high_x.max(-low_x);
        let far_y = high_y.max(-low_y);
        let near_m = (near_x * near_x + near_y * near_y).sqrt();
        let far_m = (far_x * far_x + far_y * far_y).sqrt().min(max_path_m);
        let rise_m = top_m - span.0.z;
        // What lies lower than `top` from the lowest start is farther still from higher ones.
        let drop_m = (span.0.z - top_m).max(0.0);
        if near_m * near_m + drop_m * drop_m > max_path_m * max_path_m {
            return None;
        }
        let tangent = if rise_m > 0.0 { rise_m / near_m } else { rise_m / far_m };
        let (first_bin, bin_count) = if near_m > 0.0 {
            bins_of([(low_x, low_y), (high_x, low_y), (low_x, high_y), (high_x, high_y)])
        } else {
            (0, BINS)
        };
        let tangent = (tangent as f32).next_up();
        Some(Self { tangent, first_bin, bin_count, distance_m: near_m, edge_m: high[0] - low[0] })
    }

    fn bins(&self) -> impl Iterator<Item = usize> + use<> {
        let first = self.first_bin;
        (0..self.bin_count).map(move |i| (first + i) & (BINS - 1))
    }
}

/// The bins that a rectangle off the origin spans: the first, and how many.
fn bins_of(corners: [(f64, f64); 4]) -> (usize, usize) {
    let all = corners.map(|(x, y)| compass(x, y));
    // Off the origin the rectangle lies in a half plane, which is 2 wide: the directions unfold
    // around that of any corner.
    let mut low = 0.0_f64;
    let mut high = 0.0_f64;
    for at in all {
        let mut turn = at - all[0];
        if turn > 2.0 {
            turn -= 4.0;
        } else if turn < -2.0 {
            turn += 4.0;
        }
        low = low.min(turn);
        high = high.max(turn);
    }
    let scale = BINS as f64 / 4.0;
    let first = ((all[0] + low) * scale - 1e-6).floor();
    let last = ((all[0] + high) * scale + 1e-6).floor();
    let count = ((last - first) as usize + 1).min(BINS);
    (first.rem_euclid(BINS as f64) as usize, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_every_direction_of_a_rectangle() {
        for i in 0..360 {
            let angle = f64::from(i).to_radians();
            let (x, y) = (5.0 * libm::cos(angle), 5.0 * libm::sin(angle));
            let (a, b) = (f64::from(i % 7) * 0.5 + 0.01, f64::from(i % 5) * 0.4 + 0.01);
            let (first, count) =
                bins_of([(x - a, y - b), (x + a, y - b), (x - a, y + b), (x + a, y + b)]);
            for j in 0..100 {
                let (u, v) = (f64::from(j % 10) / 4.5 - 1.0, f64::from(j / 10) / 4.5 - 1.0);
                let bin = (compass(x + a * u, y + b * v) * BINS as f64 / 4.0) as usize % BINS;
                let from = (bin + BINS - first) % BINS;
                assert!(from < count, "rectangle {i}");
            }
        }
    }
}
