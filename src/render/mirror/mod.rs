//! The mirror rule of the authorities: at this window, when and for how long?
//!
//! [`MirrorRule`] looks up the suns of a whole year that each PV surface mirrors into a receiver;
//! [`MirrorYear`] turns them into minutes per day, hours per year, and a chart.

mod region;
mod rule;
mod suns;
#[cfg(test)]
mod tests;
mod year;

pub use region::points_on;
pub use rule::{Lit, MirrorReceiver, MirrorRule, SEPARATION_DEG};
pub use suns::MirrorTimes;
pub use year::{MirrorDay, MirrorRun, MirrorSummary, MirrorYear};
