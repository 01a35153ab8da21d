//! From the sun to the place where a photon lands.
//!
//! Only the PV emits. Photon `n` of `N` belongs to the position `(n + xi) / N` in the cumulative
//! distribution over (timestep, PV surface), weighed with `E * A * g`: irradiance, area, and an
//! upper bound over the sun's disc of `cos * reflectance bound`. It draws a direction to the sun's
//! disc and a point on the surface, is scattered by the PV's BSDF by survival, and flies to where
//! it lands. Whoever survives carries the same flux, `sum(E A g) / N`.
//!
//! Directions that provably reach nothing within the path limit ([`Fate::NotSampled`]) are told
//! from a conservative horizon per piece of PV, without tracing a ray.
//!
//! What the tally says follows the order of the questions, cheapest first: parts of the disc
//! behind the PV's plane or below the horizon (`blocked`, no flux), the PV's absorption
//! (`absorbed`), the horizon (`not_sampled`), the way to the sun (`blocked`), the flight. So the
//! blocked flux counts the shadow on photons that would have flown towards the neighbourhood;
//! those that the PV takes or the sky swallows aren't asked. It closes all the same.
//!
//! [`Fate::NotSampled`]: crate::base::Fate::NotSampled

mod aim;
mod batch;
mod clip;
mod disc;
mod emission;
mod emitter;
mod error;
mod horizon;
mod path;
mod pilot;
mod power;
mod reach;
mod skyline;
mod yields;

pub use batch::{BATCH_PHOTONS, UnitSink, run, run_units};
pub use emission::{Emission, Receivers, Settings};
pub use error::Error;
pub use path::Tracer;
pub use pilot::{Plan, plan};
