//! People and places: where they stand, what arrives there by photons or by integration, what an
//! eye sees of the PV, and what the mirror rule of the authorities says.

pub mod air;
pub mod clock;
mod error;
pub mod eyes;
pub mod metrics;
pub mod mirror;
pub mod points;
pub mod probe;
pub mod received;
pub mod sweep;
pub mod tables;
mod year;

pub use clock::Clock;
pub use error::Error;
pub use points::receivers;
