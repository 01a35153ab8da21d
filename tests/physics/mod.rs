//! Closed forms, energy balance, geometry.

mod bsdf;
pub mod bsdf_files;
mod case_study;
mod render;
mod trace;
mod weather;
