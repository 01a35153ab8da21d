use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;

use super::patches::{EyePv, LitPv, Patch, Root, Seen};
use super::shine::{Shine, Waiting};
use crate::base::Frame;
use crate::bsdf::{Bsdf, Term, on_circle};
use crate::site::Site;

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
#[derive(Clone, Debug)]
pub struct EyeMaterial<'a> {
    bsdf: &'a Bsdf,
    terms: Arc<[Shine<'a>]>,
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
/// middle stands for it (of facets with its second order, to 1e-3, of files to 5e-3), up to the second
/// four points (to 1e-3), beyond it all.
const FACETS_RATIOS: [f64; 2] = [0.14, 0.25];
const FILE_RATIOS: [f64; 2] = [0.05, 0.25];
/// A sun so many radii over the PV is seen by facets alike; below, as files are looked at.
const LOW_RADII: f64 = 20.0;
/// Ways in which the disc is looked at.
const WAYS: usize = 3;
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
        Self { bsdf, terms: Shine::terms(bsdf).into(), width, falls }
    }

    /// That of each PV surface; `bsdfs` by the entry of the project that selects it.
    pub fn by_surface(bsdfs: &'a [Bsdf], site: &Site) -> Vec<Self> {
        let each: Vec<Self> = bsdfs.iter().map(Self::new).collect();
        site.pv.iter().map(|surface| each[surface.entry].clone()).collect()
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

    /// Radiance of a point of PV that the sun lights, W/m2/sr: the sun's disc is integrated where the
    /// lobe is narrow, and mirrored where the material mirrors. Directions in the PV's frame.
    pub fn shine(&self, sun: &SunAt, to_sun: DVec3, out: DVec3) -> f64 {
        let half = to_sun + out;
        let across = libm::hypot(half.x, half.y) / half.length().max(1e-12);
        let mut waiting = Waiting::default();
        let dark = Glint { towards: out, solid_angle_sr: 0.0, radiance_w_m2_sr: 0.0, surface: 0 };
        waiting.push(dark, out);
        let mut glints = Vec::new();
        let way = self.way(sun, to_sun, half.length(), across);
        self.light(sun, to_sun, (way, &mut waiting), &mut glints);
        glints.first().map_or(0.0, |glint| glint.radiance_w_m2_sr)
    }

    /// In which way the sun's disc is looked at from a patch: by the length of the sum of both
    /// directions and the tilt of the half vector.
    fn way(&self, sun: &SunAt, to_sun: DVec3, length: f64, tilt: f64) -> usize {
        let high = to_sun.z > LOW_RADII * sun.radius_rad();
        let (width, [point, few]) = match self.falls {
            Falls::Facets(width) if high => (width, FACETS_RATIOS),
            Falls::Facets(width) | Falls::File(width) => (width, FILE_RATIOS),
        };
        let ratio = sun.radius_rad() / (length.max(0.2) * (width * width + tilt * tilt).sqrt());
        usize::from(ratio >= point) + usize::from(ratio >= few)
    }

    /// Radiances of the patches that wait for one way of looking at the sun's disc.
    fn light(
        &self,
        sun: &SunAt,
        to_sun: DVec3,
        (way, waiting): (usize, &mut Waiting),
        into: &mut Vec<Glint>,
    ) {
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
        let delta = self.bsdf.has_delta().then(|| self.bsdf.mirrored(to_sun));
        let edge = libm::cos(radius);
        let mirrored = |out: DVec3| match delta {
            Some(share) if DVec3::new(-out.x, -out.y, out.z).dot(to_sun) > edge => {
                share / sun.solid_angle_sr()
            }
            _ => 0.0,
        };
        waiting.light(&self.terms, sun, (&places, second), &mirrored, into);
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
        let mut waiting: [Waiting; WAYS] = Default::default();
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            let to_sun = facet.frame.local_from_world(sun.direction);
            let Some(material) = materials.get(usize::from(facet.surface)) else { continue };
            if to_sun.z <= 0.0 || facet.before_m(seen.eye.position) <= 0.0 {
                continue;
            }
            let (frame, surface) = (facet.frame, facet.surface);
            let looking = Looking { seen, lit, sun, material, root, frame, to_sun, surface };
            looking.descend(&root.whole, &mut waiting);
            for (way, waiting) in waiting.iter_mut().enumerate().filter(|(_, w)| !w.is_empty()) {
                material.light(sun, to_sun, (way, waiting), into);
            }
        }
    }
}

impl Looking<'_> {
    fn descend(&self, patch: &Patch, into: &mut [Waiting; WAYS]) {
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
        let glint = Glint {
            towards: -way / away_m,
            solid_angle_sr: share * patch.solid_angle_sr(eye),
            radiance_w_m2_sr: 0.0,
            surface: self.surface,
        };
        into[self.material.way(self.sun, self.to_sun, length, across)].push(glint, out);
    }
}
