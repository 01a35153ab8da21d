//! Pictures of the scene: the daylight background behind the maps, and luminances at an instant.

pub(in crate::render) mod background;
pub mod moment;
pub(in crate::render) mod palette;
mod sky_directions;

pub use background::{background, representative_suns};
