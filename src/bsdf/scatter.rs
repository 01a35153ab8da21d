//! The one type that the rest of the program scatters by: a model, a measured side, or a mixture, with
//! the same questions to each (bound, sample, evaluate, reflectance).

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::circle::on_hemisphere;
use super::{Error, Facets, Measured, Mixture, Model, fresnel};
use crate::base::Stream;

/// How a surface scatters light; see the module for the frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Bsdf {
    /// `f = reflectance / pi`.
    Lambertian {
        /// Share of the light that comes back.
        reflectance: f64,
    },
    /// A delta lobe of constant reflectance.
    Mirror {
        /// Share of the light that comes back.
        reflectance: f64,
    },
    /// A delta lobe with Fresnel's reflectance.
    Glass {
        /// Refractive index.
        index: f64,
    },
    /// A lobe of facets over a broad ground: glass over cells, coated or not, and metal.
    Facets(Box<Facets>),
    /// Several side by side.
    Mixture(Mixture),
    /// Values from a file.
    Measured(Measured),
}

/// A direction that light was scattered into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattered {
    /// Unit vector away from the surface, local.
    pub direction: DVec3,
    /// 1, or more where the bound was too low (never, for the models).
    pub weight: f64,
}

impl Bsdf {
    /// A model's reflection.
    ///
    /// # Errors
    /// A number outside its range.
    pub fn from_model(model: &Model) -> Result<Self, Error> {
        model.check()?;
        Ok(match model {
            &Model::Lambertian { reflectance } => Self::Lambertian { reflectance },
            &Model::Mirror { reflectance } => Self::Mirror { reflectance },
            &Model::Glass { index } => Self::Glass { index },
            &Model::PvGlass { index, ggx_alpha, cell_reflectance } => {
                Self::Facets(Box::new(Facets::glass(index, None, ggx_alpha, cell_reflectance)))
            }
            &Model::CoatedGlass { index, ggx_alpha, cell_reflectance, coating } => {
                Self::Facets(Box::new(Facets::glass(index, coating, ggx_alpha, cell_reflectance)))
            }
            &Model::Metal { index, extinction, ggx_alpha } => {
                Self::Facets(Box::new(Facets::metal(index, extinction, ggx_alpha)))
            }
            Model::Mixture { parts } => Self::Mixture(Mixture::new(
                parts
                    .iter()
                    .map(|p| Ok((p.share, Self::from_model(&p.model)?)))
                    .collect::<Result<_, Error>>()?,
            )),
        })
    }

    /// Upper bound of the sampling weight for light from `incident`: what [`Self::sample`] relies
    /// on; at least [`Self::reflectance`]. 0 from below.
    #[inline]
    pub fn bound(&self, incident: DVec3) -> f64 {
        if incident.z <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Lambertian { reflectance } | Self::Mirror { reflectance } => *reflectance,
            Self::Glass { index } => fresnel::reflectance(incident.z, *index),
            Self::Facets(facets) => {
                let (lobe, ground) = facets.bounds(incident.z);
                lobe + ground
            }
            Self::Mixture(mixture) => mixture.bound(incident),
            Self::Measured(measured) => measured.reflectance(incident),
        }
    }

    /// Upper bound of [`Self::bound`] over all incident directions whose cosine is from
    /// `cos_low` to `cos_high`: over the sun's disc.
    pub fn bound_between(&self, cos_low: f64, cos_high: f64) -> f64 {
        let (low, high) = (cos_low.clamp(0.0, 1.0), cos_high.clamp(0.0, 1.0));
        match self {
            Self::Lambertian { reflectance } | Self::Mirror { reflectance } => *reflectance,
            Self::Glass { index } => fresnel::reflectance(low, *index),
            Self::Facets(facets) => facets.bound_between(low, high),
            Self::Mixture(mixture) => mixture.bound_between(low, high),
            Self::Measured(measured) => measured.most(low, high),
        }
    }

    /// Draws a direction so that `density * survival * bound(incident) = f * cos(out)`. `None`:
    /// the photon dies in the surface.
    #[inline]
    pub fn sample(&self, incident: DVec3, random: &mut Stream) -> Option<Scattered> {
        self.sample_within(incident, self.bound(incident), random)
    }

    /// [`Self::sample`] against any other `bound`, so that `density * survival * weight * bound =
    /// f * cos(out)`: one draw then also decides about what the caller's bound lies above this
    /// one's. A bound that is too low shows as a weight above 1.
    #[inline]
    pub fn sample_within(
        &self,
        incident: DVec3,
        bound: f64,
        random: &mut Stream,
    ) -> Option<Scattered> {
        if incident.z <= 0.0 || bound <= 0.0 {
            return None;
        }
        let stake = random.uniform();
        let needed = self.bound(incident);
        let (bound, weight) = if needed > bound { (needed, needed / bound) } else { (bound, 1.0) };
        let stake = stake * bound;
        if stake >= needed {
            return None;
        }
        let direction = match self {
            Self::Lambertian { .. } => {
                let (u, v) = (random.uniform(), random.uniform());
                on_hemisphere(u, v)
            }
            Self::Mirror { .. } | Self::Glass { .. } => {
                DVec3::new(-incident.x, -incident.y, incident.z)
            }
            Self::Facets(facets) => facets.sample(incident, stake, random)?,
            Self::Mixture(mixture) => mixture.sample(incident, stake, random)?,
            Self::Measured(measured) => measured.sample(incident, random)?,
        };
        Some(Scattered { direction, weight })
    }

    /// The scattering function, 1/sr, without delta lobes; 0 where a direction points into the
    /// surface.
    pub fn evaluate(&self, incident: DVec3, out: DVec3) -> f64 {
        if incident.z <= 0.0 || out.z <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Lambertian { reflectance } => reflectance * FRAC_1_PI,
            Self::Mirror { .. } | Self::Glass { .. } => 0.0,
            Self::Facets(facets) => facets.evaluate(incident, out),
            Self::Mixture(mixture) => mixture.evaluate(incident, out),
            Self::Measured(measured) => measured.evaluate(incident, out),
        }
    }

    /// Share of the light from `incident` that comes back into the hemisphere, delta lobes
    /// included. Deterministic quadrature where there is no closed form: to about 1e-3 of itself.
    pub fn reflectance(&self, incident: DVec3) -> f64 {
        if incident.z <= 0.0 {
            return 0.0;
        }
        match self {
            Self::Lambertian { reflectance } | Self::Mirror { reflectance } => *reflectance,
            Self::Glass { index } => fresnel::reflectance(incident.z, *index),
            Self::Facets(facets) => facets.reflectance(incident),
            Self::Mixture(mixture) => mixture.reflectance(incident),
            Self::Measured(measured) => measured.reflectance(incident),
        }
    }

    /// Share of the light from `incident` that goes into a delta lobe, which [`Self::evaluate`]
    /// can't say.
    pub fn mirrored(&self, incident: DVec3) -> f64 {
        match self {
            Self::Mirror { .. } | Self::Glass { .. } => self.reflectance(incident),
            Self::Facets(facets) => facets.mirrored(incident.z),
            Self::Mixture(mixture) => mixture.mirrored(incident),
            Self::Lambertian { .. } | Self::Measured(_) => 0.0,
        }
    }

    /// Whether all light goes into a single direction, which [`Self::evaluate`] can't say.
    pub fn is_delta(&self) -> bool {
        matches!(self, Self::Mirror { .. } | Self::Glass { .. })
    }
}
