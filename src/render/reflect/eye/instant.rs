use glam::DVec3;

use super::glint::{Eye, Glint};
use super::hazard::{Hazard, veil_per_sr};

/// The brightest patch that an eye sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Brightest {
    /// Its radiance, W/m2/sr.
    pub radiance_w_m2_sr: f64,
    /// Unit vector to it.
    #[serde(skip)]
    pub towards: DVec3,
    /// Number of its PV surface.
    pub surface: u16,
}

/// An instant of an eye: all that shines at it, summed up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EyeInstant {
    /// Irradiance of the plane across the line of sight, W/m2.
    pub surface_w_m2: f64,
    /// Irradiance of planes that face the beams (E_n), W/m2.
    pub normal_w_m2: f64,
    /// Solid angle of all lit PV in sight, sr.
    pub lit_sr: f64,
    /// The brightest patch.
    pub peak: Brightest,
    /// The part that is worst for an after-image.
    pub after_image: Hazard,
    /// The part that is worst for a burn: smaller and brighter, or the same.
    pub burn: Hazard,
    /// Veil over what the eye looks at, W/m2/sr: times the luminous efficacy, cd/m2.
    pub veil_w_m2_sr: f64,
    /// The PV surface that sends most.
    pub surface: u16,
}

impl EyeInstant {
    /// Sums glints up. Which part of the PV counts as the source of the hazard is not said by the
    /// formulas: here the brightest patches are joined, one after the other, and the part that
    /// comes out worst is taken, its irradiance and its angle together. `glints` are sorted.
    pub fn of(eye: &Eye, glints: &mut [Glint]) -> Self {
        glints.sort_by(|a, b| b.radiance_w_m2_sr.total_cmp(&a.radiance_w_m2_sr));
        let mut out = Self::default();
        let (mut worst, mut burning) = (0.0, 0.0);
        let mut surfaces: Vec<f64> = Vec::new();
        if let Some(first) = glints.first() {
            out.peak = Brightest {
                radiance_w_m2_sr: first.radiance_w_m2_sr,
                towards: first.towards,
                surface: first.surface,
            };
        }
        for glint in glints.iter() {
            let part = glint.radiance_w_m2_sr * glint.solid_angle_sr;
            let cos = eye.direction.dot(glint.towards).clamp(0.0, 1.0);
            out.normal_w_m2 += part;
            out.surface_w_m2 += part * cos;
            out.lit_sr += glint.solid_angle_sr;
            out.veil_w_m2_sr += part * cos * veil_per_sr(libm::acos(cos).to_degrees());
            let hazard = Hazard::of(out.normal_w_m2, out.lit_sr);
            let (after_image, burn) = (hazard.after_image_ratio(), hazard.burn_ratio());
            if after_image > worst {
                (worst, out.after_image) = (after_image, hazard);
            }
            if burn > burning {
                (burning, out.burn) = (burn, hazard);
            }
            let surface = usize::from(glint.surface);
            if surfaces.len() <= surface {
                surfaces.resize(surface + 1, 0.0);
            }
            surfaces[surface] += part;
        }
        let most = surfaces
            .iter()
            .enumerate()
            .fold((0, 0.0), |most, (i, w)| if *w > most.1 { (i, *w) } else { most });
        out.surface = most.0 as u16;
        out
    }

    /// Irradiances and the brightest patch alone.
    pub(super) fn bright(eye: &Eye, glints: &[Glint]) -> Self {
        let mut out = Self::default();
        for glint in glints {
            let part = glint.radiance_w_m2_sr * glint.solid_angle_sr;
            out.normal_w_m2 += part;
            out.surface_w_m2 += part * eye.direction.dot(glint.towards).clamp(0.0, 1.0);
            if glint.radiance_w_m2_sr > out.peak.radiance_w_m2_sr {
                let Glint { radiance_w_m2_sr, towards, surface, .. } = *glint;
                out.peak = Brightest { radiance_w_m2_sr, towards, surface };
            }
        }
        out
    }

    /// Irradiances and the brightest patch, times a factor, and those of another instant times one.
    pub(super) fn scaled(&self, factor: f64, more: &Self, more_factor: f64) -> Self {
        let sum = |of: fn(&Self) -> f64| factor * of(self) + more_factor * of(more);
        let radiance_w_m2_sr = sum(|i| i.peak.radiance_w_m2_sr);
        Self {
            surface_w_m2: sum(|i| i.surface_w_m2),
            normal_w_m2: sum(|i| i.normal_w_m2),
            peak: Brightest { radiance_w_m2_sr, ..self.peak },
            ..Self::default()
        }
    }

    /// Mean radiance of all lit PV in sight, W/m2/sr.
    pub fn mean_w_m2_sr(&self) -> f64 {
        if self.lit_sr > 0.0 { self.normal_w_m2 / self.lit_sr } else { 0.0 }
    }
}
