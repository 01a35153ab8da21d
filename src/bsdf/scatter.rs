use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::circle::on_hemisphere;
use super::ggx::Ggx;
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
    /// A rough dielectric over a diffuse cell.
    PvGlass(PvGlass),
    /// A lobe of facets over a broad ground.
    Facets(Box<Facets>),
    /// Several side by side.
    Mixture(Mixture),
    /// Values from a file.
    Measured(Measured),
}

/// Rough glass over a diffuse cell:
/// `f = D(h) G2(i, o) F(i.h) / (4 cos_i cos_o) + rho (1 - F(i)) (1 - F(o)) / (pi (1 - Fm))`,
/// with Fm the hemispherical mean of F. The second term reflects `rho (1 - F(i))` in all: light
/// enters the glass, and the share rho of it comes out again, with the angular distribution of an
/// even radiance below a smooth interface. It is reciprocal. The rough lobe reflects F's mean over
/// its facets, which near normal incidence is a little more than the F(i) that the second term
/// leaves it; with rho up to 0.9 the sum stays below 1 (a test holds it).
#[derive(Clone, Debug, PartialEq)]
pub struct PvGlass {
    pub(super) index: f64,
    pub(super) ggx: Ggx,
    /// rho.
    cell: f64,
    /// rho / (1 - Fm).
    pub(super) diffuse: f64,
    /// 1 - F at normal incidence: the most that leaves the glass.
    out_most: f64,
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
            &Model::PvGlass { index, ggx_alpha, cell_reflectance } => Self::PvGlass(PvGlass {
                index,
                ggx: Ggx { alpha: ggx_alpha },
                cell: cell_reflectance,
                diffuse: cell_reflectance / (1.0 - fresnel::diffuse_mean(index)),
                out_most: 1.0 - fresnel::reflectance(1.0, index),
            }),
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
            Self::PvGlass(glass) => {
                let (lobe, diffuse) = glass.bounds(incident.z);
                lobe + diffuse
            }
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
            // The lobe's bound grows towards grazing incidence, the diffuse one shrinks.
            Self::PvGlass(glass) => glass.bounds(low).0 + glass.bounds(high).1,
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
        let (needed, lobe) = match self {
            Self::Lambertian { reflectance } | Self::Mirror { reflectance } => (*reflectance, 0.0),
            Self::Glass { index } => (fresnel::reflectance(incident.z, *index), 0.0),
            Self::PvGlass(glass) => {
                let (lobe, diffuse) = glass.bounds(incident.z);
                (lobe + diffuse, lobe)
            }
            Self::Facets(_) | Self::Mixture(_) => (self.bound(incident), 0.0),
            Self::Measured(measured) => (measured.reflectance(incident), 0.0),
        };
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
            Self::PvGlass(glass) => glass.sample(incident, stake, lobe, needed - lobe, random)?,
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
            Self::PvGlass(glass) => glass.evaluate(incident, out),
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
            Self::PvGlass(glass) => glass.reflectance(incident),
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
            Self::Lambertian { .. } | Self::PvGlass(_) | Self::Measured(_) => 0.0,
        }
    }

    /// Whether all light goes into a single direction, which [`Self::evaluate`] can't say.
    pub fn is_delta(&self) -> bool {
        matches!(self, Self::Mirror { .. } | Self::Glass { .. })
    }
}

impl PvGlass {
    /// Refractive index, roughness alpha, and `rho / (1 - Fm)`: all that [`Bsdf::evaluate`]
    /// depends on, for those who evaluate many suns at once.
    pub fn parts(&self) -> (f64, f64, f64) {
        (self.index, self.ggx.alpha, self.diffuse)
    }

    /// Bounds of the two terms' sampling weights.
    #[inline]
    fn bounds(&self, cos: f64) -> (f64, f64) {
        let entering = 1.0 - fresnel::reflectance(cos, self.index);
        (fresnel::facet_bound(cos, self.index), self.diffuse * entering * self.out_most)
    }

    /// The terms share one number, `stake`: it has chosen the term in proportion to the bounds
    /// `lobe` and `diffuse`, and what is left of it decides on survival.
    #[inline]
    fn sample(
        &self,
        incident: DVec3,
        stake: f64,
        lobe: f64,
        diffuse: f64,
        random: &mut Stream,
    ) -> Option<DVec3> {
        let (u, v) = (random.uniform(), random.uniform());
        if stake < lobe {
            let half = self.ggx.facet(incident, u, v);
            let cos = incident.dot(half);
            let out = half * (2.0 * cos) - incident;
            if out.z <= 0.0 {
                return None;
            }
            let value = fresnel::reflectance(cos, self.index);
            if stake >= value || stake >= value * self.ggx.seen_back(incident, out) {
                return None;
            }
            Some(out.normalize())
        } else {
            let out = on_hemisphere(u, v);
            let leaving = 1.0 - fresnel::reflectance(out.z, self.index);
            (out.z > 0.0 && (stake - lobe) * self.out_most < diffuse * leaving).then_some(out)
        }
    }

    fn evaluate(&self, incident: DVec3, out: DVec3) -> f64 {
        let entering = 1.0 - fresnel::reflectance(incident.z, self.index);
        let leaving = 1.0 - fresnel::reflectance(out.z, self.index);
        let diffuse = self.diffuse * entering * leaving * FRAC_1_PI;
        let Some(half) = (incident + out).try_normalize() else {
            return diffuse;
        };
        let facets = self.ggx.density(half) * self.ggx.seen_by_both(incident, out);
        let mirrored = fresnel::reflectance(incident.dot(half), self.index);
        diffuse + facets * mirrored / (4.0 * incident.z * out.z)
    }

    /// The lobe's part by a midpoint rule over the two numbers that draw a facet, which follows
    /// lobes of any width; the diffuse part in closed form.
    fn reflectance(&self, incident: DVec3) -> f64 {
        const AROUND: u32 = 96;
        const OUTWARD: u32 = 192;
        let mut sum = 0.0;
        for i in 0..AROUND {
            let u = (f64::from(i) + 0.5) / f64::from(AROUND);
            for j in 0..OUTWARD {
                // Shifting each row by a golden part keeps rows from ending on the same step.
                let shift = (f64::from(i) * 0.618_033_988_749_895) % 1.0;
                let v = (f64::from(j) + shift) / f64::from(OUTWARD);
                let half = self.ggx.facet(incident, u, v);
                let cos = incident.dot(half);
                let out = half * (2.0 * cos) - incident;
                if out.z > 0.0 {
                    sum +=
                        fresnel::reflectance(cos, self.index) * self.ggx.seen_back(incident, out);
                }
            }
        }
        let lobe = sum / f64::from(AROUND * OUTWARD);
        let entering = 1.0 - fresnel::reflectance(incident.z, self.index);
        lobe + self.cell * entering
    }
}
