//! One file a stage. Each asks the manifest what is current, calls the rooms, and records what
//! they left behind.

mod glare;
mod photons;
mod pictures;
mod render;
mod report;
mod suns;
mod verdicts;

pub(super) use glare::glare;
pub(super) use photons::{Traced, pages, trace};
pub(super) use pictures::{key as pictures_key, pictures};
pub(super) use render::render;
pub(super) use report::report;
pub(super) use suns::suns;
