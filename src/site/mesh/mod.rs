//! Triangle meshes of CAD and modelling programs: OBJ with MTL, glTF and GLB, PLY, STL.
//!
//! Readers fill a [`Mesh`] in the file's own coordinates; [`Mesh::add`] places it. Triangles that
//! share edges and lie in one plane become one surface, so that a roof is one PV surface however
//! finely it was cut up.

mod accessor;
mod gltf;
mod model;
mod obj;
mod patches;
mod ply;
mod stl;

pub(super) use gltf::read as gltf;
pub(super) use model::{Mesh, Owner};
pub(super) use obj::read as obj;
pub(super) use ply::read as ply;
pub(super) use stl::read as stl;
