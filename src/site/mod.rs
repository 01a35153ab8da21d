//! What stands there: the scene's surfaces, the PV among them, their materials, and the rays.

pub mod bsdf;
mod bvh;
mod scene;

pub use bvh::{Bvh, RayHit};
pub use scene::{Face, Material, Object, PvSurface, Site, Triangle};
