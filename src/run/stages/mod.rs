//! What makes each unit of work: it is handed the unit, calls the rooms, and says what they left
//! behind.

mod crossings;
mod direct;
mod events;
mod eyes;
mod files;
mod fused;
mod glare;
mod glare_files;
mod moments;
mod photons;
mod pictures;
mod receivers;
mod render;
mod report;
mod series_files;
mod stores;
mod suns;
mod tile_notes;

pub(super) use crossings::air;
pub(super) use direct::integrate;
pub(super) use eyes::eyes;
pub(super) use glare::glare;
pub(super) use moments::luminances;
pub(super) use photons::{Traced, pages, share, trace};
pub(super) use pictures::pictures;
pub(super) use receivers::{check as check_receivers, place, received};
pub(super) use render::{annual, background, hits, series};
pub(super) use report::{report, verdicts};
pub(super) use suns::suns;
