//! Closed forms, energy balance, geometry.

mod beam;
mod bsdf;
pub mod bsdf_files;
mod case_study;
mod case_study_photons;
mod render;
pub mod trace;
mod weather;
