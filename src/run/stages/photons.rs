//! From the sun to the photon store: `trace` and `pages`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glintmap_formats::seal;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::base::{Aabb, Photon, PhotonSink, SinkError, Tally};
use crate::pages::{self, Spill};
use crate::run::job::{Job, Stage};
use crate::run::manifest::key_of;
use crate::run::resolve::Candidate;
use crate::run::{Error, Shard};
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
        let path = job.folder.at(&job.folder.tally(&candidate.name));
        let text = fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
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

fn unit(stage: &str, candidate: &Candidate) -> String {
    format!("{stage} {}", candidate.name)
}

fn write(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    let text = serde_json::to_vec_pretty(value).map_err(std::io::Error::from)?;
    seal::write_bytes(path, &text).map_err(|source| Error::Write { path: path.to_owned(), source })
}

/// Traces each candidate's photons into its spill.
pub(in crate::run) fn trace(job: &mut Job<'_>) -> Result<(), Error> {
    let resolved = job.resolved;
    for candidate in resolved.candidates.iter().filter(|_| resolved.needs_photons()) {
        let key = resolved.photons_key(candidate)?;
        if let Some(shard) = job.options.shard {
            share(job, candidate, &key, shard)?;
            continue;
        }
        let name = unit("trace", candidate);
        if !job.needs(Stage::Trace, &name, &key) {
            continue;
        }
        let began = Instant::now();
        for note in &candidate.notes {
            job.progress.say(&format!("{}: {note}", candidate.name));
        }
        let spill = job.folder.prepare(&job.folder.spill(&candidate.name))?;
        let Done { plan, units, .. } = match shares(job, candidate, &key)? {
            Some((parts, done)) => {
                // What an earlier merge left is of no use.
                let memory = job.options.memory_bytes / 4;
                pages::join(&parts, &spill, memory, job.progress)?;
                done
            }
            None => land(job, candidate, &key, None, &spill)?,
        };
        let Some(tally) = Done::tally(units, &plan) else {
            let path = job.folder.at(&job.folder.shards(&candidate.name));
            return Err(Error::Shards { path, what: "units of the plan are missing".into() });
        };
        let traced = Traced { plan, effective_photons: tally.effective_photons(), tally };
        let tally_name = job.folder.tally(&candidate.name);
        write(&job.folder.prepare(&tally_name)?, &traced)?;
        job.progress.say(&told(candidate, &traced, began));
        let facts = json!({ "sent": tally.sent.photons, "stored": tally.stored.photons });
        job.done(&name, &key, &[tally_name], began, facts)?;
    }
    Ok(())
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
        stage: Stage::Trace,
        spill,
        bounds: site.bounds,
        expected: resolved.trace.stored / shard.map_or(1, |s| u64::from(s.of)),
    };
    let name = || candidate.name.clone();
    let tracer = Tracer::new(&emission);
    let tracer = tracer.map_err(|source| Error::Photons { name: name(), source })?;
    fill(job, &tracer, &filling)
}

/// What a spill is filled for.
pub(super) struct Filling<'a> {
    /// For people.
    pub name: &'a str,
    /// What decides the photons.
    pub key: &'a str,
    pub shard: Option<Shard>,
    /// The stage; where that is forced, nothing is gone on with.
    pub stage: Stage,
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
    let &Filling { name, key, shard, stage, spill, bounds, expected } = filling;
    let memory = job.options.memory_bytes / 4;
    let read = |note: &str| serde_json::from_str::<Done>(note).ok();
    let forced = job.is_forced(stage);
    // A spill that isn't sealed, or was made from other settings, is of no use.
    let accept = |note: &str| !forced && read(note).is_some_and(|done| done.fits(key, shard));
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
            let plan = tracer.plan(job.progress);
            let plan = plan.map_err(|source| Error::Photons { name: name.to_owned(), source })?;
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

/// The file that says that a share is complete.
const SHARE: &str = "traced.json";

/// Traces one share of a candidate's photons.
fn share(job: &mut Job<'_>, candidate: &Candidate, key: &str, shard: Shard) -> Result<(), Error> {
    let name = format!("trace {} {}", candidate.name, shard.name());
    let folder = job.folder.shards(&candidate.name).join(shard.name());
    let path = job.folder.at(&folder).join(SHARE);
    let forced = job.options.force.is_some_and(|f| f <= Stage::Trace);
    if !forced && read_share(&path).is_some_and(|done| done.fits(key, Some(shard))) {
        job.summary.current.push(name);
        return Ok(());
    }
    let began = Instant::now();
    job.remove(&folder.join(SHARE))?;
    let spill = job.folder.prepare(&folder.join("spill"))?;
    let done = land(job, candidate, key, Some(shard), &spill)?;
    write(&path, &done)?;
    let units = done.units.len();
    job.progress.say(&format!("{}: {units} of {} units", name, done.plan.units()));
    job.note(&name, began, json!({ "units": units }))
}

fn read_share(path: &Path) -> Option<Done> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
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
        let folder = path.join(shard.name());
        match read_share(&folder.join(SHARE)) {
            None => missing.push(shard.name()),
            Some(done) if !done.fits(key, Some(shard)) => {
                missing.push(format!("{} (it is from other settings)", shard.name()));
            }
            Some(done) => {
                parts.push(folder.join("spill"));
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

/// Sorts each candidate's spill into its photon store.
pub(in crate::run) fn pages(job: &mut Job<'_>) -> Result<(), Error> {
    let resolved = job.resolved;
    for candidate in resolved.candidates.iter().filter(|_| resolved.needs_photons()) {
        let key = key_of("pages", &resolved.photons_key(candidate)?)?;
        let name = unit("pages", candidate);
        let spill_name = job.folder.spill(&candidate.name);
        if !job.needs(Stage::Pages, &name, &key) {
            // Photons that were sorted already: the run was stopped before they could go.
            job.remove(&spill_name)?;
            continue;
        }
        let began = Instant::now();
        if !job.folder.at(&spill_name).exists() {
            // The photons were traced, sorted, and then the store was removed or forced anew.
            job.manifest.units.remove(&unit("trace", candidate));
            trace(job)?;
        }
        let traced = Traced::read(job, candidate)?;
        let store_name = job.folder.store(&candidate.name);
        let store = job.folder.prepare(&store_name)?;
        let (site, timeline) = (job.site()?, job.timeline()?);
        let about = pages::About {
            provenance: job.provenance(&key, &[("material", &candidate.name)]),
            timesteps: u32::try_from(timeline.steps.len()).unwrap_or(u32::MAX),
            surfaces: site.pv.iter().map(|s| s.name.clone()).collect(),
            basis: timeline.basis,
            tally: traced.tally,
        };
        let memory = job.options.memory_bytes / 4 * 3;
        let built =
            pages::build(&job.folder.at(&spill_name), &store, &about, memory, job.progress)?;
        let facts = serde_json::to_value(&built).map_err(std::io::Error::from)?;
        job.done(&name, &key, &[store_name], began, facts)?;
        job.remove(&spill_name)?;
        job.remove(&job.folder.shards(&candidate.name))?;
    }
    Ok(())
}
