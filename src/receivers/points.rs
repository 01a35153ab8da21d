//! From observers, regions and files of sensors to points in the scene.

use std::collections::BTreeSet;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::error::Error;
use crate::base::limits;
use crate::project::{Folder, Key, ObserverTable, PlannedView, RegionTable, Resolved};
use crate::render::samples::{Sample, sample_objects, sample_polygon};
use crate::render::sensors::{Footing, Sensor, place};
use crate::render::{HitMap, PvInView, View};
use crate::site::{Coordinates, Site, local_from_map};

/// Distance between the points of a region where it says nothing, m.
const SPACING_M: f64 = 1.0;
/// Points of a region; a larger one gets a wider lattice.
const MAX_REGION_POINTS: usize = 2500;

/// What a group of points is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// `[[observer]]`
    Observer,
    /// `[[region]]`
    Region,
    /// `[[view]] sensors`
    Sensors,
}

/// Points that belong together; they follow each other in the set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// As in the project file.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Its first point's number in the set.
    pub first: usize,
    /// The area that each point stands for, m2; 0 for points that stand for none.
    pub area_m2: Vec<f64>,
    /// What each stands on.
    pub footing: Vec<Footing>,
    /// What each sees of the PV.
    pub pv: Vec<Option<PvInView>>,
    /// What a reader should know of its making.
    pub notes: Vec<String>,
}

impl Group {
    /// How many points it has.
    pub fn points(&self) -> usize {
        self.area_m2.len()
    }
}

/// `points.json`: whose points the pixels of a set are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointSet {
    /// In the order of their points.
    pub groups: Vec<Group>,
}

impl PointSet {
    /// What a point that stands in free air sees of the PV; `None` for others.
    pub fn in_air(&self, point: usize) -> Option<Option<PvInView>> {
        let group = self.groups.iter().rfind(|g| g.first <= point)?;
        let at = point - group.first;
        (group.footing.get(at) == Some(&Footing::Air)).then(|| group.pv.get(at).copied().flatten())
    }
}

/// Points before they are looked up in the scene.
#[derive(Debug, Default)]
pub struct Points {
    pub sensors: Vec<Sensor>,
    pub set: PointSet,
}

impl Points {
    fn push(&mut self, name: &str, kind: Kind, samples: &[Sample], notes: Vec<String>) {
        self.set.groups.push(Group {
            name: name.to_owned(),
            kind,
            first: self.sensors.len(),
            area_m2: samples.iter().map(|s| s.area_m2).collect(),
            footing: Vec::new(),
            pv: Vec::new(),
            notes,
        });
        self.sensors.extend(samples.iter().map(|s| s.sensor));
    }
}

/// The observers and regions of a project in words: what they stand on, how many points they have.
/// Regions in pictures are left to the run, which knows what the pictures show.
///
/// # Errors
/// Objects that aren't there, regions without a point.
pub fn receivers(resolved: &Resolved, site: &Site) -> Result<Vec<String>, Error> {
    let spreader = Spreader { resolved, site };
    spreader.check()?;
    let mut lines = Vec::new();
    let mut tell = |name: &str, samples: &[Sample]| {
        let sensors: Vec<Sensor> = samples.iter().map(|s| s.sensor).collect();
        let placed = place(&sensors, site, resolved.trace.max_path_m, resolved.trace.seed);
        let count = |footing| placed.footing.iter().filter(|f| **f == footing).count();
        let seen = placed.pv.iter().flatten().count();
        lines.push(format!(
            "receiver {name}: {} points, {} on surfaces, {} in free air, {seen} see PV",
            sensors.len(),
            count(Footing::Surface),
            count(Footing::Air),
        ));
    };
    for o in &resolved.project.observer {
        tell(&o.name, &[Sample { sensor: spreader.observer(o), area_m2: 0.0 }]);
    }
    for region in resolved.project.region.iter().filter(|r| r.view.is_none()) {
        let (samples, _) = spreader.region(
            region,
            &|_| Ok(HitMap { columns: 0, rows: 0, hits: Vec::new() }),
            MAX_REGION_POINTS,
        )?;
        tell(&region.name, &samples);
    }
    Ok(lines)
}

/// Turns what the project file says into points in local coordinates.
pub struct Spreader<'a> {
    pub resolved: &'a Resolved,
    pub site: &'a Site,
}

impl Spreader<'_> {
    /// A mistake in a region of the project, or in one that was asked for beside it.
    fn wrong(&self, region: &str, what: &str) -> Error {
        let known = self.resolved.project.region.iter().position(|r| r.name == region);
        match known {
            Some(number) => self.resolved.mistake(&Key::item("region", number), what),
            None => self.resolved.mistaken(format!("[[region]] \"{region}\": {what}")),
        }
        .into()
    }

    fn local(&self, point: DVec3, map: bool) -> DVec3 {
        match map {
            true => local_from_map(point, self.site.origin, self.resolved.scene.north_deg),
            false => point,
        }
    }

    /// A vector, turned as points are.
    fn turned(&self, v: DVec3, map: bool) -> DVec3 {
        match map {
            true => local_from_map(v, DVec3::ZERO, self.resolved.scene.north_deg),
            false => v,
        }
    }

    /// The sensors of a file, as one group.
    pub fn file(&self, name: &str, sensors: &[Sensor], map: bool) -> Points {
        let samples: Vec<Sample> = sensors
            .iter()
            .map(|s| Sample {
                sensor: Sensor {
                    position: self.local(s.position, map),
                    normal: self.turned(s.normal, map),
                },
                area_m2: 0.0,
            })
            .collect();
        let mut points = Points::default();
        points.push(name, Kind::Sensors, &samples, Vec::new());
        points
    }

    /// Checks that every object that a region names is there.
    ///
    /// # Errors
    /// [`Error::Project`] with the nearest names.
    pub fn check(&self) -> Result<(), Error> {
        for region in &self.resolved.project.region {
            self.objects(region)?;
        }
        Ok(())
    }

    /// All observers and regions. `hits` reads the hits of a picture.
    ///
    /// # Errors
    /// Objects that aren't there, regions without a point, too many points.
    pub fn receivers(
        &self,
        hits: &dyn Fn(&PlannedView) -> Result<HitMap, Error>,
    ) -> Result<Points, Error> {
        let mut points = Points::default();
        for o in &self.resolved.project.observer {
            let sample = Sample { sensor: self.observer(o), area_m2: 0.0 };
            points.push(&o.name, Kind::Observer, &[sample], Vec::new());
        }
        for region in &self.resolved.project.region {
            let (samples, notes) = self.region(region, hits, MAX_REGION_POINTS)?;
            if samples.is_empty() {
                return Err(self.wrong(
                    &region.name,
                    "not one point of it lies on the scene; check its polygon or object",
                ));
            }
            points.push(&region.name, Kind::Region, &samples, notes);
        }
        if points.sensors.len() > limits::MAX_VIEW_EDGE {
            let what = format!(
                "all regions together have {} points, at most {} are possible; raise spacing_m",
                points.sensors.len(),
                limits::MAX_VIEW_EDGE
            );
            let last = self.resolved.project.region.last().map_or("", |r| &r.name);
            return Err(self.wrong(last, &what));
        }
        Ok(points)
    }

    /// An eye; it looks at the middle of the PV where it says nothing.
    pub fn observer(&self, o: &ObserverTable) -> Sensor {
        let map = o.coordinates == Some(Coordinates::Map);
        let position = self.local(DVec3::from_array(o.point), map);
        let normal = match o.direction {
            Some(d) => self.turned(DVec3::from_array(d), map),
            None => self.pv_middle() - position,
        };
        Sensor { position, normal: normal.try_normalize().unwrap_or(DVec3::Z) }
    }

    fn pv_middle(&self) -> DVec3 {
        let triangles = self.site.pv.iter().flat_map(|s| &s.triangles);
        let (mut sum, mut area) = (DVec3::ZERO, 0.0);
        for t in triangles.map(|t| &self.site.triangles[*t as usize]) {
            let [a, b, c] = t.corners.map(glam::Vec3::as_dvec3);
            let share = f64::from(t.area_m2());
            sum += (a + b + c) / 3.0 * share;
            area += share;
        }
        if area > 0.0 { sum / area } else { DVec3::ZERO }
    }

    /// The points of a region with the area that each stands for, `most` of them: a finer lattice
    /// is made coarser. Beside them what a reader should know of their making.
    ///
    /// # Errors
    /// Objects that aren't there.
    pub fn region(
        &self,
        region: &RegionTable,
        hits: &dyn Fn(&PlannedView) -> Result<HitMap, Error>,
        most: usize,
    ) -> Result<(Vec<Sample>, Vec<String>), Error> {
        if let (Some(name), Some(polygon)) = (&region.view, &region.polygon) {
            // The reader checked that there is such a view.
            let view = self.resolved.views.iter().find(|v| v.name == *name);
            let Some((view, picture)) = view.and_then(|v| Some((v, v.picture()?))) else {
                return Ok((Vec::new(), Vec::new()));
            };
            let all = pixels(&picture.view, &hits(view)?, polygon);
            let every = all.len().div_ceil(most).max(1);
            let thinned = all
                .into_iter()
                .step_by(every)
                .map(|s| Sample { area_m2: s.area_m2 * every as f64, ..s });
            let note = match every {
                1 => format!("a point for each pixel of the view “{name}”"),
                n => format!("a point for every {n} pixels of the view “{name}”"),
            };
            return Ok((thinned.collect(), vec![note]));
        }
        let asked_m = region.spacing_m.unwrap_or(SPACING_M);
        let objects = self.objects(region)?;
        let mut spacing_m = asked_m;
        let (mut samples, mut missing) = self.lattice(region, &objects, spacing_m);
        while samples.len() > most {
            spacing_m *= (samples.len() as f64 / most as f64).sqrt() * 1.02;
            (samples, missing) = self.lattice(region, &objects, spacing_m);
            if spacing_m > 1e6 {
                break;
            }
        }
        let mut notes = vec![format!("points {spacing_m:.2} m apart")];
        if spacing_m > asked_m {
            notes.push(format!("{asked_m} m were asked for, which makes more than {most} points"));
        }
        if missing > 0 {
            notes.push(format!("{missing} points of the polygon lie beyond the scene"));
        }
        Ok((samples, notes))
    }

    /// The polygon of a region in plan, local coordinates.
    pub fn plan(&self, region: &RegionTable) -> Option<Vec<[f64; 2]>> {
        let map = region.coordinates == Some(Coordinates::Map);
        let local = |[x, y]: &[f64; 2]| {
            let p = self.local(DVec3::new(*x, *y, 0.0), map);
            [p.x, p.y]
        };
        Some(region.polygon.as_ref()?.iter().map(local).collect())
    }

    fn lattice(&self, r: &RegionTable, objects: &[u32], spacing_m: f64) -> (Vec<Sample>, usize) {
        match self.plan(r) {
            None => (sample_objects(self.site, objects, spacing_m, self.resolved.trace.seed), 0),
            Some(local) => sample_polygon(self.site, &local, r.height_m, spacing_m),
        }
    }

    /// The objects of a region: those with an id, else those whose ids begin with it and a dash
    /// (parts of a building).
    pub fn objects(&self, region: &RegionTable) -> Result<Vec<u32>, Error> {
        let mut out = BTreeSet::new();
        for id in region.object.iter().flat_map(|ids| ids.list()) {
            let with = |fits: &dyn Fn(&str) -> bool| -> Vec<u32> {
                let objects = self.site.objects.iter().enumerate();
                objects.filter(|(_, o)| fits(&o.id)).map(|(i, _)| i as u32).collect()
            };
            let mut found = with(&|known| known == id);
            if found.is_empty() {
                let part = format!("{id}-");
                found = with(&|known| known.starts_with(&part));
            }
            if found.is_empty() {
                let names: BTreeSet<&str> =
                    self.site.objects.iter().map(|o| o.id.as_str()).collect();
                let mut names: Vec<&str> = names.into_iter().filter(|n| !n.is_empty()).collect();
                names.sort_by_key(|n| (strsim::damerau_levenshtein(n, id), *n));
                names.truncate(5);
                let what = format!(
                    "no object of the scene is named \"{id}\"; the nearest are {}",
                    names.join(", ")
                );
                return Err(self.wrong(&region.name, &what));
            }
            out.extend(found);
        }
        Ok(out.into_iter().collect())
    }
}

/// What the pixels inside a polygon of a picture show, each with the area that it covers there.
fn pixels(view: &View, hits: &HitMap, polygon: &[[f64; 2]]) -> Vec<Sample> {
    let mut out = Vec::new();
    for row in 0..hits.rows {
        for column in 0..hits.columns {
            let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
            let hit = hits.at(column, row);
            if !hit.kind.receives() || !holds(polygon, x, y) {
                continue;
            }
            let (position, normal) = (hit.position.as_dvec3(), hit.normal.as_dvec3());
            let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(dx, dy)| {
                let ray = view.ray_at(x + dx, y + dy)?;
                let along = normal.dot(position - ray.origin) / normal.dot(ray.direction);
                (along.is_finite() && along > 0.0).then(|| ray.origin + ray.direction * along)
            });
            let area_m2 = match corners {
                [Some(a), Some(b), Some(c), Some(d)] => 0.5 * (c - a).cross(d - b).length(),
                _ => 0.0,
            };
            out.push(Sample { sensor: Sensor { position, normal }, area_m2 });
        }
    }
    out
}

/// Whether a polygon holds a place.
pub fn holds(polygon: &[[f64; 2]], x: f64, y: f64) -> bool {
    let mut odd = false;
    for (at, a) in polygon.iter().enumerate() {
        let b = polygon[(at + 1) % polygon.len()];
        if (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            odd = !odd;
        }
    }
    odd
}

/// The groups of a set, from their file.
///
/// # Errors
/// When the file is missing or damaged.
pub fn read_points(folder: &Folder, set: &PlannedView) -> Result<PointSet, Error> {
    Ok(folder.read_json(&folder.points(&set.name))?)
}
