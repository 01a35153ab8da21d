//! Points instead of pixels: where they lie and what they see; then, after their series were
//! rendered as those of pictures are, what arrives there.

pub(in crate::run) mod sheet;

use glintmap_formats::seal;
use serde_json::json;

use super::judged::class;
use super::pictures::read;
use super::render::telling_store;
use crate::glare::Lengths;
use crate::pages::Store;
use crate::project::{Candidate, PlannedView, Points};
use crate::receivers::air::Crossings;
use crate::receivers::clock::Clock;
use crate::receivers::points::{Spreader, read_points};
use crate::receivers::received::{Reader, Received};
use crate::render::sensors;
use crate::rules::Class;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::{TimeAxis, Volume};

/// Clock times at which glare outdoors counts, h.
pub(super) const OUTDOOR_H: [f64; 2] = [6.0, 22.0];

/// Checks what regions name before anything is made.
pub(in crate::run) fn check(job: &Job<'_>) -> Result<(), Error> {
    if job.resolved.project.region.is_empty() {
        return Ok(());
    }
    Ok(Spreader { resolved: job.resolved, site: job.site()? }.check()?)
}

/// Finds the points of a set in the scene: `hits.gmh` and `points.json`.
pub(in crate::run) fn place(
    job: &Job<'_>,
    set: &PlannedView,
    from: &Points,
    key: &str,
) -> Result<Made, Error> {
    let trace = &job.resolved.trace;
    let spreader = Spreader { resolved: job.resolved, site: job.site()? };
    let mut points = match from {
        Points::File { sensors, map, .. } => spreader.file(&set.name, sensors, *map),
        Points::Receivers => spreader.receivers(&|view| Ok(job.folder.read_hits(&view.name)?))?,
    };
    let placed = sensors::place(&points.sensors, spreader.site, trace.max_path_m, trace.seed);
    for group in &mut points.set.groups {
        let range = group.first..group.first + group.points();
        group.footing = placed.footing[range.clone()].to_vec();
        group.pv = placed.pv[range].to_vec();
    }
    let name = job.folder.hits(&set.name);
    let path = job.folder.prepare(&name)?;
    let provenance = job.provenance(key, &[("view", &set.name)]);
    placed.hits.write_sensors(&path, trace.max_path_m, &provenance)?;
    let list = job.folder.points(&set.name);
    let path = job.folder.at(&list);
    let text = serde_json::to_vec_pretty(&points.set).map_err(std::io::Error::from)?;
    seal::write_bytes(&path, &text).map_err(|source| Error::Write { path, source })?;
    let facts = json!({ "points": points.sensors.len(), "groups": points.set.groups.len() });
    Ok(Made::new(vec![name, list], facts))
}

/// Reads what arrives at the points of a set: `sensors.csv`, `receivers.json`, and for each group
/// when.
pub(in crate::run) fn received(job: &Job<'_>, of: OfView<'_>) -> Result<Made, Error> {
    let OfView { candidate, view: set } = of;
    let map = |file: &str| job.folder.map(&candidate.name, &set.name, file);
    let hits = job.folder.read_hits(&set.name)?;
    let volume = Volume::open(&job.folder.at(&job.folder.series(&candidate.name, &set.name)))?;
    let store = telling_store(job, candidate)?;
    let points = read_points(&job.folder, set)?;
    let gather = set.photons();
    let air = match gather {
        None => None,
        Some(_) => Crossings::open(
            &job.folder,
            &candidate.name,
            (&points, set),
            job.options.page_cache_bytes,
        )?,
    };
    let surfaces: Vec<String> = job.site()?.pv.iter().map(|s| s.name.clone()).collect();
    let axis = TimeAxis::from(job.timeline()?);
    let clock = Clock::new(&job.resolved.project.site, axis.year);
    let civil = TimeAxis { hour: clock.hours(&axis), ..axis.clone() };
    let steps = axis.day.len();
    let bandwidth = gather.copied().unwrap_or_default().series_bandwidth(steps);
    let annual = read(job, &map("annual.exr"), "annual.wh_m2")?;
    let normal = read(job, &map("annual.exr"), "annual_normal.wh_m2")?;
    let thresholds = &job.resolved.project.glare.thresholds_w_m2;
    let filtered = thresholds
        .iter()
        .map(|t| {
            let of = |name: &str| -> Result<Vec<f32>, Error> {
                let exr = job.folder.glare(&candidate.name, &set.name, *t, &format!("{name}.exr"));
                Ok(read(job, &exr, &format!("{name}.h"))?.data().to_vec())
            };
            Ok([of("cumulative")?, of("longest_run")?])
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let mut reader = Reader {
        hits: &hits,
        volume: &volume,
        axis: &axis,
        lengths: Lengths::of(&axis)?,
        civil: &civil,
        store: store.as_ref(),
        air: air.as_ref(),
        exact: set.is_direct(),
        surfaces: &surfaces,
        bandwidth,
        max_radius_m: gather
            .and_then(|gather| gather.annual.max_radius_m)
            .or_else(|| Some(store.as_ref()?.max_radius_m(bandwidth)))
            .unwrap_or_default(),
        thresholds,
        annual: annual.data(),
        filtered: &filtered,
        counts: vec![true; steps],
    };
    let mut outputs = Vec::new();
    let mut all = Received { clock: clock.zone(), groups: Vec::new() };
    let mut table = sheet::head(thresholds);
    let groups = points.groups;
    job.progress.begin("receivers", groups.len() as u64, "receivers");
    for (number, group) in groups.iter().enumerate() {
        job.progress.check()?;
        let outdoor = class(job, &group.name) == Some(Class::Outdoor);
        for (t, counts) in reader.counts.iter_mut().enumerate() {
            let hour = clock.civil_hour(axis.day[t], axis.hour[t]);
            *counts = !outdoor || (OUTDOOR_H[0]..=OUTDOOR_H[1]).contains(&hour);
        }
        let mut reading = reader.read(group)?;
        if outdoor && reading.group.not_evaluated.is_none() {
            reading.group.notes.push("only times from 6 to 22 h count".into());
        }
        sheet::points(&mut table, group, &reading, &hits, [&annual, &normal], &clock, &axis);
        if reading.group.not_evaluated.is_none() {
            let name = map(&format!("{}.csv", occurrence(number, &group.name)));
            let path = job.folder.prepare(&name)?;
            let text = sheet::occurrence(&reading, &surfaces, &clock, &axis);
            seal::write_bytes(&path, text.as_bytes())
                .map_err(|source| Error::Write { path, source })?;
            outputs.push(name);
        }
        all.groups.push(reading.group);
        job.progress.advance(1);
    }
    job.progress.finish();
    let text = serde_json::to_vec_pretty(&all).map_err(std::io::Error::from)?;
    for (name, bytes) in [("receivers.json", text), ("sensors.csv", table.into_bytes())] {
        let path = job.folder.at(&map(name));
        seal::write_bytes(&path, &bytes).map_err(|source| Error::Write { path, source })?;
        outputs.push(map(name));
    }
    let cache = store.as_ref().map(Store::cache_stats);
    let facts = json!({ "receivers": all.groups.len(), "cache": cache });
    Ok(Made::new(outputs, facts))
}

/// `occurrence/01-church-tower`: where the times of a group lie, without an extension.
pub(in crate::run) fn occurrence(number: usize, name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' })
        .collect();
    let words: Vec<&str> = plain.split('-').filter(|w| !w.is_empty()).collect();
    let mut short = words.join("-");
    short.truncate(40);
    format!("occurrence/{:02}-{short}", number + 1)
}

/// What arrives at the groups of a set, from their file.
pub(in crate::run) fn read_received(
    job: &Job<'_>,
    candidate: &Candidate,
    set: &PlannedView,
) -> Result<Received, Error> {
    let path = job.folder.at(&job.folder.map(&candidate.name, &set.name, "receivers.json"));
    let text = std::fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
    serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
}
