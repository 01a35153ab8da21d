//! Held against programs and references that others made.

mod bsdf;
mod direct;
mod eyes;
mod figures;
mod glare;
mod maps;
mod mirror;
mod photons;
mod picture;
mod scattering;
mod scenes;
mod sky;
mod views;
mod volume;
