//! One spot: what arrives there, when, and from which PV surface.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;

use super::air::Crossings;
use super::clock::Clock;
use super::error::Error;
use super::points::PointSet;
use super::points::read_points;
use crate::base::Timeline;
use crate::pages::{Access, Neighbours, OpenOptions, Query, Store};
use crate::project::Folder;
use crate::project::{PlannedView, Resolved};
use crate::render::{Gather, Hit, HitMap};
use crate::volume::Volume;

/// Which spot.
#[derive(Clone, Copy, Debug)]
pub enum Spot {
    /// A pixel of the view: column, row.
    Pixel(usize, usize),
    /// The pixel in which the view shows this point; of sensors the nearest.
    Point(DVec3),
}

/// What a probe found.
#[derive(Clone, Debug, Serialize)]
pub struct Probed {
    /// The view.
    pub view: String,
    /// Column and row.
    pub pixel: [usize; 2],
    /// What lies there: receiver, sky, pv, air, ….
    pub kind: String,
    /// Where the pixel's ray lands, m from the local origin.
    pub position: [f32; 3],
    /// Distance to the nearest visible PV point, m; 0 where none is visible.
    pub pv_distance_m: f32,
    /// By material.
    pub materials: Vec<ProbedMaterial>,
}

/// What one material sends there.
#[derive(Clone, Debug, Serialize)]
pub struct ProbedMaterial {
    /// The material or case.
    pub name: String,
    /// Radiant exposure of the year, Wh/m2, from the time series.
    pub annual_wh_m2: f64,
    /// Largest irradiance, W/m2.
    pub peak_w_m2: f32,
    /// When that is.
    pub peak_at: String,
    /// Hours of the year above each threshold, unfiltered.
    pub hours_above: Vec<(f64, f64)>,
    /// Share of the flux nearby by PV surface.
    pub shares: BTreeMap<String, f64>,
    /// All timesteps with light.
    pub series: Vec<Moment>,
}

/// One timestep with light.
#[derive(Clone, Debug, Serialize)]
pub struct Moment {
    /// Index of the timestep.
    pub timestep: usize,
    /// Day of the year from 0.
    pub day: u32,
    /// Local standard time, h.
    pub hour: f64,
    /// Date and civil time.
    pub at: String,
    /// Altitude of the sun, degrees.
    pub sun_altitude_deg: f64,
    /// Azimuth of the sun, clockwise from north, degrees.
    pub sun_azimuth_deg: f64,
    /// W/m2.
    pub irradiance_w_m2: f32,
}

/// Looks at one spot of a project that was run.
///
/// # Errors
/// When the view isn't known, the spot lies outside it, or the run isn't there yet.
pub fn probe(resolved: &Resolved, view: &str, spot: Spot) -> Result<Probed, Error> {
    let wrong = |message: String| Error::from(resolved.mistaken(message));
    let names = || resolved.with_sensors().map(|v| v.name.as_str());
    let known = || names().collect::<Vec<_>>().join(", ");
    let planned = resolved.with_sensors().find(|v| v.name == view).ok_or_else(|| {
        wrong(format!("no [[view]] is named \"{view}\" (there are: {})", known()))
    })?;
    let folder = Folder::new(resolved.run_folder());
    let hits_path = folder.at(&folder.hits(view));
    if !hits_path.exists() {
        return Err(Error::NotMade {
            what: format!("the view \"{view}\" wasn't rendered yet"),
            project: resolved.folder.clone(),
            stage: "render",
        });
    }
    let (hits, _) = HitMap::read(&hits_path)?;
    let (columns, rows) = (hits.columns, hits.rows);
    let (column, row) = pixel_of(planned, &hits, spot)
        .filter(|&(c, r)| c < columns && r < rows)
        .ok_or_else(|| {
            wrong(format!("the spot lies outside the view \"{view}\" of {columns} x {rows} pixels"))
        })?;
    let hit = *hits.at(column, row);
    let points = planned.points().map(|_| read_points(&folder, planned)).transpose()?;
    let timeline = resolved.timeline()?;
    let mut materials = Vec::new();
    for candidate in &resolved.candidates {
        let series = folder.at(&folder.series(&candidate.name, view));
        if !series.exists() {
            continue;
        }
        let volume = Volume::open(&series)?;
        let values = volume.pixel(column, row)?;
        let mut from = BTreeMap::new();
        if let Some(gather) = planned.photons() {
            let store = Store::open(
                &folder.at(&folder.store(&candidate.name)),
                &OpenOptions { cache_bytes: 16 << 20, access: Access::Mapped },
            )?;
            let names = &store.info().surfaces;
            from = match points.as_ref().filter(|set| set.in_air(column).is_some()) {
                Some(set) => in_air(&folder, &candidate.name, (set, planned), column, names)?,
                None => shares(&store, &hit, &gather.annual)?,
            };
        }
        materials.push(material(resolved, &timeline, &candidate.name, &values, from));
    }
    let (kind, pv_distance_m) = match points.as_ref().and_then(|set| set.in_air(column)) {
        Some(pv) => ("air", pv.map_or(0.0, |v| v.nearest_m as f32)),
        None => (hit.kind.name(), hit.pv_distance_m),
    };
    Ok(Probed {
        view: view.to_owned(),
        pixel: [column, row],
        kind: kind.to_owned(),
        position: hit.position.to_array(),
        pv_distance_m,
        materials,
    })
}

fn pixel_of(view: &PlannedView, hits: &HitMap, spot: Spot) -> Option<(usize, usize)> {
    match spot {
        Spot::Pixel(column, row) => Some((column, row)),
        // Of sensors the nearest.
        Spot::Point(point) if view.points().is_some() => {
            let away = |h: &Hit| h.position.as_dvec3().distance_squared(point);
            let nearest =
                hits.hits.iter().enumerate().min_by(|a, b| away(a.1).total_cmp(&away(b.1)));
            nearest.map(|(i, _)| (i, 0))
        }
        Spot::Point(point) => {
            let (column, row) = view.picture()?.view.project(point)?;
            (column >= 0.0 && row >= 0.0).then_some((column as usize, row as usize))
        }
    }
}

/// What crossed a receiver in free air.
fn in_air(
    folder: &Folder,
    candidate: &str,
    set: (&PointSet, &PlannedView),
    point: usize,
    names: &[String],
) -> Result<BTreeMap<String, f64>, Error> {
    let mut shares: BTreeMap<String, f64> = BTreeMap::new();
    if let Some(crossings) = Crossings::open(folder, candidate, set, 16 << 20)? {
        crossings.photons(point, |_, flux_w, surface| {
            let name = names.get(usize::from(surface)).cloned().unwrap_or_default();
            *shares.entry(name).or_default() += f64::from(flux_w);
        })?;
    }
    let total: f64 = shares.values().sum();
    shares.values_mut().for_each(|share| *share /= total);
    Ok(shares)
}

fn shares(store: &Store, hit: &Hit, gather: &Gather) -> Result<BTreeMap<String, f64>, Error> {
    // Sky and what is clipped have no place, and PV keeps no photons.
    if !hit.kind.receives() {
        return Ok(BTreeMap::new());
    }
    let count = gather.bandwidth;
    let max_radius_m = gather.max_radius_m.unwrap_or_else(|| store.max_radius_m(count));
    let query = Query { point: hit.position, normal: hit.normal, count, max_radius_m };
    let mut found = Neighbours::default();
    store.nearest(&query, &mut found)?;
    let mut shares: BTreeMap<String, f64> = BTreeMap::new();
    let total: f64 = found.items().iter().map(|n| f64::from(n.flux_w)).sum();
    for n in found.items() {
        let name = store.info().surfaces.get(usize::from(n.surface)).cloned().unwrap_or_default();
        *shares.entry(name).or_default() += f64::from(n.flux_w) / total;
    }
    Ok(shares)
}

fn material(
    resolved: &Resolved,
    timeline: &Timeline,
    name: &str,
    values: &[f32],
    shares: BTreeMap<String, f64>,
) -> ProbedMaterial {
    let clock = Clock::new(&resolved.project.site, timeline.year);
    let moments: Vec<Moment> = timeline
        .steps
        .iter()
        .zip(values)
        .enumerate()
        .filter(|(_, (_, e))| **e > 0.0)
        .map(|(timestep, (step, &irradiance_w_m2))| Moment {
            timestep,
            day: step.day,
            hour: step.hour,
            at: clock.show(step.day, step.hour),
            sun_altitude_deg: libm::asin(step.sun.z).to_degrees(),
            sun_azimuth_deg: libm::atan2(step.sun.x, step.sun.y).to_degrees().rem_euclid(360.0),
            irradiance_w_m2,
        })
        .collect();
    let weigh = |above: f64| {
        timeline
            .steps
            .iter()
            .zip(values)
            .filter(|(_, e)| f64::from(**e) > above)
            // An empty `sum` is -0.
            .fold(0.0, |sum, (s, _)| sum + s.weight_h)
    };
    let peak = moments.iter().max_by(|a, b| a.irradiance_w_m2.total_cmp(&b.irradiance_w_m2));
    ProbedMaterial {
        name: name.to_owned(),
        annual_wh_m2: timeline
            .steps
            .iter()
            .zip(values)
            .fold(0.0, |sum, (s, e)| sum + s.weight_h * f64::from(*e)),
        peak_w_m2: peak.map_or(0.0, |m| m.irradiance_w_m2),
        peak_at: peak.map_or_else(|| "never".into(), |m| m.at.clone()),
        hours_above: resolved
            .project
            .glare
            .thresholds_w_m2
            .iter()
            .map(|&t| (t, weigh(t)))
            .collect(),
        shares,
        series: moments,
    }
}
