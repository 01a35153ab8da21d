//! The files that a rendered view leaves: time series, peaks, maps of the year.

use std::path::PathBuf;

use glintmap_formats::npy;

use super::files::Subject;
use crate::base::{Grid, Provenance};
use crate::picture::hdr;
use crate::project::{Map, SeriesOf};
use crate::render::{HitMap, Quantity};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::volume::{self, Rounded, Volume, Writer};

/// The irradiance whose series a view keeps beside that which the project asks for.
pub(super) fn other(job: &Job<'_>, of: Subject<'_>) -> Option<Quantity> {
    let other = match job.resolved.quantity {
        Quantity::Surface => Quantity::Normal,
        Quantity::Normal => Quantity::Surface,
    };
    of.view.both.then_some(other)
}

/// Which of the series holds an irradiance.
pub(super) fn series_of(job: &Job<'_>, quantity: Quantity) -> SeriesOf {
    SeriesOf { quantity, asked: job.resolved.quantity }
}

/// Where the series of an irradiance lies.
pub(super) fn name(job: &Job<'_>, of: Subject<'_>, quantity: Quantity) -> PathBuf {
    job.folder.series_of(&of.candidate.name, &of.view.name, series_of(job, quantity))
}

/// The series of a view: begun, or gone on with where it was made from the same settings.
pub(super) fn writer(
    job: &Job<'_>,
    of: Subject<'_>,
    quantity: Quantity,
    hits: &HitMap,
) -> Result<Writer, Error> {
    let name = name(job, of, quantity);
    let path = job.folder.prepare(&name)?;
    let mut provenance = job.provenance(of.key, &of.about());
    if let Some(most) = Rounded::largest_relative_error(of.view.mantissa_bits) {
        provenance.about.insert("largest_relative_error".to_owned(), most);
    }
    let (columns, rows) = (hits.columns, hits.rows);
    let quantity = written_quantity(quantity);
    let create =
        |timeline| Writer::create_or_resume(&path, timeline, columns, rows, quantity, &provenance);
    match create(job.timeline()?) {
        // Made from other settings: of no use any more.
        Err(volume::Error::Different { .. }) => {
            job.remove(&name)?;
            Ok(create(job.timeline()?)?)
        }
        other => Ok(other?),
    }
}

/// The largest irradiance of the year, from the finished series.
pub(super) fn peak(
    job: &Job<'_>,
    of: Subject<'_>,
    quantity: Quantity,
) -> Result<Vec<PathBuf>, Error> {
    let volume = Volume::open(&job.folder.at(&name(job, of, quantity)))?;
    let peak = volume.peak(job.progress)?;
    job.progress.finish();
    write_peak(job, of, quantity, &peak)
}

/// Writes the largest irradiance of the year.
pub(super) fn write_peak(
    job: &Job<'_>,
    of: Subject<'_>,
    quantity: Quantity,
    peak: &Grid<f32>,
) -> Result<Vec<PathBuf>, Error> {
    let attributes = job.attributes(of.key, &of.about())?;
    job.write_maps(of, &[(Map::Peak(series_of(job, quantity)), peak)], &attributes)
}

/// Writes the maps of the year, [`Map::Annual`] first; that one as a Radiance picture and a NumPy
/// array, too. The EXR file comes last: where it is there, the others are.
pub(super) fn write_annual(
    job: &Job<'_>,
    of: Subject<'_>,
    maps: &[(Map, &Grid<f32>)],
    attributes: &[(String, String)],
) -> Result<(), Error> {
    let Some((_, surface)) = maps.first() else { return Ok(()) };
    let [_, hdr_name, npy_name] = annual_names(job, of);
    let mut lines = vec![
        format!("SOFTWARE= {}", Provenance::PROGRAM),
        "annual radiant exposure, Wh/m2".to_owned(),
    ];
    if of.view.points.is_none() {
        lines.push(of.view.view.to_view_line());
    }
    hdr::write(&job.folder.prepare(&hdr_name)?, &surface.map(|v| [*v; 3]), &lines)?;
    let shape = [surface.rows(), surface.columns()];
    npy::write(&job.folder.at(&npy_name), &shape, surface.data())?;
    job.write_maps(of, maps, attributes)?;
    Ok(())
}

/// What [`write_annual`] leaves.
pub(super) fn annual_names(job: &Job<'_>, of: Subject<'_>) -> [PathBuf; 3] {
    let (candidate, view) = (&of.candidate.name, &of.view.name);
    let folder = &job.folder;
    [
        folder.exr(candidate, view, Map::Annual),
        folder.hdr(candidate, view, Map::Annual),
        folder.npy(candidate, view, Map::Annual),
    ]
}

/// The volume's word for what was rendered; neither room knows the other.
fn written_quantity(quantity: Quantity) -> volume::Quantity {
    match quantity {
        Quantity::Surface => volume::Quantity::Surface,
        Quantity::Normal => volume::Quantity::Normal,
    }
}
