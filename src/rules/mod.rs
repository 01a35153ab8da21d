//! Criteria as data: what a country, a guideline or a paper calls too much, and how a receiver
//! fares. Profiles are TOML files; users add their own in the same form.
//!
//! A verdict never claims more than was measured: a limit whose quantity, threshold or conditions
//! aren't among the measurements is "not evaluated", and a profile passes only if all its limits
//! for the receiver's class were evaluated.

mod error;
mod profile;
mod verdict;

pub use error::Error;
pub use profile::{Class, Limit, Operator, Profile, Quantity, Status, built_in, ids, load};
pub use verdict::{Judged, Measured, Metrics, Outcome, Verdict};
