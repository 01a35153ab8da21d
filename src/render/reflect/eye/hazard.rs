//! Formulas of the eye: what light does to the retina, and how much it veils.

use std::f64::consts::PI;

/// Diameter of a pupil in daylight, m (Ho, Ghanbari, Diver 2011).
const PUPIL_M: f64 = 2e-3;
/// Transmittance of the eye.
const OCULAR: f64 = 0.5;
/// Focal length of the eye, m.
const FOCAL_M: f64 = 0.017;
/// Subtended angle above which the threshold of a burn is constant, rad.
const LARGE_RAD: f64 = 0.118;
/// Age of the observer that veils are computed for, years.
pub const AGE_YEARS: f64 = 50.0;
/// Colour of the iris: 0 black, 0.5 brown, 1.2 light blue.
pub const PIGMENT: f64 = 0.5;

/// What a bright part does to an eye that looks at it, by C. K. Ho, C. M. Ghanbari, R. B. Diver,
/// "Methodology to assess potential glint and glare hazards from concentrating solar power
/// plants", J. Sol. Energy Eng. 133 (2011) 031021.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Hazard {
    /// Angle that a round source of the same solid angle subtends, rad.
    pub subtended_rad: f64,
    /// Irradiance on the retina, W/cm2.
    pub retinal_w_cm2: f64,
}

/// How bad that is.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum HazardZone {
    /// Nothing shines.
    #[default]
    None,
    /// Green: low potential for an after-image.
    Low,
    /// Yellow: potential for a temporary after-image.
    AfterImage,
    /// Red: potential for a permanent burn of the retina.
    Burn,
}

/// Retinal irradiance from which an after-image is possible, W/cm2.
pub fn after_image_w_cm2(subtended_rad: f64) -> f64 {
    3.59e-5 / libm::pow(subtended_rad, 1.77)
}

/// Retinal irradiance from which a burn is possible, W/cm2.
pub fn burn_w_cm2(subtended_rad: f64) -> f64 {
    if subtended_rad < LARGE_RAD { LARGE_RAD / subtended_rad } else { 1.0 }
}

impl Hazard {
    /// From the irradiance of a part at the cornea, W/m2, and its solid angle:
    /// `E_r = E_c d_p^2 t / (f w)^2`.
    pub fn of(cornea_w_m2: f64, solid_angle_sr: f64) -> Self {
        if solid_angle_sr <= 0.0 {
            return Self::default();
        }
        let subtended_rad = 2.0 * (solid_angle_sr / PI).sqrt();
        let image_m = FOCAL_M * subtended_rad;
        let retinal_w_cm2 = cornea_w_m2 * 1e-4 * PUPIL_M * PUPIL_M * OCULAR / (image_m * image_m);
        Self { subtended_rad, retinal_w_cm2 }
    }

    /// Retinal irradiance over that of a possible after-image.
    pub fn after_image_ratio(&self) -> f64 {
        if self.subtended_rad > 0.0 {
            self.retinal_w_cm2 / after_image_w_cm2(self.subtended_rad)
        } else {
            0.0
        }
    }

    /// Retinal irradiance over that of a possible burn.
    pub fn burn_ratio(&self) -> f64 {
        if self.subtended_rad > 0.0 {
            self.retinal_w_cm2 / burn_w_cm2(self.subtended_rad)
        } else {
            0.0
        }
    }
}

/// The zone of a pair of ratios; a limit is exceeded when strictly above.
pub fn zone(after_image_ratio: f64, burn_ratio: f64) -> HazardZone {
    if burn_ratio > 1.0 {
        HazardZone::Burn
    } else if after_image_ratio > 1.0 {
        HazardZone::AfterImage
    } else if after_image_ratio > 0.0 {
        HazardZone::Low
    } else {
        HazardZone::None
    }
}

/// Veiling luminance over the illuminance of the glare source at the eye, 1/sr: the CIE general
/// disability glare equation (CIE 146:2002; J. J. Vos, Clin. Exp. Optom. 86 (2003) 363), valid
/// from 0.1 to 100 degrees between source and line of sight:
/// `10 / q^3 + (5 / q^2 + 0.1 p / q) (1 + (A / 62.5)^4) + 0.0025 p`. Closer than 0.1 degrees it is
/// taken as at 0.1. From 1 to 30 degrees it is close to Stiles and Holladay's
/// `10 (1 + (A / 70)^4) / q^2`.
pub fn veil_per_sr(angle_deg: f64) -> f64 {
    let q = angle_deg.max(0.1);
    let age = libm::pow(AGE_YEARS / 62.5, 4.0);
    10.0 / (q * q * q) + (5.0 / (q * q) + 0.1 * PIGMENT / q) * (1.0 + age) + 0.0025 * PIGMENT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_itself_leaves_an_after_image() {
        // Ho et al. (2011): looking at the sun, 0.1 W/cm2 and 9.3 mrad, gives some 8 W/cm2 on the
        // retina: above an after-image, below a burn for a blink's 0.15 s.
        let sun = Hazard::of(1000.0, PI / 4.0 * 9.3e-3 * 9.3e-3);
        assert!((sun.subtended_rad - 9.3e-3).abs() < 1e-12);
        assert!((sun.retinal_w_cm2 - 8.0).abs() < 0.1, "{sun:?}");
        assert_eq!(zone(sun.after_image_ratio(), sun.burn_ratio()), HazardZone::AfterImage);
        assert!(sun.after_image_ratio() > 50.0 && sun.burn_ratio() > 0.5, "{sun:?}");
        // A large source: the burn's threshold is 1 W/cm2, and the two lines meet nowhere below.
        assert_eq!(burn_w_cm2(0.2), 1.0);
        assert!((burn_w_cm2(0.01) - 11.8).abs() < 1e-9);
        assert!((after_image_w_cm2(0.01) - 3.59e-5 / libm::pow(0.01, 1.77)).abs() < 1e-12);
        assert_eq!(Hazard::of(1.0, 0.0).after_image_ratio(), 0.0);
    }

    #[test]
    fn the_veil_is_stiles_and_holladays_in_the_middle() {
        for angle in [2.0, 3.0, 5.0, 10.0, 20.0] {
            let simple = 10.0 * (1.0 + libm::pow(AGE_YEARS / 70.0, 4.0)) / (angle * angle);
            let ratio = veil_per_sr(angle) / simple;
            assert!((0.6..1.4).contains(&ratio), "{angle}: {ratio}");
        }
        assert!(veil_per_sr(0.0) == veil_per_sr(0.1) && veil_per_sr(90.0) > 0.0);
    }
}
