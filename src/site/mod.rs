//! What stands there: the scene's surfaces, the PV among them, their materials, and the rays.
//!
//! Readers (`rad`, `cityjson`, `mesh`, `terrain`) put what they find, in the coordinates of the
//! source and in f64, into one draft; [`Site::load`] moves the draft to the local origin, turns it
//! to true north, cuts its polygons into triangles, picks the PV and builds the hierarchy for rays.
//!
//! Coordinates: Radiance files are local; city models hold map coordinates. Local coordinates are
//! map coordinates less [`Site::origin`], turned about the origin so that +y is true north:
//! [`local_from_map`].

mod array;
mod build;
mod bvh;
pub mod check;
mod cityjson;
mod clip;
mod convergence;
mod crowns;
mod draft;
mod error;
mod files;
mod format;
mod levels;
mod load;
mod log;
mod mesh;
mod placement;
mod rad;
mod scene;
mod select;
mod source;
mod spec;
mod surroundings;
mod terrain;
mod triangle;
mod triangulate;

pub use bvh::{Bvh, RayHit};
pub use crowns::{Crowns, Season};
pub use error::Error;
pub use files::Files;
pub use load::{Loaded, load, load_from};
pub use placement::{North, NorthSource, local_from_map, map_from_local};
pub use scene::{Face, Material, Object, PvSurface, Site};
pub use select::{azimuth_deg, tilt_deg};
pub use source::Source;
pub use spec::{Coordinates, Origin, PvArray, PvSpec, SceneFile, SceneSpec, Select};
pub use triangle::Triangle;
