use std::f64::consts::PI;

use crate::base::MIN_COS;
use crate::pages::Neighbour;

/// Radius below which a disc doesn't shrink, m. All k photons at one place (a focus, or photons
/// whose quantised positions agree) would otherwise make an infinite irradiance.
pub const MIN_RADIUS_M: f64 = 1e-3;
/// How photons around a point become irradiance there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize)]
pub enum Estimator {
    /// `E = sum(Phi_1..Phi_{k-1}) / (pi r_k^2)`: free of bias where photons lie at random.
    #[default]
    Photons,
    /// The paper's: all k in the sum, too bright by k/(k-1).
    Radiance,
}

impl Estimator {
    /// 1 where the k-th photon itself counts, else 0.
    pub(in crate::render) fn keeps_last(self) -> u64 {
        match self {
            Self::Photons => 0,
            Self::Radiance => 1,
        }
    }
}

/// How photons in the disc are weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// All the same: the handbook's estimator.
    #[default]
    Flat,
    /// `2 (1 - d^2 / r^2)`: smoother pictures, a third more noise for the same bandwidth.
    Epanechnikov,
}

/// The disc over which the photons of one point are spread.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disc {
    /// The photon that sets the radius and isn't summed.
    pub skip: Option<usize>,
    pub radius_m: f64,
    /// Whether the radius was raised to [`MIN_RADIUS_M`].
    pub floored: bool,
}

impl Disc {
    fn of(
        items: &[Neighbour],
        farthest: Option<usize>,
        full: bool,
        max_radius_m: f32,
        estimator: Estimator,
    ) -> Self {
        let Some(last) = farthest.filter(|_| full) else {
            return Self { skip: None, radius_m: f64::from(max_radius_m), floored: false };
        };
        let radius_m = f64::from(items[last].distance2_m2).sqrt();
        Self {
            skip: (estimator == Estimator::Photons).then_some(last),
            radius_m: radius_m.max(MIN_RADIUS_M),
            floored: radius_m < MIN_RADIUS_M,
        }
    }

    fn area_m2(&self) -> f64 {
        PI * self.radius_m * self.radius_m
    }
}

/// What the photons around a point say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// E on the surface: W/m2 times the unit of the weights.
    pub surface: f64,
    /// E_n, on a plane that faces each photon's beam; the same unit.
    pub normal: f64,
    /// Radius of the disc over which the photons were spread, m.
    pub radius_m: f64,
    /// Photons found.
    pub photons: usize,
    /// Whether the radius was raised to [`MIN_RADIUS_M`].
    pub floored: bool,
}

/// Irradiance from the photons around a point, each times the weight of its timestep (1 for the
/// sum over all timesteps in W/m2, its hours for the year in Wh/m2).
///
/// `items` are the photons found, `farthest` the position of the farthest among them, `full`
/// whether as many were found as were asked for; if not, they are spread over `max_radius_m`.
/// Sums run in f64 in the order of `items`. Nothing found gives exactly 0.
pub fn estimate(
    items: &[Neighbour],
    farthest: Option<usize>,
    full: bool,
    max_radius_m: f32,
    estimator: Estimator,
    weight: impl Fn(u32) -> f64,
) -> Estimate {
    let disc = Disc::of(items, farthest, full, max_radius_m, estimator);
    let (mut surface, mut normal) = (0.0, 0.0);
    for (i, photon) in items.iter().enumerate() {
        if Some(i) != disc.skip {
            let weighted = f64::from(photon.flux_w) * weight(photon.timestep);
            surface += weighted;
            normal += weighted / f64::from(photon.cos.max(MIN_COS));
        }
    }
    let area_m2 = disc.area_m2();
    Estimate {
        surface: surface / area_m2,
        normal: normal / area_m2,
        radius_m: disc.radius_m,
        photons: items.len(),
        floored: disc.floored,
    }
}
