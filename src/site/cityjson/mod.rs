//! CityJSON 1.0, 1.1 and 2.0, and CityJSONSeq (one feature a line).
//!
//! Read are boundary representations (`MultiSurface` to `CompositeSolid`, and templates), one level
//! of detail for each object, semantics and parts. Not read: appearance, points, lines, attributes.
//! Specification: <https://www.cityjson.org/specs/2.0.1/>.

mod geometry;
mod model;
mod read;

pub(super) use read::{How, Read, read, read_sequence};
