//! The files that a rendered view leaves: time series, peaks, maps of the year.

use std::path::PathBuf;

use glintmap_formats::npy;

use crate::base::{Grid, Irradiance, Provenance};
use crate::picture::hdr;
use crate::project::{Map, SeriesOf};
use crate::render::HitMap;
use crate::run::error::Error;
use crate::run::job::Job;
use crate::run::units::OfView;
use crate::volume::{Rounded, Volume, Writer};

/// Which of the series holds an irradiance.
pub(super) fn series_of(job: &Job<'_>, quantity: Irradiance) -> SeriesOf {
    SeriesOf { quantity, asked: job.resolved.quantity }
}

/// Where the series of an irradiance lies.
pub(super) fn name(job: &Job<'_>, of: OfView<'_>, quantity: Irradiance) -> PathBuf {
    job.folder.series_of(&of.candidate.name, &of.view.name, series_of(job, quantity))
}

/// The series of a view: begun, or gone on with.
pub(super) fn writer(
    job: &Job<'_>,
    of: OfView<'_>,
    key: &str,
    quantity: Irradiance,
    hits: &HitMap,
) -> Result<Writer, Error> {
    let path = job.folder.prepare(&name(job, of, quantity))?;
    let mut provenance = job.provenance(key, &of.view.about(&of.candidate.name));
    if let Some(most) = Rounded::largest_relative_error(of.view.mantissa_bits) {
        provenance.about.insert("largest_relative_error".to_owned(), most);
    }
    let (columns, rows) = (hits.columns, hits.rows);
    let timeline = job.timeline()?;
    Ok(Writer::create_or_resume(&path, timeline, columns, rows, quantity, &provenance)?)
}

/// The largest irradiance of the year, from the finished series.
pub(super) fn peak(
    job: &Job<'_>,
    of: OfView<'_>,
    key: &str,
    quantity: Irradiance,
) -> Result<Vec<PathBuf>, Error> {
    let volume = Volume::open(&job.folder.at(&name(job, of, quantity)))?;
    let peak = volume.peak(job.progress)?;
    job.progress.finish();
    write_peak(job, of, key, quantity, &peak)
}

/// Writes the largest irradiance of the year.
pub(super) fn write_peak(
    job: &Job<'_>,
    of: OfView<'_>,
    key: &str,
    quantity: Irradiance,
    peak: &Grid<f32>,
) -> Result<Vec<PathBuf>, Error> {
    let attributes = job.attributes(key, &of.view.about(&of.candidate.name))?;
    job.write_maps(of, &[(Map::Peak(series_of(job, quantity)), peak)], &attributes)
}

/// Writes the maps of the year, [`Map::Annual`] first; that one as a Radiance picture and a NumPy
/// array, too.
pub(super) fn write_annual(
    job: &Job<'_>,
    of: OfView<'_>,
    maps: &[(Map, &Grid<f32>)],
    attributes: &[(String, String)],
) -> Result<Vec<PathBuf>, Error> {
    let mut outputs = job.write_maps(of, maps, attributes)?;
    let Some((map, surface)) = maps.first() else { return Ok(outputs) };
    let mut lines = vec![
        format!("SOFTWARE= {}", Provenance::PROGRAM),
        "annual radiant exposure, Wh/m2".to_owned(),
    ];
    lines.extend(of.view.picture().map(|picture| picture.view.to_view_line()));
    let picture = job.folder.hdr(&of.candidate.name, &of.view.name, *map);
    hdr::write(&job.folder.at(&picture), &surface.map(|v| [*v; 3]), &lines)?;
    let array = job.folder.npy(&of.candidate.name, &of.view.name, *map);
    let shape = [surface.rows(), surface.columns()];
    npy::write(&job.folder.at(&array), &shape, surface.data())?;
    outputs.extend([picture, array]);
    Ok(outputs)
}
