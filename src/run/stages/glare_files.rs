//! The files of an analysis at a threshold: durations, hours with their bounds, events, and the maps
//! of the year from the series as it is.

use std::io;
use std::path::PathBuf;

use glintmap_formats::npy;

use super::events::{self, Found};
use super::files::Attributes;
use crate::base::Grid;
use crate::glare::{self, Analysis, YearMap, YearRows};
use crate::project::{GlareMap, Map};
use crate::receivers::clock::Clock;
use crate::run::error::Error;
use crate::run::job::Job;
use crate::run::units::OfView;
use crate::volume::TimeAxis;

/// Writes what an analysis found; the names of the files.
pub(super) fn write(
    job: &Job<'_>,
    of: OfView<'_>,
    threshold: f64,
    found: &Found<'_>,
    attributes: &[(String, String)],
) -> Result<Vec<PathBuf>, Error> {
    let Found { analysis, axis, bounds, .. } = *found;
    let step_h = axis.map_or(job.timeline()?.step_h, |axis| axis.step_h);
    let mut outputs = Vec::new();
    for (map, counts, hours) in durations(analysis, step_h) {
        let map = Map::Glare(threshold, map);
        let name = job.folder.npy(&of.candidate.name, &of.view.name, map);
        npy::write(&job.folder.prepare(&name)?, &[counts.rows(), counts.columns()], counts.data())?;
        outputs.push(name);
        outputs.extend(job.write_maps(of, &[(map, &hours)], attributes)?);
    }
    if of.view.points().is_none() {
        outputs.extend(events::write(job, of, threshold, found)?);
    }
    let glare = |map| Map::Glare(threshold, map);
    let maps = [
        (glare(GlareMap::AtLeast), &bounds.low_h),
        (glare(GlareMap::Hours), &bounds.hours_h),
        (glare(GlareMap::AtMost), &bounds.high_h),
    ];
    outputs.extend(job.write_maps(of, &maps, attributes)?);
    Ok(outputs)
}

/// What the maps of an analysis say of their making.
pub(super) fn attributes(
    job: &Job<'_>,
    of: OfView<'_>,
    threshold: f64,
    key: &str,
) -> Result<Attributes, Error> {
    let threshold = threshold.to_string();
    let quantity = job.resolved.quantity.name();
    let more = [("threshold_w_m2", threshold.as_str()), ("quantity", quantity)];
    job.attributes(key, &[of.view.about(&of.candidate.name), more].concat())
}

/// Each duration map with its timesteps turned into hours. Cumulative hours carry the weight of
/// each timestep; sustained and longest run are clock time of one day, so the time step alone.
fn durations(analysis: &Analysis, step_h: f64) -> [(GlareMap, &Grid<i32>, Grid<f32>); 3] {
    let clock = |counts: &Grid<i32>| counts.map(|n| (f64::from(*n) * step_h) as f32);
    let cumulative = match &analysis.cumulative_h {
        Some(hours) => hours.clone(),
        None => clock(&analysis.cumulative),
    };
    [
        (GlareMap::Cumulative, &analysis.cumulative, cumulative),
        (GlareMap::Sustained, &analysis.sustained, clock(&analysis.sustained)),
        (GlareMap::LongestRun, &analysis.longest_run, clock(&analysis.longest_run)),
    ]
}

/// The unfiltered year of a series: its timesteps, rows and columns, and what hands the maps on.
pub(super) struct UnfilteredYear<'a, F> {
    pub axis: &'a TimeAxis,
    pub size: [usize; 2],
    pub make: F,
}

/// Writes the maps of the year from the series as it is, each as `.npy` (float32) and `.exr`. A
/// month without glare has no map. Clock times say which clock they mean. Memory holds one map at a
/// time.
pub(super) fn write_year<F: FnOnce(YearRows<'_>) -> Result<(), glare::Error>>(
    job: &Job<'_>,
    of: OfView<'_>,
    threshold: f64,
    UnfilteredYear { axis, size: [rows, columns], make }: UnfilteredYear<'_, F>,
    attributes: &[(String, String)],
) -> Result<Vec<PathBuf>, Error> {
    let maps = YearMap::all(axis);
    let clock = Clock::new(&job.resolved.project.site, axis.year);
    let map = |map: YearMap| Map::Glare(threshold, GlareMap::Unfiltered(map));
    let npy_name = |of_map| job.folder.npy(&of.candidate.name, &of.view.name, map(of_map));
    let mut writers = Vec::new();
    for map in &maps {
        let path = job.folder.prepare(&npy_name(*map))?;
        writers.push(npy::Writer::<f32>::create(&path, &[rows, columns])?);
    }
    let mut push = |map: YearMap, rows: &[f32]| {
        let at = maps.iter().position(|m| *m == map).unwrap_or(0);
        writers[at].push(rows).map_err(io::Error::other)
    };
    make(&mut push)?;
    let mut outputs = Vec::new();
    for (writer, of_map) in writers.into_iter().zip(&maps) {
        writer.finish()?;
        let name = npy_name(*of_map);
        let numbers = npy::Reader::<f32>::open(&job.folder.at(&name))?.read_all()?;
        if matches!(of_map, YearMap::Month(_)) && numbers.iter().all(|hours| *hours == 0.0) {
            job.remove(&name)?;
            continue;
        }
        let grid = Grid::from_vec(columns, rows, numbers);
        let mut attributes = attributes.to_vec();
        if matches!(of_map, YearMap::FirstHour | YearMap::LastHour) {
            attributes.push(("clock".to_owned(), clock.zone()));
        }
        outputs.push(name);
        outputs.extend(job.write_maps(of, &[(map(*of_map), &grid)], &attributes)?);
    }
    Ok(outputs)
}
