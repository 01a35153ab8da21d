//! What a view shows: the rays of its pixels or points, what they hit first, and the order in which
//! tiles are worked on.

pub(in crate::render) mod camera;
pub(in crate::render) mod error;
pub(in crate::render) mod hits;
pub(in crate::render) mod order;
pub(in crate::render) mod pv_visibility;
pub mod samples;
pub mod sensors;
pub(in crate::render) mod view_options;

pub use camera::{Projection, View, ViewRay};
pub use error::Error;
pub use hits::{Hit, HitKind, HitMap, hits};
pub use pv_visibility::PvInView;
