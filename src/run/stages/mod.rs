//! What makes each unit of work: it is handed the unit, calls the rooms, and says what they left
//! behind.

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

pub(super) use direct::integrate;
pub(super) use eyes::eyes;
pub(super) use glare::glare;
pub use judged::Judgement;
pub(super) use judged::read as read_judgements;
pub(super) use moments::luminances;
pub(super) use passing::air;
pub(super) use photons::{Traced, pages, share, trace};
pub(super) use pictures::pictures;
pub(super) use receivers::{check as check_receivers, place, received};
pub(super) use render::{annual, background, hits, series};
pub(super) use report::{report, verdicts};
pub(super) use suns::suns;
