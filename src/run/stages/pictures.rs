//! What people look at: each map in colours over the daylight background, one scale per quantity
//! over all materials and views; and the ratio maps.

mod confidence;
mod marks;
mod occurrence;
mod regions;
mod unfiltered;

use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::json;

use self::marks::Marks;
use super::render::attributes;
use crate::base::{Grid, SpectralBasis};
use crate::picture::scale::{self, Below};
use crate::picture::{Figure, Rgb, Scale, compose, exr, tonemap};
use crate::project::{Candidate, PlannedView};
use crate::run::error::Error;
use crate::run::job::{Job, Made};

/// Decades of the logarithmic scale of annual maps.
const DECADES: f64 = 3.0;
/// Share of the lit pixels that a scale covers: single hot pixels don't decide.
const COVERED: f64 = 0.999;
/// Ratios beyond this are drawn as this.
const LARGEST_RATIO: f64 = 10.0;

/// A quantity that has one scale over all materials and views.
struct Quantity {
    file: String,
    /// Name of the picture, where it isn't that of the file.
    picture: Option<&'static str>,
    channel: String,
    title: String,
    legend: String,
    bare: String,
    caption: String,
    scale: Scale,
    /// Of a ratio: it isn't drawn where both parts are below this many Wh/m2, because there it
    /// compares single photons.
    faint_wh_m2: Option<f64>,
}

/// Draws every map and chart.
pub(in crate::run) fn pictures(job: &Job<'_>, key: &str) -> Result<Made, Error> {
    let resolved = job.resolved;
    let mut outputs = Vec::new();
    ratios(job, key, &mut outputs)?;
    let quantities = quantities(job)?;
    let total = resolved.views.len() * resolved.candidates.len() * quantities.len();
    job.progress.begin("pictures", total as u64, "pictures");
    for (view, picture) in resolved.views.iter().filter_map(|v| Some((v, v.picture()?))) {
        let direct = read_rgb(job, view)?;
        let marks = Marks::of(job, view, picture)?;
        outputs.push(daylight(job, view, &direct)?);
        let tasks: Vec<(&Candidate, &Quantity)> = resolved
            .candidates
            .iter()
            .flat_map(|c| quantities.iter().map(move |q| (c, q)))
            .collect();
        let drawn = tasks.par_iter().map(|(candidate, quantity)| {
            job.progress.check()?;
            let exr_name =
                job.folder.map(&candidate.name, &view.name, &format!("{}.exr", quantity.file));
            let noise = quantity.picture.is_some();
            let there = job.folder.at(&exr_name).exists() && !(noise && view.is_direct());
            let png =
                there.then(|| draw(job, candidate, view, quantity, &direct, &marks)).transpose()?;
            job.progress.advance(1);
            Ok(png)
        });
        outputs.extend(drawn.collect::<Result<Vec<_>, Error>>()?.into_iter().flatten());
    }
    outputs.extend(occurrence::draw(job)?);
    job.progress.finish();
    let made = outputs.len();
    Ok(Made::new(outputs, json!({ "files": made })))
}

/// Writes each candidate's annual map divided by the reference's.
fn ratios(job: &Job<'_>, key: &str, outputs: &mut Vec<PathBuf>) -> Result<(), Error> {
    let resolved = job.resolved;
    let Some(reference) = resolved.reference else { return Ok(()) };
    for view in &resolved.views {
        let old = annual(job, &resolved.candidates[reference], view)?;
        for (i, candidate) in resolved.candidates.iter().enumerate() {
            if i == reference {
                continue;
            }
            let ratio = compose::ratio(&annual(job, candidate, view)?, &old)?;
            let name = job.folder.map(&candidate.name, &view.name, "ratio.exr");
            let about = [
                ("material", candidate.name.as_str()),
                ("reference", resolved.candidates[reference].name.as_str()),
                ("view", view.name.as_str()),
            ];
            let path = job.folder.at(&name);
            exr::write(&path, &[("ratio", &ratio)], &attributes(job, key, &about))?;
            outputs.push(name);
        }
    }
    Ok(())
}

fn annual(job: &Job<'_>, c: &Candidate, view: &PlannedView) -> Result<Grid<f32>, Error> {
    read(job, &job.folder.map(&c.name, &view.name, "annual.exr"), "annual.wh_m2")
}

/// One channel of an EXR of this run.
pub(in crate::run) fn read(
    job: &Job<'_>,
    name: &std::path::Path,
    channel: &str,
) -> Result<Grid<f32>, Error> {
    let path = job.folder.at(name);
    Ok(exr::read(&path)?.values(Some(channel), &path)?.1)
}

fn read_rgb(job: &Job<'_>, view: &PlannedView) -> Result<Rgb, Error> {
    let path = job.folder.at(&job.folder.direct(&view.name));
    let channels = exr::read(&path)?;
    channels.rgb().ok_or_else(|| {
        // It was written by this run's render stage; only somebody else can have changed it.
        Error::Manifest { path, message: "expected the channels R, G and B".into() }
    })
}

/// Every map of a kind, over all materials and views.
fn all(job: &Job<'_>, file: &str, channel: &str) -> Result<Vec<Grid<f32>>, Error> {
    of_views(job, file, channel, |_| true)
}

fn of_views(
    job: &Job<'_>,
    file: &str,
    channel: &str,
    which: impl Fn(&PlannedView) -> bool,
) -> Result<Vec<Grid<f32>>, Error> {
    let mut grids = Vec::new();
    for candidate in &job.resolved.candidates {
        for view in job.resolved.views.iter().filter(|view| which(view)) {
            let name = job.folder.map(&candidate.name, &view.name, &format!("{file}.exr"));
            if job.folder.at(&name).exists() {
                grids.push(read(job, &name, channel)?);
            }
        }
    }
    Ok(grids)
}

fn quantities(job: &Job<'_>) -> Result<Vec<Quantity>, Error> {
    let resolved = job.resolved;
    let watts = watts(job.timeline()?.basis);
    let hours_unit = watts.replace("W/", "Wh/");
    let peak_channel = super::render::peak_channel(resolved.quantity);
    let what = super::render::quantity_words(resolved.quantity);
    let mut out = Vec::new();
    let top = |grids: &[Grid<f32>], share: f64| {
        scale::nice_ceiling(scale::percentile(grids, share).max(1e-6))
    };
    let annual = decades(top(&all(job, "annual", "annual.wh_m2")?, COVERED), &hours_unit);
    let faintest = annual.min;
    out.push(Quantity {
        file: "annual".into(),
        picture: None,
        channel: "annual.wh_m2".into(),
        title: "Energy from the PV in a year".into(),
        legend: "annual radiant exposure".into(),
        bare: "no colour: less, or nothing".into(),
        caption: "Sunlight that the PV throws onto each surface, summed over the year; the sun's own light is not in it.".into(),
        scale: annual,
        faint_wh_m2: None,
    });
    let peak = all(job, "peak", peak_channel)?;
    out.push(Quantity {
        file: "peak".into(),
        picture: None,
        channel: peak_channel.into(),
        title: "Strongest irradiance from the PV".into(),
        legend: format!("largest irradiance {what}"),
        bare: "no colour: less, or nothing".into(),
        caption:
            "The largest value of any timestep, unfiltered; noise makes single pixels too bright."
                .into(),
        scale: decades(top(&peak, COVERED), watts),
        faint_wh_m2: None,
    });
    if let Some(reference) = resolved.reference {
        let name = &resolved.candidates[reference].name;
        let ratio = all(job, "ratio", "ratio")?;
        out.push(Quantity {
            file: "ratio".into(),
            picture: None,
            channel: "ratio".into(),
            title: format!("Energy in a year compared with {name}"),
            legend: format!("ratio to {name}"),
            bare: format!("no colour: both below {} {hours_unit}", scale::format_value(faintest)),
            caption: format!(
                "Above 1 this material sends more light to a place than {name} does, below 1 less."
            ),
            scale: Scale::ratio(top(&ratio, 0.99).min(LARGEST_RATIO)),
            faint_wh_m2: Some(faintest),
        });
    }
    for (file, title, meaning) in [
        (
            "cumulative",
            "Hours of glare in a year",
            "Sum of all times of the year above the threshold.",
        ),
        (
            "sustained",
            "Longest glare event",
            "The longest time that one event, connected in space and time, covers a place on any day.",
        ),
        (
            "longest_run",
            "Longest glare without a break",
            "The longest uninterrupted time above the threshold on any day.",
        ),
    ] {
        let mut grids = Vec::new();
        let paths = |t: f64| format!("glare-{t}/{file}");
        for &t in &resolved.project.glare.thresholds_w_m2 {
            grids.extend(all(job, &paths(t), &format!("{file}.h"))?);
        }
        let max = scale::percentile(&grids, 1.0);
        let max = if max > 0.0 { scale::nice_ceiling(max) } else { 1.0 };
        for &t in &resolved.project.glare.thresholds_w_m2 {
            out.push(Quantity {
                file: paths(t),
                picture: None,
                channel: format!("{file}.h"),
                title: format!("{title} above {t} {watts}"),
                legend: format!("time above {t} {watts}"),
                bare: "no colour: never above the threshold".into(),
                caption: format!("{meaning} Irradiance {what}, smoothed in space and time as in the published method."),
                scale: Scale::linear(max, "h"),
                faint_wh_m2: None,
            });
        }
    }
    unfiltered::quantities(job, (watts, what), &mut out)?;
    confidence::quantities(job, (watts, &hours_unit, what), &mut out)?;
    Ok(out)
}

/// The unit of irradiance, for people.
fn watts(basis: SpectralBasis) -> &'static str {
    match basis {
        SpectralBasis::Visible => "visible W/m²",
        SpectralBasis::Broadband => "W/m²",
    }
}

/// A logarithmic scale; what lies below it shows the background: there, single photons decide.
fn decades(max: f64, unit: &str) -> Scale {
    Scale { below: Below::Transparent, ..Scale::logarithmic(max, DECADES, unit) }
}

fn subtitle(job: &Job<'_>, view: &PlannedView) -> Result<String, Error> {
    let p = &job.resolved.project;
    let timeline = job.timeline()?;
    let year =
        if p.time.half_year { "half a year, doubled".into() } else { p.time.year.to_string() };
    Ok(format!(
        "{} · {} · {} suns ({year}) · up to {} m from the PV",
        p.site.name,
        view.name,
        timeline.steps.len(),
        p.photons.max_path_m
    ))
}

fn draw(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    quantity: &Quantity,
    direct: &Rgb,
    marks: &Marks,
) -> Result<PathBuf, Error> {
    let name = |extension: &str| {
        let file = format!("{}.{extension}", quantity.file);
        job.folder.map(&candidate.name, &view.name, &file)
    };
    let mut data = read(job, &name("exr"), &quantity.channel)?;
    if let (Some(faint), Some(reference)) = (quantity.faint_wh_m2, job.resolved.reference) {
        let new = annual(job, candidate, view)?;
        let old = annual(job, &job.resolved.candidates[reference], view)?;
        let sums = new.data().iter().zip(old.data()).map(|(n, o)| f64::from(n.max(*o)));
        for (value, sum) in data.data_mut().iter_mut().zip(sums) {
            if sum < faint {
                *value = 0.0;
            }
        }
    }
    let mut figure = Figure::new(&data, quantity.scale.clone());
    figure.title = format!("{}: {}", candidate.name, quantity.title);
    figure.subtitle = subtitle(job, view)?;
    figure.background = Some(direct);
    figure.legend = quantity.legend.clone();
    figure.bare = quantity.bare.clone();
    figure.caption = vec![quantity.caption.clone()];
    if data.data().iter().all(|v| *v == 0.0) {
        figure
            .caption
            .insert(0, "Nothing in this view reaches the scale: the map is empty.".into());
    }
    if job.resolved.is_draft_of(view) {
        figure.watermark = Some("draft, not for assessment".into());
    }
    marks.put_on(&mut figure);
    let path = match quantity.picture {
        Some(picture) => name("exr").with_file_name(format!("{picture}.png")),
        None => name("png"),
    };
    figure.write_png(&job.folder.at(&path), &texts(job))?;
    Ok(path)
}

/// The background alone, as a picture that people like to look at.
fn daylight(job: &Job<'_>, view: &PlannedView, direct: &Rgb) -> Result<PathBuf, Error> {
    let name = job.folder.view_file(&view.name, "direct.png");
    let pixels = tonemap::tonemap(direct, tonemap::Exposure::Factor(1.0), false);
    crate::picture::png::write(&job.folder.at(&name), &pixels, &texts(job))?;
    Ok(name)
}

fn texts(job: &Job<'_>) -> Vec<(String, String)> {
    vec![
        ("Software".to_owned(), crate::base::Provenance::PROGRAM.to_owned()),
        ("Title".to_owned(), job.resolved.project.site.name.clone()),
    ]
}
