//! Glare events for people: when by the clock, where in the scene, and which PV surface sends
//! them. As a table and as points of a map.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::PathBuf;

use glam::DVec3;
use glintmap_formats::seal;
use rayon::prelude::*;
use serde_json::json;

use super::glare::Kept;
use super::receivers::sheet::quoted;
use super::render::telling_store;
use crate::glare::{self, Event, Events, Regular};
use crate::pages::{Neighbours, Query, Store};
use crate::project::{Candidate, PlannedView};
use crate::receivers::clock::Clock;
use crate::render::{Hit, HitMap};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::site::{Site, map_from_local};
use crate::volume::TimeAxis;

/// Events that are taken into memory at a time; the peaks of a block that share a pixel share a
/// search.
const BLOCK_EVENTS: usize = 1 << 16;
/// Photons asked for at each peak.
const ASKED_PHOTONS: usize = 2000;

/// The PV surface that sends most of an event, and its share; `None` where no photon tells.
type Sender = Option<(u16, f32)>;

/// Writes `events.csv` and `events.geojson`; their names below `run/`.
pub(super) fn write(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    threshold: f64,
    made: &Kept<'_>,
) -> Result<Vec<PathBuf>, Error> {
    let Kept { analysis, axis, grid, .. } = *made;
    let name = |file: &str| job.folder.glare(&candidate.name, &view.name, threshold, file);
    let hits = job.folder.read_hits(&view.name)?;
    let senders = match telling_store(job, candidate)? {
        Some(store) => senders(&analysis.events, grid, &hits, &store, view)?,
        None => vec![None; analysis.events.len()],
    };
    let whole = TimeAxis::from(job.timeline()?);
    let steps = axis.unwrap_or(&whole);
    let told = Told {
        clock: Clock::new(&job.resolved.project.site, steps.year),
        axis: steps,
        site: job.site()?,
        hits: &hits,
        north_deg: job.resolved.scene.north_deg,
    };
    let csv = name("events.csv");
    let path = job.folder.prepare(&csv)?;
    seal::write(&path, |out| {
        let events = analysis.events.iter()?.zip(&senders);
        let rows = events.map(|(event, sender)| Ok(told.columns(&event?, *sender)));
        let mut longer = Longer::new(out, rows);
        glare::write_events(&mut longer, &analysis.events, axis)
    })
    .map_err(|source: io::Error| Error::Write { path: path.clone(), source })?;
    let points = name("events.geojson");
    let path = job.folder.at(&points);
    let crs = job.resolved.scene.crs.as_deref();
    seal::write(&path, |out| told.geojson(out, &analysis.events, &senders, crs))
        .map_err(|source: io::Error| Error::Write { path: path.clone(), source })?;
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

/// What turns numbers into words.
struct Told<'a> {
    clock: Clock,
    axis: &'a TimeAxis,
    site: &'a Site,
    hits: &'a HitMap,
    north_deg: f64,
}

/// Columns that follow those of the analysis.
const COLUMNS: &str =
    "first_at,last_at,x_m,y_m,z_m,map_x_m,map_y_m,map_z_m,object,pv_surface,pv_share";

impl Told<'_> {
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

    fn columns(&self, event: &Event, sender: Sender) -> String {
        let place = match self.hit(event) {
            Some(hit) => {
                let local = hit.position.as_dvec3();
                let map = self.map(local);
                let numbers: Vec<String> = local
                    .to_array()
                    .into_iter()
                    .chain(map.to_array())
                    .map(|v| format!("{v:.2}"))
                    .collect();
                format!("{},{}", numbers.join(","), quoted(self.object(hit)))
            }
            None => ",".repeat(6),
        };
        let who = match sender {
            Some((s, share)) => format!("{},{share:.3}", quoted(self.surface(s))),
            None => ",".to_owned(),
        };
        format!("{},{},{place},{who}", self.at(event.first), self.at(event.last))
    }

    /// A FeatureCollection of the events that have a place: map coordinates, metres. GeoJSON of
    /// today knows degrees only; the member `crs` of its first edition says what these are.
    fn geojson(
        &self,
        out: &mut impl Write,
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

/// Lengthens the lines that go through: the first by [`COLUMNS`], each further one by the next
/// row.
struct Longer<'a, W, R> {
    out: &'a mut W,
    rows: R,
    line: usize,
}

impl<'a, W: Write, R: Iterator<Item = io::Result<String>>> Longer<'a, W, R> {
    fn new(out: &'a mut W, rows: R) -> Self {
        Self { out, rows, line: 0 }
    }
}

impl<W: Write, R: Iterator<Item = io::Result<String>>> Write for Longer<'_, W, R> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for part in bytes.split_inclusive(|b| *b == b'\n') {
            match part.split_last() {
                Some((b'\n', rest)) => {
                    self.out.write_all(rest)?;
                    let more = match self.line {
                        0 => COLUMNS.to_owned(),
                        _ => self.rows.next().transpose()?.unwrap_or_default(),
                    };
                    writeln!(self.out, ",{more}")?;
                    self.line += 1;
                }
                _ => self.out.write_all(part)?,
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_gets_its_columns_however_it_is_written() {
        let mut out = Vec::new();
        let rows = ["one", "two"].map(|row| Ok(row.to_owned()));
        let mut longer = Longer::new(&mut out, rows.into_iter());
        for part in ["fir", "st\n1", ",2", "\n3,4\n"] {
            longer.write_all(part.as_bytes()).expect("writes");
        }
        let text = String::from_utf8(out).expect("text");
        assert_eq!(text, format!("first,{COLUMNS}\n1,2,one\n3,4,two\n"));
    }
}
