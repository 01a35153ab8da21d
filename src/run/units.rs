//! All units of work of a plan: their stages, their names in the manifest, and the keys that they
//! must have been made from.

use super::error::Error;
use super::job::Stage;
use super::stages;
use crate::project::Resolved;
use crate::project::{Manifest, key_of};

/// A unit of work that the plan asks for.
#[derive(Clone, Debug)]
pub struct Planned {
    /// The stage that makes it.
    pub stage: Stage,
    /// Its name in the manifest.
    pub unit: String,
    /// What it must have been made from; `None` for the report, which follows from the manifest.
    pub key: Option<String>,
}

impl Planned {
    /// Whether it was made from the plan's settings and all that it left behind is there.
    pub fn is_current(&self, manifest: &Manifest, run: &std::path::Path) -> bool {
        match &self.key {
            Some(key) => manifest.is_current(run, &self.unit, key),
            None => manifest.units.get(&self.unit).is_some_and(|u| u.is_whole(run)),
        }
    }
}

/// Every unit of a plan, in the order of the stages.
///
/// # Errors
/// When settings can't be hashed.
pub fn units(resolved: &Resolved) -> Result<Vec<Planned>, Error> {
    let mut all = Vec::new();
    let mut add = |stage: Stage, unit: String, key: Option<String>| {
        all.push(Planned { stage, unit, key });
    };
    add(Stage::Suns, "suns".into(), Some(resolved.suns_key()?));
    for candidate in resolved.candidates.iter().filter(|_| resolved.needs_photons()) {
        let photons = resolved.photons_key(candidate)?;
        let pages = key_of("pages", &photons)?;
        add(Stage::Trace, format!("trace {}", candidate.name), Some(photons));
        add(Stage::Pages, format!("pages {}", candidate.name), Some(pages));
    }
    for view in resolved.with_sensors() {
        let hits = resolved.hits_key(view)?;
        let direct = key_of("direct", &(&hits, resolved.suns_key()?))?;
        add(Stage::Render, format!("hits {}", view.name), Some(hits));
        if view.points.is_none() {
            add(Stage::Render, format!("direct {}", view.name), Some(direct));
        }
        for candidate in &resolved.candidates {
            let render = resolved.render_key(candidate, view)?;
            for &threshold in &resolved.project.glare.thresholds_w_m2 {
                let unit = format!("glare {} {} {threshold}", candidate.name, view.name);
                add(Stage::Glare, unit, Some(resolved.glare_key(candidate, view, threshold)?));
            }
            if view.points.is_some() {
                let unit = stages::received_unit(candidate, view);
                add(Stage::Glare, unit, Some(resolved.received_key(candidate, view)?));
            }
            let unit = format!("render {} {}", candidate.name, view.name);
            add(Stage::Render, unit, Some(render));
        }
    }
    if let Some(key) = resolved.eyes_key()? {
        add(Stage::Glare, stages::EYES_UNIT.into(), Some(key));
    }
    add(Stage::Pictures, "pictures".into(), Some(stages::pictures_key(resolved)?));
    if let Some(key) = resolved.moments_key()? {
        add(Stage::Pictures, stages::MOMENTS_UNIT.into(), Some(key));
    }
    add(Stage::Report, "report".into(), None);
    all.sort_by_key(|p| p.stage);
    Ok(all)
}

/// The stage that makes a unit of this name.
pub fn stage_of(unit: &str) -> Option<Stage> {
    match unit.split(' ').next()? {
        "hits" | "direct" => Some(Stage::Render),
        first => Stage::ALL.into_iter().find(|s| s.name() == first),
    }
}
