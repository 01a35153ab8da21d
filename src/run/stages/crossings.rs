//! Receivers in free air: photons are sent through discs at them, in a run of their own, and kept in
//! a store of their own. So what lands, and every map of it, is the same whoever stands in the air,
//! and an observer more costs no second trace of the scene.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;

use super::photons::{Done, Filling, Traced, fill};
use crate::base::{SensorSheet, VirtualSensor};
use crate::pages;
use crate::project::PhotonGather;
use crate::receivers::air::{Crossings, InAir};
use crate::receivers::points::read_points;
use crate::render::sensors;
use crate::render::{Hit, HitMap, VirtualSensors};
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::trace::{Emission, Settings, Through, Tracer};

/// Crossings of each disc that are aimed at, at least; no more in all than `photons.stored`.
const CROSSINGS: u64 = 10_000;

/// What crossed discs, and the discs.
pub(super) struct Air {
    crossings: Crossings,
    gates: Vec<VirtualSensor>,
}

impl Air {
    /// What the unit left; `None` where no point stands in free air.
    pub fn open(job: &Job<'_>, of: OfView<'_>, hits: &HitMap) -> Result<Option<Self>, Error> {
        let OfView { candidate, view } = of;
        if view.points().is_none() {
            return Ok(None);
        }
        let set = read_points(&job.folder, view)?;
        let cache_bytes = job.options.page_cache_bytes;
        let crossings = Crossings::open(&job.folder, &candidate.name, (&set, view), cache_bytes)?;
        let Some(crossings) = crossings else { return Ok(None) };
        let gates = gates(job, hits, &crossings.air)?;
        Ok(Some(Self { crossings, gates }))
    }

    /// What maps and series are made from.
    pub fn passed(&self) -> VirtualSensors<'_> {
        let Crossings { air, store } = &self.crossings;
        VirtualSensors { store, discs: &self.gates, sheet: air.sheet, columns: &air.points }
    }
}

fn gates(job: &Job<'_>, hits: &HitMap, air: &InAir) -> Result<Vec<VirtualSensor>, Error> {
    let site = job.site()?;
    let gate_of = |&point: &usize| {
        let Hit { position, normal, .. } = hits.hits[point];
        sensors::virtual_sensor(position.as_dvec3(), normal.as_dvec3(), air.radius_m, site)
    };
    Ok(air.points.iter().map(gate_of).collect())
}

/// Sends photons through the discs of a set; makes nothing where no point stands in free air.
pub(in crate::run) fn air(
    job: &Job<'_>,
    of: OfView<'_>,
    gather: &PhotonGather,
    key: &str,
) -> Result<Made, Error> {
    let view = of.view;
    let Some(air) = InAir::of(&read_points(&job.folder, view)?, view) else {
        return Ok(Made::new(Vec::new(), json!({ "receivers": 0 })));
    };
    let gates = gates(job, &job.folder.read_hits(&view.name)?, &air)?;
    let bandwidth = gather.series_bandwidth.unwrap_or_default() as u64;
    let each = bandwidth.max(3 * job.timeline()?.steps.len() as u64).max(CROSSINGS);
    let wanted = (gates.len() as u64 * each).min(job.resolved.trace.stored);
    let store = send(job, of, (&gates, air.sheet), wanted, key)?;
    Ok(Made::new(vec![store], json!({ "receivers": gates.len() })))
}

fn send(
    job: &Job<'_>,
    of: OfView<'_>,
    (gates, sheet): (&[VirtualSensor], SensorSheet),
    wanted: u64,
    key: &str,
) -> Result<PathBuf, Error> {
    let OfView { candidate, view } = of;
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
    let tracer = Tracer::through(&emission, &Through { sensors: gates, sheet, most })?;
    let name = of.to_string();
    let spill = job.folder.prepare(&job.folder.air_spill(&candidate.name, &view.name))?;
    let filling = Filling {
        name: &name,
        key,
        shard: None,
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
    let store = job.folder.air(&candidate.name, &view.name);
    let path = job.folder.prepare(&store)?;
    let memory = job.options.memory_bytes / 4 * 3;
    let built = pages::build(&spill, &path, &about, memory, job.progress)?;
    job.progress.say(&format!(
        "{name}: {} crossings of {} receivers in free air, {} photons sent in {:.1} s",
        built.photons,
        gates.len(),
        tally.sent.photons,
        began.elapsed().as_secs_f64(),
    ));
    Ok(store)
}
