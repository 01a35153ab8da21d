//! The project file, the plan, the stages and the manifest: the only place that knows the order
//! of the stages and joins rooms that don't know each other.

mod clean;
mod clock;
mod cpu;
mod create;
mod error;
mod estimate;
mod eyes;
mod folder;
mod job;
mod log;
pub mod manifest;
pub mod mirror;
mod points;
pub mod probe;
mod project;
mod reader;
mod received;
pub mod replay;
mod resolve;
mod runner;
mod set;
mod shard;
mod site_plan;
mod stages;
pub mod sweep;
mod units;
mod verify;
mod words;

pub use clean::{Cleaned, Part, Usage, clean};
pub use clock::Clock;
pub use cpu::{Took, Watch};
pub use create::{Demo, NewScene, Quality, SiteAt, create, demo};
pub use error::Error;
pub use estimate::{Estimate, StageEstimate, bytes_in_words, estimate};
pub use folder::Folder;
pub use job::{Options, Stage, Summary};
pub use points::receivers;
pub use project::Project;
pub use resolve::{Candidate, DRAFT_BELOW_PHOTONS, PlannedView, Resolved};
pub use runner::run;
pub use set::Assignment;
pub use shard::Shard;
pub use site_plan::draw_site;
pub use stages::Judgement;
pub use verify::verify;
