use glam::DVec3;

use super::Cone;
use super::circle::on_circle;

/// The GGX (Trowbridge-Reitz) microfacet distribution, isotropic, with Smith's height-correlated
/// masking and shadowing (Heitz 2014, "Understanding the masking-shadowing function", eq. 99).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ggx {
    /// Roughness alpha (not its root).
    pub alpha: f64,
}

impl Ggx {
    /// Density of facet normals, 1/sr.
    pub(super) fn density(&self, half: DVec3) -> f64 {
        if half.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        // sin^2 + alpha^2 cos^2 keeps its digits near the normal, where 1 - cos^2 would not.
        let root = half.x * half.x + half.y * half.y + a2 * half.z * half.z;
        a2 / (std::f64::consts::PI * root * root)
    }

    /// Smith's auxiliary function Lambda.
    #[inline]
    fn lambda(&self, v: DVec3) -> f64 {
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Share of facets that both directions see.
    pub(super) fn seen_by_both(&self, incident: DVec3, out: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(incident) + self.lambda(out))
    }

    /// Share of the facets seen from `incident` that `out` sees as well; the survival of a
    /// direction drawn by [`Self::facet`].
    #[inline]
    pub(super) fn seen_back(&self, incident: DVec3, out: DVec3) -> f64 {
        let lambda = self.lambda(incident);
        (1.0 + lambda) / (1.0 + lambda + self.lambda(out))
    }

    /// A facet normal from the distribution of those visible from `incident` (Heitz 2018,
    /// "Sampling the GGX distribution of visible normals"), drawn as a spherical cap (Dupuy and
    /// Benyoub 2023, "Sampling visible GGX normals with spherical caps": the same distribution,
    /// fewer operations).
    #[inline]
    pub(super) fn facet(&self, incident: DVec3, u: f64, v: f64) -> DVec3 {
        let a = self.alpha;
        let stretched = DVec3::new(incident.x * a, incident.y * a, incident.z).normalize();
        let (cos, sin) = on_circle(u);
        let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let half = DVec3::new(radius * cos, radius * sin, z) + stretched;
        // The cap's rim gives a zero vector once in 2^64 draws: the normal will do.
        DVec3::new(half.x * a, half.y * a, half.z.max(0.0)).try_normalize().unwrap_or(DVec3::Z)
    }

    /// Upper bound of [`Self::seen_back`] for incident cosines from `cos_incident` (above 0) and
    /// outgoing ones up to `cos_out`: it shrinks as either direction rises or the other falls.
    pub(super) fn seen_back_most(&self, cos_incident: f64, cos_out: f64) -> f64 {
        let lambda = |cos: f64| {
            let cos2 = (cos * cos).min(1.0);
            0.5 * ((1.0 + self.alpha * self.alpha * (1.0 - cos2) / cos2).sqrt() - 1.0)
        };
        let incident = lambda(cos_incident);
        (1.0 + incident) / (1.0 + incident + lambda(cos_out))
    }

    /// A cone that holds all facet normals that [`Self::facet`] draws from a rectangle of its two
    /// numbers, for every incident direction of a cone above the horizon: interval arithmetic over
    /// the steps of its computation.
    pub(super) fn facets_within(&self, u: [f64; 2], v: [f64; 2], from: &Cone) -> Cone {
        let a = self.alpha;
        let (low, high) = from.heights();
        let heights = [low.max(0.0), high];
        if high <= 0.0 {
            return Cone::ALL;
        }
        // The stretched direction: its length depends on the height alone.
        let lengths = heights.map(|z| (a * a + (1.0 - a * a) * z * z).sqrt());
        let up = [heights[0] / lengths[0], heights[1] / lengths[1]];
        let side = |centre: f64| {
            let (low, high) = (a * (centre - from.angle_rad), a * (centre + from.angle_rad));
            [
                if low < 0.0 { low / lengths[0] } else { low / lengths[1] },
                if high > 0.0 { high / lengths[0] } else { high / lengths[1] },
            ]
        };
        let (x, y) = (side(from.axis.x), side(from.axis.y));
        // The cap's point above the stretched direction, and its distance from the axis.
        let z = [1.0 - v[1] - v[1] * up[1], 1.0 - v[0] - v[0] * up[0]];
        let radius = |z: f64| (1.0 - z * z).max(0.0).sqrt();
        let radii = [
            radius(z[0]).min(radius(z[1])),
            if z[0] <= 0.0 && z[1] >= 0.0 { 1.0 } else { radius(z[0]).max(radius(z[1])) },
        ];
        let (cos, sin) = on_arc(u);
        let along = |unit: [f64; 2], offset: [f64; 2]| {
            let low = unit[0] * if unit[0] < 0.0 { radii[1] } else { radii[0] };
            let high = unit[1] * if unit[1] < 0.0 { radii[0] } else { radii[1] };
            [a * (low + offset[0]), a * (high + offset[1])]
        };
        let (x, y) = (along(cos, x), along(sin, y));
        let z = [(1.0 - v[1]) * (1.0 + up[0]), (1.0 - v[0]) * (1.0 + up[1])];
        Cone::of_box(DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]))
    }
}

/// Ranges of cosine and sine over an arc, in turns from 0 to 1.
fn on_arc(turns: [f64; 2]) -> ([f64; 2], [f64; 2]) {
    let ends = turns.map(on_circle);
    let inside = |at: f64| turns[0] <= at && at <= turns[1];
    let range = |a: f64, b: f64, low: bool, high: bool| {
        [if low { -1.0 } else { a.min(b) }, if high { 1.0 } else { a.max(b) }]
    };
    let cos = range(ends[0].0, ends[1].0, inside(0.5), inside(0.0) || inside(1.0));
    let sin = range(ends[0].1, ends[1].1, inside(0.75), inside(0.25));
    (cos, sin)
}
