//! From the sun to the place where a photon lands.
//!
//! Only the PV emits, and only what may land. The BSDF is drawn from a unit square for each of its
//! lobes (`Chart`); for each sun and PV surface these are cut into smaller squares, those with
//! the largest waste first, and a square is kept only for those pieces of the surface from which a
//! cone that holds all its directions, for all of the sun's disc, doesn't clear the horizon: a
//! conservative one, for each piece and compass direction, of what lies within the path limit. So
//! what is left out provably reaches nothing. Squares are cut as finely as the photons wanted for
//! each sun are worth, and again as photons come to them: memory doesn't grow with the suns.
//!
//! Photon `n` of `N` belongs to the position `(n + xi) / N` in the cumulative distribution over
//! (timestep, PV surface, square), weighed with `E * A * W`: irradiance, area of the pieces, and an
//! upper bound over square and disc of `density * cos`. It draws a direction to the sun's disc and
//! a point of the square, survives with `density * cos / W`, starts from one of the pieces, and
//! flies to where it lands. Whoever survives carries the same flux, `sum(E A W) / N`.
//!
//! What falls onto the PV and what it scatters follow from integrals over sun, disc and BSDF; what
//! no photon carried of it was `Fate::NotSampled`, so the tally closes. The blocked flux counts
//! the shadow on photons that would have flown towards the neighbourhood alone: the others aren't
//! asked.
//!
//! [`Through`] virtual sensors in free air photons are sent in a run of their own, aimed at them
//! alone: what lands, and what is stored of it, doesn't depend on who stands in the air. What can't
//! cross a virtual sensor is `Fate::NotSampled` there, what lands before it does
//! `Fate::Escaped`.
//!
//! `Fate::Escaped`: crate::base::Fate::Escaped `Fate::NotSampled`:
//! crate::base::Fate::NotSampled `Chart`: crate::bsdf::Chart

mod aim;
mod batch;
mod clip;
mod compass;
mod disc;
mod emission;
mod emitter;
mod error;
mod horizon;
mod path;
mod pilot;
mod plan;
mod power;
mod reach;
mod replay;
mod skyline;
mod virtual_sensors;
mod yields;

pub use batch::UnitSink;
pub use emission::{Emission, Receivers, Settings};
pub use error::Error;
pub use path::Tracer;
pub use plan::{BATCH_PHOTONS, Plan};
pub use replay::Retold;
pub use virtual_sensors::Through;
