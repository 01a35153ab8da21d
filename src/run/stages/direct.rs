//! Maps and series of a view that is integrated directly.

use std::path::PathBuf;

use glintmap_formats::npy;
use serde_json::json;

use super::fused;
use super::series_files::{name, peak, write_annual, write_peak, writer};
use crate::base::{Grid, SinkError, TileRect, TileSink, limits, tiles};
use crate::project::{Candidate, Map, PlannedView, SeriesKept};
use crate::receivers::air::InAir;
use crate::receivers::points::read_points;
use crate::render::{self, Direct, DirectScene, DirectSinks, FusedDirect, HitMap, TileYear};
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::{Rounded, TimeAxis};

/// Integrates a view. The sums of the year wait, tile by tile, beside the series until all tiles
/// are there: so an interrupted run needs no tile twice.
pub(in crate::run) fn integrate(job: &Job<'_>, of: OfView<'_>, key: &str) -> Result<Made, Error> {
    let OfView { candidate, view } = of;
    let mut hits = job.folder.read_hits(&view.name)?;
    if view.points().is_some() {
        // What is integrated needs no surface to land on.
        if let Some(air) = InAir::of(&read_points(&job.folder, view)?, view) {
            hits = air.lifted(hits);
        }
    }
    let direct = Direct::new(scene(job, candidate)?, job.sight()?)?;
    let keep = |tile: TileRect, year: &TileYear| {
        let all = [&year.surface_wh_m2, &year.normal_wh_m2, &year.error_wh_m2];
        let values: Vec<f32> = all.into_iter().flatten().copied().collect();
        let name = job.folder.waiting_tile(&candidate.name, &view.name, tile);
        let path = job.folder.prepare(&name).map_err(std::io::Error::other)?;
        npy::write(&path, &[all.len(), tile.rows, tile.columns], &values)
            .map_err(|e| SinkError::Io(std::io::Error::other(e)))
    };
    let mut made = Made::default();
    if view.is_fused() {
        let axis = TimeAxis::from(job.timeline()?);
        let thresholds = &job.resolved.project.glare.thresholds_w_m2;
        let analysed = analyse(job, &axis, view, (&direct, &hits), thresholds, &keep)?;
        job.progress.finish();
        let fused::Made { rendered, peak, analyses, batches } = analysed;
        made.facts = json!({ "integrated": rendered.summary, "batches": batches });
        made.outputs.extend(write_peak(job, of, key, job.resolved.quantity, &peak)?);
        made.others = fused::keep_all(job, of, &axis, analyses)?;
    } else {
        made.facts = written(job, of, (&direct, &hits), key, &keep, &mut made.outputs)?;
    }
    made.outputs.extend(annual(job, of, &hits, key)?);
    Ok(made)
}

/// Takes a tile's sums over the year.
type Keep<'a> = &'a (dyn Fn(TileRect, &TileYear) -> Result<(), SinkError> + Sync);

/// Writes the series, and the peaks; facts for the log.
fn written(
    job: &Job<'_>,
    of: OfView<'_>,
    (direct, hits): (&Direct<'_>, &HitMap),
    key: &str,
    keep: Keep<'_>,
    outputs: &mut Vec<PathBuf>,
) -> Result<serde_json::Value, Error> {
    let view = of.view;
    let quantity = job.resolved.quantity;
    let writer_of = |quantity| writer(job, of, key, quantity, hits);
    let other = (view.series == SeriesKept::Both).then(|| quantity.other());
    let other = other.map(|other| Ok::<_, Error>((other, writer_of(other)?))).transpose()?;
    let writer = writer_of(quantity)?;
    let rounded = |writer| Rounded::new(writer, view.mantissa_bits);
    let series = rounded(&writer);
    let others = other.as_ref().map(|(quantity, writer)| (*quantity, rounded(writer)));
    let sinks = DirectSinks {
        series: (quantity, &series),
        other: others.as_ref().map(|(quantity, sink)| (*quantity, sink as &dyn TileSink)),
        keep,
    };
    let summary = render::direct_series(direct, hits, sinks, job.progress)?;
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(name(job, of, quantity));
    outputs.extend(peak(job, of, key, quantity)?);
    if let Some((quantity, writer)) = other {
        writer.finish()?;
        outputs.push(name(job, of, quantity));
        outputs.extend(peak(job, of, key, quantity)?);
    }
    Ok(json!({ "series": written, "integrated": summary }))
}

fn scene<'a>(job: &'a Job<'_>, candidate: &'a Candidate) -> Result<DirectScene<'a>, Error> {
    let site = job.site()?;
    Ok(DirectScene {
        site,
        timeline: job.timeline()?,
        bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
        max_path_m: job.resolved.trace.max_path_m,
        sun_visibility: job.resolved.trace.sun_visibility,
    })
}

fn analyse<'a, 'd>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    view: &PlannedView,
    (direct, hits): (&'d Direct<'d>, &'d HitMap),
    thresholds: &[f64],
    keep: Keep<'_>,
) -> Result<fused::Made<'a, FusedDirect<'d>>, Error> {
    fused::analyse(job, axis, view, hits, thresholds, |whole| {
        let to = (job.resolved.quantity, whole);
        Ok(FusedDirect::prepare(direct, hits, to, keep, job.progress)?)
    })
}

/// Analyses a fused view again.
pub(super) fn fused<'a>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    of: OfView<'_>,
    thresholds: &[f64],
) -> Result<Vec<fused::Analysed<'a>>, Error> {
    let hits = job.folder.read_hits(&of.view.name)?;
    let direct = Direct::new(scene(job, of.candidate)?, job.sight()?)?;
    Ok(analyse(job, axis, of.view, (&direct, &hits), thresholds, &|_, _| Ok(()))?.analyses)
}

/// The year's maps from the tiles that wait.
fn annual(job: &Job<'_>, of: OfView<'_>, hits: &HitMap, key: &str) -> Result<Vec<PathBuf>, Error> {
    let (columns, rows) = (hits.columns, hits.rows);
    let empty = || Grid::filled(columns, rows, 0.0_f32);
    let mut maps = [empty(), empty(), empty()];
    for tile in tiles(columns, rows, limits::TILE_EDGE) {
        let name = job.folder.waiting_tile(&of.candidate.name, &of.view.name, tile);
        let values: Vec<f32> = npy::Reader::open(&job.folder.at(&name))?.read_all()?;
        for (map, part) in maps.iter_mut().zip(values.chunks_exact(tile.pixels())) {
            for (i, &value) in part.iter().enumerate() {
                let at = (tile.column + i % tile.columns, tile.row + i / tile.columns);
                map[at] = value;
            }
        }
    }
    let [surface, normal, error] = &maps;
    let maps =
        [(Map::Annual, surface), (Map::AnnualNormal, normal), (Map::IntegrationError, error)];
    let attributes = job.attributes(key, &of.view.about(&of.candidate.name))?;
    write_annual(job, of, &maps, &attributes)
}
