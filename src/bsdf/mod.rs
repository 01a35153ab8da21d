//! How PV scatters light: models of reflection, sampled, evaluated and bounded.
//!
//! Directions are local: z is the PV's normal, and both the incident direction (to the sun) and
//! the outgoing one point away from the surface. All models are isotropic; measured
//! ones ([`BsdfFile`]) may not be: x lies horizontal to the right as seen from outside, y up the
//! slope.
//!
//! Sampling works by survival: [`Bsdf::sample`] draws a direction or lets the photon die, such
//! that `density * survival * bound(incident) = f(incident, out) * cos(out)`. Whoever survives
//! carries the same flux, so that a store's photons are all equal.

mod account;
mod block;
mod cells;
mod chart;
mod circle;
mod cone;
mod content;
mod curve;
mod disk;
mod error;
mod facets;
mod file;
mod fresnel;
mod ggx;
mod gonio;
mod incidence;
mod interface;
mod interpolation;
mod klems;
mod lobe;
mod measured;
mod mixture;
mod model;
mod numbers;
pub mod presets;
mod rough;
mod scatter;
mod source;
mod square;
mod survey;
mod terms;
mod tree;
mod write;

pub use account::{Account, Row};
pub use block::{Block, Side, Spectrum, Table, Way};
#[cfg(test)]
pub(crate) use chart::samples;
pub use circle::{on_circle, on_hemisphere};
pub use cone::Cone;
pub use error::Error;
pub use facets::Facets;
pub use file::BsdfFile;
pub use fresnel::reflectance as fresnel_reflectance;
pub use gonio::{Goniophotometer, Incident};
pub use incidence::Incidence;
pub use interface::{Coating, coated_reflectance, film_reflectance, metal_reflectance};
pub use interpolation::{Interpolation, Reach};
pub use klems::{KlemsBasis, Matrix, Ring};
pub use lobe::Lobe;
pub use measured::Measured;
pub use mixture::Mixture;
pub use model::{Model, Part, preset_or_model};
pub use presets::{PRESETS, Preset};
pub use scatter::{Bsdf, Scattered};
pub use source::Source;
pub use square::{Chart, Square};
pub use survey::{ANGLES_DEG, Reciprocity};
pub use terms::{FacetTerm, Term};
pub use tree::Tree;
pub use write::{Cost, Fineness, Written, write, write_points};
