//! Glare durations and events of a series at a threshold.

use serde_json::json;

use super::events::Found;
use super::glare_files::{self, UnfilteredYear};
use super::{direct, fused, render};
use crate::base::Grid;
use crate::glare::{self, HourBounds, HourCounter, Regular, Slices, YearRows, each_slice};
use crate::project::Map;
use crate::receivers::clock::Clock;
use crate::render::undecided;
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
    let bounds = count(job, of, &volume, threshold)?;
    let found = Found { analysis: &analysis, axis, grid: grid.as_ref(), bounds: &bounds };
    let attributes = glare_files::attributes(job, of, threshold, key)?;
    let mut outputs = glare_files::write(job, of, threshold, &found, &attributes)?;
    if let Some(axis) = volume.axis().filter(|_| view.points().is_none()) {
        let [_, rows, columns] = volume.shape();
        let clock_h = Clock::new(&job.resolved.project.site, axis.year).hours(axis);
        let make = |rows: YearRows<'_>| {
            glare::year(&volume, threshold, Some(&clock_h), rows, job.progress).map(|_| ())
        };
        let year = UnfilteredYear { axis, size: [rows, columns], make };
        outputs.extend(glare_files::write_year(job, of, threshold, year, &attributes)?);
    }
    let facts = json!({ "events": analysis.events.len(), "timesteps": steps });
    Ok(Made::new(outputs, facts))
}

/// Counts the hours of a threshold over a whole series.
fn count(
    job: &Job<'_>,
    of: OfView<'_>,
    series: &dyn Slices,
    threshold_w_m2: f64,
) -> Result<HourBounds, Error> {
    let photon_w_m2 = match of.view.is_direct() {
        true => {
            // Without photons there is no noise.
            let [_, rows, columns] = series.shape();
            Grid::filled(columns, rows, 0.0)
        }
        false => job.read_map(of, Map::PhotonIrradiance)?,
    };
    let open_w_m2 = photon_w_m2.map(|photon| undecided(threshold_w_m2, *photon));
    let mut counter = HourCounter::new(threshold_w_m2, &open_w_m2);
    let steps = &job.timeline()?.steps;
    each_slice(series, 0..series.shape()[0], job.progress, |t, slice| {
        counter.push(slice, steps.get(t).map_or(0.0, |s| s.weight_h));
    })?;
    Ok(counter.finish())
}
