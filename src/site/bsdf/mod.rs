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

mod circle;
mod cone;
mod disk;
mod file;
mod fresnel;
mod ggx;
mod klems;
mod lobe;
mod measured;
mod model;
mod numbers;
mod scatter;
mod survey;
mod tree;

pub use circle::{on_circle, on_hemisphere};
pub use cone::Cone;
pub use file::{Block, BsdfFile, Side, Spectrum, Table, Way};
pub use fresnel::reflectance as fresnel_reflectance;
pub use klems::{KlemsBasis, Matrix, Ring};
#[cfg(test)]
pub(crate) use lobe::samples;
pub use lobe::{Lobe, Square};
pub use measured::Measured;
pub use model::{Error, Model};
pub use scatter::{Bsdf, Scattered};
pub use survey::{ANGLES_DEG, Reciprocity};
pub use tree::Tree;
