use serde_json::json;

use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::sky;

/// Writes the timesteps.
pub(in crate::run) fn suns(job: &Job<'_>) -> Result<Made, Error> {
    let name = job.folder.suns();
    let timeline = job.timeline()?;
    let steps = timeline.steps.len();
    job.folder.write(&name, |mut out| sky::write_csv(&mut out, timeline))?;
    job.progress.say(&format!("suns: {steps} timesteps with the sun above the horizon"));
    Ok(Made::new(vec![name], json!({ "timesteps": steps })))
}
