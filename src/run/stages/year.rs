//! Per pixel, from the series as it is: days with glare, longest run, worst day, months, clock
//! times, margins.

use std::io;
use std::path::{Path, PathBuf};

use glintmap_formats::npy;

use crate::base::Grid;
use crate::glare::{self, YearMap, YearRows};
use crate::picture::exr;
use crate::receivers::clock::Clock;
use crate::run::error::Error;
use crate::run::job::Job;
use crate::volume::TimeAxis;

/// The channel of a map's EXR: what it is, then its unit.
pub(super) fn channel(map: YearMap) -> String {
    match map {
        YearMap::Above => "above.h".into(),
        YearMap::Days => "days.d".into(),
        YearMap::LongestRun => "longest_run.h".into(),
        YearMap::LongestDay => "longest_day.h".into(),
        YearMap::FirstHour => "first_hour.h".into(),
        YearMap::LastHour => "last_hour.h".into(),
        YearMap::ExceededOnWorstDay => "exceeded_30min.w_m2".into(),
        YearMap::ExceededInYear => "exceeded_50h.w_m2".into(),
        YearMap::Month(month) => format!("month_{month:02}.h"),
    }
}

/// Writes the maps of the year into `unfiltered/` below `folder` (a name below `run/`), each as
/// `.npy` (float32) and `.exr`; `make` hands them on. A month
/// without glare has no map. Clock times say which clock they mean. Memory holds one map at a time.
pub(super) fn write(
    job: &Job<'_>,
    folder: &Path,
    (axis, [rows, columns]): (&TimeAxis, [usize; 2]),
    make: impl FnOnce(YearRows<'_>) -> Result<(), glare::Error>,
    attributes: &[(String, String)],
) -> Result<Vec<PathBuf>, Error> {
    let maps = YearMap::all(axis);
    let clock = Clock::new(&job.resolved.project.site, axis.year);
    let name = |map: YearMap, extension: &str| {
        folder.join("unfiltered").join(format!("{}.{extension}", map.name()))
    };
    let mut writers = Vec::new();
    for map in &maps {
        let path = job.folder.prepare(&name(*map, "npy"))?;
        writers.push(npy::Writer::<f32>::create(&path, &[rows, columns])?);
    }
    let mut push = |map: YearMap, band: &[f32]| {
        let at = maps.iter().position(|m| *m == map).unwrap_or(0);
        writers[at].push(band).map_err(io::Error::other)
    };
    make(&mut push)?;
    let mut outputs = Vec::new();
    for (writer, map) in writers.into_iter().zip(&maps) {
        writer.finish()?;
        let numbers = npy::Reader::<f32>::open(&job.folder.at(&name(*map, "npy")))?.read_all()?;
        if matches!(map, YearMap::Month(_)) && numbers.iter().all(|hours| *hours == 0.0) {
            job.remove(&name(*map, "npy"))?;
            continue;
        }
        let grid = Grid::from_vec(columns, rows, numbers);
        let exr_name = name(*map, "exr");
        let mut attributes = attributes.to_vec();
        if matches!(map, YearMap::FirstHour | YearMap::LastHour) {
            attributes.push(("clock".to_owned(), clock.zone()));
        }
        exr::write(&job.folder.at(&exr_name), &[(channel(*map).as_str(), &grid)], &attributes)?;
        outputs.extend([name(*map, "npy"), exr_name]);
    }
    Ok(outputs)
}
