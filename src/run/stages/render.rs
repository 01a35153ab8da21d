//! Hits and background of each view, then maps and series of each candidate.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::{Value, json};

use super::files::Subject;
use super::stores::{open_store, series_bandwidth};
use super::tile_notes::TileNotes;
use super::{crossings, direct, fused, series_files};
use crate::base::TileSink;
use crate::pages::Store;
use crate::picture::{self, exr};
use crate::project::{Candidate, Map, PlannedView, key_of};
use crate::render::{self, Fused, Gather, HitMap, Passed, Quantity, Series, Surfaces};
use crate::run::cpu::Watch;
use crate::run::error::Error;
use crate::run::job::{Job, Stage};
use crate::volume::{Rounded, TimeAxis};

/// Suns that light the background picture: enough for soft shadows of a year.
const BACKGROUND_SUNS: usize = 24;

/// Renders all views of all candidates.
pub(in crate::run) fn render(job: &mut Job<'_>) -> Result<(), Error> {
    let resolved = job.resolved;
    for view in &resolved.views {
        hits(job, view)?;
        background(job, view)?;
    }
    for set in &resolved.sensors {
        super::receivers::place(job, set)?;
    }
    let mut sight = None;
    for candidate in &resolved.candidates {
        for view in resolved.with_sensors() {
            if view.direct {
                direct::maps(job, candidate, view, &mut sight)?;
            } else {
                maps(job, candidate, view)?;
            }
        }
    }
    Ok(())
}

fn hits(job: &mut Job<'_>, view: &PlannedView) -> Result<(), Error> {
    let key = job.resolved.hits_key(view)?;
    let unit = format!("hits {}", view.name);
    if !job.needs(Stage::Render, &unit, &key) {
        return Ok(());
    }
    let began = Instant::now();
    let trace = &job.resolved.trace;
    let hits = render::hits(&view.view, job.site()?, trace.max_path_m, trace.seed, job.progress)?;
    let name = job.folder.hits(&view.name);
    let path = job.folder.prepare(&name)?;
    let provenance = job.provenance(&key, &[("view", &view.name)]);
    hits.write(&path, &view.view, trace.max_path_m, &provenance)?;
    job.done(&unit, &key, &[name], began, json!({ "pixels": hits.hits.len() }))
}

fn background(job: &mut Job<'_>, view: &PlannedView) -> Result<(), Error> {
    let key = key_of("direct", &(job.resolved.hits_key(view)?, job.resolved.suns_key()?))?;
    let unit = format!("direct {}", view.name);
    if !job.needs(Stage::Render, &unit, &key) {
        return Ok(());
    }
    let began = Instant::now();
    let hits = job.folder.read_hits(&view.name)?;
    let suns = render::representative_suns(job.timeline()?, BACKGROUND_SUNS);
    let picture = render::background(&view.view, &hits, job.site()?, &suns, job.progress)?;
    let name = job.folder.direct(&view.name);
    let path = job.folder.prepare(&name)?;
    let channel = |i: usize| picture.map(|rgb| rgb[i]);
    let (r, g, b) = (channel(0), channel(1), channel(2));
    let attributes = job.attributes(&key, &[("view", &view.name)])?;
    exr::write(&path, &[("R", &r), ("G", &g), ("B", &b)], &attributes)?;
    job.done(&unit, &key, &[name], began, json!({ "suns": suns.len() }))
}

/// What a view's maps and series are gathered from.
#[derive(Clone, Copy)]
struct Photons<'a> {
    store: &'a Store,
    surfaces: Option<&'a Surfaces<'a>>,
    hits: &'a HitMap,
    /// Of the points in free air.
    air: Option<Passed<'a>>,
}

/// What the series of a view gave, and facts for the log.
struct Gathered<'a> {
    series: Series,
    facts: Value,
    /// Of a fused view.
    analyses: Vec<fused::Analysed<'a>>,
}

fn maps(job: &mut Job<'_>, candidate: &Candidate, view: &PlannedView) -> Result<(), Error> {
    let key = job.resolved.render_key(candidate, view)?;
    let unit = format!("render {} {}", candidate.name, view.name);
    if !job.needs(Stage::Render, &unit, &key) {
        return Ok(());
    }
    let began = Instant::now();
    let of = Subject { candidate, view, key: &key };
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let surfaces = view.annual.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let crossings = crossings::crossings(job, candidate, view, &hits)?;
    let air = crossings.as_ref().map(crossings::Made::passed);
    let photons = Photons { store: &store, surfaces: surfaces.as_ref(), hits: &hits, air };
    let annual_took = annual(job, of, photons)?;
    let mut outputs = series_files::annual_names(job, of).to_vec();
    if air.is_some() {
        outputs.push(job.folder.air(&candidate.name, &view.name));
    }
    let annual_cache = store.cache_stats();
    let watch = Watch::start();
    let axis = TimeAxis::from(job.timeline()?);
    let gathered = match view.fuse {
        true => analysed_series(job, of, photons, &axis, &mut outputs)?,
        false => all_series(job, of, photons, &mut outputs)?,
    };
    let series_took = watch.read();
    let Gathered { series, facts, analyses } = gathered;
    if view.fuse {
        fused::record(job, candidate, view, &axis, analyses, began)?;
    }
    outputs.extend(noise(job, of, &series)?);
    let share = series.summary.photons_per_lit_timestep();
    warn_of_noise(job, of, share)?;
    let facts = json!({
        "cache": store.cache_stats(),
        "annual": annual_took,
        "annual_cache": annual_cache,
        "series_took": series_took,
        "series": facts,
        "gathered": series.summary,
        "photons_per_lit_timestep": share,
    });
    job.done(&unit, &key, &outputs, began, facts)
}

/// The maps of the year; how long they took, nothing where they were there.
fn annual(job: &Job<'_>, of: Subject<'_>, photons: Photons<'_>) -> Result<Option<Value>, Error> {
    let Photons { store, surfaces, hits, air } = photons;
    let mut attributes = job.attributes(of.key, &of.about())?;
    // What `view_file` reads.
    attributes.push(("VIEW".to_owned(), of.view.view.to_options()));
    // Written last: where it says that it was made from the same, the others were, too.
    let [last, ..] = series_files::annual_names(job, of).map(|name| job.folder.at(&name));
    let made = |made: picture::Channels| attributes.iter().all(|a| made.attributes.contains(a));
    if !job.is_forced(Stage::Render) && last.exists() && exr::read(&last).is_ok_and(made) {
        return Ok(None);
    }
    let watch = Watch::start();
    let weights: Vec<f64> = job.timeline()?.steps.iter().map(|s| s.weight_h).collect();
    let gather = &of.view.annual;
    let mut annual = render::annual(store, surfaces, hits, &weights, gather, job.progress)?;
    if let Some(air) = &air {
        air.add_year(&mut annual, &weights)?;
    }
    let took = watch.read();
    job.progress.finish();
    let maps = [
        (Map::Annual, &annual.surface),
        (Map::AnnualNormal, &annual.normal),
        (Map::Radius, &annual.radius_m),
        (Map::StandardError, &annual.error),
    ];
    series_files::write_annual(job, of, &maps, &attributes)?;
    Ok(Some(json!(took)))
}

/// Renders a fused view and analyses it, batch by batch.
fn analysed_series<'a>(
    job: &Job<'_>,
    of: Subject<'_>,
    photons: Photons<'_>,
    axis: &'a TimeAxis,
    outputs: &mut Vec<PathBuf>,
) -> Result<Gathered<'a>, Error> {
    let thresholds = &job.resolved.project.glare.thresholds_w_m2;
    let gather = series_gather(job, of.view)?;
    let made = analysed(job, axis, of.view, photons, &gather, thresholds)?;
    job.progress.finish();
    let fused::Made { rendered, peak, analyses, batches } = made;
    let series = rendered.series;
    outputs.extend(series_files::write_peak(job, of, job.resolved.quantity, &peak)?);
    Ok(Gathered { series, facts: json!({ "batches": batches }), analyses })
}

/// Writes the series of a view; what that of the irradiance gave which the project asks for.
fn all_series(
    job: &Job<'_>,
    of: Subject<'_>,
    photons: Photons<'_>,
    outputs: &mut Vec<PathBuf>,
) -> Result<Gathered<'static>, Error> {
    let gathered = one_series(job, of, photons, job.resolved.quantity, outputs)?;
    if let Some(other) = series_files::other(job, of) {
        one_series(job, of, photons, other, outputs)?;
    }
    Ok(gathered)
}

/// Writes a series, and the peak of it.
fn one_series(
    job: &Job<'_>,
    of: Subject<'_>,
    photons: Photons<'_>,
    quantity: Quantity,
    outputs: &mut Vec<PathBuf>,
) -> Result<Gathered<'static>, Error> {
    let Photons { store, surfaces, hits, air } = photons;
    let gather = series_gather(job, of.view)?;
    let writer = series_files::writer(job, of, quantity, hits)?;
    let series = series_files::series_of(job, quantity);
    let notes = job.folder.tile_notes(&of.candidate.name, &of.view.name, series);
    let path = job.folder.prepare(&notes)?;
    let rounded = Rounded::new(&writer, of.view.mantissa_bits);
    let noted = TileNotes::open(&rounded, &path, of.key, hits.columns)?;
    let with_air = air.as_ref().map(|a| a.series(&noted, quantity));
    let sink: &dyn TileSink = match &with_air {
        Some(sink) => sink,
        None => &noted,
    };
    let mut series = render::series(store, surfaces, hits, &gather, quantity, sink, job.progress)?;
    if let Some(air) = &air {
        air.add_noise(&mut series, quantity)?;
    }
    drop(noted);
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(series_files::name(job, of, quantity));
    outputs.extend(series_files::peak(job, of, quantity)?);
    job.remove(&notes)?;
    Ok(Gathered { series, facts: json!(written), analyses: Vec::new() })
}

/// What a photon of the series stands for, and how far they were gathered.
fn noise(job: &Job<'_>, of: Subject<'_>, series: &Series) -> Result<Vec<PathBuf>, Error> {
    let maps =
        [(Map::PhotonIrradiance, &series.photon_w_m2), (Map::SeriesRadius, &series.radius_m)];
    job.write_maps(of, &maps, &job.attributes(of.key, &of.about())?)
}

/// Tells the user where noise decides about durations.
fn warn_of_noise(job: &mut Job<'_>, of: Subject<'_>, share: Option<f64>) -> Result<(), Error> {
    let Some(photons) = share.filter(|p| *p < 10.0) else { return Ok(()) };
    let bandwidth = series_gather(job, of.view)?.bandwidth;
    job.warn(format!(
        "{} {}: {photons:.1} photons for each timestep that is lit at a pixel (bandwidth {bandwidth}); below 10 noise decides about durations: store more photons and raise series_bandwidth",
        of.candidate.name, of.view.name
    ));
    Ok(())
}

/// Analyses a fused view again.
pub(super) fn fused<'a>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    candidate: &Candidate,
    view: &PlannedView,
    thresholds: &[f64],
) -> Result<Vec<fused::Analysed<'a>>, Error> {
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let gather = series_gather(job, view)?;
    let surfaces = gather.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let photons = Photons { store: &store, surfaces: surfaces.as_ref(), hits: &hits, air: None };
    Ok(analysed(job, axis, view, photons, &gather, thresholds)?.analyses)
}

fn analysed<'a, 's>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    view: &PlannedView,
    photons: Photons<'s>,
    gather: &Gather,
    thresholds: &[f64],
) -> Result<fused::Made<'a, Fused<'s>>, Error> {
    let Photons { store, surfaces, hits, .. } = photons;
    fused::analyse(job, axis, view, hits, thresholds, |whole| {
        let to = (job.resolved.quantity, whole);
        Ok(Fused::prepare(store, surfaces, hits, gather, to, job.progress)?)
    })
}

/// How the series of a view is gathered.
fn series_gather(job: &Job<'_>, view: &PlannedView) -> Result<Gather, Error> {
    let gather = Gather { bandwidth: series_bandwidth(job, view)?, ..view.annual };
    Ok(if view.series_edges { gather } else { gather.open() })
}
