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
