//! From the sun to the photon store: `trace` and `pages`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::base::{Aabb, Photon, PhotonSink, SinkError, Tally};
use crate::pages::{self, Spill};
use crate::project::{Candidate, Shard};
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::Work;
use crate::trace::{self, Emission, Plan, Tracer, UnitSink};

/// Tracing that a killed run loses at most, beside the unit that it was in.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(10);

/// `tally.json`: how many photons were sent, and where they went.
#[derive(Debug, Deserialize, Serialize)]
pub(in crate::run) struct Traced {
    /// From the pilot.
    pub plan: Plan,
    /// Photons and flux by fate.
    pub tally: Tally,
    /// `(sum Phi)^2 / sum Phi^2`.
    pub effective_photons: f64,
}

impl Traced {
    /// What the stage `trace` left of a candidate.
    pub fn read(job: &Job<'_>, candidate: &Candidate) -> Result<Self, Error> {
        Ok(job.folder.read_json(&job.folder.tally(&candidate.name))?)
    }
}

/// Which units of a plan are in a spill, and from which settings: the note of its checkpoints, and
/// `traced.json` beside the completed spill of a share.
#[derive(Debug, Deserialize, Serialize)]
pub(super) struct Done {
    key: String,
    shard: Option<Shard>,
    pub plan: Plan,
    pub units: Vec<(u64, Tally)>,
}

impl Done {
    fn fits(&self, key: &str, shard: Option<Shard>) -> bool {
        self.key == key && self.shard == shard
    }

    /// The tally of all units, which must be complete.
    pub fn tally(mut units: Vec<(u64, Tally)>, plan: &Plan) -> Option<Tally> {
        units.sort_by_key(|(unit, _)| *unit);
        let whole = units.iter().map(|(unit, _)| *unit).eq(0..plan.units());
        let mut sum = Tally::default();
        units.iter().for_each(|(_, tally)| sum.add(tally));
        whole.then_some(sum)
    }
}

/// Keeps photons in the spill, and seals a checkpoint now and then.
struct Keeper {
    spill: Spill,
    done: Done,
    sealed: Option<Instant>,
}

impl Keeper {
    fn seal(&mut self) -> Result<(), SinkError> {
        let note = serde_json::to_string(&self.done).map_err(std::io::Error::from)?;
        self.spill.checkpoint(&note)?;
        self.sealed = Some(Instant::now());
        Ok(())
    }
}

impl PhotonSink for Keeper {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        self.spill.accept(photons)
    }
}

impl UnitSink for Keeper {
    fn complete(&mut self, unit: u64, tally: &Tally) -> Result<(), SinkError> {
        self.done.units.push((unit, *tally));
        // The first unit at once: it holds the pilot's result as well.
        if self.sealed.is_none_or(|at| at.elapsed() >= CHECKPOINT_EVERY) {
            self.seal()
        } else {
            Ok(())
        }
    }
}

/// Traces a candidate's photons into its spill.
pub(in crate::run) fn trace(
    job: &Job<'_>,
    candidate: &Candidate,
    key: &str,
) -> Result<Made, Error> {
    let began = Instant::now();
    for note in &candidate.notes {
        job.progress.say(&format!("{}: {note}", candidate.name));
    }
    let spill = job.folder.prepare(&job.folder.spill(&candidate.name))?;
    let Done { plan, units, .. } = match shares(job, candidate, key)? {
        Some((parts, done)) => {
            // What an earlier merge left is of no use.
            let memory = job.options.memory_bytes / 4;
            pages::join(&parts, &spill, memory, job.progress)?;
            done
        }
        None => land(job, candidate, key, None, &spill)?,
    };
    let Some(tally) = Done::tally(units, &plan) else {
        let path = job.folder.at(&job.folder.shards(&candidate.name));
        return Err(Error::Shards { path, what: "units of the plan are missing".into() });
    };
    let traced = Traced { plan, effective_photons: tally.effective_photons(), tally };
    let tally_name = job.folder.tally(&candidate.name);
    job.folder.write_json(&tally_name, &traced)?;
    job.progress.say(&told(candidate, &traced, began));
    let facts = json!({ "sent": tally.sent.photons, "stored": tally.stored.photons });
    Ok(Made::new(vec![tally_name], facts))
}

/// Fills a spill with the photons of a candidate that land.
fn land(
    job: &Job<'_>,
    candidate: &Candidate,
    key: &str,
    shard: Option<Shard>,
    spill: &Path,
) -> Result<Done, Error> {
    let resolved = job.resolved;
    let site = job.site()?;
    let timeline = job.timeline()?;
    let emission = Emission {
        site,
        timeline,
        bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
        settings: resolved.trace,
    };
    let filling = Filling {
        name: &candidate.name,
        key,
        shard,
        spill,
        bounds: site.bounds,
        expected: resolved.trace.stored / shard.map_or(1, |s| u64::from(s.of)),
    };
    fill(job, &Tracer::new(&emission)?, &filling)
}

/// What a spill is filled for.
pub(super) struct Filling<'a> {
    /// For people.
    pub name: &'a str,
    /// What decides the photons.
    pub key: &'a str,
    pub shard: Option<Shard>,
    pub spill: &'a Path,
    /// Where photons lie.
    pub bounds: Aabb,
    /// How many, about.
    pub expected: u64,
}

/// Traces what is missing in a spill, from its last checkpoint on, and completes it.
pub(super) fn fill(
    job: &Job<'_>,
    tracer: &Tracer<'_>,
    filling: &Filling<'_>,
) -> Result<Done, Error> {
    let &Filling { name, key, shard, spill, bounds, expected } = filling;
    let memory = job.options.memory_bytes / 4;
    let read = |note: &str| serde_json::from_str::<Done>(note).ok();
    // A spill that isn't sealed, or a share that was made from other settings, is of no use.
    let accept = |note: &str| read(note).is_some_and(|done| done.fits(key, shard));
    let resumed = Spill::resume(spill, bounds, expected, memory, accept)?;
    let resumed = resumed.and_then(|(spill, note)| Some((spill, read(&note)?)));
    let mut keeper = match resumed {
        Some((spill, done)) => {
            let (have, all) = (done.units.len(), done.plan.units());
            job.progress.say(&format!("{name}: goes on after {have} of {all} units"));
            Keeper { spill, done, sealed: Some(Instant::now()) }
        }
        None => {
            let new = Spill::create(spill, bounds, expected, memory)?;
            job.progress.say(&format!("{name}: pilot"));
            let plan = tracer.plan(job.progress)?;
            let done = Done { key: key.to_owned(), shard, plan, units: Vec::new() };
            Keeper { spill: new, done, sealed: None }
        }
    };
    let plan = keeper.done.plan.clone();
    let missing: Vec<u64> = (0..plan.units())
        .filter(|&unit| shard.is_none_or(|s| s.has(unit)))
        .filter(|unit| keeper.done.units.iter().all(|(have, _)| have != unit))
        .collect();
    tracer.run_units(&plan, &missing, &mut keeper, job.progress)?;
    keeper.seal().map_err(trace::Error::from)?;
    keeper.spill.finish()?;
    Ok(keeper.done)
}

/// Traces one share of each candidate's photons. Other shares may be traced in the same folder at
/// the same time, so the manifest knows none of them: a share says itself what it was made from.
pub(in crate::run) fn share(job: &mut Job<'_>, shard: Shard) -> Result<(), Error> {
    for unit in job.plan.clone() {
        let Work::Trace(candidate) = unit.work else { continue };
        let name = format!("{} {}", unit.name, shard.name());
        let tally = job.folder.shard_tally(&candidate.name, shard);
        let done = read_share(job, candidate, shard).filter(|_| !job.is_forced(unit.stage));
        if done.is_some_and(|done| done.fits(&unit.key, Some(shard))) {
            job.summary.current.push(name);
            continue;
        }
        let began = Instant::now();
        let forced = job.is_forced(unit.stage);
        job.remove(tally.parent().filter(|_| forced).unwrap_or(&tally))?;
        let spill = job.folder.prepare(&job.folder.shard_spill(&candidate.name, shard))?;
        let done = land(job, candidate, &unit.key, Some(shard), &spill)?;
        job.folder.write_json(&tally, &done)?;
        let units = done.units.len();
        job.progress.say(&format!("{}: {units} of {} units", name, done.plan.units()));
        job.note(&name, began, json!({ "units": units }))?;
    }
    Ok(())
}

fn read_share(job: &Job<'_>, candidate: &Candidate, shard: Shard) -> Option<Done> {
    job.folder.read_json(&job.folder.shard_tally(&candidate.name, shard)).ok()
}

/// The spills of all shares of a candidate's photons, and what they hold together; `None` where
/// nobody traces in shares.
fn shares(
    job: &Job<'_>,
    candidate: &Candidate,
    key: &str,
) -> Result<Option<(Vec<PathBuf>, Done)>, Error> {
    let path = job.folder.at(&job.folder.shards(&candidate.name));
    let Ok(entries) = fs::read_dir(&path) else { return Ok(None) };
    let mut found: Vec<Shard> =
        entries.filter_map(|entry| Shard::of_name(entry.ok()?.file_name().to_str()?)).collect();
    found.sort_by_key(|shard| (shard.of, shard.index));
    let (Some(first), Some(last)) = (found.first(), found.last()) else { return Ok(None) };
    let wrong = |what: String| Err(Error::Shards { path: path.clone(), what });
    if first.of != last.of {
        let (a, b) = (first.name(), last.name());
        return wrong(format!("{a} and {b} don't go together, remove one kind"));
    }
    let mut whole: Option<Done> = None;
    let mut parts = Vec::new();
    let mut missing = Vec::new();
    for index in 1..=first.of {
        let shard = Shard { index, of: first.of };
        match read_share(job, candidate, shard) {
            None => missing.push(shard.name()),
            Some(done) if !done.fits(key, Some(shard)) => {
                missing.push(format!("{} (it is from other settings)", shard.name()));
            }
            Some(done) => {
                parts.push(job.folder.at(&job.folder.shard_spill(&candidate.name, shard)));
                match &mut whole {
                    Some(whole) if whole.plan != done.plan => {
                        missing.push(format!("{} (it has another plan)", shard.name()));
                    }
                    Some(whole) => whole.units.extend(done.units),
                    None => whole = Some(done),
                }
            }
        }
    }
    match whole {
        Some(whole) if missing.is_empty() => Ok(Some((parts, whole))),
        _ => wrong(format!("missing of {} shares: {}", first.of, missing.join(", "))),
    }
}

fn told(candidate: &Candidate, traced: &Traced, began: Instant) -> String {
    let t = &traced.tally;
    let share = |part: f64| 100.0 * part / t.sent.flux_w.max(f64::MIN_POSITIVE);
    format!(
        "{}: {} photons stored of {} sent in {:.1} s; of the flux {:.2} % landed, {:.1} % absorbed, {:.1} % blocked",
        candidate.name,
        t.stored.photons,
        t.sent.photons,
        began.elapsed().as_secs_f64(),
        share(t.stored.flux_w),
        share(t.absorbed.flux_w),
        share(t.blocked.flux_w),
    )
}

/// Sorts a candidate's spill into its photon store.
pub(in crate::run) fn pages(
    job: &Job<'_>,
    candidate: &Candidate,
    key: &str,
) -> Result<Made, Error> {
    let traced = Traced::read(job, candidate)?;
    let store_name = job.folder.store(&candidate.name);
    let store = job.folder.prepare(&store_name)?;
    let (site, timeline) = (job.site()?, job.timeline()?);
    let about = pages::About {
        provenance: job.provenance(key, &[("material", &candidate.name)]),
        timesteps: u32::try_from(timeline.steps.len()).unwrap_or(u32::MAX),
        surfaces: site.pv.iter().map(|s| s.name.clone()).collect(),
        basis: timeline.basis,
        tally: traced.tally,
    };
    let memory = job.options.memory_bytes / 4 * 3;
    let spill = job.folder.at(&job.folder.spill(&candidate.name));
    let built = pages::build(&spill, &store, &about, memory, job.progress)?;
    let facts = serde_json::to_value(&built).map_err(std::io::Error::from)?;
    // The spill holds what was joined from them until the store is recorded.
    job.remove(&job.folder.shards(&candidate.name))?;
    Ok(Made::new(vec![store_name], facts))
}
