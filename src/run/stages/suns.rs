use glintmap_formats::seal;
use serde_json::json;

use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::sky;

/// Writes the timesteps.
pub(in crate::run) fn suns(job: &Job<'_>) -> Result<Made, Error> {
    let name = job.folder.suns();
    let path = job.folder.prepare(&name)?;
    let timeline = job.timeline()?;
    let steps = timeline.steps.len();
    seal::write(&path, |out| sky::write_csv(out, timeline))
        .map_err(|source: std::io::Error| Error::Write { path: path.clone(), source })?;
    job.progress.say(&format!("suns: {steps} timesteps with the sun above the horizon"));
    Ok(Made::new(vec![name], json!({ "timesteps": steps })))
}
