use glam::DVec3;

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
    fn hidden(&self, v: DVec3) -> f64 {
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Share of facets that both directions see.
    pub(super) fn seen_by_both(&self, incident: DVec3, out: DVec3) -> f64 {
        1.0 / (1.0 + self.hidden(incident) + self.hidden(out))
    }

    /// Share of the facets seen from `incident` that `out` sees as well; the survival of a
    /// direction drawn by [`Self::facet`].
    #[inline]
    pub(super) fn seen_back(&self, incident: DVec3, out: DVec3) -> f64 {
        let hidden = self.hidden(incident);
        (1.0 + hidden) / (1.0 + hidden + self.hidden(out))
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
}
