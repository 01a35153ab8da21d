use std::path::PathBuf;

use serde_json::json;

use super::band::{self, Band};
use super::render::{self, attributes};
use super::{direct, fused};
use crate::base::Grid;
use crate::glare::{self, Analysis, Regular, Slices, YearRows};
use crate::picture::exr;
use crate::project::{Candidate, PlannedView};
use crate::receivers::clock::Clock;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::{TimeAxis, Volume};

/// Analyses a candidate's series in a view at a threshold.
pub(in crate::run) fn glare(
    job: &Job<'_>,
    of: OfView<'_>,
    threshold: f64,
    key: &str,
) -> Result<Made, Error> {
    let OfView { candidate, view } = of;
    if view.is_fused() {
        // Rendered before, but not analysed at this threshold.
        let axis = TimeAxis::from(job.timeline()?);
        let analyses = match view.photons() {
            None => direct::fused(job, &axis, of, &[threshold])?,
            Some(gather) => render::fused(job, &axis, of, gather, &[threshold])?,
        };
        let made = fused::keep_all(job, of, &axis, analyses)?;
        return Ok(made.into_iter().next().map(|unit| unit.made).unwrap_or_default());
    }
    let volume = Volume::open(&job.folder.at(&job.folder.series(&candidate.name, &view.name)))?;
    let spill = job.folder.root().to_owned();
    let mut settings = glare::Settings { threshold, spill, ..job.resolved.glare.clone() };
    if view.points().is_some() {
        // Points that follow each other in a list needn't be neighbours.
        settings.sigma[1..].fill(0.0);
    }
    let steps = volume.shape()[0] as u64;
    let mut segments = volume.segments();
    // Steps that differ in length come onto the finest regular grid before they are filtered.
    let grid = match volume.axis() {
        Some(axis) => Regular::of(&volume, axis, &segments)?,
        None => None,
    };
    let regular_axis = grid.as_ref().zip(volume.axis()).map(|(grid, axis)| grid.axis(axis));
    let axis = regular_axis.as_ref().or(volume.axis());
    let mut source: &dyn Slices = &volume;
    if let Some(grid) = &grid {
        source = grid;
        segments = grid.segments().to_vec();
    }
    let mut analysis = glare::analyse(source, &segments, &settings, None, job.progress)?;
    if view.points().is_some() {
        analysis.sustained.clone_from(&analysis.longest_run);
    }
    job.progress.finish();
    let band = band::count(job, candidate, view, &volume, threshold)?;
    let made = Kept { analysis: &analysis, axis, grid: grid.as_ref(), band: &band };
    let mut outputs = keep(job, candidate, view, (threshold, key), &made)?;
    if let Some(axis) = volume.axis().filter(|_| view.points().is_none()) {
        let folder = job.folder.glare(&candidate.name, &view.name, threshold, "");
        let attributes = provenance(job, candidate, view, (threshold, key));
        let [_, rows, columns] = volume.shape();
        let clock_h = Clock::new(&job.resolved.project.site, axis.year).hours(axis);
        let make = |rows: YearRows<'_>| {
            glare::year(&volume, threshold, Some(&clock_h), rows, job.progress).map(|_| ())
        };
        let of = (axis, [rows, columns]);
        outputs.extend(super::year::write(job, &folder, of, make, &attributes)?);
    }
    let facts = json!({ "events": analysis.events.len(), "timesteps": steps });
    Ok(Made::new(outputs, facts))
}

/// What an analysis gives.
pub(super) struct Kept<'a> {
    pub analysis: &'a Analysis,
    /// Of the timesteps that it counts.
    pub axis: Option<&'a TimeAxis>,
    /// What put them onto a regular grid, if they weren't on one.
    pub grid: Option<&'a Regular<'a>>,
    pub band: &'a Band,
}

/// Writes what an analysis found; the names of the files.
pub(super) fn keep(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (threshold, key): (f64, &str),
    made: &Kept<'_>,
) -> Result<Vec<PathBuf>, Error> {
    let Kept { analysis, axis, band, .. } = *made;
    let name = |file: &str| job.folder.glare(&candidate.name, &view.name, threshold, file);
    let step_h = axis.map_or(job.timeline()?.step_h, |axis| axis.step_h);
    let attributes = provenance(job, candidate, view, (threshold, key));
    let mut outputs = Vec::new();
    for (map, counts, hours) in hours(analysis, step_h) {
        let npy = job.folder.prepare(&name(&format!("{map}.npy")))?;
        glintmap_formats::npy::write(&npy, &[counts.rows(), counts.columns()], counts.data())?;
        let exr_name = name(&format!("{map}.exr"));
        let channel = format!("{map}.h");
        exr::write(&job.folder.at(&exr_name), &[(channel.as_str(), &hours)], &attributes)?;
        outputs.extend([name(&format!("{map}.npy")), exr_name]);
    }
    if view.points().is_none() {
        outputs.extend(super::events::write(job, candidate, view, threshold, made)?);
    }
    outputs.push(band::write(job, candidate, view, (threshold, &attributes), band)?);
    Ok(outputs)
}

/// What the files of an analysis say of where they come from.
pub(super) fn provenance(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (threshold, key): (f64, &str),
) -> Vec<(String, String)> {
    let about = [
        ("material", candidate.name.as_str()),
        ("view", view.name.as_str()),
        ("threshold_w_m2", &threshold.to_string()),
        ("quantity", job.resolved.quantity.name()),
    ];
    attributes(job, key, &about)
}

/// Each duration map with its timesteps turned into hours. Cumulative hours carry the weight of
/// each timestep; sustained and longest run are clock time of one day, so the time step alone.
fn hours(analysis: &Analysis, step_h: f64) -> [(&'static str, &Grid<i32>, Grid<f32>); 3] {
    let clock = |counts: &Grid<i32>| counts.map(|n| (f64::from(*n) * step_h) as f32);
    let cumulative = match &analysis.cumulative_h {
        Some(hours) => hours.clone(),
        None => clock(&analysis.cumulative),
    };
    [
        ("cumulative", &analysis.cumulative, cumulative),
        ("sustained", &analysis.sustained, clock(&analysis.sustained)),
        ("longest_run", &analysis.longest_run, clock(&analysis.longest_run)),
    ]
}
