//! GGX facets over a ground, for many suns or many places at once.

use super::kernel::{Point, Sums};
use super::suns::Suns;
use crate::base::MIN_COS;
use crate::render::reflect::disc::DiscPoint;
use crate::render::reflect::lobe::{FacetLobe, Outs};

/// A lobe with all that depends on the suns alone.
#[derive(Debug)]
pub(super) struct Lobe {
    pub shape: FacetLobe,
    /// By sun: `strength * cos * ground`.
    pub from: Vec<f32>,
    /// By sun: Smith's Lambda.
    pub hidden: Vec<f32>,
}

/// Places of the PV that stand for some area, as a receiver sees them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ways {
    /// From there to the receiver in the facet's frame, m.
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

/// Points of a rule, at most.
pub(super) const POINTS: usize = 8;

impl Lobe {
    /// Of a term with a share of the area. `from`: what enters the ground, by sun.
    pub(super) fn of(shape: FacetLobe, from: Vec<f32>, suns: &Suns) -> Self {
        let hidden = suns.direction.iter().map(|d| shape.hidden(*d)).collect();
        Self { shape, from, hidden }
    }

    /// Point by point, all suns at once: for few points and many suns.
    pub(super) fn add_suns(&self, points: &[Point], sums: &mut Sums) {
        for point in points {
            let out = point.out;
            let out = self.shape.outs([[out.x as f32], [out.y as f32], [out.z as f32]]);
            let worth = [point.surface as f32, point.normal as f32];
            pulp::Arch::new().dispatch(One { lobe: self, out: &out, worth, sums });
        }
    }

    /// Sun by sun, all points at once: for few suns, and for discs, which are `places`.
    /// `toward`: the receiver's normal, turned over, in the facet's frame.
    pub(super) fn add_points(
        &self,
        (ways, toward): (&Ways, [f32; 3]),
        suns: &Suns,
        list: &[u32],
        places: &[DiscPoint],
        into: &mut Sums,
    ) {
        into.clear(list.len());
        let lobe = self;
        pulp::Arch::new().dispatch(Eight { lobe, ways, toward, suns, list, places, into });
    }

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
        let mirrored = self.shape.reflected(length2);
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
    worth: [f32; 2],
    sums: &'a mut Sums,
}

impl pulp::NullaryFnOnce for One<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lobe, out, worth, sums } = self;
        let Sums { surface, normal, gathered } = sums;
        let n = surface.len();
        let (x, y, z) = (&gathered.x[..n], &gathered.y[..n], &gathered.z[..n]);
        let (strength, from, hidden) =
            (&gathered.strength[..n], &gathered.from[..n], &gathered.hidden[..n]);
        let (surface, normal) = (&mut surface[..n], &mut normal[..n]);
        let alpha2 = (lobe.shape.alpha * lobe.shape.alpha) as f32;
        for i in 0..n {
            let sun = [x[i], y[i], z[i], strength[i], from[i], hidden[i]];
            let value = lobe.shape.value(sun, [0.0; 3], alpha2, out, 0);
            surface[i] += worth[0] * value;
            normal[i] += worth[1] * value;
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
    places: &'a [DiscPoint],
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
        let outs = lobe.shape.outs([x, y, z]);
        let alpha2 = (lobe.shape.alpha * lobe.shape.alpha) as f32;
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
                        *sum +=
                            place.share * lobe.chord(sun, up, lobe.shape.alpha as f32, &outs, p);
                    }
                    continue;
                }
                let second = [place.second[0], place.second[1], suns.steep[i]];
                for (p, sum) in sums.iter_mut().enumerate() {
                    *sum += place.share * lobe.shape.value(sun, second, alpha2, &outs, p);
                }
            }
            into.surface[k] = dot(&sums, &surface);
            into.normal[k] = dot(&sums, &normal);
        }
    }
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
