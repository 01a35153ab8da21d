//! The order of the stages: the only place that knows it, and that joins rooms that don't know each
//! other. Units of work, resuming, disk space, the log.

mod clean;
mod cpu;
mod error;
mod estimate;
mod job;
mod log;
pub mod replay;
mod runner;
mod site_plan;
mod stages;
mod units;
mod verify;

pub use clean::{Cleaned, Part, Usage, clean};
pub use cpu::{Took, Watch};
pub use error::Error;
pub use estimate::{Estimate, StageEstimate, bytes_in_words, estimate};
pub use job::{Options, Stage, Summary};
pub use runner::run;
pub use site_plan::draw_site;
pub use units::{HandedOn, OfView, Unit, Work, units};
pub use verify::verify;
