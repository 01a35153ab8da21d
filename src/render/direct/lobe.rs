//! GGX facets over a ground, for many suns or many places at once.

use std::f64::consts::PI;

use glam::DVec3;

use super::kernel::{Point, Sums};
use super::suns::Suns;
use crate::render::MIN_COS;
use crate::site::bsdf::FacetTerm;

/// GGX facets over a ground.
#[derive(Debug)]
pub(super) struct Lobe {
    pub alpha: f64,
    share: f64,
    /// What a facet reflects, as a polynomial of `2 cos - 1`.
    reflectance: [f32; TERMS],
    /// The ground's factor at even steps of the cosine, straight in between.
    ground: Vec<f32>,
    /// Largest relative error of the reflectance.
    pub fit: f64,
    /// By sun: `strength * cos * ground`.
    pub from: Vec<f32>,
    /// By sun: Smith's Lambda.
    pub hidden: Vec<f32>,
}

/// Coefficients of a reflectance's polynomial.
const TERMS: usize = 15;
/// Steps of a ground's factor: good to 1e-5.
const STEPS: usize = 512;

/// Smith's Lambda of GGX.
fn hidden(v: DVec3, alpha: f64) -> f64 {
    let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

/// Places of the PV that stand for some area, as a spot sees them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ways {
    /// From there to the spot in the facet's frame, m.
    pub way: [[f32; POINTS]; 3],
    /// Area, m2.
    pub area: [f32; POINTS],
}

impl Default for Ways {
    fn default() -> Self {
        // Of no weight, but no division by 0 either.
        Self { way: [[0.0; POINTS], [0.0; POINTS], [1.0; POINTS]], area: [0.0; POINTS] }
    }
}

/// A point of the sun's disc.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// In the sun's frame: to the side, up, and along.
    pub at: [f32; 3],
    /// Share of the disc.
    pub share: f32,
    /// Halves of the mean squares of the rest of the disc around it, to the side and up: the
    /// second order of its mean.
    pub second: [f32; 2],
    /// Half of the height of the chord that it stands for, rad: over that the lobe's mean is exact.
    /// 0 for a point.
    pub chord: f32,
}

/// Outgoing directions with what depends on them alone.
#[derive(Clone, Copy, Debug)]
struct Outs<const N: usize> {
    x: [f32; N],
    y: [f32; N],
    z: [f32; N],
    /// Before the lobe.
    scale: [f32; N],
    /// Before the ground.
    ground: [f32; N],
    /// `1 + Lambda`.
    hidden: [f32; N],
    surface: [f32; N],
    normal: [f32; N],
}

/// Points of a rule, at most.
pub(super) const POINTS: usize = 8;

impl Lobe {
    /// Of a term with a share of the area. `from`: what enters the ground, by sun.
    pub(super) fn of(
        share: f64,
        alpha: f64,
        term: &FacetTerm<'_>,
        from: Vec<f32>,
        suns: &Suns,
    ) -> Self {
        let (reflectance, fit) = polynomial(&|cos| term.reflectance(cos));
        let step = 1.0 / STEPS as f64;
        let ground = (0..=STEPS).map(|i| term.ground(i as f64 * step) as f32).collect();
        let hidden = suns.direction.iter().map(|d| hidden(*d, alpha) as f32).collect();
        Self { alpha, share, reflectance, ground, fit, from, hidden }
    }

    /// Point by point, all suns at once: for few points and many suns.
    pub(super) fn add_suns(&self, points: &[Point], sums: &mut Sums) {
        for point in points {
            let out = point.out;
            let mut outs = Outs {
                x: [out.x as f32],
                y: [out.y as f32],
                z: [out.z as f32],
                scale: [0.0],
                ground: [0.0],
                hidden: [0.0],
                surface: [point.surface as f32],
                normal: [point.normal as f32],
            };
            self.prepare(&mut outs);
            pulp::Arch::new().dispatch(One { lobe: self, out: &outs, sums });
        }
    }

    #[inline(always)]
    fn prepare<const N: usize>(&self, outs: &mut Outs<N>) {
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
    }

    /// Sun by sun, all points at once: for few suns, and for discs, which are `places`.
    /// `toward`: the spot's normal, turned over, in the facet's frame.
    pub(super) fn add_points(
        &self,
        (ways, toward): (&Ways, [f32; 3]),
        suns: &Suns,
        list: &[u32],
        places: &[Place],
        into: &mut Sums,
    ) {
        into.clear(list.len());
        let lobe = self;
        pulp::Arch::new().dispatch(Eight { lobe, ways, toward, suns, list, places, into });
    }

    /// Radiance towards one direction, W/m2/sr. `second`: see [`Place`], and [`Suns::steep`]: the
    /// mean over a part of the sun's disc is the value at its middle plus half of the mean squares
    /// times the second derivatives. In the plane of the facet the lobe is a function of the half
    /// vector's shadow d, `(d^2 + alpha^2 h_z^2)^-2`, and the disc is shorter by `cos_i` along the
    /// sun's own shadow.
    #[inline(always)]
    fn value<const N: usize>(
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
        let mirrored = horner(&self.reflectance, length2.sqrt() - 1.0);
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

impl Lobe {
    /// Radiance towards one direction, W/m2/sr, of a chord of the disc that reaches `half` to both
    /// sides along `up`. Along it the lobe is `1 / q^2` of a square polynomial q, whose
    /// integral is known; all else is taken at the mean place, and the length's fourth power to
    /// second order.
    #[inline(always)]
    fn chord<const N: usize>(
        &self,
        [x, y, z, strength, from, hidden]: [f32; 6],
        (up, half): ([f32; 3], f32),
        alpha: f32,
        outs: &Outs<N>,
        p: usize,
    ) -> f32 {
        let (dx, dy, hz) = (x + outs.x[p], y + outs.y[p], z + outs.z[p]);
        let [a, b, c] = [dx, dy, alpha * hz];
        let [u, v, w] = [up[0], up[1], alpha * up[2]];
        // q = steep * ((t + middle)^2 + least)
        let inverse = 1.0 / (u * u + v * v + w * w);
        let middle = (a * u + b * v + c * w) * inverse;
        let [i, j, k] = [b * w - c * v, c * u - a * w, a * v - b * u];
        let least = (i * i + j * j + k * k) * (inverse * inverse);
        let root = 1.0 / least.max(1e-14).sqrt();
        let [low, high] = [(middle - half) * root, (middle + half) * root];
        let (near, far) = (1.0 / (1.0 + low * low), 1.0 / (1.0 + high * high));
        let turn = arc_tangent(high) - arc_tangent(low);
        let (all, rest) = (high * far - low * near, 1.0 / root);
        let under = turn + all;
        let sum = under * (root * root * root) * (inverse * inverse);
        // Mean and variance of the place under `1 / q^2`.
        let mean = (near - far) / under;
        let spread = ((turn - all) / under - mean * mean).max(0.0) * (rest * rest);
        let at = mean * rest - middle;
        let (dx, dy, hz) = (dx + at * up[0], dy + at * up[1], hz + at * up[2]);
        let length2 = dx * dx + dy * dy + hz * hz;
        let slope = 2.0 * (dx * up[0] + dy * up[1] + hz * up[2]);
        let fourth = length2 * length2 + spread * (slope * slope + 2.0 * length2);
        let mirrored = horner(&self.reflectance, length2.sqrt() - 1.0);
        let lobe = outs.scale[p] * fourth * sum / (4.0 * half);
        strength * lobe * mirrored / (outs.hidden[p] + hidden) + outs.ground[p] * from
    }
}

/// Good to 1e-7 (Hastings; Abramowitz and Stegun 4.4.49).
#[inline(always)]
fn arc_tangent(t: f32) -> f32 {
    const TERMS: [f32; 9] = [
        1.0,
        -0.333_331_45,
        0.199_935_51,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_613,
        -0.016_165_737,
        0.002_866_225_7,
    ];
    let far = t.abs() > 1.0;
    let x = if far { 1.0 / t } else { t };
    let x2 = x * x;
    let mut sum = TERMS[8];
    for k in (0..8).rev() {
        sum = sum * x2 + TERMS[k];
    }
    let near = sum * x;
    if far { std::f32::consts::FRAC_PI_2.copysign(t) - near } else { near }
}

/// [`Lobe::add_suns`] for one point. Types of their own, not closures, which would be compiled for
/// the oldest processor.
struct One<'a> {
    lobe: &'a Lobe,
    out: &'a Outs<1>,
    sums: &'a mut Sums,
}

impl pulp::NullaryFnOnce for One<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lobe, out, sums } = self;
        let Sums { surface, normal, gathered } = sums;
        let n = surface.len();
        let (x, y, z) = (&gathered.x[..n], &gathered.y[..n], &gathered.z[..n]);
        let (strength, from, hidden) =
            (&gathered.strength[..n], &gathered.from[..n], &gathered.hidden[..n]);
        let (surface, normal) = (&mut surface[..n], &mut normal[..n]);
        let alpha2 = (lobe.alpha * lobe.alpha) as f32;
        for i in 0..n {
            let sun = [x[i], y[i], z[i], strength[i], from[i], hidden[i]];
            let value = lobe.value(sun, [0.0; 3], alpha2, out, 0);
            surface[i] += out.surface[0] * value;
            normal[i] += out.normal[0] * value;
        }
    }
}

/// [`Lobe::add_points`].
struct Eight<'a> {
    lobe: &'a Lobe,
    ways: &'a Ways,
    toward: [f32; 3],
    suns: &'a Suns,
    list: &'a [u32],
    places: &'a [Place],
    into: &'a mut Sums,
}

impl pulp::NullaryFnOnce for Eight<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lobe, ways, toward, suns, list, places, into } = self;
        let [mut x, mut y, mut z, mut surface, mut normal] = [[0.0; POINTS]; 5];
        for k in 0..POINTS {
            let [a, b, c] = [ways.way[0][k], ways.way[1][k], ways.way[2][k]];
            let away2 = a * a + b * b + c * c;
            let inverse = 1.0 / away2.sqrt();
            (x[k], y[k], z[k]) = (a * inverse, b * inverse, (c * inverse).max(1e-5));
            let cos = (toward[0] * a + toward[1] * b + toward[2] * c) * inverse;
            let cos = if c > 0.0 { cos.max(0.0) } else { 0.0 };
            let solid = ways.area[k] * z[k] / away2;
            surface[k] = solid * cos;
            normal[k] = solid * (cos / cos.max(MIN_COS));
        }
        let empty = [0.0; POINTS];
        let mut outs =
            Outs { x, y, z, scale: empty, ground: empty, hidden: empty, surface, normal };
        lobe.prepare(&mut outs);
        let alpha2 = (lobe.alpha * lobe.alpha) as f32;
        for (k, &i) in list.iter().enumerate() {
            let i = i as usize;
            let across = suns.across[i];
            let mut sums = [0.0; POINTS];
            for place in places {
                let [u, v, w] = place.at;
                let sun = [
                    suns.x[i] * w + across[0] * u + across[3] * v,
                    suns.y[i] * w + across[1] * u + across[4] * v,
                    suns.z[i] * w + across[2] * u + across[5] * v,
                    suns.strength[i],
                    lobe.from[i],
                    lobe.hidden[i],
                ];
                if place.chord > 0.0 {
                    let up = ([across[3], across[4], across[5]], place.chord);
                    for (p, sum) in sums.iter_mut().enumerate() {
                        *sum += place.share * lobe.chord(sun, up, lobe.alpha as f32, &outs, p);
                    }
                    continue;
                }
                let second = [place.second[0], place.second[1], suns.steep[i]];
                for (p, sum) in sums.iter_mut().enumerate() {
                    *sum += place.share * lobe.value(sun, second, alpha2, &outs, p);
                }
            }
            into.surface[k] = dot(&sums, &outs.surface);
            into.normal[k] = dot(&sums, &outs.normal);
        }
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

#[inline(always)]
fn dot(a: &[f32; POINTS], b: &[f32; POINTS]) -> f32 {
    let mut products = [0.0; POINTS];
    for k in 0..POINTS {
        products[k] = a[k] * b[k];
    }
    let [a, b, c, d, e, f, g, h] = products;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
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
