//! The words of this wing: an eye, a sun, and what shines from the one to the other.

use std::f64::consts::PI;

use glam::DVec3;

/// An eye, or a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where, m from the local origin.
    pub position: DVec3,
    /// Unit vector: where it looks. Nothing behind it is seen.
    pub direction: DVec3,
}

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
