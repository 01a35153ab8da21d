//! One file a stage. Each asks the manifest what is current, calls the rooms, and records what
//! they left behind.

mod glare;
mod photons;
mod pictures;
mod render;
mod report;
mod suns;
mod verdicts;

use super::Error;
use super::manifest::key_of;
use super::runner::{Job, Stage};

pub(super) use glare::glare;
pub(super) use photons::{pages, trace};
pub(super) use pictures::pictures;
pub(super) use render::render;
pub(super) use report::report;
pub(super) use suns::suns;

/// Whether any unit that reads the scene has to be made.
pub(super) fn needs_scene(job: &Job<'_>) -> Result<bool, Error> {
    let resolved = job.resolved;
    let stale = |stage: Stage, unit: String, key: String| {
        let wanted = stage <= job.options.until;
        let forced = job.options.force.is_some_and(|f| stage >= f);
        wanted && (forced || !job.manifest.is_current(job.folder.root(), &unit, &key))
    };
    for candidate in &resolved.candidates {
        let key = resolved.photons_key(candidate)?;
        let pages = key_of("pages", &key)?;
        if stale(Stage::Trace, format!("trace {}", candidate.name), key)
            || stale(Stage::Pages, format!("pages {}", candidate.name), pages)
        {
            return Ok(true);
        }
    }
    for view in &resolved.views {
        if stale(Stage::Render, format!("hits {}", view.name), resolved.hits_key(view)?) {
            return Ok(true);
        }
    }
    Ok(false)
}
