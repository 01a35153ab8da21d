use std::time::Instant;

use serde_json::json;

use crate::run::error::Error;
use crate::run::job::{Job, Stage};
use crate::sky;

/// Writes the timesteps.
pub(in crate::run) fn suns(job: &mut Job<'_>) -> Result<(), Error> {
    let key = job.resolved.suns_key()?;
    if !job.needs(Stage::Suns, "suns", &key) {
        return Ok(());
    }
    let began = Instant::now();
    let name = job.folder.suns();
    let timeline = job.timeline()?;
    let steps = timeline.steps.len();
    job.folder.write(&name, |mut out| sky::write_csv(&mut out, timeline))?;
    job.progress.say(&format!("suns: {steps} timesteps with the sun above the horizon"));
    job.done("suns", &key, &[name], began, json!({ "timesteps": steps }))
}
