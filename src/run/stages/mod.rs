//! One file a stage. Each asks the manifest what is current, calls the rooms, and records what
//! they left behind.

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

pub(super) use eyes::UNIT as EYES_UNIT;
pub(super) use glare::glare;
pub(super) use moments::UNIT as MOMENTS_UNIT;
pub(super) use photons::{Traced, pages, trace};
pub(super) use pictures::{key as pictures_key, pictures};
pub(super) use receivers::{check as check_receivers, received_unit};
pub(super) use render::render;
pub(super) use report::report;
pub(super) use suns::suns;
