//! Radiances of many patches of PV at once.

use glam::DVec3;

use super::glint::{Glint, SunAt};
use crate::bsdf::{Bsdf, FacetTerm, Measured, Term};
use crate::render::reflect::lobe::FacetLobe;

/// Patches that are evaluated at once.
const LANES: usize = 8;

/// A term of a scattering function, ready for many outgoing directions.
#[derive(Debug)]
pub(super) enum Shine<'a> {
    /// The same everywhere, 1/sr.
    Even(f64),
    /// A ground below a smooth front; the factor before it, 1/sr.
    Ground(FacetTerm<'a>, f64),
    /// Facets over a ground; the factor before the ground, 1/sr.
    Lobe(Box<FacetLobe>, FacetTerm<'a>, f64),
    /// Values of a file, and the share of the area.
    Measured(&'a Measured, f64),
}

impl<'a> Shine<'a> {
    /// The terms of a scattering function without its delta lobes.
    pub(super) fn terms(bsdf: &'a Bsdf) -> Vec<Self> {
        let of = |(share, term)| match term {
            Term::Even(per_sr) => Self::Even(share * per_sr),
            Term::Measured(measured) => Self::Measured(measured, share),
            Term::Lobe(term) => {
                let ground = share * term.ground_per_sr();
                match term.alpha() {
                    None => Self::Ground(term, ground),
                    Some(alpha) => {
                        Self::Lobe(Box::new(FacetLobe::of(share, alpha, &term)), term, ground)
                    }
                }
            }
        };
        bsdf.terms().into_iter().map(of).collect()
    }

    /// Adds the mean of `f cos_i` over places of the sun's disc, 1/sr, for each outgoing direction, of
    /// what is modelled.
    /// `second`: half of the mean square of the disc's radius to each side, where its middle stands
    /// for all of it, rad2.
    pub(super) fn add(&self, places: &[DVec3], second: f64, outs: &[DVec3], into: &mut [f64]) {
        let above = || places.iter().filter(|s| s.z > 0.0);
        let mean = |of: &dyn Fn(&DVec3) -> f64| above().map(of).sum::<f64>() / places.len() as f64;
        match self {
            Self::Even(per_sr) => {
                let value = mean(&|s| s.z) * per_sr;
                into.iter_mut().for_each(|sum| *sum += value);
            }
            Self::Ground(term, factor) => {
                let entering = mean(&|s| s.z * term.ground(s.z)) * factor;
                for (sum, out) in into.iter_mut().zip(outs) {
                    *sum += entering * term.ground(out.z);
                }
            }
            // Its disc is cut, see `SunlitFile`.
            Self::Measured(..) => {}
            Self::Lobe(lobe, term, ground) => {
                let sun = |s: &DVec3| {
                    let from = (s.z * term.ground(s.z) * ground) as f32;
                    [s.x as f32, s.y as f32, s.z as f32, 1.0, from, lobe.hidden(*s)]
                };
                let suns: Vec<[f32; 6]> = above().map(sun).collect();
                let share = 1.0 / places.len() as f32;
                let second = second as f32;
                pulp::Arch::new().dispatch(Many { lobe, suns: &suns, second, share, outs, into });
            }
        }
    }
}

/// [`Shine::add`] for facets. A type of its own, not a closure, which would be compiled for the
/// oldest processor.
struct Many<'a> {
    lobe: &'a FacetLobe,
    suns: &'a [[f32; 6]],
    second: f32,
    share: f32,
    outs: &'a [DVec3],
    into: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Many<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { lobe, suns, second, share, outs, into } = self;
        let alpha2 = (lobe.alpha * lobe.alpha) as f32;
        for (outs, into) in outs.chunks(LANES).zip(into.chunks_mut(LANES)) {
            // What is left over looks along the normal, and isn't asked.
            let [mut x, mut y, mut z] = [[0.0; LANES], [0.0; LANES], [1.0; LANES]];
            for (p, out) in outs.iter().enumerate() {
                (x[p], y[p], z[p]) = (out.x as f32, out.y as f32, (out.z as f32).max(1e-5));
            }
            let lanes = lobe.outs([x, y, z]);
            let mut sums = [0.0; LANES];
            for sun in suns {
                let steep = 1.0 / (sun[0] * sun[0] + sun[1] * sun[1]).max(1e-9);
                for (p, sum) in sums.iter_mut().enumerate() {
                    *sum += lobe.value(*sun, [second, second, steep], alpha2, &lanes, p);
                }
            }
            for (sum, value) in into.iter_mut().zip(sums) {
                *sum += f64::from(share * value);
            }
        }
    }
}

/// Patches that wait for their radiance.
#[derive(Debug, Default)]
pub(super) struct Waiting {
    glints: Vec<Glint>,
    /// Towards the eye, in the frame of the PV.
    outs: Vec<DVec3>,
    values: Vec<f64>,
}

impl Waiting {
    /// A patch, dark as yet, and the direction from it to the eye in the frame of the PV.
    pub(super) fn push(&mut self, glint: Glint, out: DVec3) {
        self.glints.push(glint);
        self.outs.push(out);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.glints.is_empty()
    }

    /// Hands on those that shine, and is empty then. `besides`: what delta lobes and files send to a
    /// direction, 1/sr.
    pub(super) fn light(
        &mut self,
        terms: &[Shine<'_>],
        sun: &SunAt,
        (places, second): (&[DVec3], f64),
        besides: &dyn Fn(DVec3) -> f64,
        into: &mut Vec<Glint>,
    ) {
        self.values.clear();
        self.values.resize(self.outs.len(), 0.0);
        for term in terms {
            term.add(places, second, &self.outs, &mut self.values);
        }
        for ((glint, out), value) in self.glints.drain(..).zip(&self.outs).zip(&self.values) {
            let radiance_w_m2_sr = sun.irradiance_w_m2 * (value + besides(*out));
            if radiance_w_m2_sr > 0.0 {
                into.push(Glint { radiance_w_m2_sr, ..glint });
            }
        }
        self.outs.clear();
    }
}
