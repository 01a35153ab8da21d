//! The Gaussian in time and space, bit for bit SciPy's, over a window of a few timesteps.
//!
//! [`kernel`] has the weights, `passes` the three axes, `smooth` one slice after another, `window`
//! and `wave` what is kept of the volume meanwhile, in the strips of `strip`.

pub(in crate::glare) mod kernel;
pub(in crate::glare) mod passes;
pub(in crate::glare) mod smooth;
pub(in crate::glare) mod strip;
pub(in crate::glare) mod vector;
pub(in crate::glare) mod wave;
pub(in crate::glare) mod window;

pub use kernel::Kernel;
