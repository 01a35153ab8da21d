use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use crate::site::bsdf::{Bsdf, fresnel_reflectance};

/// Suns as they stand in a facet's frame, one array for each number.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    /// Which sun: an index into the timeline.
    pub step: Vec<u32>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub z: Vec<f64>,
    /// Direct normal irradiance, W/m2.
    pub strength: Vec<f64>,
    /// Share of the light that enters the glass.
    pub entering: Vec<f64>,
    /// Smith's Lambda of the sun.
    pub hidden: Vec<f64>,
}

impl Batch {
    pub(super) fn len(&self) -> usize {
        self.step.len()
    }

    pub(super) fn clear(&mut self) {
        self.step.clear();
        for list in self.lists() {
            list.clear();
        }
    }

    fn lists(&mut self) -> [&mut Vec<f64>; 6] {
        [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.strength,
            &mut self.entering,
            &mut self.hidden,
        ]
    }

    pub(super) fn sun(&self, i: usize) -> DVec3 {
        DVec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub(super) fn push(&mut self, step: u32, sun: DVec3, strength: f64, kernel: &Kernel<'_>) {
        let (entering, hidden) = kernel.of_direction(sun);
        self.push_known(step, sun, strength, entering, hidden);
    }

    /// The i-th sun of another batch.
    pub(super) fn push_from(&mut self, other: &Self, i: usize) {
        self.push_known(
            other.step[i],
            other.sun(i),
            other.strength[i],
            other.entering[i],
            other.hidden[i],
        );
    }

    fn push_known(&mut self, step: u32, sun: DVec3, strength: f64, entering: f64, hidden: f64) {
        self.step.push(step);
        let values = [sun.x, sun.y, sun.z, strength, entering, hidden];
        for (list, value) in self.lists().into_iter().zip(values) {
            list.push(value);
        }
    }
}

/// How a facet scatters, in the form that is evaluated for many suns at once.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel<'a> {
    /// The same radiance everywhere; 1/sr.
    Even(f64),
    /// A rough dielectric over a diffuse cell: `PvGlass`, the same formula.
    Glossy { index: f64, alpha: f64, diffuse: f64 },
    /// Anything else, one sun after the other.
    Any(&'a Bsdf),
}

/// Lobes of files are taken to be at least this wide, rad: their cells span a degree or more.
const MEASURED_WIDTH: f64 = 0.03;

impl<'a> Kernel<'a> {
    pub(super) fn of(bsdf: &'a Bsdf) -> Self {
        match bsdf {
            Bsdf::Lambertian { reflectance } => Self::Even(reflectance * FRAC_1_PI),
            Bsdf::PvGlass(glass) => {
                let (index, alpha, diffuse) = glass.parts();
                Self::Glossy { index, alpha, diffuse }
            }
            other => Self::Any(other),
        }
    }

    /// Half-width of the lobe as tilts of its half vectors, rad; infinite where there is none.
    pub(super) fn width(&self) -> f64 {
        match self {
            Self::Even(_) => f64::INFINITY,
            Self::Glossy { alpha, .. } => *alpha,
            Self::Any(_) => MEASURED_WIDTH,
        }
    }

    /// What depends on one direction alone: the share of light that passes the interface, and
    /// Smith's Lambda.
    #[inline]
    fn of_direction(&self, v: DVec3) -> (f64, f64) {
        match self {
            Self::Glossy { index, alpha, .. } if v.z > 0.0 => {
                let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
                let hidden = 0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0);
                (1.0 - fresnel_reflectance(v.z, *index), hidden)
            }
            _ => (0.0, 0.0),
        }
    }

    /// Radiance towards `out` (in the facet's frame) from each sun, W/m2/sr:
    /// `f * cos_i * strength`. Element by element, so that it doesn't depend on how many are
    /// computed at once.
    pub(super) fn radiance(&self, suns: &Batch, out: DVec3, into: &mut [f64]) {
        match *self {
            Self::Even(f) => {
                for (i, value) in into.iter_mut().enumerate() {
                    *value = f * suns.z[i].max(0.0) * suns.strength[i];
                }
            }
            Self::Any(bsdf) => {
                for (i, value) in into.iter_mut().enumerate() {
                    let sun = suns.sun(i);
                    *value = bsdf.evaluate(sun, out) * sun.z.max(0.0) * suns.strength[i];
                }
            }
            Self::Glossy { index, alpha, diffuse } => {
                let (leaving, hidden) = self.of_direction(out);
                let glossy = Glossy {
                    out,
                    index,
                    alpha2: alpha * alpha,
                    lobe: 0.25 / (PI * out.z),
                    base: diffuse * leaving * FRAC_1_PI,
                    hidden: 1.0 + hidden,
                };
                pulp::Arch::new().dispatch(|| glossy.all(suns, into));
            }
        }
    }
}

/// [`Kernel::Glossy`] for one outgoing direction.
struct Glossy {
    out: DVec3,
    index: f64,
    alpha2: f64,
    lobe: f64,
    base: f64,
    hidden: f64,
}

impl Glossy {
    #[inline(always)]
    fn all(&self, suns: &Batch, into: &mut [f64]) {
        let n = into.len();
        let (x, y, z) = (&suns.x[..n], &suns.y[..n], &suns.z[..n]);
        let (strength, entering, hidden) =
            (&suns.strength[..n], &suns.entering[..n], &suns.hidden[..n]);
        let squared = self.index * self.index;
        for i in 0..n {
            let (hx, hy, hz) = (x[i] + self.out.x, y[i] + self.out.y, z[i] + self.out.z);
            let across2 = hx * hx + hy * hy;
            let length2 = across2 + hz * hz;
            let spread = across2 + self.alpha2 * (hz * hz);
            let density = self.alpha2 * (length2 * length2) / (spread * spread);
            let c = 0.5 * length2.sqrt();
            let inside = (1.0 - (1.0 - c * c) / squared).max(0.0).sqrt();
            let across = (c - self.index * inside) / (c + self.index * inside);
            let parallel = (self.index * c - inside) / (self.index * c + inside);
            let mirrored = 0.5 * (across * across + parallel * parallel);
            let lobe = self.lobe * density * mirrored / (self.hidden + hidden[i]);
            let value = strength[i] * (lobe + self.base * entering[i] * z[i]);
            into[i] = if z[i] > 0.0 { value } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};
    use crate::site::bsdf::{Model, on_hemisphere};

    #[test]
    fn many_at_once_are_what_one_at_a_time_is() {
        for alpha in [0.005, 0.05, 0.4] {
            let model = Model::PvGlass { index: 1.52, ggx_alpha: alpha, cell_reflectance: 0.04 };
            let bsdf = Bsdf::from_model(&model).expect("valid");
            let kernel = Kernel::of(&bsdf);
            let mut random = Stream::new(1, Purpose::Survey, 0);
            let mut suns = Batch::default();
            for step in 0..1000 {
                let sun = on_hemisphere(random.uniform(), random.uniform());
                suns.push(step, sun, 700.0, &kernel);
            }
            let mut values = vec![0.0; suns.len()];
            for i in 0..100 {
                // Half of them close to the mirrored direction of some sun.
                let out = if i % 2 == 0 {
                    on_hemisphere(random.uniform(), random.uniform())
                } else {
                    let s = suns.sun(i);
                    (DVec3::new(-s.x, -s.y, s.z) + DVec3::X * 0.01).normalize()
                };
                kernel.radiance(&suns, out, &mut values);
                for (j, value) in values.iter().enumerate() {
                    let sun = suns.sun(j);
                    let slow = bsdf.evaluate(sun, out) * sun.z * 700.0;
                    assert!((value - slow).abs() <= 1e-9 * slow, "{value} {slow}");
                }
            }
        }
    }
}
