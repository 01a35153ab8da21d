//! Closed forms, energy balance, geometry.

mod bsdf;
mod case_study;
mod render;
mod trace;
