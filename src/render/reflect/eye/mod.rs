//! What an eye sees of the PV: which parts shine, how bright, how large, and what that does to it.
//!
//! An [`EyePv`] knows the PV in cells. For an eye it tells which cells are in sight ([`Seen`]), for
//! a sun which are lit ([`LitPv`]); [`EyePv::look`] joins them with a material into [`Glint`]s:
//! directions with solid angle and radiance. [`EyeInstant`] sums those up, [`hazard`] holds the
//! formulas of the eye; a [`Sweeper`] goes through a year in fine steps.
#![doc = ""]
#![doc = include_str!("../../../docs/observers.md")]

mod glint;
mod glints;
pub mod hazard;
mod instant;
mod material;
mod patches;
mod shine;
mod sweep;
#[cfg(test)]
mod tests;

pub use glint::{Eye, Glint, SunAt};
pub use instant::{Brightest, EyeInstant};
pub use material::{EyeMaterial, UnderSun};
pub use patches::{EyePv, LitPv, Seen};
pub use sweep::{Sweep, SweepLimits, Sweeper};
