//! Quadrature over a triangle of PV, and a cell as a receiver sees it.
//!
//! Whether a rule is good for a cell is known from one ratio, the cell's size beside the length over
//! which the integrand changes: its error was tabulated by trial for the integrand's shape, see
//! [`rule_error`].

use glam::{DVec3, Vec3};

use super::kernel::Point;
use super::lobe::{POINTS, Ways};
use super::receiver::ReceiverPoint;
use crate::base::MIN_COS;
use crate::bsdf::Cone;
use crate::render::reflect::facet::Facet;
use crate::render::reflect::pv::Cell;

/// Points of a rule on a triangle and their weights.
type Rule = &'static [([f64; 3], f64)];

const THIRD: f64 = 1.0 / 3.0;
/// The middle, of degree 1.
const ONE: Rule = &[([THIRD; 3], 1.0)];
/// Three points of degree 2 (Strang and Fix 1973).
const THREE: Rule = {
    const A: f64 = 2.0 / 3.0;
    const B: f64 = 1.0 / 6.0;
    &[([A, B, B], THIRD), ([B, A, B], THIRD), ([B, B, A], THIRD)]
};
/// Radon's rule, 7 points of degree 5 (1948).
const SEVEN: Rule = {
    const A: f64 = 0.470_142_064_105_115_1;
    const B: f64 = 0.101_286_507_323_456_34;
    const A1: f64 = 1.0 - 2.0 * A;
    const B1: f64 = 1.0 - 2.0 * B;
    const WA: f64 = 0.132_394_152_788_506_2;
    const WB: f64 = 0.125_939_180_544_827_15;
    &[
        ([THIRD; 3], 0.225),
        ([A1, A, A], WA),
        ([A, A1, A], WA),
        ([A, A, A1], WA),
        ([B1, B, B], WB),
        ([B, B1, B], WB),
        ([B, B, B1], WB),
    ]
};

/// The rules, from coarse to fine.
pub(super) const RULES: [Rule; 3] = [ONE, THREE, SEVEN];
/// Number of the finest.
pub(super) const FINEST: usize = 2;
/// Up to which ratio of a cell's radius to the length over which the integrand changes a rule is
/// good: to [`rule_error`] there, that is to 1e-3 and a little more.
pub(super) const GOOD: [f32; 3] = [0.025, 0.18, 0.6];

/// Bound of a rule's relative error on a cell of `ratio`. Found by trial, for `(d^2 + a^2)^-2` (the
/// lobe of GGX facets, and what distance does) on triangles of many shapes at all places about the
/// peak; the worst of 400 lies below by a fifth or more, the mean by four fifths.
#[inline]
pub(super) fn rule_error(rule: usize, ratio: f32) -> f32 {
    let squared = ratio * ratio;
    match rule {
        0 => 1.5 * squared,
        1 => 0.2 * squared * ratio,
        _ => 0.02 * squared * squared * ratio,
    }
}

/// A cell as a receiver sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// From its corners to the receiver, in the facet's frame, m.
    pub ways: [Vec3; 3],
    /// From its middle towards the receiver.
    pub out: Vec3,
    /// How far that direction moves to each corner, across the facet's normal.
    pub offs: [[f32; 2]; 3],
    /// How far it moves at most over the cell: across the facet's normal and along it.
    pub across: f32,
    pub along: f32,
    /// Its radius beside its distance.
    pub near: f32,
}

impl Look {
    pub(super) fn at(cell: &Cell, facet: &Facet, receiver: &ReceiverPoint) -> Self {
        let ways =
            cell.corners.map(|c| facet.frame.local_from_world(receiver.position - c).as_vec3());
        let way = (ways[0] + ways[1] + ways[2]) * (1.0 / 3.0);
        let out = way / way.length();
        let (mut across2, mut along, mut radius2_m2) = (0.0_f32, 0.0_f32, 0.0_f32);
        let mut nearest2_m2 = way.length_squared();
        let mut offs = [[0.0; 2]; 3];
        for (corner, to) in ways.into_iter().zip(&mut offs) {
            let length2_m2 = corner.length_squared();
            let off = corner / length2_m2.sqrt() - out;
            *to = [off.x, off.y];
            across2 = across2.max(off.x * off.x + off.y * off.y);
            along = along.max(off.z.abs());
            radius2_m2 = radius2_m2.max((corner - way).length_squared());
            nearest2_m2 = nearest2_m2.min(length2_m2);
        }
        let near = (radius2_m2 / nearest2_m2).sqrt();
        Self { ways, out, offs, across: across2.sqrt(), along, near }
    }

    /// A cone that holds the directions from all of the cell to the receiver.
    pub(super) fn outs(&self) -> Cone {
        let out = self.out.as_dvec3().normalize();
        let cos = |way: &Vec3| way.as_dvec3().normalize().dot(out);
        let least = self.ways.iter().map(cos).fold(1.0, f64::min);
        Cone::new(out, libm::acos(least.max(-1.0)))
    }

    /// The places of the finest rule, for the cell's share that is seen.
    pub(super) fn places(&self, area_m2: f64) -> Ways {
        let mut out = Ways::default();
        let [a, b, c] = self.ways;
        for (k, &([u, v, w], weight)) in SEVEN.iter().enumerate().take(POINTS) {
            let way = a * u as f32 + b * v as f32 + c * w as f32;
            (out.way[0][k], out.way[1][k], out.way[2][k]) = (way.x, way.y, way.z);
            out.area[k] = (weight * area_m2) as f32;
        }
        out
    }

    /// The points of a rule, each worth its part of the area that is seen.
    pub(super) fn points(
        cell: &Cell,
        facet: &Facet,
        receiver: &ReceiverPoint,
        rule: usize,
        area_m2: f64,
        into: &mut Vec<Point>,
    ) {
        let [a, b, c] = cell.corners;
        into.extend(RULES[rule].iter().filter_map(|&([u, v, w], weight)| {
            Self::point(a * u + b * v + c * w, weight * area_m2, facet, receiver)
        }));
    }

    /// A place of the PV that stands for some area; `None` where receiver and PV don't face each
    /// other.
    pub(super) fn point(
        place: DVec3,
        area_m2: f64,
        facet: &Facet,
        receiver: &ReceiverPoint,
    ) -> Option<Point> {
        let way = receiver.position - place;
        let away2_m2 = way.length_squared();
        let towards = way / away2_m2.sqrt();
        let out = facet.frame.local_from_world(towards);
        let cos = -receiver.normal.dot(towards);
        if out.z <= 0.0 || cos <= 0.0 {
            return None;
        }
        let solid_sr = area_m2 * out.z / away2_m2;
        let facing = cos / cos.max(f64::from(MIN_COS));
        Some(Point { out, surface: solid_sr * cos, normal: solid_sr * facing })
    }
}
