//! What is drawn over a map so that one knows where one is: north, scale, compass, sun paths,
//! observers, the outlines of the PV and of regions.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use super::regions;
use crate::picture::Figure;
use crate::picture::figure::{AxisLabel, Marker, Polyline};
use crate::project::{Picture, PlannedView};
use crate::receivers::points::Kind;
use crate::receivers::points::read_points;
use crate::render::{Projection, View};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::site::Site;

const OUTLINE: [u8; 3] = [255, 255, 255];
const SUN_PATH: [u8; 3] = [255, 196, 60];
/// Days whose sun paths are drawn: about the solstices, the equinoxes and between.
const SUN_PATHS: usize = 5;

/// All marks of a view.
pub(super) struct Marks {
    polylines: Vec<Polyline>,
    markers: Vec<Marker>,
    axis: Vec<AxisLabel>,
    metres_per_pixel: Option<f64>,
    north_deg: Option<f64>,
}

impl Marks {
    pub(super) fn of(
        job: &Job<'_>,
        planned: &PlannedView,
        picture: &Picture,
    ) -> Result<Self, Error> {
        let view = &picture.view;
        let markers = places(job, view)?
            .into_iter()
            .filter_map(|(place, label)| {
                let (column, row) = view.project(place)?;
                Some(Marker { at: [column, row], label })
            })
            .filter(|m| inside(view, m.at))
            .collect();
        let mut marks = Self {
            polylines: Vec::new(),
            markers,
            axis: Vec::new(),
            metres_per_pixel: None,
            north_deg: None,
        };
        match view.projection() {
            Projection::Parallel => {
                marks.polylines = outline(job.site()?, view);
                marks.metres_per_pixel = Some(view.size()[0] / view.columns() as f64);
                let [right, up] = view.axes();
                let (across, along) = (DVec3::Y.dot(right), DVec3::Y.dot(up));
                if across.hypot(along) > 0.1 {
                    marks.north_deg = Some(libm::atan2(across, along).to_degrees());
                }
            }
            Projection::Cylindrical => {
                marks.polylines = sun_paths(job, view)?;
                marks.axis = compass(view);
            }
            _ => marks.polylines = sun_paths(job, view)?,
        }
        marks.polylines.extend(regions::outlines(job, planned)?);
        Ok(marks)
    }

    pub(super) fn put_on(&self, figure: &mut Figure<'_>) {
        figure.polylines.clone_from(&self.polylines);
        figure.markers.clone_from(&self.markers);
        figure.axis.clone_from(&self.axis);
        figure.metres_per_pixel = self.metres_per_pixel;
        figure.north_deg = self.north_deg;
    }
}

/// Where the observers are, and in plans the middle of each region.
fn places(job: &Job<'_>, view: &View) -> Result<Vec<(DVec3, String)>, Error> {
    let Some(set) = job.results()?.receivers() else { return Ok(Vec::new()) };
    let hits = job.folder.read_hits(&set.name)?;
    let mut out = Vec::new();
    for group in read_points(&job.folder, set)?.groups {
        let plan = view.projection() == Projection::Parallel;
        if group.kind == Kind::Observer || (group.kind == Kind::Region && plan) {
            let all = &hits.hits[group.first..group.first + group.points()];
            let sum = all.iter().fold(DVec3::ZERO, |sum, h| sum + h.position.as_dvec3());
            out.push((sum / all.len() as f64, group.name));
        }
    }
    Ok(out)
}

fn inside(view: &View, at: [f64; 2]) -> bool {
    (0.0..view.columns() as f64).contains(&at[0]) && (0.0..view.rows() as f64).contains(&at[1])
}

/// The border of each PV surface: the edges that only one of its triangles has.
fn outline(site: &Site, view: &View) -> Vec<Polyline> {
    let mut lines = Vec::new();
    for surface in &site.pv {
        let mut edges: BTreeMap<[[u32; 3]; 2], (usize, [Vec3; 2])> = BTreeMap::new();
        for &t in &surface.triangles {
            let [a, b, c] = site.triangles[t as usize].corners;
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let bits = |v: Vec3| v.to_array().map(f32::to_bits);
                let mut key = [bits(p), bits(q)];
                key.sort_unstable();
                edges.entry(key).or_insert((0, [p, q])).0 += 1;
            }
        }
        for (count, ends) in edges.into_values() {
            let at = |v: Vec3| view.project(v.as_dvec3()).map(|(c, r)| [c, r]);
            if let (1, Some(p), Some(q)) = (count, at(ends[0]), at(ends[1])) {
                lines.push(Polyline {
                    points: vec![p, q],
                    color: OUTLINE,
                    width: 0.8,
                    label: String::new(),
                });
            }
        }
    }
    lines
}

fn sun_paths(job: &Job<'_>, view: &View) -> Result<Vec<Polyline>, Error> {
    let steps = &job.timeline()?.steps;
    let mut days: Vec<u32> = steps.iter().map(|s| s.day).collect();
    days.dedup();
    let chosen: Vec<u32> = (0..SUN_PATHS.min(days.len()))
        .map(|i| days[i * (days.len() - 1) / (SUN_PATHS - 1).max(1)])
        .collect();
    let mut lines = Vec::new();
    for day in chosen {
        let mut points: Vec<[f64; 2]> = Vec::new();
        for step in steps.iter().filter(|s| s.day == day) {
            let Some((column, row)) = view.project_direction(step.sun) else { continue };
            // A path that leaves a panorama at one edge comes back at the other.
            let jumps =
                points.last().is_some_and(|p| (p[0] - column).abs() > view.columns() as f64 * 0.5);
            if jumps {
                points.push([f64::NAN; 2]);
            }
            points.push([column, row]);
        }
        if points.len() > 1 {
            lines.push(Polyline { points, color: SUN_PATH, width: 0.7, label: String::new() });
        }
    }
    Ok(lines)
}

fn compass(view: &View) -> Vec<AxisLabel> {
    const POINTS: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
    let mut labels = Vec::new();
    for (i, name) in POINTS.into_iter().enumerate() {
        let azimuth = (i as f64 * 45.0).to_radians();
        let direction = DVec3::new(libm::sin(azimuth), libm::cos(azimuth), 0.0);
        if let Some((column, _)) = view.project_direction(direction)
            && (0.0..=view.columns() as f64).contains(&column)
        {
            labels.push(AxisLabel { column, label: name.into(), major: i % 2 == 0 });
        }
    }
    labels
}
