//! Held against programs and references that others made.

mod bsdf;
mod glare;
mod photons;
mod mirror;
mod picture;
mod scenes;
mod sky;
mod views;
mod volume;
