use std::f64::consts::PI;

use glam::DVec3;

use super::patches::{EyePv, LitPv, Patch, Root, Seen};
use crate::base::Frame;
use crate::site::bsdf::{Bsdf, on_circle};

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
}

/// A patch is looked at through its middle once its half vectors spread less than this share of
/// the lobe's width.
const FINE: f64 = 0.15;
/// A patch is at least as fine as that as seen from the eye, rad.
const WIDEST: f64 = 0.1;
/// Lobe widths within which the sun is a disc; outside a point at its middle does.
const NEAR_WIDTHS: f64 = 8.0;
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
        let from = DVec3::new(libm::sin(1.0), 0.0, libm::cos(1.0));
        let width = match bsdf {
            Bsdf::Lambertian { .. } => f64::INFINITY,
            Bsdf::PvGlass(glass) => glass.parts().1,
            other if other.mirrored(from) > 0.0 => 0.0,
            // Half vectors turn by half of what directions turn.
            other => other.lobe(MEASURED_AT_DEG).width_deg.to_radians() / 4.0,
        };
        Self { bsdf, width }
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
        let rough = if self.width.is_finite() && tilt < NEAR_WIDTHS * self.width + 2.0 * radius {
            let frame = Frame::around(to_sun);
            let mut sum = 0.0;
            for ring in 0..RINGS {
                let r = radius * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
                for i in 0..AROUND {
                    let turn = (i as f64 + 0.5 * (ring % 2) as f64) / AROUND as f64;
                    let (x, y) = on_circle(turn);
                    sum += one((frame.z + frame.x * (r * x) + frame.y * (r * y)).normalize());
                }
            }
            sum / (RINGS * AROUND) as f64
        } else {
            one(to_sun)
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
        let scale = (self.material.width.powi(2) + disc * disc + tilt * tilt).sqrt();
        let coarse = angle > WIDEST
            || (self.material.width.is_finite() && spread > FINE * scale)
            || (share < 1.0
                && patch.level < self.root.level
                && tilt < NEAR_WIDTHS * scale.min(0.1));
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
