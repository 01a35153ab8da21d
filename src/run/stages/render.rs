//! What a picture sees and its background; then, of each candidate, maps of the year and series from
//! photons.

use std::path::PathBuf;

use serde_json::json;

use super::crossings::Air;
use super::series_files::{self, series_of};
use super::stores::open_store;
use super::tile_notes::TileNotes;
use crate::base::{Irradiance, TileSink};
use crate::pages::Store;
use crate::picture::exr;
use crate::project::{Map, PhotonGather, Picture, PlannedView, SeriesKept};
use crate::render::{self, Fused, Gather, HitMap, Series, Surfaces, View, VirtualSensors};
use crate::run::cpu::Watch;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::{Rounded, TimeAxis};

/// Suns that light the background picture: enough for soft shadows of a year.
const BACKGROUND_SUNS: usize = 24;
/// Photons of a lit timestep at a pixel below which noise decides about durations.
const DECIDING_PHOTONS: f64 = 10.0;

/// What the pixels of a picture see.
pub(in crate::run) fn hits(
    job: &Job<'_>,
    view: &PlannedView,
    picture: &Picture,
    key: &str,
) -> Result<Made, Error> {
    let (trace, camera) = (&job.resolved.trace, &picture.view);
    let hits = render::hits(camera, job.site()?, trace.max_path_m, trace.seed, job.progress)?;
    let name = job.folder.hits(&view.name);
    let path = job.folder.prepare(&name)?;
    let provenance = job.provenance(key, &[("view", &view.name)]);
    hits.write(&path, camera, trace.max_path_m, &provenance)?;
    Ok(Made::new(vec![name], json!({ "pixels": hits.hits.len() })))
}

/// The daylight background of a picture.
pub(in crate::run) fn background(
    job: &Job<'_>,
    view: &PlannedView,
    picture: &Picture,
    key: &str,
) -> Result<Made, Error> {
    let hits = job.folder.read_hits(&view.name)?;
    let suns = render::representative_suns(job.timeline()?, BACKGROUND_SUNS);
    let picture = render::background(&picture.view, &hits, job.site()?, &suns, job.progress)?;
    let name = job.folder.direct(&view.name);
    let path = job.folder.prepare(&name)?;
    let channel = |i: usize| picture.map(|rgb| rgb[i]);
    let (r, g, b) = (channel(0), channel(1), channel(2));
    let attributes = job.attributes(key, &[("view", &view.name)])?;
    exr::write(&path, &[("R", &r), ("G", &g), ("B", &b)], &attributes)?;
    Ok(Made::new(vec![name], json!({ "suns": suns.len() })))
}

/// What is gathered from: photons, where discs end, and pixels or points.
struct Gathering<'a> {
    store: &'a Store,
    surfaces: Option<&'a Surfaces<'a>>,
    hits: &'a HitMap,
    air: Option<VirtualSensors<'a>>,
}

/// The time series of a view from photons, or its analyses where none is kept.
pub(in crate::run) fn series(
    job: &Job<'_>,
    of: OfView<'_>,
    gather: &PhotonGather,
    key: &str,
) -> Result<Made, Error> {
    let OfView { candidate, view } = of;
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let gather = gather.series(job.timeline()?.steps.len());
    let surfaces = gather.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let air = Air::open(job, of, &hits)?;
    let from = Gathering {
        store: &store,
        surfaces: surfaces.as_ref(),
        hits: &hits,
        air: air.as_ref().map(Air::passed),
    };
    let watch = Watch::start();
    let quantity = job.resolved.quantity;
    let mut made = Made::default();
    let (series, written) = match view.series {
        SeriesKept::None => {
            let axis = TimeAxis::from(job.timeline()?);
            let thresholds = &job.resolved.project.glare.thresholds_w_m2;
            let analysed = analysed(job, &axis, view, &from, &gather, thresholds)?;
            job.progress.finish();
            let super::fused::Made { rendered, peak, analyses, batches } = analysed;
            made.outputs.extend(series_files::write_peak(job, of, key, quantity, &peak)?);
            made.others = super::fused::keep_all(job, of, &axis, analyses)?;
            (rendered.series, json!({ "batches": batches }))
        }
        SeriesKept::One => written(job, &from, of, (key, quantity), &gather, &mut made.outputs)?,
        SeriesKept::Both => {
            let asked = written(job, &from, of, (key, quantity), &gather, &mut made.outputs)?;
            written(job, &from, of, (key, quantity.other()), &gather, &mut made.outputs)?;
            asked
        }
    };
    let series_took = watch.read();
    let noise =
        [(Map::PhotonIrradiance, &series.photon_w_m2), (Map::SeriesRadius, &series.radius_m)];
    let attributes = job.attributes(key, &view.about(&candidate.name))?;
    made.outputs.extend(job.write_maps(of, &noise, &attributes)?);
    let share = series.summary.photons_per_lit_timestep();
    if let Some(photons) = share.filter(|p| *p < DECIDING_PHOTONS) {
        made.warnings.push(format!(
            "{of}: {photons:.1} photons for each timestep that is lit at a pixel (bandwidth {}); below {DECIDING_PHOTONS} noise decides about durations: store more photons and raise series_bandwidth",
            gather.bandwidth
        ));
    }
    made.facts = json!({
        "cache": store.cache_stats(),
        "series_took": series_took,
        "series": written,
        "gathered": series.summary,
        "photons_per_lit_timestep": share,
    });
    Ok(made)
}

/// Analyses a fused view again.
pub(super) fn fused<'a>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    of: OfView<'_>,
    gather: &PhotonGather,
    thresholds: &[f64],
) -> Result<Vec<super::fused::Analysed<'a>>, Error> {
    let hits = job.folder.read_hits(&of.view.name)?;
    let store = open_store(job, of.candidate)?;
    let gather = gather.series(axis.day.len());
    let surfaces = gather.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let from = Gathering { store: &store, surfaces: surfaces.as_ref(), hits: &hits, air: None };
    Ok(analysed(job, axis, of.view, &from, &gather, thresholds)?.analyses)
}

fn analysed<'a, 's>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    view: &PlannedView,
    from: &Gathering<'s>,
    gather: &Gather,
    thresholds: &[f64],
) -> Result<super::fused::Made<'a, Fused<'s>>, Error> {
    super::fused::analyse(job, axis, view, from.hits, thresholds, |whole| {
        let to = (job.resolved.quantity, whole);
        Ok(Fused::prepare(from.store, from.surfaces, from.hits, gather, to, job.progress)?)
    })
}

/// Writes the series, and the peak of it.
fn written(
    job: &Job<'_>,
    from: &Gathering<'_>,
    of: OfView<'_>,
    (key, quantity): (&str, Irradiance),
    gather: &Gather,
    outputs: &mut Vec<PathBuf>,
) -> Result<(Series, serde_json::Value), Error> {
    let OfView { candidate, view } = of;
    let &Gathering { store, surfaces, hits, air } = from;
    let writer = series_files::writer(job, of, key, quantity, hits)?;
    let notes = job.folder.tile_notes(&candidate.name, &view.name, series_of(job, quantity));
    let path = job.folder.prepare(&notes)?;
    let rounded = Rounded::new(&writer, view.mantissa_bits);
    let noted = TileNotes::open(&rounded, &path, hits.columns)?;
    let with_air = air.as_ref().map(|a| a.series(&noted, quantity));
    let sink: &dyn TileSink = match &with_air {
        Some(sink) => sink,
        None => &noted,
    };
    let mut series = render::series(store, surfaces, hits, gather, quantity, sink, job.progress)?;
    if let Some(air) = &air {
        air.add_noise(&mut series, quantity)?;
    }
    drop(noted);
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(series_files::name(job, of, quantity));
    outputs.extend(series_files::peak(job, of, key, quantity)?);
    Ok((series, json!(written)))
}

/// The maps of the year of a view from photons.
pub(in crate::run) fn annual(
    job: &Job<'_>,
    of: OfView<'_>,
    gather: &PhotonGather,
    key: &str,
) -> Result<Made, Error> {
    let OfView { candidate, view } = of;
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let surfaces = gather.annual.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let air = Air::open(job, of, &hits)?;
    let watch = Watch::start();
    let weights: Vec<f64> = job.timeline()?.steps.iter().map(|s| s.weight_h).collect();
    let mut annual =
        render::annual(&store, surfaces.as_ref(), &hits, &weights, &gather.annual, job.progress)?;
    if let Some(air) = &air {
        air.passed().add_year(&mut annual, &weights)?;
    }
    let took = watch.read();
    job.progress.finish();
    let mut attributes = job.attributes(key, &view.about(&candidate.name))?;
    // What `view_file` reads. Points have no camera, but their files always had the attribute.
    let camera = match view.picture() {
        Some(picture) => picture.view.clone(),
        None => View::parse("-vtv", 1, 1)?,
    };
    attributes.push(("VIEW".to_owned(), camera.to_options()));
    let maps = [
        (Map::Annual, &annual.surface),
        (Map::AnnualNormal, &annual.facing_beam),
        (Map::Radius, &annual.radius_m),
        (Map::StandardError, &annual.error),
    ];
    let outputs = series_files::write_annual(job, of, &maps, &attributes)?;
    Ok(Made::new(outputs, json!({ "annual": took, "cache": store.cache_stats() })))
}
