//! Held against programs and references that others made.

mod bsdf;
mod glare;
mod mirror;
mod picture;
mod scenes;
mod sky;
mod views;
mod volume;
