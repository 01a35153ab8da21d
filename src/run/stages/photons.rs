//! From the sun to the photon store: `trace` and `pages`.

use std::time::Instant;

use glintmap_formats::seal;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::base::Tally;
use crate::pages::{self, Spill};
use crate::run::Error;
use crate::run::manifest::key_of;
use crate::run::resolve::Candidate;
use crate::run::runner::{Job, Stage};
use crate::trace::{self, Emission};

/// `tally.json`: how many photons were sent, and where they went.
#[derive(Debug, Deserialize, Serialize)]
pub(in crate::run) struct Traced {
    /// From the pilot.
    pub plan: trace::Plan,
    /// Photons and flux by fate.
    pub tally: Tally,
    /// `(sum Phi)^2 / sum Phi^2`.
    pub effective_photons: f64,
}

fn unit(stage: &str, candidate: &Candidate) -> String {
    format!("{stage} {}", candidate.name)
}

/// Traces each candidate's photons into its spill.
pub(in crate::run) fn trace(job: &mut Job<'_>) -> Result<(), Error> {
    let resolved = job.resolved;
    for candidate in &resolved.candidates {
        let key = resolved.photons_key(candidate)?;
        let name = unit("trace", candidate);
        if !job.needs(Stage::Trace, &name, &key) {
            continue;
        }
        let began = Instant::now();
        let spill_name = job.folder.spill(&candidate.name);
        // A spill that isn't sealed, or was made from other settings, is of no use.
        job.remove(&spill_name)?;
        let spill_path = job.folder.prepare(&spill_name)?;
        let site = job.site()?;
        let timeline = job.timeline()?;
        let emission = Emission {
            site,
            timeline,
            bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
            settings: resolved.trace,
        };
        for note in &candidate.notes {
            job.progress.say(&format!("{}: {note}", candidate.name));
        }
        job.progress.say(&format!("{}: pilot", candidate.name));
        let plan = trace::plan(&emission, job.progress)?;
        let memory = job.options.memory_bytes / 4;
        let mut spill = Spill::create(&spill_path, site.bounds, resolved.trace.stored, memory)?;
        let tally = trace::run(&emission, &plan, &mut spill, job.progress)?;
        spill.finish()?;
        let traced = Traced { plan, effective_photons: tally.effective_photons(), tally };
        let tally_name = job.folder.tally(&candidate.name);
        let path = job.folder.prepare(&tally_name)?;
        let text = serde_json::to_vec_pretty(&traced).map_err(std::io::Error::from)?;
        seal::write_bytes(&path, &text).map_err(|source| Error::Write { path, source })?;
        job.progress.say(&told(candidate, &traced, began));
        let facts = json!({ "sent": tally.sent.photons, "stored": tally.stored.photons });
        job.done(&name, &key, &[tally_name], began, facts)?;
    }
    Ok(())
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
    for candidate in &resolved.candidates {
        let key = key_of("pages", &resolved.photons_key(candidate)?)?;
        let name = unit("pages", candidate);
        if !job.needs(Stage::Pages, &name, &key) {
            continue;
        }
        let began = Instant::now();
        let spill_name = job.folder.spill(&candidate.name);
        if !job.folder.at(&spill_name).exists() {
            // The photons were traced, sorted, and then the store was removed or forced anew.
            job.manifest.units.remove(&unit("trace", candidate));
            trace(job)?;
        }
        let tally_path = job.folder.at(&job.folder.tally(&candidate.name));
        let text = std::fs::read(&tally_path)
            .map_err(|source| Error::Read { path: tally_path.clone(), source })?;
        let traced: Traced = serde_json::from_slice(&text)
            .map_err(|e| Error::Manifest { path: tally_path, message: e.to_string() })?;
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
        let memory = job.options.memory_bytes / 2;
        let built =
            pages::build(&job.folder.at(&spill_name), &store, &about, memory, job.progress)?;
        let facts = serde_json::to_value(&built).map_err(std::io::Error::from)?;
        job.done(&name, &key, &[store_name], began, facts)?;
        job.remove(&spill_name)?;
    }
    Ok(())
}
