//! How a PV surface scatters towards an eye: its terms, the width of its lobe, and the same under a
//! sun, whose disc is integrated where that matters.

use std::sync::Arc;

use glam::DVec3;

use super::glint::{Glint, SunAt};
use super::shine::{Shine, Waiting};
use crate::base::Frame;
use crate::bsdf::{Bsdf, Cone, Term, on_circle};
use crate::render::reflect::disc::Disc;
use crate::render::reflect::sunlit::SunlitFile;
use crate::site::Site;

/// How a PV surface scatters, with the width of its lobe.
#[derive(Clone, Debug)]
pub struct EyeMaterial<'a> {
    bsdf: &'a Bsdf,
    terms: Arc<[Shine<'a>]>,
    /// Smallest alpha of its lobes of facets; infinite where there are none.
    alpha: f64,
    /// Whether some of it is measured, with jumps wherever they are.
    measured: bool,
}

/// Radius of the sun's disc beside the length over which a lobe changes: up to the first its middle
/// stands for it, with its second order (to 1e-3), up to the second four points (to 1e-3), beyond it
/// all.
const RATIOS: [f64; 2] = [0.14, 0.25];
/// The first for a sun so low that the second order doesn't do (to 5e-3), and how many radii over
/// the PV that is.
const LOW_RATIO: f64 = 0.05;
const LOW_RADII: f64 = 20.0;
/// Ways in which the disc is looked at.
pub(super) const WAYS: usize = 3;
/// Fresnel's reflectance changes its logarithm by up to that with a radian of tilt; with
/// what hides facets from one another, towards grazing angles, by up to the second.
const STEADY_PER_RAD: [f64; 2] = [6.0, 20.0];
/// Points of the sun's disc: on rings of equal area.
const RINGS: usize = 4;
const AROUND: usize = 8;

impl<'a> EyeMaterial<'a> {
    /// Finds the lobe's width.
    pub fn new(bsdf: &'a Bsdf) -> Self {
        let terms = bsdf.terms();
        let alphas = terms.iter().filter_map(|(_, term)| match term {
            Term::Lobe(term) => term.alpha(),
            Term::Even(_) | Term::Measured(_) => None,
        });
        let alpha = alphas.fold(f64::INFINITY, f64::min);
        let measured = terms.iter().any(|(_, term)| matches!(term, Term::Measured(_)));
        Self { bsdf, terms: Shine::terms(bsdf).into(), alpha, measured }
    }

    /// That of each PV surface; `bsdfs` by the entry of the project that selects it.
    pub fn by_surface(bsdfs: &'a [Bsdf], site: &Site) -> Vec<Self> {
        let each: Vec<Self> = bsdfs.iter().map(Self::new).collect();
        site.pv.iter().map(|surface| each[surface.entry].clone()).collect()
    }

    /// How many times brighter all that is neither mirrored nor measured may get, beside the sun's
    /// strength, while half vectors that are tilted by `tilt` at least turn by `turned`, rad. A lobe
    /// of facets goes with `(tilt^2 + alpha^2)^-2`: that grows fastest where it is already close.
    pub(super) fn growth(&self, tilt: f64, turned: f64) -> f64 {
        let alpha = self.alpha;
        let [fresnel, most] = STEADY_PER_RAD;
        let steady = libm::exp((1.0 / alpha).clamp(fresnel, most) * turned);
        if alpha.is_infinite() {
            return steady;
        }
        let alpha2 = alpha * alpha;
        let steepest = 0.5 * (turned + (turned * turned + 4.0 * alpha2).sqrt());
        let before = tilt.max(steepest);
        let after = before - turned;
        let ratio = (before * before + alpha2) / (after * after + alpha2);
        ratio * ratio * steady
    }

    /// Upper bound of the mean of `f cos_i` of what is measured, 1/sr, for suns anywhere in a cone and
    /// outgoing directions of another, in the frame of the PV.
    pub(super) fn most_measured(&self, suns: &Cone, outs: &Cone) -> f64 {
        let cos = suns.heights().1.max(0.0);
        self.terms.iter().fold(0.0, |sum, term| match term {
            Shine::Measured(measured, share) => {
                sum + share * cos * measured.most_between(suns, outs)
            }
            _ => sum,
        })
    }

    /// Half-width of its lobes of facets as tilts of half vectors, rad; 0 where it mirrors, infinite
    /// where it has none.
    pub fn width(&self) -> f64 {
        if self.bsdf.has_delta() { 0.0 } else { self.alpha }
    }

    /// Whether some of it is measured.
    pub(super) fn is_measured(&self) -> bool {
        self.measured
    }

    /// Whether some of it isn't.
    pub(super) fn is_modelled(&self) -> bool {
        !matches!(&*self.terms, [Shine::Measured(..)])
    }

    /// How it scatters.
    pub fn bsdf(&self) -> &'a Bsdf {
        self.bsdf
    }

    /// The same under a sun, whose direction is in the frame of the PV.
    pub fn under(&self, sun: &SunAt, to_sun: DVec3) -> UnderSun<'a> {
        let disc = Disc { radius_rad: sun.radius_rad() };
        let files = self.terms.iter().filter_map(|term| match term {
            Shine::Measured(measured, share) => {
                Some(SunlitFile::new(measured, *share, to_sun, &disc))
            }
            _ => None,
        });
        UnderSun { sun: *sun, to_sun, files: files.collect(), material: self.clone() }
    }
}

/// A material in the light of one sun.
#[derive(Debug)]
pub struct UnderSun<'a> {
    sun: SunAt,
    pub(super) to_sun: DVec3,
    /// What is measured of it.
    files: Vec<SunlitFile<'a>>,
    pub(super) material: EyeMaterial<'a>,
}

impl UnderSun<'_> {
    /// Radiance of a point of PV that the sun lights, W/m2/sr: the sun's disc is integrated where the
    /// lobe is narrow, and mirrored where the material mirrors. Direction in the PV's frame.
    pub fn radiance(&self, out: DVec3) -> f64 {
        let half = self.to_sun + out;
        let across = libm::hypot(half.x, half.y) / half.length().max(1e-12);
        let mut waiting = Waiting::default();
        let dark = Glint { towards: out, solid_angle_sr: 0.0, radiance_w_m2_sr: 0.0, surface: 0 };
        waiting.push(dark, out);
        let mut glints = Vec::new();
        self.light(self.way(half.length(), across), &mut waiting, &mut glints);
        glints.first().map_or(0.0, |glint| glint.radiance_w_m2_sr)
    }

    /// Mean over the disc of `f cos_i` of what is measured, 1/sr.
    pub(super) fn measured(&self, out: DVec3) -> f64 {
        self.files.iter().fold(0.0, |sum, file| sum + file.value(out))
    }

    /// Smallest and largest of these among the directions of a cone, or beyond.
    pub(super) fn measured_span(&self, out: &Cone) -> [f64; 2] {
        self.files.iter().fold([0.0; 2], |[low, high], file| {
            let [least, most] = file.span(out);
            [low + least, high + most]
        })
    }

    /// In which way the sun's disc is looked at from a patch: by the length of the sum of both
    /// directions and the tilt of the half vector.
    pub(super) fn way(&self, length: f64, tilt: f64) -> usize {
        let (radius, width) = (self.sun.radius_rad(), self.material.alpha);
        let [point, few] = RATIOS;
        let point = if self.to_sun.z > LOW_RADII * radius { point } else { LOW_RATIO };
        let ratio = radius / (length.max(0.2) * (width * width + tilt * tilt).sqrt());
        usize::from(ratio >= point) + usize::from(ratio >= few)
    }

    /// Radiances of the patches that wait for one way of looking at the sun's disc.
    pub(super) fn light(&self, way: usize, waiting: &mut Waiting, into: &mut Vec<Glint>) {
        let (sun, to_sun) = (&self.sun, self.to_sun);
        let radius = sun.radius_rad();
        let frame = Frame::around(to_sun);
        let around = |r: f64, from: f64, count: usize| {
            (0..count).map(move |i| {
                let (x, y) = on_circle((i as f64 + from) / count as f64);
                (frame.z + frame.x * (r * x) + frame.y * (r * y)).normalize()
            })
        };
        let places: Vec<DVec3> = match way {
            0 => vec![to_sun],
            1 => around(radius * std::f64::consts::FRAC_1_SQRT_2, 0.0, 4).collect(),
            _ => (0..RINGS)
                .flat_map(|ring| {
                    let r = radius * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
                    around(r, 0.5 * (ring % 2) as f64, AROUND)
                })
                .collect(),
        };
        // The mean square to each side is a quarter of the radius squared.
        let second = if way == 0 { radius * radius / 8.0 } else { 0.0 };
        let delta = self.material.bsdf.has_delta().then(|| self.material.bsdf.mirrored(to_sun));
        let edge = libm::cos(radius);
        let besides = |out: DVec3| {
            let mirrored = match delta {
                Some(share) if DVec3::new(-out.x, -out.y, out.z).dot(to_sun) > edge => {
                    share / sun.solid_angle_sr()
                }
                _ => 0.0,
            };
            mirrored + self.measured(out)
        };
        waiting.light(&self.material.terms, sun, (&places, second), &besides, into);
    }
}
