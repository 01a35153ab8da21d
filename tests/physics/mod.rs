//! Closed forms, energy balance, geometry.

mod beam;
mod bsdf;
mod case_study;
mod case_study_photons;
mod render;
mod trace;
