//! Glare events for people: when by the clock, where in the scene, and which PV surface sends
//! them. As a table and as points of a map.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;

use super::stores::telling_store;
use crate::base::table::{Fixed, Table};
use crate::glare::{Analysis, Event, EventRow, EventTimes, Events, HourBounds, Regular};
use crate::pages::{Neighbours, Query, Store};
use crate::project::PlannedView;
use crate::receivers::clock::Clock;
use crate::render::{Hit, HitMap};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::run::units::OfView;
use crate::site::{Site, map_from_local};
use crate::volume::TimeAxis;

/// Events that are taken into memory at a time; the peaks of a block that share a pixel share a
/// search.
const BLOCK_EVENTS: usize = 1 << 16;
/// Photons asked for at each peak.
const ASKED_PHOTONS: usize = 2000;

/// The PV surface that sends most of an event, and its share; `None` where no photon tells.
type Sender = Option<(u16, f32)>;

/// What an analysis gives.
pub(super) struct Found<'a> {
    pub analysis: &'a Analysis,
    /// Of the timesteps that it counts.
    pub axis: Option<&'a TimeAxis>,
    /// What put them onto a regular grid, if they weren't on one.
    pub grid: Option<&'a Regular<'a>>,
    pub bounds: &'a HourBounds,
}

/// Writes `events.csv` and `events.geojson`; their names below `run/`.
pub(super) fn write(
    job: &Job<'_>,
    of: OfView<'_>,
    threshold: f64,
    found: &Found<'_>,
) -> Result<Vec<PathBuf>, Error> {
    let OfView { candidate, view } = of;
    let Found { analysis, axis, grid, .. } = *found;
    let hits = job.folder.read_hits(&view.name)?;
    let senders = match telling_store(job, candidate)? {
        Some(store) => senders(&analysis.events, grid, &hits, &store, view)?,
        None => vec![None; analysis.events.len()],
    };
    let whole = TimeAxis::from(job.timeline()?);
    let steps = axis.unwrap_or(&whole);
    let gazetteer = Gazetteer {
        clock: Clock::new(&job.resolved.project.site, steps.year),
        axis: steps,
        site: job.site()?,
        hits: &hits,
        north_deg: job.resolved.scene.north_deg,
    };
    let events = &analysis.events;
    let csv = job.folder.events(&candidate.name, &view.name, threshold);
    job.folder.write(&csv, |out| gazetteer.csv(out, events, &senders))?;
    let points = job.folder.event_points(&candidate.name, &view.name, threshold);
    let crs = job.resolved.scene.crs.as_deref();
    job.folder.write(&points, |out| gazetteer.geojson(out, events, &senders, crs))?;
    Ok(vec![csv, points])
}

/// The pixel that stands for an event: that of its centroid, where a surface is seen that takes
/// light, else that of its peak.
fn pixel(event: &Event, hits: &HitMap) -> usize {
    let (row, column) =
        (event.centroid_row.round() as usize, event.centroid_column.round() as usize);
    if row < hits.rows && column < hits.columns && hits.at(column, row).kind.receives() {
        return row * hits.columns + column;
    }
    event.peak_row as usize * hits.columns + event.peak_column as usize
}

/// Which surface sends each event: the photons around its peak, in its timesteps. One search for
/// each pixel of a block that is the peak of an event.
fn senders(
    events: &Events,
    grid: Option<&Regular<'_>>,
    hits: &HitMap,
    store: &Store,
    view: &PlannedView,
) -> Result<Vec<Sender>, Error> {
    let spilled = |source| Error::Read { path: PathBuf::from("the spilled glare events"), source };
    let mut out = Vec::with_capacity(events.len());
    let mut all = events.iter().map_err(spilled)?;
    loop {
        let mut block: Vec<Event> =
            all.by_ref().take(BLOCK_EVENTS).collect::<io::Result<_>>().map_err(spilled)?;
        // Photons know the timesteps of the series.
        let shown = |at: u32| grid.and_then(|g| g.shown(at as usize)).map_or(at, |t| t as u32);
        for event in &mut block {
            (event.first, event.last) = (shown(event.first), shown(event.last));
        }
        if block.is_empty() {
            return Ok(out);
        }
        senders_of_block(&block, hits, store, view, &mut out)?;
    }
}

fn senders_of_block(
    events: &[Event],
    hits: &HitMap,
    store: &Store,
    view: &PlannedView,
    out: &mut Vec<Sender>,
) -> Result<(), Error> {
    let first = out.len();
    out.resize(first + events.len(), None);
    let mut by_pixel: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, e) in events.iter().enumerate() {
        let pixel = e.peak_row as usize * hits.columns + e.peak_column as usize;
        by_pixel.entry(pixel).or_default().push(i);
    }
    let asked: Vec<(usize, Vec<usize>)> = by_pixel.into_iter().collect();
    let gather = view.photons().copied().unwrap_or_default();
    let count = gather.series_bandwidth.unwrap_or(ASKED_PHOTONS).min(ASKED_PHOTONS);
    let max_radius_m = gather.annual.max_radius_m.unwrap_or_else(|| store.max_radius_m(count));
    let found: Vec<Vec<(usize, (u16, f32))>> = asked
        .par_iter()
        .map_init(Neighbours::default, |near, (pixel, list)| {
            let Some(hit) = hits.hits.get(*pixel).filter(|h| h.kind.receives()) else {
                return Ok(Vec::new());
            };
            let query = Query { point: hit.position, normal: hit.normal, count, max_radius_m };
            store.nearest(&query, near)?;
            let sender = |i: &usize| main_sender(&events[*i], near).map(|s| (*i, s));
            Ok(list.iter().filter_map(sender).collect())
        })
        .collect::<Result<_, Error>>()?;
    for (i, sender) in found.into_iter().flatten() {
        out[first + i] = Some(sender);
    }
    Ok(())
}

/// The surface with most flux among the photons of an event's timesteps; the first of equals.
fn main_sender(event: &Event, near: &Neighbours) -> Sender {
    let mut sums: BTreeMap<u16, f64> = BTreeMap::new();
    for p in near.items().iter().filter(|p| (event.first..=event.last).contains(&p.timestep)) {
        *sums.entry(p.surface).or_insert(0.0) += f64::from(p.flux_w);
    }
    let sum: f64 = sums.values().sum();
    let mut main: Option<(u16, f64)> = None;
    for (surface, flux) in sums {
        if main.is_none_or(|(_, most)| flux > most) {
            main = Some((surface, flux));
        }
    }
    main.filter(|_| sum > 0.0).map(|(surface, flux)| (surface, (flux / sum) as f32))
}

/// When an event is by the clock, where it is, and which PV surface sends most of it: the columns
/// that follow those of the analysis.
#[derive(Clone, Debug, Default, Serialize)]
struct EventPlace {
    first_at: String,
    last_at: String,
    x_m: Fixed<2>,
    y_m: Fixed<2>,
    z_m: Fixed<2>,
    map_x_m: Fixed<2>,
    map_y_m: Fixed<2>,
    map_z_m: Fixed<2>,
    object: String,
    pv_surface: String,
    pv_share: Fixed<3>,
}

/// What turns the numbers of an event into places, dates and names.
struct Gazetteer<'a> {
    clock: Clock,
    axis: &'a TimeAxis,
    site: &'a Site,
    hits: &'a HitMap,
    north_deg: f64,
}

impl Gazetteer<'_> {
    fn at(&self, timestep: u32) -> String {
        let (at, axis) = (timestep as usize, self.axis);
        let when = axis.day.get(at).zip(axis.hour.get(at));
        when.map_or_else(String::new, |(day, hour)| self.clock.show(*day, *hour))
    }

    fn map(&self, local: DVec3) -> DVec3 {
        map_from_local(local, self.site.origin, self.north_deg)
    }

    fn object(&self, hit: &Hit) -> &str {
        self.site.objects.get(hit.object as usize).map_or("", |o| o.id.as_str())
    }

    fn surface(&self, number: u16) -> &str {
        self.site.pv.get(usize::from(number)).map_or("", |surface| surface.name.as_str())
    }

    /// What is seen where an event is.
    fn hit(&self, event: &Event) -> Option<&Hit> {
        self.hits.hits.get(pixel(event, self.hits)).filter(|h| h.kind.receives())
    }

    fn place(&self, event: &Event, sender: Sender) -> EventPlace {
        let mut out = EventPlace {
            first_at: self.at(event.first),
            last_at: self.at(event.last),
            ..EventPlace::default()
        };
        if let Some(hit) = self.hit(event) {
            let local = hit.position.as_dvec3();
            let map = self.map(local);
            [out.x_m, out.y_m, out.z_m] = local.to_array().map(Fixed::from);
            [out.map_x_m, out.map_y_m, out.map_z_m] = map.to_array().map(Fixed::from);
            out.object = self.object(hit).to_owned();
        }
        if let Some((surface, share)) = sender {
            out.pv_surface = self.surface(surface).to_owned();
            out.pv_share = f64::from(share).into();
        }
        out
    }

    /// The table of all events.
    fn csv(&self, out: &mut dyn Write, events: &Events, senders: &[Sender]) -> io::Result<()> {
        let mut table = Table::of::<(EventRow, EventTimes, EventPlace)>(out)?;
        for (event, sender) in events.iter()?.zip(senders) {
            let event = event?;
            let times = EventTimes::of(&event, self.axis);
            table.push((EventRow::from(&event), times, self.place(&event, *sender)))?;
        }
        table.finish().map(|_| ())
    }

    /// A FeatureCollection of the events that have a place: map coordinates, metres. GeoJSON of
    /// today knows degrees only; the member `crs` of its first edition says what these are.
    fn geojson(
        &self,
        out: &mut dyn Write,
        events: &Events,
        senders: &[Sender],
        crs: Option<&str>,
    ) -> io::Result<()> {
        write!(out, "{{\"type\":\"FeatureCollection\",")?;
        if let Some(crs) = crs {
            let name = json!({ "type": "name", "properties": { "name": crs } });
            write!(out, "\"crs\":{name},")?;
        }
        write!(out, "\"features\":[")?;
        let mut comma = "";
        for (event, sender) in events.iter()?.zip(senders) {
            let event = event?;
            let Some(hit) = self.hit(&event) else { continue };
            let place = self.map(hit.position.as_dvec3()).to_array();
            // Centimetres are enough, and short.
            let place = place.map(|v| (v * 100.0).round() / 100.0);
            let steps = f64::from(event.last - event.first + 1);
            let feature = json!({
                "type": "Feature",
                "geometry": { "type": "Point", "coordinates": place },
                "properties": {
                    "first": event.first,
                    "last": event.last,
                    "first_at": self.at(event.first),
                    "last_at": self.at(event.last),
                    "duration_h": steps * self.axis.step_h,
                    "pixels": event.pixels,
                    "peak_w_m2": event.peak_w_m2,
                    "centroid": [event.centroid_column, event.centroid_row],
                    "object": self.object(hit),
                    "pv_surface": sender.map(|(s, _)| self.surface(s)),
                    "pv_share": sender.map(|(_, share)| (f64::from(share) * 1000.0).round() / 1000.0),
                },
            });
            write!(out, "{comma}\n{feature}")?;
            comma = ",";
        }
        writeln!(out, "\n]}}")
    }
}
