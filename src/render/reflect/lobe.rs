//! GGX facets over a ground in single precision, for many outgoing directions at once.

use std::f64::consts::PI;

use glam::DVec3;

use crate::bsdf::FacetTerm;

/// GGX facets over a ground.
#[derive(Debug)]
pub(in crate::render) struct FacetLobe {
    pub alpha: f64,
    share: f64,
    /// What a facet reflects, as a polynomial of `2 cos - 1`.
    reflectance: [f32; TERMS],
    /// The ground's factor at even steps of the cosine, straight in between.
    ground: Vec<f32>,
    /// Largest relative error of the reflectance.
    pub fit: f64,
}

/// Coefficients of a reflectance's polynomial.
const TERMS: usize = 15;
/// Steps of a ground's factor: good to 1e-5.
const STEPS: usize = 512;

/// Outgoing directions with what depends on them alone.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Outs<const N: usize> {
    pub x: [f32; N],
    pub y: [f32; N],
    pub z: [f32; N],
    /// Before the lobe.
    pub scale: [f32; N],
    /// Before the ground.
    pub ground: [f32; N],
    /// `1 + Lambda`.
    pub hidden: [f32; N],
}

impl FacetLobe {
    /// Of a term with a share of the area; `alpha` is the term's.
    pub(in crate::render) fn of(share: f64, alpha: f64, term: &FacetTerm<'_>) -> Self {
        let (reflectance, fit) = polynomial(&|cos| term.reflectance(cos));
        let step = 1.0 / STEPS as f64;
        let ground = (0..=STEPS).map(|i| term.ground(i as f64 * step) as f32).collect();
        Self { alpha, share, reflectance, ground, fit }
    }

    /// Smith's Lambda of GGX.
    pub(in crate::render) fn hidden(&self, v: DVec3) -> f32 {
        let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
        (0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)) as f32
    }

    /// What a facet reflects, by the squared length of the sum of both directions, which is twice
    /// the cosine on the facet.
    #[inline(always)]
    pub(in crate::render) fn reflected(&self, length2: f32) -> f32 {
        horner(&self.reflectance, length2.sqrt() - 1.0)
    }

    /// Unit vectors, all above the surface, with what depends on them alone.
    #[inline(always)]
    pub(in crate::render) fn outs<const N: usize>(&self, [x, y, z]: [[f32; N]; 3]) -> Outs<N> {
        let mut outs = Outs { x, y, z, scale: [0.0; N], ground: [0.0; N], hidden: [0.0; N] };
        let alpha2 = (self.alpha * self.alpha) as f32;
        let scale = (self.share * self.alpha * self.alpha * 0.25 / PI) as f32;
        for k in 0..N {
            let z = outs.z[k];
            let z2 = z * z;
            outs.hidden[k] = 0.5 + 0.5 * (1.0 + alpha2 * (1.0 - z2).max(0.0) / z2).sqrt();
            outs.scale[k] = scale / z;
            let at = z * STEPS as f32;
            let below = (at as usize).min(STEPS - 1);
            let [a, b] = [self.ground[below], self.ground[below + 1]];
            outs.ground[k] = a + (at - below as f32) * (b - a);
        }
        outs
    }

    /// Radiance towards one direction, W/m2/sr. `second`: halves of the mean
    /// squares of a part of the sun's disc, to the side and up, and the sun's `1 / (x^2 + y^2)`: the
    /// mean over a part of the sun's disc is the value at its middle plus half of the mean squares
    /// times the second derivatives. In the plane of the facet the lobe is a function of the half
    /// vector's shadow d, `(d^2 + alpha^2 h_z^2)^-2`, and the disc is shorter by `cos_i` along the
    /// sun's own shadow.
    #[inline(always)]
    pub(in crate::render) fn value<const N: usize>(
        &self,
        [x, y, z, strength, from, hidden]: [f32; 6],
        [side, up, steep]: [f32; 3],
        alpha2: f32,
        outs: &Outs<N>,
        p: usize,
    ) -> f32 {
        let (dx, dy, hz) = (x + outs.x[p], y + outs.y[p], z + outs.z[p]);
        let (across2, hz2) = (dx * dx + dy * dy, hz * hz);
        let length2 = across2 + hz2;
        // The half vector's length is twice the cosine on the facet.
        let mirrored = self.reflected(length2);
        let spread = across2 + alpha2 * hz2;
        let seen = outs.hidden[p] + hidden;
        let inverse = 1.0 / (spread * seen);
        let q = inverse * seen;
        let lobe = outs.scale[p] * (length2 * q) * (length2 * q) * (inverse * spread);
        let along = dx * x + dy * y;
        let up2 = along * along * steep;
        let bend =
            side * (24.0 * q * (across2 - up2) - 4.0) + up * (z * z) * (24.0 * q * up2 - 4.0);
        strength * lobe * (1.0 + q * bend) * mirrored + outs.ground[p] * from
    }
}

#[inline(always)]
fn horner(of: &[f32; TERMS], x: f32) -> f32 {
    let mut sum = of[TERMS - 1];
    for k in (0..TERMS - 1).rev() {
        sum = sum * x + of[k];
    }
    sum
}

/// A polynomial of `2 x - 1` through a function of 0..1 at Chebyshev's nodes, and its largest
/// relative error.
fn polynomial(of: &dyn Fn(f64) -> f64) -> ([f32; TERMS], f64) {
    let n = TERMS as f64;
    let node = |k: usize| libm::cos(PI * (k as f64 + 0.5) / n);
    let values: Vec<f64> = (0..TERMS).map(|k| of(0.5 * (node(k) + 1.0))).collect();
    // T_j as polynomials, one after the other.
    let mut before = [0.0; TERMS];
    let mut now = [0.0; TERMS];
    (before[0], now[1]) = (1.0, 1.0);
    let mut sum = [0.0; TERMS];
    for j in 0..TERMS {
        let angle = |k: usize| libm::cos(PI * j as f64 * (k as f64 + 0.5) / n);
        let c = values.iter().enumerate().map(|(k, v)| v * angle(k)).sum::<f64>() * 2.0 / n;
        let c = if j == 0 { 0.5 * c } else { c };
        for (s, t) in sum.iter_mut().zip(before) {
            *s += c * t;
        }
        let mut next = [0.0; TERMS];
        for k in 0..TERMS {
            next[k] = if k > 0 { 2.0 * now[k - 1] } else { 0.0 } - before[k];
        }
        (before, now) = (now, next);
    }
    let out = sum.map(|s| s as f32);
    let mut fit = 0.0_f64;
    for i in 0..=1000 {
        let x = f64::from(i) / 1000.0;
        let y = out.iter().rev().fold(0.0_f32, |y, c| y * (2.0 * x as f32 - 1.0) + c);
        let expected = of(x);
        fit = fit.max((f64::from(y) - expected).abs() / expected.max(1e-3));
    }
    (out, fit)
}
