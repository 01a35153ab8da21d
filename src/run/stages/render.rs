//! Hits and background of each view, then maps and series of each candidate.

use std::path::PathBuf;
use std::time::Instant;

use serde_json::json;

use crate::base::{Grid, SpectralBasis};
use crate::pages::{Access, OpenOptions, Store};
use crate::picture::{exr, hdr};
use crate::render::{self, Gather, HitMap, Quantity, Surfaces};
use crate::run::Error;
use crate::run::job::{Job, Stage};
use crate::run::manifest::key_of;
use crate::run::resolve::{Candidate, PlannedView};
use crate::volume::{self, Volume, Writer};

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
    for candidate in &resolved.candidates {
        for view in resolved.with_sensors() {
            maps(job, candidate, view)?;
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
    let hits = read_hits(job, view)?;
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

/// The hits of a view, from its file.
pub(in crate::run) fn read_hits(job: &Job<'_>, view: &PlannedView) -> Result<HitMap, Error> {
    Ok(HitMap::read(&job.folder.at(&job.folder.hits(&view.name)))?.0)
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
    let hits = read_hits(job, view)?;
    let store_path = job.folder.at(&job.folder.store(&candidate.name));
    let options = OpenOptions { cache_bytes: job.options.page_cache_bytes, access: Access::Mapped };
    let store = Store::open(&store_path, &options)?;
    let about = [("material", candidate.name.as_str()), ("view", view.name.as_str())];
    let surfaces = view.annual.edges.then(|| job.site().map(Surfaces::of)).transpose()?;
    let surfaces = surfaces.as_ref();
    let mut outputs = annual(job, (&store, surfaces, &hits), candidate, view, &key, &about)?;
    let quantity = job.resolved.quantity;
    let steps = job.timeline()?.steps.len();
    let bandwidth = view.series_bandwidth.unwrap_or_else(|| (3 * steps).max(4000));
    let gather = Gather { bandwidth, ..view.annual };
    let series_name = job.folder.series(&candidate.name, &view.name);
    let series_path = job.folder.prepare(&series_name)?;
    let provenance = job.provenance(&key, &about);
    let (columns, rows) = (hits.columns, hits.rows);
    let create = |timeline| {
        Writer::create_or_resume(
            &series_path,
            timeline,
            columns,
            rows,
            written_quantity(quantity),
            &provenance,
        )
    };
    let writer = match create(job.timeline()?) {
        // Made from other settings: of no use any more.
        Err(volume::Error::Different { .. }) => {
            job.remove(&series_name)?;
            create(job.timeline()?)?
        }
        other => other?,
    };
    let told = render::series(&store, surfaces, &hits, &gather, quantity, &writer, job.progress)?;
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(series_name);
    outputs.push(peak(job, candidate, view, &key, &about)?);
    let share = told.summary.photons_per_lit_timestep();
    if let Some(photons) = share.filter(|p| *p < 10.0) {
        job.warn(format!(
            "{} {}: {photons:.1} photons for each timestep that is lit at a pixel (bandwidth {bandwidth}); below 10 noise decides about durations: store more photons and raise series_bandwidth",
            candidate.name, view.name
        ));
    }
    let facts = json!({
        "cache": store.cache_stats(),
        "series": written,
        "gathered": told.summary,
        "photons_per_lit_timestep": share,
    });
    job.done(&unit, &key, &outputs, began, facts)
}

fn annual(
    job: &Job<'_>,
    (store, surfaces, hits): (&Store, Option<&Surfaces<'_>>, &HitMap),
    candidate: &Candidate,
    view: &PlannedView,
    key: &str,
    about: &[(&str, &str)],
) -> Result<Vec<PathBuf>, Error> {
    let weights: Vec<f64> = job.timeline()?.steps.iter().map(|s| s.weight_h).collect();
    let annual = render::annual(store, surfaces, hits, &weights, &view.annual, job.progress)?;
    job.progress.finish();
    let name = |file: &str| job.folder.map(&candidate.name, &view.name, file);
    let path = job.folder.prepare(&name("annual.exr"))?;
    let channels: [(&str, &Grid<f32>); 4] = [
        ("annual.wh_m2", &annual.surface),
        ("annual_normal.wh_m2", &annual.normal),
        ("radius.m", &annual.radius_m),
        ("standard_error.wh_m2", &annual.error),
    ];
    exr::write(&path, &channels, &attributes(job, key, about))?;
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
    Ok(vec![name("annual.exr"), name("annual.hdr"), name("annual.npy")])
}

/// The largest irradiance of the year, from the finished series.
fn peak(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    key: &str,
    about: &[(&str, &str)],
) -> Result<PathBuf, Error> {
    let volume = Volume::open(&job.folder.at(&job.folder.series(&candidate.name, &view.name)))?;
    let peak = volume.peak(job.progress)?;
    job.progress.finish();
    let name = job.folder.map(&candidate.name, &view.name, "peak.exr");
    let channel = peak_channel(job.resolved.quantity);
    exr::write(&job.folder.prepare(&name)?, &[(channel, &peak)], &attributes(job, key, about))?;
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
