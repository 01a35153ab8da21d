//! Radiance scene files: polygons, spheres, cylinders, cones, rings and their materials.
//!
//! As the reference manual of Radiance has it ("The RADIANCE 5.1 Synthetic Imaging System", scene
//! description): `modifier type identifier`, then three counted lists of arguments (strings,
//! integers, reals); `modifier alias identifier target`; `#` comments; `!` commands, which aren't
//! run. What patterns and textures do to a material is not followed.

mod lexer;
mod materials;
mod names;
mod read;
mod shapes;

pub(super) use names::Names;
pub(super) use read::read;
