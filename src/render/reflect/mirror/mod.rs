//! The mirror rule of the authorities: at this window, when and for how long?
//!
//! [`MirrorRule`] looks up the suns of a whole year that each PV surface mirrors into a receiver;
//! [`MirrorYear`] turns them into minutes per day, hours per year, and a chart; [`Anywhere`] sums
//! a façade of many receivers up.

mod anywhere;
mod rule;
mod suns;
#[cfg(test)]
mod tests;
mod year;

pub use anywhere::Anywhere;
pub use rule::{Lit, MirrorReceiver, MirrorRule, SEPARATION_DEG};
pub use suns::MirrorTimes;
pub use year::{MirrorDay, MirrorRun, MirrorSummary, MirrorYear};
