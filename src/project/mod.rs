//! The project: what `project.toml` says, checked and with all defaults filled in, and the folder
//! that its run leaves behind.
//!
//! [`Project`] is the file as it is written, table by table; [`Resolved`] is what the other rooms
//! take. [`artifacts`] names the files of a run, [`Folder`] reads and writes them, [`Manifest`] says what was made from what.

pub mod artifacts;
mod create;
mod error;
mod folder;
pub mod keys;
mod manifest;
mod places;
mod read;
mod reader;
mod resolve;
mod results;
mod set;
mod shard;
mod tables;
mod view_tables;
mod views;
mod words;

pub use artifacts::{GlareMap, Map, SeriesOf};
pub use create::{Demo, NewScene, Quality, SiteAt, create, demo};
pub use error::Error;
pub use folder::Folder;
pub use manifest::{Manifest, hash_path};
pub use places::{Key, Mistake, Mistakes, Place};
pub use resolve::{Camera, Candidate, DRAFT_BELOW_PHOTONS, MOMENTS, Made, PlannedMoment, Resolved};
pub use results::Results;
pub use set::Assignment;
pub use shard::Shard;
pub use tables::{MaterialTable, Project, SiteTable};
pub use view_tables::{Ids, MomentTable, ObserverTable, RegionTable, ViewTable};
pub use views::{
    Estimator, PhotonGather, Picture, PlannedView, Points, RECEIVERS, SeriesKept, Sight, Target,
};
pub use words::WordOr;
