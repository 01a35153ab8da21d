//! Receivers in free air: photons are sent through their gates, in a run of their own, and kept in
//! a store of their own. So what lands, and every map of it, is the same whoever stands in the air,
//! and an observer more costs no second trace of the scene.

use std::time::Instant;

use super::photons::{Done, Filling, Traced, fill};
use crate::base::{Gate, GateSheet};
use crate::pages::{self, Access, OpenOptions, Store};
use crate::project::key_of;
use crate::project::{Candidate, PlannedView};
use crate::receivers::air::{Crossings, InAir};
use crate::receivers::points::read_points;
use crate::render::sensors;
use crate::render::{Hit, HitMap, Passed};
use crate::run::error::Error;
use crate::run::job::{Job, Stage};
use crate::trace::{Emission, Settings, Through, Tracer};

/// Crossings of each gate that are aimed at, at least; no more in all than `photons.stored`.
const CROSSINGS: u64 = 10_000;

/// Crossings, and the gates that they crossed.
pub(super) struct Made {
    crossings: Crossings,
    gates: Vec<Gate>,
}

impl Made {
    /// What maps and series are made from.
    pub fn passed(&self) -> Passed<'_> {
        let Crossings { air, store } = &self.crossings;
        Passed { store, gates: &self.gates, sheet: air.sheet, sensors: &air.points }
    }
}

/// Sends photons through the gates of a set, unless that was done; `None` where no point stands in
/// free air.
pub(super) fn crossings(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    hits: &HitMap,
) -> Result<Option<Made>, Error> {
    if view.points.is_none() {
        return Ok(None);
    }
    let set = read_points(&job.folder, view)?;
    let Some(air) = InAir::of(&set, view) else { return Ok(None) };
    let site = job.site()?;
    let gate_of = |&point: &usize| {
        let Hit { position, normal, .. } = hits.hits[point];
        sensors::gate(position.as_dvec3(), normal.as_dvec3(), air.radius_m, site)
    };
    let gates: Vec<Gate> = air.points.iter().map(gate_of).collect();
    let bandwidth = view.series_bandwidth.unwrap_or_default() as u64;
    let each = bandwidth.max(3 * job.timeline()?.steps.len() as u64).max(CROSSINGS);
    let wanted = (gates.len() as u64 * each).min(job.resolved.trace.stored);
    let upstream = (job.resolved.photons_key(candidate)?, job.resolved.hits_key(view)?);
    let key = key_of("air", &(upstream, wanted, air.radius_m))?;
    let name = job.folder.air(&candidate.name, &view.name);
    let path = job.folder.prepare(&name)?;
    let options = OpenOptions { cache_bytes: job.options.page_cache_bytes, access: Access::Mapped };
    let current = (!job.is_forced(Stage::Render)).then(|| Store::open(&path, &options).ok());
    let current = current.flatten().filter(|s| s.info().provenance.settings == key);
    let store = match current {
        Some(store) => store,
        None => {
            job.remove(&name)?;
            send(job, candidate, view, (&gates, air.sheet), wanted, &key)?;
            Store::open(&path, &options)?
        }
    };
    Ok(Some(Made { crossings: Crossings { air, store }, gates }))
}

fn send(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (gates, sheet): (&[Gate], GateSheet),
    wanted: u64,
    key: &str,
) -> Result<(), Error> {
    let began = Instant::now();
    let (site, timeline) = (job.site()?, job.timeline()?);
    let emission = Emission {
        site,
        timeline,
        bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
        settings: Settings { stored: wanted.max(1), ..job.resolved.trace },
    };
    // No more effort than all surfaces together were worth.
    let most = Traced::read(job, candidate)?.plan.emitted;
    let tracer = Tracer::through(&emission, &Through { gates, sheet, most })?;
    let name = format!("{} {}", candidate.name, view.name);
    let spill_name = job.folder.air_spill(&candidate.name, &view.name);
    let spill = job.folder.prepare(&spill_name)?;
    let filling = Filling {
        name: &name,
        key,
        shard: None,
        stage: Stage::Render,
        spill: &spill,
        bounds: sheet.bounds(),
        expected: wanted,
    };
    let Done { plan, units, .. } = fill(job, &tracer, &filling)?;
    let tally = Done::tally(units, &plan).unwrap_or_default();
    let discs = format!("{}, side by side in the order of the sensors", gates.len());
    let about = pages::About {
        provenance: job.provenance(
            key,
            &[("material", &candidate.name), ("view", &view.name), ("gates", &discs)],
        ),
        timesteps: u32::try_from(timeline.steps.len()).unwrap_or(u32::MAX),
        surfaces: site.pv.iter().map(|s| s.name.clone()).collect(),
        basis: timeline.basis,
        tally,
    };
    let path = job.folder.prepare(&job.folder.air(&candidate.name, &view.name))?;
    let memory = job.options.memory_bytes / 4 * 3;
    let built = pages::build(&spill, &path, &about, memory, job.progress)?;
    job.remove(&spill_name)?;
    job.progress.say(&format!(
        "{name}: {} crossings of {} receivers in free air, {} photons sent in {:.1} s",
        built.photons,
        gates.len(),
        tally.sent.photons,
        began.elapsed().as_secs_f64(),
    ));
    Ok(())
}
