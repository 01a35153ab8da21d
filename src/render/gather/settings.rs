use super::error::Error;
use super::estimator::{Estimator, Kernel};
use super::flux::MOST_PHOTONS;
use super::surfaces::Tolerance;
use crate::pages::Store;

/// Radiance draws from 0 to 0.02 (`PMAP_NORM_TOL`) the cosine of normals up to which it rejects a
/// photon: all within 88.9 degrees count, none beyond 90. This is the middle, `acos(0.01)`.
const RADIANCE_NORMAL_DEG: f32 = 89.43;

/// Most photons for a point: their fluxes' sums stay exact ([`MOST_PHOTONS`]), and their candidates
/// in memory.
const MOST_BANDWIDTH: usize = 1_000_000;
const _: () = assert!(MOST_BANDWIDTH <= MOST_PHOTONS);

/// How photons are gathered.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Gather {
    /// Photons per point, at least 2.
    pub bandwidth: usize,
    /// Bound on the search, m; the store's own rule where it is left out.
    pub max_radius_m: Option<f32>,
    /// How they become irradiance.
    pub estimator: Estimator,
    /// How they are weighed.
    pub kernel: Kernel,
    /// Largest angle between the normals of pixel and photon, degrees.
    pub normal_tolerance_deg: f32,
    /// How far a photon may lie off the pixel's tangent plane, m; any distance where it is left
    /// out.
    pub plane_tolerance_m: Option<f32>,
    /// Whether a disc ends where its surface ends and at walls that stand on it.
    pub edges: bool,
}

impl Default for Gather {
    fn default() -> Self {
        Self {
            bandwidth: 400,
            max_radius_m: None,
            estimator: Estimator::Photons,
            kernel: Kernel::Flat,
            normal_tolerance_deg: 60.0,
            plane_tolerance_m: Some(0.25),
            edges: true,
        }
    }
}

impl Gather {
    /// Settings that can't be, each with its name and what is expected of it. The only place that
    /// knows their bounds.
    pub fn mistakes(&self) -> Vec<(&'static str, String)> {
        let mut out = Vec::new();
        let mut expect = |key, right: bool, what: String| {
            if !right {
                out.push((key, what));
            }
        };
        let found = self.bandwidth;
        let right = (2..=MOST_BANDWIDTH).contains(&found);
        expect(
            "bandwidth",
            right,
            format!("expected 2 to {MOST_BANDWIDTH} photons, found {found}"),
        );
        let radius_m = self.max_radius_m.unwrap_or(1.0);
        let right = radius_m > 0.0 && radius_m.is_finite();
        expect("max_radius_m", right, format!("expected metres above 0, found {radius_m}"));
        let found = self.normal_tolerance_deg;
        let right = (1.0..=90.0).contains(&found);
        expect("normal_tolerance_deg", right, format!("expected 1 to 90, found {found}"));
        let found = self.plane_tolerance_m.unwrap_or(1.0);
        let right = (0.01..=100.0).contains(&found);
        expect("plane_tolerance_m", right, format!("expected 0.01 to 100, found {found}"));
        out
    }

    /// The bound on the search that holds for a store, m, after the settings were checked.
    pub(in crate::render) fn radius_m(&self, store: &Store) -> Result<f32, Error> {
        if let Some((key, expected)) = self.mistakes().first() {
            return Err(Error::settings(format!("{key}: {expected}")));
        }
        let radius = self.max_radius_m.unwrap_or_else(|| store.max_radius_m(self.bandwidth));
        if radius.is_finite() && radius > 0.0 {
            return Ok(radius);
        }
        if self.max_radius_m.is_none() && store.info().photons == 0 {
            // An empty store has no rule to offer, and nothing to find either.
            return Ok(1.0);
        }
        let what = format!("max_radius_m is {radius}, expected a length above 0");
        Err(Error::settings(what))
    }

    /// What is done: the paper's estimator knows neither kernels nor edges, and takes photons of
    /// nearly every normal on the same side.
    pub(in crate::render) fn as_used(self) -> Self {
        match self.estimator {
            Estimator::Photons => self,
            Estimator::Radiance => Self {
                kernel: Kernel::Flat,
                normal_tolerance_deg: RADIANCE_NORMAL_DEG,
                plane_tolerance_m: None,
                edges: false,
                ..self
            },
        }
    }

    /// The same with discs that end nowhere and take photons of any height.
    pub fn open(self) -> Self {
        Self { plane_tolerance_m: None, edges: false, ..self }
    }

    /// Whether the store's own search finds what counts: discs without end or tolerance.
    pub(in crate::render) fn is_open(&self) -> bool {
        !self.edges && self.plane_tolerance_m.is_none() && self.normal_tolerance_deg == 60.0
    }

    pub(in crate::render) fn tolerance(&self) -> Tolerance {
        // The store's own search has exactly a half for 60 degrees.
        let open = self.normal_tolerance_deg == 60.0;
        Tolerance {
            normal_cos: if open { 0.5 } else { libm::cosf(self.normal_tolerance_deg.to_radians()) },
            plane_m: self.plane_tolerance_m.unwrap_or(f32::INFINITY),
        }
    }
}
