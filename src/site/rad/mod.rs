//! Radiance scene files: polygons, spheres, cylinders, cones, rings and their materials.
//!
//! As the reference manual of Radiance has it ("The RADIANCE 5.1 Synthetic Imaging System", scene
//! description): `modifier type identifier`, then three counted lists of arguments (strings,
//! integers, reals); `modifier alias identifier target`; `#` comments. Of `!` commands, `xform`
//! (with arrays and files of arguments) and `cat` are executed here, without a shell; others are
//! refused. What patterns and textures do to a material is not followed.

mod command;
mod files;
mod lexer;
mod materials;
mod modifiers;
mod names;
mod read;
mod shapes;
mod surfaces;
mod transform;

pub(super) use names::Names;
pub(super) use read::read;
