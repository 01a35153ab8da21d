//! The PV seen from a point: what direct integration, eyes and pictures of moments share.
//!
//! [`pv`] cuts the PV into cells and finds out which of them something sees; [`disc`] is the sun's
//! disc; [`sunlit`] is a measured BSDF under that disc.

pub(super) mod disc;
pub(super) mod pv;
pub(super) mod sunlit;
