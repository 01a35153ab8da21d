//! What a store says about itself in its text header, and the search radius that follows from it.

use std::collections::BTreeMap;

use super::cube::Cube;
use crate::base::{Aabb, Provenance, SpectralBasis, Tally};

/// What the store is told about the photons in it.
#[derive(Clone, Debug)]
pub struct About {
    /// How it was made.
    pub provenance: Provenance,
    /// Number of timesteps; photons name them by index.
    pub timesteps: u32,
    /// Names of the PV surfaces; photons name them by index.
    pub surfaces: Vec<String>,
    /// What a watt is.
    pub basis: SpectralBasis,
    /// Where all photons went that were sent.
    pub tally: Tally,
}

/// What a store holds, from its header.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StoreInfo {
    /// Number of photons.
    pub photons: u64,
    /// Tight box around them, metres; a point at 0 for an empty store.
    pub bounds: Aabb,
    /// Number of timesteps.
    pub timesteps: u32,
    /// Names of the PV surfaces.
    pub surfaces: Vec<String>,
    /// What a watt is.
    pub basis: SpectralBasis,
    /// Sum of the photons' flux, W.
    pub flux_w: f64,
    /// Smallest flux of a photon, W; 0 for an empty store.
    pub flux_min_w: f32,
    /// Largest flux of a photon, W.
    pub flux_max_w: f32,
    /// `(sum Phi)^2 / sum Phi^2`.
    pub effective_photons: f64,
    /// Where all photons went that were sent.
    pub tally: Tally,
    /// Area that photons cover, divided by their number, m2: see [`RADIUS_RULE`].
    pub area_m2_per_photon: f64,
    /// Number of pages.
    pub pages: u64,
    /// How it was made.
    pub provenance: Provenance,
}

/// How far a search goes at most, in words; [`Store::max_radius_m`](super::Store::max_radius_m) is the
/// same in code.
pub const RADIUS_RULE: &str = "max_radius_m(k) = 2 sqrt(k a / pi), at least 0.05 m, at most 10 m; a = area_m2_per_photon \
= lit area / photons, where the lit area is that of the octree cells with photons in them, divided until a cell holds at \
most 16. Where photons lie as dense as on average, k of them fill a quarter of that circle; where they lie \
up to 4 times sparser, k are still found";

/// Bounds of the search radius, metres.
pub(super) const RADIUS_M: [f64; 2] = [0.05, 10.0];

/// [`RADIUS_RULE`] for `bandwidth` photons.
///
/// The mean over the lit area, not a median over photons: where most photons lie in one hot spot,
/// any percentile of theirs is the hot spot's, and the wide, dim rest, where the limit decides
/// what is seen, would get a radius in which there is nothing. In dense places the limit does
/// not matter, because k photons are found long before.
pub(super) fn max_radius_m(area_m2_per_photon: f64, bandwidth: usize) -> f32 {
    let area = bandwidth as f64 * area_m2_per_photon;
    let radius = 2.0 * (area / std::f64::consts::PI).sqrt();
    radius.clamp(RADIUS_M[0], RADIUS_M[1]) as f32
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    pub made: Provenance,
    pub units: BTreeMap<String, String>,
    pub spectral_basis: SpectralBasis,
    pub photons: u64,
    pub flux_w: f64,
    pub flux_min_w: f32,
    pub flux_max_w: f32,
    pub effective_photons: f64,
    pub timesteps: u32,
    pub surfaces: Vec<String>,
    pub bounds: Aabb,
    pub search: Search,
    pub errors: BTreeMap<String, String>,
    pub tally: Tally,
    pub layout: Layout,
}

#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Search {
    pub area_m2_per_photon: f64,
    pub rule: String,
}

/// Sizes of what follows the header.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layout {
    pub cube: Cube,
    pub page_photons: u32,
    pub pages: u64,
    pub nodes: u64,
    pub pages_bytes: u64,
    pub directory_bytes: u64,
    pub directory_crc32c: u32,
}

/// What the build adds up, page by page in their order.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sums {
    pub photons: u64,
    pub flux_w: f64,
    pub flux2_w2: f64,
    pub flux_min_w: f32,
    pub flux_max_w: f32,
    pub area_m2: f64,
    pub bounds: Aabb,
}

impl Sums {
    pub const NONE: Self = Self {
        photons: 0,
        flux_w: 0.0,
        flux2_w2: 0.0,
        flux_min_w: f32::INFINITY,
        flux_max_w: 0.0,
        area_m2: 0.0,
        bounds: Aabb::EMPTY,
    };

    pub fn add(&mut self, other: &Self) {
        self.photons += other.photons;
        self.flux_w += other.flux_w;
        self.flux2_w2 += other.flux2_w2;
        self.flux_min_w = self.flux_min_w.min(other.flux_min_w);
        self.flux_max_w = self.flux_max_w.max(other.flux_max_w);
        self.area_m2 += other.area_m2;
        self.bounds = self.bounds.union(other.bounds);
    }
}

impl Header {
    pub fn new(about: &About, sums: &Sums, layout: Layout) -> Self {
        let words = |pairs: &[(&str, &str)]| {
            pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
        };
        let empty = sums.photons == 0;
        let point = Aabb { min: glam::Vec3::ZERO, max: glam::Vec3::ZERO };
        let effective = sums.flux_w * sums.flux_w / sums.flux2_w2;
        Self {
            made: about.provenance.clone(),
            units: words(&[
                ("position", "m from the local origin; x east, y north, z up"),
                ("flux", "W, in the timestep's own hour"),
                ("direction", "unit vector from the receiver to where the light came from"),
            ]),
            spectral_basis: about.basis,
            photons: sums.photons,
            flux_w: sums.flux_w,
            flux_min_w: if empty { 0.0 } else { sums.flux_min_w },
            flux_max_w: sums.flux_max_w,
            effective_photons: if effective.is_finite() { effective } else { 0.0 },
            timesteps: about.timesteps,
            surfaces: about.surfaces.clone(),
            bounds: if empty { point } else { sums.bounds },
            search: Search {
                area_m2_per_photon: if empty { 0.0 } else { sums.area_m2 / sums.photons as f64 },
                rule: RADIUS_RULE.to_owned(),
            },
            errors: words(&[
                ("position", "half of the page's longest edge / 65535, an axis"),
                ("normal, direction", "7e-5 radians"),
                ("flux", "1/4096, relative"),
            ]),
            tally: about.tally,
            layout,
        }
    }

    pub fn info(&self) -> StoreInfo {
        StoreInfo {
            photons: self.photons,
            bounds: self.bounds,
            timesteps: self.timesteps,
            surfaces: self.surfaces.clone(),
            basis: self.spectral_basis,
            flux_w: self.flux_w,
            flux_min_w: self.flux_min_w,
            flux_max_w: self.flux_max_w,
            effective_photons: self.effective_photons,
            tally: self.tally,
            area_m2_per_photon: self.search.area_m2_per_photon,
            pages: self.layout.pages,
            provenance: self.made.clone(),
        }
    }
}
