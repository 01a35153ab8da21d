//! Maps and series of a view that is integrated directly.

use std::path::PathBuf;
use std::time::Instant;

use glintmap_formats::npy;
use serde_json::json;

use super::files::Subject;
use super::{fused, series_files};
use crate::base::{Grid, SinkError, TileRect, TileSink, limits, tiles};
use crate::project::{Candidate, Map, PlannedView};
use crate::receivers::air::InAir;
use crate::receivers::points::read_points;
use crate::render::{
    self, Direct, DirectScene, DirectSinks, FusedDirect, HitMap, PvSight, TileYear,
};
use crate::run::error::Error;
use crate::run::job::{Job, Stage};
use crate::volume::{Rounded, TimeAxis};

/// Integrates a view; `sight` is kept from one to the next. The sums of the year wait, tile by
/// tile, beside the series until all tiles are there: so an interrupted run needs no tile twice.
pub(super) fn maps(
    job: &mut Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    sight: &mut Option<PvSight>,
) -> Result<(), Error> {
    let key = job.resolved.render_key(candidate, view)?;
    let unit = format!("render {} {}", candidate.name, view.name);
    if !job.needs(Stage::Render, &unit, &key) {
        return Ok(());
    }
    let began = Instant::now();
    let mut hits = job.folder.read_hits(&view.name)?;
    if view.points.is_some() {
        // What is integrated needs no surface to land on.
        if let Some(air) = InAir::of(&read_points(&job.folder, view)?, view) {
            hits = air.lifted(hits);
        }
    }
    let of = Subject { candidate, view, key: &key };
    let waiting = job.folder.waiting_tiles(&candidate.name, &view.name);
    if sight.is_none() {
        *sight = Some(sees(job)?);
    }
    let Some(sight) = sight else { return Ok(()) };
    let direct = Direct::new(scene(job, candidate)?, sight)?;
    let folder = &job.folder;
    let keep = |tile: TileRect, year: &TileYear| {
        let all = [&year.surface_wh_m2, &year.normal_wh_m2, &year.error_wh_m2];
        let values: Vec<f32> = all.into_iter().flatten().copied().collect();
        let path = folder.prepare(&folder.waiting_tile(&candidate.name, &view.name, tile));
        path.map_err(std::io::Error::other)
            .and_then(|path| {
                let shape = [all.len(), tile.rows, tile.columns];
                npy::write(&path, &shape, &values).map_err(std::io::Error::other)
            })
            .map_err(SinkError::Io)
    };
    let mut outputs = Vec::new();
    let facts = if view.fuse {
        let axis = TimeAxis::from(job.timeline()?);
        let thresholds = &job.resolved.project.glare.thresholds_w_m2;
        let made = analyse(job, &axis, view, (&direct, &hits), thresholds, &keep)?;
        job.progress.finish();
        let fused::Made { rendered, peak, analyses, batches } = made;
        let summary = rendered.summary;
        outputs.extend(series_files::write_peak(job, of, job.resolved.quantity, &peak)?);
        fused::record(job, candidate, view, &axis, analyses, began)?;
        json!({ "integrated": summary, "batches": batches })
    } else {
        written(job, of, (&direct, &hits), &keep, &mut outputs)?
    };
    annual(job, of, &hits)?;
    outputs.extend(series_files::annual_names(job, of));
    job.remove(&waiting)?;
    job.done(&unit, &key, &outputs, began, facts)
}

/// Takes a tile's sums over the year.
type Keep<'a> = &'a (dyn Fn(TileRect, &TileYear) -> Result<(), SinkError> + Sync);

/// Writes the series, and the peaks; facts for the log.
fn written(
    job: &Job<'_>,
    of: Subject<'_>,
    (direct, hits): (&Direct<'_>, &HitMap),
    keep: Keep<'_>,
    outputs: &mut Vec<PathBuf>,
) -> Result<serde_json::Value, Error> {
    let writer =
        |quantity| Ok::<_, Error>((quantity, series_files::writer(job, of, quantity, hits)?));
    let asked = writer(job.resolved.quantity)?;
    let other = series_files::other(job, of).map(writer).transpose()?;
    let rounded = |writer| Rounded::new(writer, of.view.mantissa_bits);
    let series = rounded(&asked.1);
    let others = other.as_ref().map(|(quantity, writer)| (*quantity, rounded(writer)));
    let sinks = DirectSinks {
        series: (asked.0, &series),
        other: others.as_ref().map(|(quantity, sink)| (*quantity, sink as &dyn TileSink)),
        keep,
    };
    let summary = render::direct_series(direct, hits, sinks, job.progress)?;
    job.progress.finish();
    let mut facts = Vec::new();
    for (quantity, writer) in std::iter::once(asked).chain(other) {
        facts.push(json!(writer.finish()?));
        outputs.push(series_files::name(job, of, quantity));
        outputs.extend(series_files::peak(job, of, quantity)?);
    }
    Ok(json!({ "series": facts[0], "integrated": summary }))
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

/// What the PV sees of the suns.
fn sees(job: &Job<'_>) -> Result<PvSight, Error> {
    let free = job.resolved.trace.sun_visibility;
    Ok(PvSight::new(job.site()?, job.timeline()?, free, job.progress)?)
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
    candidate: &Candidate,
    view: &PlannedView,
    thresholds: &[f64],
) -> Result<Vec<fused::Analysed<'a>>, Error> {
    let (hits, sight) = (job.folder.read_hits(&view.name)?, sees(job)?);
    let direct = Direct::new(scene(job, candidate)?, &sight)?;
    Ok(analyse(job, axis, view, (&direct, &hits), thresholds, &|_, _| Ok(()))?.analyses)
}

/// The year's maps from the tiles that wait.
fn annual(job: &Job<'_>, of: Subject<'_>, hits: &HitMap) -> Result<(), Error> {
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
    series_files::write_annual(job, of, &maps, &job.attributes(of.key, &of.about())?)
}
