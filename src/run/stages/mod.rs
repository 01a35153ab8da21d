//! One file a stage. Each asks the manifest what is current, calls the rooms, and records what
//! they left behind.

mod band;
mod direct;
mod events;
mod eyes;
mod fused;
mod glare;
mod judged;
mod moments;
mod noted;
mod passing;
mod people;
mod photons;
mod pictures;
mod receivers;
mod render;
mod report;
mod suns;
mod verdicts;
mod year;

pub(super) use eyes::UNIT as EYES_UNIT;
pub(super) use glare::glare;
pub use judged::Judgement;
pub(super) use judged::read as read_judgements;
pub(super) use moments::UNIT as MOMENTS_UNIT;
pub(super) use passing::SPILL as AIR_SPILL;
pub(super) use photons::{Traced, pages, trace};
pub(super) use pictures::{key as pictures_key, pictures};
pub(super) use receivers::{check as check_receivers, received_unit};
pub(super) use render::render;
pub(super) use report::report;
pub(super) use suns::suns;
