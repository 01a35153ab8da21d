//! Hits and background of each view, then maps and series of each candidate.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;

use super::direct;
use super::noted::Noted;
use super::passing;
use crate::base::{Grid, SpectralBasis, TileSink};
use crate::pages::{Access, OpenOptions, Store};
use crate::picture::{self, exr, hdr};
use crate::project::key_of;
use crate::project::{Candidate, PlannedView};
use crate::render::{self, Fused, Gather, HitMap, Passed, Quantity, Series, Surfaces};
use crate::run::cpu::Watch;
use crate::run::error::Error;
use crate::run::job::{Job, Stage};
use crate::volume::{self, Rounded, TimeAxis, Volume, Writer};

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
    let attributes = attributes(job, &key, &[("view", &view.name)]);
    exr::write(&path, &[("R", &r), ("G", &g), ("B", &b)], &attributes)?;
    job.done(&unit, &key, &[name], began, json!({ "suns": suns.len() }))
}

/// What EXR files say of their making.
pub(in crate::run) fn attributes(
    job: &Job<'_>,
    key: &str,
    about: &[(&str, &str)],
) -> Vec<(String, String)> {
    let p = job.provenance(key, about);
    let mut out = vec![
        ("glintmap.program".to_owned(), p.program),
        ("glintmap.settings".to_owned(), p.settings),
        ("glintmap.seed".to_owned(), p.seed.to_string()),
    ];
    // In one attribute: OpenEXR's names end at 31 letters, file names don't.
    let inputs: Vec<String> =
        p.inputs.iter().map(|(name, hash)| format!("{name} {hash}")).collect();
    out.push(("glintmap.inputs".to_owned(), inputs.join("\n")));
    out.extend(p.about.into_iter().map(|(k, v)| (format!("glintmap.{k}"), v)));
    let basis = match job.timeline().map(|t| t.basis) {
        Ok(SpectralBasis::Visible) => "visible",
        _ => "broadband",
    };
    out.push(("glintmap.basis".to_owned(), basis.to_owned()));
    out
}

fn maps(job: &mut Job<'_>, candidate: &Candidate, view: &PlannedView) -> Result<(), Error> {
    let key = job.resolved.render_key(candidate, view)?;
    let unit = format!("render {} {}", candidate.name, view.name);
    if !job.needs(Stage::Render, &unit, &key) {
        return Ok(());
    }
    let began = Instant::now();
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let about = [("material", candidate.name.as_str()), ("view", view.name.as_str())];
    let about = (key.as_str(), &about[..]);
    let surfaces = view.annual.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let made_from = (&store, surfaces.as_ref(), &hits);
    let air = passing::crossings(job, candidate, view, &hits)?;
    let air = air.as_ref().map(passing::Made::passed);
    let (mut outputs, annual_took) = annual(job, made_from, air, candidate, view, about)?;
    if air.is_some() {
        outputs.push(passing::store_name(job, candidate, view));
    }
    let annual_cache = store.cache_stats();
    let watch = Watch::start();
    let (series, written) = if view.fuse {
        let thresholds = &job.resolved.project.glare.thresholds_w_m2;
        let axis = TimeAxis::from(job.timeline()?);
        let gather = series_gather(job, view)?;
        let made = analysed(job, &axis, view, made_from, &gather, thresholds)?;
        job.progress.finish();
        let super::fused::Made { rendered, peak, analyses, batches } = made;
        let (series, quantity) = (rendered.series, job.resolved.quantity);
        outputs.push(write_peak(job, candidate, view, about, quantity, &peak)?);
        super::fused::record(job, candidate, view, &axis, analyses, began)?;
        (series, json!({ "batches": batches }))
    } else {
        let quantity = job.resolved.quantity;
        let mut written = |quantity| {
            written(job, made_from, air, candidate, view, (about, quantity), &mut outputs)
        };
        let made = written(quantity)?;
        if view.both {
            let other = match quantity {
                Quantity::Surface => Quantity::Normal,
                Quantity::Normal => Quantity::Surface,
            };
            written(other)?;
        }
        made
    };
    let series_took = watch.read();
    let noise = job.folder.map(&candidate.name, &view.name, "noise.exr");
    let channels = [("photon.w_m2", &series.photon_w_m2), ("series_radius.m", &series.radius_m)];
    exr::write(&job.folder.prepare(&noise)?, &channels, &attributes(job, about.0, about.1))?;
    outputs.push(noise);
    let share = series.summary.photons_per_lit_timestep();
    if let Some(photons) = share.filter(|p| *p < 10.0) {
        let bandwidth = series_gather(job, view)?.bandwidth;
        job.warn(format!(
            "{} {}: {photons:.1} photons for each timestep that is lit at a pixel (bandwidth {bandwidth}); below 10 noise decides about durations: store more photons and raise series_bandwidth",
            candidate.name, view.name
        ));
    }
    let facts = json!({
        "cache": store.cache_stats(),
        "annual": annual_took,
        "annual_cache": annual_cache,
        "series_took": series_took,
        "series": written,
        "gathered": series.summary,
        "photons_per_lit_timestep": share,
    });
    job.done(&unit, &key, &outputs, began, facts)
}

/// Analyses a fused view again.
pub(super) fn fused<'a>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    candidate: &Candidate,
    view: &PlannedView,
    thresholds: &[f64],
) -> Result<Vec<super::fused::Analysed<'a>>, Error> {
    let hits = job.folder.read_hits(&view.name)?;
    let store = open_store(job, candidate)?;
    let gather = series_gather(job, view)?;
    let surfaces = gather.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let from = (&store, surfaces.as_ref(), &hits);
    Ok(analysed(job, axis, view, from, &gather, thresholds)?.analyses)
}

fn analysed<'a, 's>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    view: &PlannedView,
    (store, surfaces, hits): MadeFrom<'s>,
    gather: &Gather,
    thresholds: &[f64],
) -> Result<super::fused::Made<'a, Fused<'s>>, Error> {
    super::fused::analyse(job, axis, view, hits, thresholds, |whole| {
        let to = (job.resolved.quantity, whole);
        Ok(Fused::prepare(store, surfaces, hits, gather, to, job.progress)?)
    })
}

fn open_store(job: &Job<'_>, candidate: &Candidate) -> Result<Store, Error> {
    let path = job.folder.at(&job.folder.store(&candidate.name));
    let options = OpenOptions { cache_bytes: job.options.page_cache_bytes, access: Access::Mapped };
    Ok(Store::open(&path, &options)?)
}

/// The photons that tell which PV surface sends; `None` where nothing is made of photons (a store
/// that still lies there is left over from other settings).
pub(super) fn telling_store(job: &Job<'_>, candidate: &Candidate) -> Result<Option<Store>, Error> {
    job.resolved.needs_photons().then(|| open_store(job, candidate)).transpose()
}

/// How the series of a view is gathered.
fn series_gather(job: &Job<'_>, view: &PlannedView) -> Result<Gather, Error> {
    let steps = job.timeline()?.steps.len();
    let bandwidth = view.series_bandwidth.unwrap_or_else(|| (3 * steps).max(4000));
    let gather = Gather { bandwidth, ..view.annual };
    Ok(if view.series_edges { gather } else { gather.open() })
}

/// A key, and what files say of their making beside it.
pub(super) type About<'a> = (&'a str, &'a [(&'a str, &'a str)]);
type MadeFrom<'a> = (&'a Store, Option<&'a Surfaces<'a>>, &'a HitMap);

/// Writes the series, and the peak of it.
fn written(
    job: &Job<'_>,
    (store, surfaces, hits): MadeFrom<'_>,
    air: Option<Passed<'_>>,
    candidate: &Candidate,
    view: &PlannedView,
    (about, quantity): (About<'_>, Quantity),
    outputs: &mut Vec<PathBuf>,
) -> Result<(Series, serde_json::Value), Error> {
    let gather = series_gather(job, view)?;
    let writer = writer(job, candidate, view, (about.0, quantity), hits)?;
    let notes = job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    let notes = notes.with_extension("notes");
    let path = job.folder.prepare(&notes)?;
    let rounded = Rounded::new(&writer, view.mantissa_bits);
    let noted = Noted::open(&rounded, &path, about.0, hits.columns)?;
    let with_air = air.as_ref().map(|a| a.series(&noted, quantity));
    let sink: &dyn TileSink = match &with_air {
        Some(sink) => sink,
        None => &noted,
    };
    let mut told = render::series(store, surfaces, hits, &gather, quantity, sink, job.progress)?;
    if let Some(air) = &air {
        air.add_noise(&mut told, quantity)?;
    }
    drop(noted);
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(job.folder.map(&candidate.name, &view.name, names(job, quantity).0));
    outputs.push(peak(job, candidate, view, about, quantity)?);
    job.remove(&notes)?;
    Ok((told, json!(written)))
}

/// Names of the series and the peak of a quantity.
pub(super) fn names(job: &Job<'_>, quantity: Quantity) -> (&'static str, &'static str) {
    match quantity {
        _ if quantity == job.resolved.quantity => ("series.zarr", "peak.exr"),
        Quantity::Surface => ("series_surface.zarr", "peak_surface.exr"),
        Quantity::Normal => ("series_normal.zarr", "peak_normal.exr"),
    }
}

/// The series of a view: begun, or gone on with where it was made from the same settings.
pub(super) fn writer(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (key, quantity): (&str, Quantity),
    hits: &HitMap,
) -> Result<Writer, Error> {
    let about = [("material", candidate.name.as_str()), ("view", view.name.as_str())];
    let name = job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    let path = job.folder.prepare(&name)?;
    let mut provenance = job.provenance(key, &about);
    if let Some(most) = Rounded::largest_relative_error(view.mantissa_bits) {
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

fn annual(
    job: &Job<'_>,
    (store, surfaces, hits): MadeFrom<'_>,
    air: Option<Passed<'_>>,
    candidate: &Candidate,
    view: &PlannedView,
    (key, about): (&str, &[(&str, &str)]),
) -> Result<(Vec<PathBuf>, Option<serde_json::Value>), Error> {
    let name = |file: &str| job.folder.map(&candidate.name, &view.name, file);
    let outputs = vec![name("annual.exr"), name("annual.hdr"), name("annual.npy")];
    let mut attributes = attributes(job, key, about);
    // What `view_file` reads.
    attributes.push(("VIEW".to_owned(), view.view.to_options()));
    // Written last: where it says that it was made from the same, the others were, too.
    let last = job.folder.prepare(&name("annual.exr"))?;
    let made = |made: picture::Channels| attributes.iter().all(|a| made.attributes.contains(a));
    if !job.is_forced(Stage::Render) && last.exists() && exr::read(&last).is_ok_and(made) {
        return Ok((outputs, None));
    }
    let watch = Watch::start();
    let weights: Vec<f64> = job.timeline()?.steps.iter().map(|s| s.weight_h).collect();
    let mut annual = render::annual(store, surfaces, hits, &weights, &view.annual, job.progress)?;
    if let Some(air) = &air {
        air.add_year(&mut annual, &weights)?;
    }
    let took = watch.read();
    job.progress.finish();
    let grey = annual.surface.map(|v| [*v; 3]);
    let mut lines = vec![
        format!("SOFTWARE= {}", crate::base::Provenance::PROGRAM),
        "annual radiant exposure, Wh/m2".to_owned(),
    ];
    if view.points.is_none() {
        lines.push(view.view.to_view_line());
    }
    hdr::write(&job.folder.at(&name("annual.hdr")), &grey, &lines)?;
    let npy = job.folder.at(&name("annual.npy"));
    glintmap_formats::npy::write(
        &npy,
        &[annual.surface.rows(), annual.surface.columns()],
        annual.surface.data(),
    )?;
    let channels: [(&str, &Grid<f32>); 4] = [
        ("annual.wh_m2", &annual.surface),
        ("annual_normal.wh_m2", &annual.normal),
        ("radius.m", &annual.radius_m),
        ("standard_error.wh_m2", &annual.error),
    ];
    exr::write(&last, &channels, &attributes)?;
    Ok((outputs, Some(json!(took))))
}

/// The largest irradiance of the year, from the finished series.
pub(super) fn peak(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    about: About<'_>,
    quantity: Quantity,
) -> Result<PathBuf, Error> {
    let series = job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    let volume = Volume::open(&job.folder.at(&series))?;
    let peak = volume.peak(job.progress)?;
    job.progress.finish();
    write_peak(job, candidate, view, about, quantity, &peak)
}

/// Writes the largest irradiance of the year.
pub(super) fn write_peak(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    (key, about): About<'_>,
    quantity: Quantity,
    peak: &Grid<f32>,
) -> Result<PathBuf, Error> {
    let name = job.folder.map(&candidate.name, &view.name, names(job, quantity).1);
    let path = job.folder.prepare(&name)?;
    exr::write(&path, &[(peak_channel(quantity), peak)], &attributes(job, key, about))?;
    Ok(name)
}

/// Name of the channel of `peak.exr`.
pub(super) fn peak_channel(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Surface => "peak.w_m2",
        Quantity::Normal => "peak_normal.w_m2",
    }
}

/// Which irradiance it is, for people.
pub(super) fn quantity_words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Surface => "on the surface",
        Quantity::Normal => "normal to the beam",
    }
}

/// The volume's word for what was rendered; neither room knows the other.
fn written_quantity(quantity: Quantity) -> volume::Quantity {
    match quantity {
        Quantity::Surface => volume::Quantity::Surface,
        Quantity::Normal => volume::Quantity::Normal,
    }
}
