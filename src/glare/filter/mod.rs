//! The Gaussian in time and space, bit for bit SciPy's, over a window of a few timesteps.
//!
//! `kernel` has the weights, `window` what is kept of the volume meanwhile, `part` the timesteps that
//! are filtered together, `strip` goes through some rows of them, `vector` has its inner loops. What
//! becomes of the filtered rows is for others to say: they hand in a `FilteredRows`.

pub(in crate::glare) mod kernel;
pub(in crate::glare) mod part;
pub(in crate::glare) mod strip;
pub(in crate::glare) mod vector;
pub(in crate::glare) mod window;

pub use kernel::Kernel;
