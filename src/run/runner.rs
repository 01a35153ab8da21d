//! Runs what is missing or out of date, in the order of the stages.

use std::time::Instant;

use super::error::Error;
use super::estimate::refuse_full_disk;
use super::job::{Job, Made, Summary};
use super::log::{Log, Logged};
use super::stage::{Options, Stage};
use super::stages;
use super::units::{Unit, Work};
use crate::base::Progress;
use crate::project::{Folder, Resolved};
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
    let told = Logged::new(progress, log.clone());
    let mut job = Job::new(resolved, options, folder, log, &told)?;
    let outcome = stages_of(&mut job);
    job.log.end(outcome.as_ref().err())?;
    outcome?;
    if options.until == Stage::Report {
        job.summary.verdicts = judgements::read(&job.folder)?;
    }
    Ok(job.summary)
}

fn stages_of<'a>(job: &mut Job<'a>) -> Result<(), Error> {
    job.resolved.notes.iter().for_each(|note| job.warn(note.clone()));
    refuse_full_disk(job)?;
    // Mistakes in the scene come up before anything is made.
    if job.has_to_read_the_scene() {
        job.site()?;
        stages::check_receivers(job)?;
    }
    if let Some(shard) = job.options.shard {
        // Other shares may be at work in the same folder: what all share isn't touched.
        return stages::share(job, shard);
    }
    let until = job.options.until;
    for stage in Stage::ALL.into_iter().filter(|stage| *stage <= until) {
        job.forget(stage)?;
        let units: Vec<Unit<'a>> =
            job.plan.iter().filter(|unit| unit.stage == stage).cloned().collect();
        for unit in &units {
            if job.is_current(unit) {
                job.settle(unit)?;
                continue;
            }
            job.begin(unit)?;
            let began = Instant::now();
            let made = make(job, unit)?;
            job.done(&unit.name, &unit.key, made, began)?;
            job.settle(unit)?;
        }
        job.end_of_stage();
    }
    Ok(())
}

/// Makes a unit.
fn make(job: &Job<'_>, unit: &Unit<'_>) -> Result<Made, Error> {
    let key = unit.key.as_str();
    match unit.work {
        Work::Suns => stages::suns(job),
        Work::Trace(candidate) => stages::trace(job, candidate, key),
        Work::Pages(candidate) => stages::pages(job, candidate, key),
        Work::Hits(view, picture) => stages::hits(job, view, picture, key),
        Work::Background(view, picture) => stages::background(job, view, picture, key),
        Work::Place(set, points) => stages::place(job, set, points, key),
        Work::Air(of, gather) => stages::air(job, of, gather, key),
        Work::Annual(of, gather) => stages::annual(job, of, gather, key),
        Work::Series(of, gather) => stages::series(job, of, gather, key),
        Work::Integrate(of) => stages::integrate(job, of, key),
        Work::Glare(of, threshold) => stages::glare(job, of, threshold, key),
        Work::Received(of) => stages::received(job, of),
        Work::Eyes => stages::eyes(job),
        Work::Pictures => stages::pictures(job, key),
        Work::Moments => stages::luminances(job, key),
        Work::Verdicts => stages::verdicts(job),
        Work::Report => stages::report(job, key),
    }
}
