//! Closed forms, energy balance, geometry.

mod beam;
mod bsdf;
pub mod bsdf_files;
mod bsdf_models;
mod bsdf_write;
mod case_study;
mod case_study_photons;
mod closed_maps;
mod direct;
mod direct_borders;
mod measured_pv;
pub mod render;
mod seasons;
mod seeds;

pub mod trace;
mod weather;
