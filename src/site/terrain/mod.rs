//! Terrain: grids of heights in map coordinates, cut to the surroundings and triangulated to a
//! stated error.

mod ascii;
mod geotiff;
mod grid;
mod tile;

pub(super) use ascii::read as ascii;
pub(super) use geotiff::read as geotiff;
pub(super) use grid::{Grid, Region, triangles};
pub(super) use tile::ERROR_M;
