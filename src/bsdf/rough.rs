//! Facets square by square: where a square of the numbers that draw a facet sends light, and how
//! much at most. See [`Bsdf::density`](super::Bsdf::density).

use std::f64::consts::PI;

use glam::DVec3;

use super::Cone;
use super::ggx::Ggx;
use super::interface::Interface;
use super::square::Square;

/// Directions that facets of a cone reflect light from another one into. Turning a facet turns
/// the reflection by twice the angle at most; turning the incident direction, by as much.
fn mirrored(facets: &Cone, from: &Cone) -> Cone {
    let (half, light) = (facets.axis, from.axis);
    let angle_rad = 2.0 * facets.angle_rad + from.angle_rad;
    Cone::new((half * (2.0 * half.dot(light)) - light).normalize(), angle_rad)
}

/// Direction and density at a point of the facets' square; `None` where it is below `least`.
#[inline]
pub(super) fn density(
    ggx: Ggx,
    reflects: &Interface,
    incident: DVec3,
    (u, v): (f64, f64),
    least: f64,
) -> Option<(DVec3, f64)> {
    let half = ggx.facet(incident, u, v);
    let cos = incident.dot(half);
    let out = half * (2.0 * cos) - incident;
    if out.z <= 0.0 {
        return None;
    }
    let value = reflects.at(cos);
    if value <= least {
        return None;
    }
    Some((out.normalize(), value * ggx.seen_back(incident, out)))
}

fn facets_within(ggx: Ggx, square: Square, from: &Cone) -> Cone {
    let (low, high) = square.corners();
    ggx.facets_within([low[0], high[0]], [low[1], high[1]], from)
}

/// A cone that holds every direction of a square, for every incident direction of `from`.
pub(super) fn reach(ggx: Ggx, square: Square, from: &Cone) -> Cone {
    mirrored(&facets_within(ggx, square, from), from)
}

/// Upper bound of the density in a square: of what its facets reflect, and of how they are seen
/// back: the more upright a direction is, the more facets see it.
pub(super) fn most(ggx: Ggx, reflects: &Interface, square: Square, from: &Cone) -> f64 {
    let facets = facets_within(ggx, square, from);
    let out = mirrored(&facets, from).heights().1;
    if out <= 0.0 {
        return 0.0;
    }
    let between = libm::acos(facets.axis.dot(from.axis).clamp(-1.0, 1.0));
    let around = facets.angle_rad + from.angle_rad;
    let cos = |angle: f64| libm::cos(angle.clamp(0.0, 0.5 * PI)).max(0.0);
    let low = from.heights().0;
    // No facet that reflects upwards is met at a larger angle.
    let value = reflects
        .most(cos(between + around), cos(between - around))
        .min(reflects.facet_bound(low.max(0.0)));
    value * if low > 0.0 { ggx.seen_back_most(low, out) } else { 1.0 }
}

/// Cosines of the directions in a square of [`Chart::Hemisphere`](super::Chart::Hemisphere).
pub(super) fn cosines(square: Square) -> (f64, f64) {
    let (low, high) = square.corners();
    ((1.0 - high[0]).max(0.0).sqrt(), (1.0 - low[0]).sqrt())
}
