//! Runs what is missing or out of date, in the order of the stages.

use super::error::Error;
use super::estimate::refuse_full_disk;
use super::job::{Job, Options, Stage, Summary};
use super::log::{Log, Logged};
use super::stages;
use crate::base::Progress;
use crate::project::Folder;
use crate::project::Resolved;
use crate::report::judgements;

/// Runs a project's stages up to `options.until`.
///
/// # Errors
/// The first stage's that fails; what was sealed before stays, and the same call goes on there.
pub fn run(
    resolved: &Resolved,
    options: Options,
    progress: &dyn Progress,
) -> Result<Summary, Error> {
    let folder = Folder::new(resolved.run_folder());
    let _lock = folder.lock(options.shard)?;
    let log = Log::begin(&folder, &options)?;
    let told = Logged { progress, log: log.clone() };
    let mut job = Job::new(resolved, options, folder, log, &told)?;
    let outcome = stages_of(&mut job);
    job.log.end(outcome.as_ref().err())?;
    outcome?;
    if options.until == Stage::Report {
        job.summary.verdicts = judgements::read(&job.folder)?;
    }
    Ok(job.summary)
}

fn stages_of(job: &mut Job<'_>) -> Result<(), Error> {
    job.resolved.notes.iter().for_each(|note| job.warn(note.clone()));
    refuse_full_disk(job)?;
    // Mistakes in the scene come up before anything is made.
    if job.has_to_read_the_scene()? {
        job.site()?;
        stages::check_receivers(job)?;
    }
    for stage in Stage::ALL {
        if stage > job.options.until {
            break;
        }
        // Other shares may be at work in the same folder: what all share isn't touched.
        if job.options.shard.is_some() {
            if stage == Stage::Trace {
                stages::trace(job)?;
            }
            continue;
        }
        job.forget(stage)?;
        match stage {
            Stage::Suns => stages::suns(job)?,
            Stage::Trace => stages::trace(job)?,
            Stage::Pages => stages::pages(job)?,
            Stage::Render => stages::render(job)?,
            Stage::Glare => stages::glare(job)?,
            Stage::Pictures => stages::pictures(job)?,
            Stage::Report => stages::report(job)?,
        }
    }
    Ok(())
}
