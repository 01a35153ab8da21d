//! Maps and series of a view that is integrated directly.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glintmap_formats::npy;
use serde_json::json;

use super::fused;
use super::render::{About, attributes, names, peak, write_peak, writer};
use crate::base::{Grid, SinkError, TileRect, TileSink, limits, tiles};
use crate::picture::{exr, hdr};
use crate::project::Folder;
use crate::project::{Candidate, PlannedView};
use crate::receivers::air::InAir;
use crate::receivers::points::read_points;
use crate::render::{
    self, Direct, DirectScene, DirectSinks, FusedDirect, HitMap, PvSight, Quantity, TileYear,
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
    let waiting = job.folder.waiting_tiles(&candidate.name, &view.name);
    let folder = job.folder.prepare(&waiting.join("tile"))?;
    let folder = folder.parent().unwrap_or(Path::new("")).to_owned();
    let quantity = job.resolved.quantity;
    if sight.is_none() {
        *sight = Some(sees(job)?);
    }
    let Some(sight) = sight else { return Ok(()) };
    let direct = Direct::new(scene(job, candidate)?, sight)?;
    let keep = |tile: TileRect, year: &TileYear| {
        let all = [&year.surface_wh_m2, &year.normal_wh_m2, &year.error_wh_m2];
        let values: Vec<f32> = all.into_iter().flatten().copied().collect();
        let path = folder.join(Folder::tile(tile));
        npy::write(&path, &[all.len(), tile.rows, tile.columns], &values)
            .map_err(|e| SinkError::Io(std::io::Error::other(e)))
    };
    let about = [("material", candidate.name.as_str()), ("view", view.name.as_str())];
    let about = (key.as_str(), &about[..]);
    let mut outputs = Vec::new();
    let facts = if view.fuse {
        let axis = TimeAxis::from(job.timeline()?);
        let thresholds = &job.resolved.project.glare.thresholds_w_m2;
        let made = analyse(job, &axis, view, (&direct, &hits), thresholds, &keep)?;
        job.progress.finish();
        let fused::Made { rendered, peak, analyses, batches } = made;
        let told = rendered.summary;
        outputs.push(write_peak(job, candidate, view, about, quantity, &peak)?);
        fused::record(job, candidate, view, &axis, analyses, began)?;
        json!({ "integrated": told, "batches": batches })
    } else {
        let from = (&direct, &hits);
        written(job, candidate, view, from, (about, quantity), &keep, &mut outputs)?
    };
    outputs.extend(annual(job, &folder, &hits, candidate, view, &key)?);
    job.remove(&waiting)?;
    job.done(&unit, &key, &outputs, began, facts)
}

/// Takes a tile's sums over the year.
type Keep<'a> = &'a (dyn Fn(TileRect, &TileYear) -> Result<(), SinkError> + Sync);

/// Writes the series, and the peaks; what is to be told of it.
fn written(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (direct, hits): (&Direct<'_>, &HitMap),
    (about, quantity): (About<'_>, Quantity),
    keep: Keep<'_>,
    outputs: &mut Vec<PathBuf>,
) -> Result<serde_json::Value, Error> {
    let other = match quantity {
        Quantity::Surface => Quantity::Normal,
        Quantity::Normal => Quantity::Surface,
    };
    let writer_of = |quantity| writer(job, candidate, view, (about.0, quantity), hits);
    let other = view.both.then(|| Ok::<_, Error>((other, writer_of(other)?))).transpose()?;
    let writer = writer_of(quantity)?;
    let rounded = |writer| Rounded::new(writer, view.mantissa_bits);
    let series = rounded(&writer);
    let others = other.as_ref().map(|(quantity, writer)| (*quantity, rounded(writer)));
    let sinks = DirectSinks {
        series: (quantity, &series),
        other: others.as_ref().map(|(quantity, sink)| (*quantity, sink as &dyn TileSink)),
        keep,
    };
    let told = render::direct_series(direct, hits, sinks, job.progress)?;
    job.progress.finish();
    let written = writer.finish()?;
    let series = |quantity| job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    outputs.push(series(quantity));
    outputs.push(peak(job, candidate, view, about, quantity)?);
    if let Some((quantity, writer)) = other {
        writer.finish()?;
        outputs.push(series(quantity));
        outputs.push(peak(job, candidate, view, about, quantity)?);
    }
    Ok(json!({ "series": written, "integrated": told }))
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
fn annual(
    job: &Job<'_>,
    folder: &Path,
    hits: &HitMap,
    candidate: &Candidate,
    view: &PlannedView,
    key: &str,
) -> Result<Vec<PathBuf>, Error> {
    let (columns, rows) = (hits.columns, hits.rows);
    let empty = || Grid::filled(columns, rows, 0.0_f32);
    let mut maps = [empty(), empty(), empty()];
    for tile in tiles(columns, rows, limits::TILE_EDGE) {
        let path = folder.join(Folder::tile(tile));
        let values: Vec<f32> = npy::Reader::open(&path)?.read_all()?;
        for (map, part) in maps.iter_mut().zip(values.chunks_exact(tile.pixels())) {
            for (i, &value) in part.iter().enumerate() {
                let at = (tile.column + i % tile.columns, tile.row + i / tile.columns);
                map[at] = value;
            }
        }
    }
    let about = [("material", candidate.name.as_str()), ("view", view.name.as_str())];
    let name = |file: &str| job.folder.map(&candidate.name, &view.name, file);
    let [surface, normal, error] = &maps;
    exr::write(
        &job.folder.prepare(&name("annual.exr"))?,
        &[("annual.wh_m2", surface), ("annual_normal.wh_m2", normal), ("error.wh_m2", error)],
        &attributes(job, key, &about),
    )?;
    let mut lines = vec![
        format!("SOFTWARE= {}", crate::base::Provenance::PROGRAM),
        "annual radiant exposure, Wh/m2".to_owned(),
    ];
    if view.points.is_none() {
        lines.push(view.view.to_view_line());
    }
    hdr::write(&job.folder.at(&name("annual.hdr")), &surface.map(|v| [*v; 3]), &lines)?;
    npy::write(&job.folder.at(&name("annual.npy")), &[rows, columns], surface.data())?;
    Ok(vec![name("annual.exr"), name("annual.hdr"), name("annual.npy")])
}
