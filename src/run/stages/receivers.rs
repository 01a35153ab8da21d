//! Points instead of pixels: where they lie and what they see; then, after their series were
//! rendered as those of pictures are, what arrives there.

use serde_json::json;

use super::stores::telling_store;
use crate::base::Grid;
use crate::base::table::Table;
use crate::pages::Store;
use crate::project::artifacts::{ReceiverFile, ReceiverId};
use crate::project::{GlareMap, Map, PlannedView, Points};
use crate::receivers::air::Crossings;
use crate::receivers::clock::Clock;
use crate::receivers::points::{Spreader, read_points};
use crate::receivers::received::{Calendar, Reader, Received, Rendered, SeriesPhotons};
use crate::receivers::tables::{OccurrenceRow, PointTable, occurrence};
use crate::render::sensors;
use crate::rules::Class;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::run::units::OfView;
use crate::volume::Volume;

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
    job.folder.write_json(&list, &points.set)?;
    let facts = json!({ "points": points.sensors.len(), "groups": points.set.groups.len() });
    Ok(Made::new(vec![name, list], facts))
}

/// What was rendered at the points of a set, as maps.
struct PointMaps {
    annual: Grid<f32>,
    normal: Grid<f32>,
    /// For each threshold hours of the year and longest run after the filter in time, h.
    filtered: Vec<[Vec<f32>; 2]>,
}

impl PointMaps {
    fn read(job: &Job<'_>, of: OfView<'_>) -> Result<Self, Error> {
        let read = |map| job.read_map(of, map);
        let mut filtered = Vec::new();
        for &t in &job.resolved.project.glare.thresholds_w_m2 {
            let of = |map| Ok::<_, Error>(read(Map::Glare(t, map))?.data().to_vec());
            filtered.push([of(GlareMap::Cumulative)?, of(GlareMap::LongestRun)?]);
        }
        Ok(Self { annual: read(Map::Annual)?, normal: read(Map::AnnualNormal)?, filtered })
    }
}

/// Reads what arrives at the points of a set: `sensors.csv`, `receivers.json`, and for each group
/// when.
pub(in crate::run) fn received(job: &Job<'_>, of: OfView<'_>) -> Result<Made, Error> {
    let OfView { candidate, view: set } = of;
    let results = job.results()?;
    let hits = job.folder.read_hits(&set.name)?;
    let volume = Volume::open(&job.folder.at(&job.folder.series(&candidate.name, &set.name)))?;
    let store = telling_store(job, candidate)?;
    let points = read_points(&job.folder, set)?;
    let cache = job.options.page_cache_bytes;
    let gather = set.photons();
    let air = match gather {
        None => None,
        Some(_) => Crossings::open(&job.folder, &candidate.name, (&points, set), cache)?,
    };
    let surfaces: Vec<String> = job.site()?.pv.iter().map(|s| s.name.clone()).collect();
    let clock = Clock::new(&job.resolved.project.site, results.timeline.year);
    let calendar = Calendar::of(results.timeline, &clock)?;
    let maps = PointMaps::read(job, of)?;
    let timesteps = results.timeline.steps.len();
    let bandwidth = gather.copied().unwrap_or_default().series_bandwidth(timesteps);
    let asked_m = gather.and_then(|gather| gather.annual.max_radius_m);
    let widest_m = || Some(store.as_ref()?.max_radius_m(bandwidth));
    let mut reader = Reader {
        rendered: Rendered {
            hits: &hits,
            volume: &volume,
            exact: set.is_direct(),
            annual: maps.annual.data(),
            filtered: &maps.filtered,
        },
        photons: SeriesPhotons {
            store: store.as_ref(),
            air: air.as_ref(),
            bandwidth,
            max_radius_m: asked_m.or_else(widest_m).unwrap_or_default(),
        },
        calendar: &calendar,
        surfaces: &surfaces,
        thresholds: results.thresholds_w_m2(),
        counts: Vec::new(),
    };
    let sheet = PointTable {
        hits: &hits,
        annual: &maps.annual,
        normal: &maps.normal,
        thresholds: results.thresholds_w_m2(),
        clock: &clock,
        axis: &calendar.axis,
    };
    let mut table = sheet.begin(Vec::new())?;
    let mut outputs = Vec::new();
    let mut all = Received { clock: clock.zone(), groups: Vec::new() };
    let groups = points.groups;
    job.progress.begin("receivers", groups.len() as u64, "receivers");
    for (number, group) in groups.iter().enumerate() {
        job.progress.check()?;
        let class = results.class(&group.name);
        reader.counts = calendar.counts(class, &clock);
        let mut reading = reader.read(group)?;
        if class == Some(Class::Outdoor) && reading.group.not_evaluated.is_none() {
            reading.group.notes.push("only times from 6 to 22 h count".into());
        }
        sheet.add(&mut table, group, &reading)?;
        if reading.group.not_evaluated.is_none() {
            let receiver = ReceiverId { number, name: &group.name };
            let file = ReceiverFile::Occurrence;
            let name = job.folder.receiver(&candidate.name, &set.name, receiver, file);
            job.folder.write(&name, |out| {
                let mut table = Table::of::<OccurrenceRow>(out)?;
                for row in occurrence(&reading, &surfaces, &clock, &calendar.axis) {
                    table.push(row)?;
                }
                table.finish().map(|_| ())
            })?;
            outputs.push(name);
        }
        all.groups.push(reading.group);
        job.progress.advance(1);
    }
    job.progress.finish();
    let received = job.folder.received(&candidate.name, &set.name);
    job.folder.write_json(&received, &all)?;
    let sensors = job.folder.sensors(&candidate.name, &set.name);
    let table = table.finish()?;
    job.folder.write(&sensors, |out| out.write_all(&table))?;
    outputs.extend([received, sensors]);
    let cache = store.as_ref().map(Store::cache_stats);
    let facts = json!({ "receivers": all.groups.len(), "cache": cache });
    Ok(Made::new(outputs, facts))
}
