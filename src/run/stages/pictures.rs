//! What people look at: each map in colours over the daylight background, one scale per quantity
//! over all materials and views; and the ratio maps.

mod atlas;
mod marks;
mod noise;
mod regions;
mod unfiltered;

use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::json;

use self::atlas::{Drawing, drawings};
use self::marks::Marks;
use crate::base::{Grid, Provenance};
use crate::picture::{Figure, Rgb, compose, exr, png, tonemap};
use crate::project::{Candidate, Map, PlannedView};
use crate::report::occurrence_charts;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;

/// Draws every map and chart.
pub(in crate::run) fn pictures(job: &Job<'_>, key: &str) -> Result<Made, Error> {
    let resolved = job.resolved;
    let mut outputs = ratios(job, key)?;
    let drawings = drawings(job)?;
    let total = resolved.views.len() * resolved.candidates.len() * drawings.len();
    job.progress.begin("pictures", total as u64, "pictures");
    for (view, picture) in resolved.views.iter().filter_map(|v| Some((v, v.picture()?))) {
        let background = read_background(job, view)?;
        let marks = Marks::of(job, view, picture)?;
        outputs.push(daylight(job, view, &background)?);
        let canvas = Canvas { view, background: &background, marks: &marks };
        let tasks: Vec<(&Candidate, &Drawing)> = resolved
            .candidates
            .iter()
            .flat_map(|c| drawings.iter().map(move |drawing| (c, drawing)))
            .collect();
        let drawn = tasks.par_iter().map(|(candidate, drawing)| {
            job.progress.check()?;
            let name = job.folder.exr(&candidate.name, &view.name, drawing.map);
            let there = job.folder.at(&name).exists() && !(drawing.is_of_noise && view.is_direct());
            let png = there.then(|| draw(job, candidate, &canvas, drawing)).transpose()?;
            job.progress.advance(1);
            Ok(png)
        });
        outputs.extend(drawn.collect::<Result<Vec<_>, Error>>()?.into_iter().flatten());
    }
    outputs.extend(occurrence_charts::draw(&job.results()?)?);
    job.progress.finish();
    let made = outputs.len();
    Ok(Made::new(outputs, json!({ "files": made })))
}

/// Writes each candidate's annual map divided by the reference's.
fn ratios(job: &Job<'_>, key: &str) -> Result<Vec<PathBuf>, Error> {
    let resolved = job.resolved;
    let mut outputs = Vec::new();
    let Some(reference) = resolved.reference.map(|at| &resolved.candidates[at]) else {
        return Ok(outputs);
    };
    for view in &resolved.views {
        let old = job.read_map(OfView { candidate: reference, view }, Map::Annual)?;
        for (i, candidate) in resolved.candidates.iter().enumerate() {
            if resolved.reference == Some(i) {
                continue;
            }
            let of = OfView { candidate, view };
            let ratio = compose::ratio(&job.read_map(of, Map::Annual)?, &old)?;
            let [material, view] = view.about(&candidate.name);
            let about = [material, ("reference", reference.name.as_str()), view];
            let attributes = job.attributes(key, &about)?;
            outputs.extend(job.write_maps(of, &[(Map::Ratio, &ratio)], &attributes)?);
        }
    }
    Ok(outputs)
}

fn read_background(job: &Job<'_>, view: &PlannedView) -> Result<Rgb, Error> {
    let path = job.folder.at(&job.folder.direct(&view.name));
    let channels = exr::read(&path)?;
    channels.rgb().ok_or_else(|| {
        // It was written by this run's render stage; only somebody else can have changed it.
        Error::Manifest { path, message: "expected the channels R, G and B".into() }
    })
}

/// What the maps of a view are drawn on.
struct Canvas<'a> {
    view: &'a PlannedView,
    background: &'a Rgb,
    marks: &'a Marks,
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
    canvas: &Canvas<'_>,
    drawing: &Drawing,
) -> Result<PathBuf, Error> {
    let view = canvas.view;
    let read = |candidate, map| job.read_map(OfView { candidate, view }, map);
    let mut data = read(candidate, drawing.map)?;
    if let (Some(faint), Some(reference)) = (drawing.faint_wh_m2, job.resolved.reference) {
        let new = read(candidate, Map::Annual)?;
        let old = read(&job.resolved.candidates[reference], Map::Annual)?;
        blank_where_faint(&mut data, [&new, &old], faint);
    }
    let mut figure = Figure::new(&data, drawing.scale.clone());
    figure.title = format!("{}: {}", candidate.name, drawing.title);
    figure.subtitle = subtitle(job, view)?;
    figure.background = Some(canvas.background);
    figure.legend = drawing.legend.clone();
    figure.bare = drawing.bare.clone();
    figure.caption = vec![drawing.caption.clone()];
    if data.data().iter().all(|v| *v == 0.0) {
        figure
            .caption
            .insert(0, "Nothing in this view reaches the scale: the map is empty.".into());
    }
    if job.resolved.is_draft_of(view) {
        figure.watermark = Some("draft, not for assessment".into());
    }
    canvas.marks.put_on(&mut figure);
    let name = job.folder.png(&candidate.name, &view.name, drawing.map);
    figure.write_png(&job.folder.at(&name), &texts(job))?;
    Ok(name)
}

/// Takes away what compares single photons: where both parts of a ratio are small.
fn blank_where_faint(ratio: &mut Grid<f32>, [new, old]: [&Grid<f32>; 2], faint_wh_m2: f64) {
    let sums = new.data().iter().zip(old.data()).map(|(n, o)| f64::from(n.max(*o)));
    for (value, sum) in ratio.data_mut().iter_mut().zip(sums) {
        if sum < faint_wh_m2 {
            *value = 0.0;
        }
    }
}

/// The background alone, as a picture that people like to look at.
fn daylight(job: &Job<'_>, view: &PlannedView, background: &Rgb) -> Result<PathBuf, Error> {
    let name = job.folder.direct_picture(&view.name);
    let pixels = tonemap::tonemap(background, tonemap::Exposure::Factor(1.0), false);
    png::write(&job.folder.at(&name), &pixels, &texts(job))?;
    Ok(name)
}

fn texts(job: &Job<'_>) -> Vec<(String, String)> {
    vec![
        ("Software".to_owned(), Provenance::PROGRAM.to_owned()),
        ("Title".to_owned(), job.resolved.project.site.name.clone()),
    ]
}
