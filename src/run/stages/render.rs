//! What a picture sees and its background; then, of each candidate, maps of the year and series from
//! photons.

use std::path::PathBuf;

use glintmap_formats::npy;
use serde_json::json;

use super::noted::Noted;
use super::passing::Air;
use crate::base::{Grid, Irradiance, SpectralBasis, TileSink};
use crate::pages::{Access, OpenOptions, Store};
use crate::picture::{exr, hdr};
use crate::project::{Candidate, PhotonGather, Picture, PlannedView, SeriesKept};
use crate::render::{self, Fused, Gather, HitMap, Series, Surfaces, View, VirtualSensors};
use crate::run::cpu::Watch;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::{Rounded, TimeAxis, Volume, Writer};

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
    let attributes = attributes(job, key, &[("view", &view.name)]);
    exr::write(&path, &[("R", &r), ("G", &g), ("B", &b)], &attributes)?;
    Ok(Made::new(vec![name], json!({ "suns": suns.len() })))
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
            made.outputs.push(write_peak(job, of, key, quantity, &peak)?);
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
    let noise = job.folder.map(&candidate.name, &view.name, "noise.exr");
    let channels = [("photon.w_m2", &series.photon_w_m2), ("series_radius.m", &series.radius_m)];
    let attributes = attributes(job, key, &view.about(&candidate.name));
    exr::write(&job.folder.prepare(&noise)?, &channels, &attributes)?;
    made.outputs.push(noise);
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
    let writer = writer(job, of, (key, quantity), hits)?;
    let name = job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    let path = job.folder.prepare(&name.with_extension("notes"))?;
    let rounded = Rounded::new(&writer, view.mantissa_bits);
    let noted = Noted::open(&rounded, &path, hits.columns)?;
    let with_air = air.as_ref().map(|a| a.series(&noted, quantity));
    let sink: &dyn TileSink = match &with_air {
        Some(sink) => sink,
        None => &noted,
    };
    let mut told = render::series(store, surfaces, hits, gather, quantity, sink, job.progress)?;
    if let Some(air) = &air {
        air.add_noise(&mut told, quantity)?;
    }
    drop(noted);
    job.progress.finish();
    let written = writer.finish()?;
    outputs.push(name);
    outputs.push(peak(job, of, key, quantity)?);
    Ok((told, json!(written)))
}

/// Names of the series and the peak of a quantity.
pub(super) fn names(job: &Job<'_>, quantity: Irradiance) -> (&'static str, &'static str) {
    match quantity {
        _ if quantity == job.resolved.quantity => ("series.zarr", "peak.exr"),
        Irradiance::Surface => ("series_surface.zarr", "peak_surface.exr"),
        Irradiance::FacingBeam => ("series_normal.zarr", "peak_normal.exr"),
    }
}

/// The series of a view: begun, or gone on with.
pub(super) fn writer(
    job: &Job<'_>,
    of: OfView<'_>,
    (key, quantity): (&str, Irradiance),
    hits: &HitMap,
) -> Result<Writer, Error> {
    let OfView { candidate, view } = of;
    let name = job.folder.map(&candidate.name, &view.name, names(job, quantity).0);
    let path = job.folder.prepare(&name)?;
    let mut provenance = job.provenance(key, &view.about(&candidate.name));
    if let Some(most) = Rounded::largest_relative_error(view.mantissa_bits) {
        provenance.about.insert("largest_relative_error".to_owned(), most);
    }
    let (columns, rows) = (hits.columns, hits.rows);
    let timeline = job.timeline()?;
    Ok(Writer::create_or_resume(&path, timeline, columns, rows, quantity, &provenance)?)
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
    let mut attributes = attributes(job, key, &view.about(&candidate.name));
    // What `view_file` reads. Points have no camera, but their files always had the attribute.
    let camera = match view.picture() {
        Some(picture) => picture.view.clone(),
        None => View::parse("-vtv", 1, 1)?,
    };
    attributes.push(("VIEW".to_owned(), camera.to_options()));
    let channels: [(&str, &Grid<f32>); 4] = [
        ("annual.wh_m2", &annual.surface),
        ("annual_normal.wh_m2", &annual.facing_beam),
        ("radius.m", &annual.radius_m),
        ("standard_error.wh_m2", &annual.error),
    ];
    let outputs = write_annual(job, of, &annual.surface, &channels, &attributes)?;
    Ok(Made::new(outputs, json!({ "annual": took, "cache": store.cache_stats() })))
}

/// Writes the maps of the year: all channels as EXR, the first also as HDR and NumPy array.
pub(super) fn write_annual(
    job: &Job<'_>,
    of: OfView<'_>,
    surface: &Grid<f32>,
    channels: &[(&str, &Grid<f32>)],
    attributes: &[(String, String)],
) -> Result<Vec<PathBuf>, Error> {
    let name = |file: &str| job.folder.map(&of.candidate.name, &of.view.name, file);
    let names = ["annual.exr", "annual.hdr", "annual.npy"].map(name);
    let mut lines = vec![
        format!("SOFTWARE= {}", crate::base::Provenance::PROGRAM),
        "annual radiant exposure, Wh/m2".to_owned(),
    ];
    lines.extend(of.view.picture().map(|picture| picture.view.to_view_line()));
    exr::write(&job.folder.prepare(&names[0])?, channels, attributes)?;
    hdr::write(&job.folder.at(&names[1]), &surface.map(|v| [*v; 3]), &lines)?;
    npy::write(&job.folder.at(&names[2]), &[surface.rows(), surface.columns()], surface.data())?;
    Ok(names.into())
}

/// The largest irradiance of the year, from the finished series.
pub(super) fn peak(
    job: &Job<'_>,
    of: OfView<'_>,
    key: &str,
    quantity: Irradiance,
) -> Result<PathBuf, Error> {
    let series = job.folder.map(&of.candidate.name, &of.view.name, names(job, quantity).0);
    let volume = Volume::open(&job.folder.at(&series))?;
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
) -> Result<PathBuf, Error> {
    let name = job.folder.map(&of.candidate.name, &of.view.name, names(job, quantity).1);
    let path = job.folder.prepare(&name)?;
    let attributes = attributes(job, key, &of.view.about(&of.candidate.name));
    exr::write(&path, &[(peak_channel(quantity), peak)], &attributes)?;
    Ok(name)
}

/// Name of the channel of `peak.exr`.
pub(super) fn peak_channel(quantity: Irradiance) -> &'static str {
    match quantity {
        Irradiance::Surface => "peak.w_m2",
        Irradiance::FacingBeam => "peak_normal.w_m2",
    }
}

/// Which irradiance it is, for people.
pub(super) fn quantity_words(quantity: Irradiance) -> &'static str {
    match quantity {
        Irradiance::Surface => "on the surface",
        Irradiance::FacingBeam => "normal to the beam",
    }
}
