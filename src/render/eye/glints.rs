use std::f64::consts::PI;

use glam::DVec3;

use super::patches::{EyePv, LitPv, Patch, Root, Seen};
use crate::base::Frame;
use crate::site::bsdf::{Bsdf, Term, on_circle};

/// A patch of PV that shines at an eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glint {
    /// Unit vector from the eye to it.
    pub towards: DVec3,
    /// How large it looks: the part that is in sight and lit, sr.
    pub solid_angle_sr: f64,
    /// How bright it is, W/m2/sr.
    pub radiance_w_m2_sr: f64,
    /// Number of the PV surface.
    pub surface: u16,
}

/// A sun as an eye's PV mirrors it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunAt {
    /// Unit vector to its centre.
    pub direction: DVec3,
    /// Direct normal irradiance, W/m2.
    pub irradiance_w_m2: f64,
    /// Diameter of its disc, degrees.
    pub diameter_deg: f64,
}

/// How a PV surface scatters, with the width of its lobe.
#[derive(Clone, Copy, Debug)]
pub struct EyeMaterial<'a> {
    bsdf: &'a Bsdf,
    /// Half-width of the lobe as tilts of its half vectors, rad; infinite where there is none.
    width: f64,
    /// How fast all that isn't mirrored changes with the tilt of half vectors.
    falls: Falls,
}

/// How a scattering function changes with the tilt of half vectors.
#[derive(Clone, Copy, Debug)]
enum Falls {
    /// As lobes of facets do, none narrower than this alpha; infinite: an even ground alone.
    Facets(f64),
    /// As a file says: nothing is known but the half-width of its lobe, rad.
    File(f64),
}

/// A patch is looked at through its middle once its half vectors spread less than this share of
/// the lobe's width.
const FINE: f64 = 0.15;
/// A patch is at least as fine as that as seen from the eye, rad.
const WIDEST: f64 = 0.1;
/// Patches that are partly in sight or in shadow are split within so many widths of the lobe;
/// farther off it hardly matters which part it is.
const NEAR_WIDTHS: f64 = 4.0;
/// Radius of the sun's disc beside the length over which the lobe changes: up to the first its
/// middle stands for it (to 5e-3), up to the second four points (to 1e-3), beyond it all.
const DISC_RATIOS: [f64; 2] = [0.05, 0.25];
/// Fresnel's reflectance changes its logarithm by up to that with a radian of tilt; with
/// what hides facets from one another, towards grazing angles, by up to the second.
const STEADY_PER_RAD: [f64; 2] = [6.0, 20.0];
/// How fast a file's lobe changes its logarithm, in widths of the lobe.
const STEEPNESS: f64 = 3.0;
/// Halvings below the cells.
const DEEPER: u32 = 9;
/// Points of the sun's disc: on rings of equal area.
const RINGS: usize = 4;
const AROUND: usize = 8;
/// Angle of incidence at which a lobe's width is measured, degrees.
const MEASURED_AT_DEG: f64 = 60.0;

impl<'a> EyeMaterial<'a> {
    /// Finds the lobe's width.
    pub fn new(bsdf: &'a Bsdf) -> Self {
        let terms = bsdf.terms();
        let alphas = terms.iter().filter_map(|(_, term)| match term {
            Term::Lobe(term) => term.alpha(),
            Term::Even(_) | Term::Measured(_) => None,
        });
        let alpha = alphas.fold(f64::INFINITY, f64::min);
        let file = terms.iter().any(|(_, term)| matches!(term, Term::Measured(_)));
        // Half vectors turn by half of what directions turn.
        let measured = || bsdf.lobe(MEASURED_AT_DEG).width_deg.to_radians() / 4.0;
        let falls = match file {
            true => Falls::File(measured().min(alpha)),
            false => Falls::Facets(alpha),
        };
        let (Falls::File(rough) | Falls::Facets(rough)) = falls;
        let width = if bsdf.has_delta() { 0.0 } else { rough };
        Self { bsdf, width, falls }
    }

    /// How many times brighter all that isn't mirrored may get, beside the sun's strength, while
    /// half vectors that are tilted by `tilt` at least turn by `turned`, rad. A lobe of facets goes
    /// with `(tilt^2 + alpha^2)^-2`: that grows fastest where it is already close.
    pub(super) fn growth(&self, tilt: f64, turned: f64) -> f64 {
        match self.falls {
            Falls::File(width) => libm::exp(STEEPNESS * turned / width.min(1.0)),
            Falls::Facets(alpha) => {
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
        }
    }

    /// Half-width of its lobe as tilts of half vectors, rad; 0 where it mirrors, infinite where it
    /// has none.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// How it scatters.
    pub fn bsdf(&self) -> &'a Bsdf {
        self.bsdf
    }

    /// Radiance of a point of PV that the sun lights, W/m2/sr; directions in the PV's frame.
    pub fn shine(&self, sun: &SunAt, to_sun: DVec3, out: DVec3) -> f64 {
        let half = (to_sun + out).normalize_or_zero();
        self.radiance(sun, to_sun, out, (half.x * half.x + half.y * half.y).sqrt())
    }

    /// Radiance of a point of PV, W/m2/sr: the sun's disc is integrated where the lobe is narrow,
    /// and mirrored where the material mirrors. Directions in the PV's frame; `tilt`: of the half
    /// vector.
    pub(super) fn radiance(&self, sun: &SunAt, to_sun: DVec3, out: DVec3, tilt: f64) -> f64 {
        let one = |s: DVec3| self.bsdf.evaluate(s, out) * s.z.max(0.0);
        let radius = sun.radius_rad();
        let (Falls::Facets(width) | Falls::File(width)) = self.falls;
        let length = (to_sun + out).length().max(0.2);
        let ratio = radius / (length * (width * width + tilt * tilt).sqrt());
        let [point, few] = DISC_RATIOS;
        let around = |sum: f64, r: f64, from: f64, count: usize, frame: &Frame| {
            (0..count).fold(sum, |sum, i| {
                let (x, y) = on_circle((i as f64 + from) / count as f64);
                sum + one((frame.z + frame.x * (r * x) + frame.y * (r * y)).normalize())
            })
        };
        let rough = if ratio < point {
            one(to_sun)
        } else if ratio < few {
            let r = radius * std::f64::consts::FRAC_1_SQRT_2;
            around(0.0, r, 0.0, 4, &Frame::around(to_sun)) / 4.0
        } else {
            let frame = Frame::around(to_sun);
            let mut sum = 0.0;
            for ring in 0..RINGS {
                let r = radius * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
                sum = around(sum, r, 0.5 * (ring % 2) as f64, AROUND, &frame);
            }
            sum / (RINGS * AROUND) as f64
        };
        let mirrored = DVec3::new(-out.x, -out.y, out.z);
        let delta = if mirrored.dot(to_sun) > libm::cos(radius) {
            self.bsdf.mirrored(to_sun) / sun.solid_angle_sr()
        } else {
            0.0
        };
        sun.irradiance_w_m2 * (rough + delta)
    }
}

impl SunAt {
    /// Radius of the disc, rad; a point sun is taken for a very small one.
    pub fn radius_rad(&self) -> f64 {
        (0.5 * self.diameter_deg.to_radians()).max(1e-4)
    }

    /// Solid angle of the disc, sr.
    pub fn solid_angle_sr(&self) -> f64 {
        2.0 * PI * (1.0 - libm::cos(self.radius_rad()))
    }
}

struct Looking<'a> {
    seen: &'a Seen,
    lit: &'a LitPv,
    sun: &'a SunAt,
    material: &'a EyeMaterial<'a>,
    root: &'a Root,
    frame: Frame,
    to_sun: DVec3,
    surface: u16,
}

impl EyePv<'_> {
    /// All that shines at an eye; `materials` by PV surface. Finest where the sun is mirrored.
    /// `into` is written over.
    pub fn look(
        &self,
        seen: &Seen,
        lit: &LitPv,
        sun: &SunAt,
        materials: &[EyeMaterial<'_>],
        into: &mut Vec<Glint>,
    ) {
        into.clear();
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            let to_sun = facet.frame.local_from_world(sun.direction);
            let Some(material) = materials.get(usize::from(facet.surface)) else { continue };
            if to_sun.z <= 0.0 || facet.before_m(seen.eye.position) <= 0.0 {
                continue;
            }
            let (frame, surface) = (facet.frame, facet.surface);
            let looking = Looking { seen, lit, sun, material, root, frame, to_sun, surface };
            looking.descend(&root.whole, into);
        }
    }
}

impl Looking<'_> {
    fn descend(&self, patch: &Patch, into: &mut Vec<Glint>) {
        let range = self.root.range(patch);
        let cells = range.len() as f64;
        let shares = self.seen.shares[range.clone()].iter().zip(&self.lit.shares[range]);
        let share = shares.map(|(a, b)| f64::from(a * b)).sum::<f64>() / cells;
        if share <= 0.0 {
            return;
        }
        let eye = self.seen.eye.position;
        let way = eye - patch.middle();
        let away_m = way.length();
        let out = self.frame.local_from_world(way / away_m);
        let angle = patch.radius_m() / away_m;
        let half = self.to_sun + out;
        let length = half.length();
        let across = (half.x * half.x + half.y * half.y).sqrt() / length.max(1e-12);
        let cos = (0.5 * length).max(0.1);
        let spread = 0.5 * angle / cos;
        let tilt = (across - spread).max(0.0);
        let disc = 0.5 * self.sun.radius_rad() / cos;
        let own = (self.material.width.powi(2) + disc * disc).sqrt();
        let scale = (own * own + tilt * tilt).sqrt();
        let coarse = angle > WIDEST
            || (self.material.width.is_finite() && spread > FINE * scale)
            || (share < 1.0 && patch.level < self.root.level && tilt < NEAR_WIDTHS * own.min(0.1));
        if coarse && patch.level < self.root.level + DEEPER {
            for part in patch.parts() {
                self.descend(&part, into);
            }
            return;
        }
        let radiance_w_m2_sr = self.material.radiance(self.sun, self.to_sun, out, across);
        if radiance_w_m2_sr > 0.0 {
            into.push(Glint {
                towards: -way / away_m,
                solid_angle_sr: share * patch.solid_angle_sr(eye),
                radiance_w_m2_sr,
                surface: self.surface,
            });
        }
    }
}
