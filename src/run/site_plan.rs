//! The plan of a site: what was understood, at one glance.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3, vec3};

use super::error::Error;
use crate::base::Grid;
use crate::picture::figure::{Marker, Polyline};
use crate::picture::{Figure, Scale};
use crate::project::artifacts::SITE_PLAN;
use crate::site::check::Summary;
use crate::site::{Site, tilt_deg};

/// Edge of the plan, pixels.
const EDGE: usize = 700;
/// How far around the PV it reaches at least, and at most, m.
const REACH_M: [f64; 2] = [60.0, 250.0];
/// The paper's limit: a circle is drawn there, m.
const PATH_M: f64 = 100.0;
/// From where the sun shines on the plan: the north-west, as on maps.
const LIGHT: Vec3 = vec3(-0.53, 0.53, 0.66);
/// Names that are written; more would cover the picture.
const NAMED: usize = 12;
const CIRCLE: [u8; 3] = [0x2a, 0x6f, 0xdb];

/// Draws the site from above into `site.png` of the project's folder: relief in grey, the PV in
/// colours of its tilt, north, a scale, and a circle of 100 m around the PV.
///
/// # Errors
/// When it can't be drawn or written.
pub fn draw_site(
    folder: &Path,
    name: &str,
    site: &Site,
    summary: &Summary,
) -> Result<PathBuf, Error> {
    let (centre, reach_m) = window(site);
    let step_m = 2.0 * reach_m / EDGE as f64;
    let place = |column: usize, row: usize| {
        let x = centre.x - reach_m + (column as f64 + 0.5) * step_m;
        let y = centre.y + reach_m - (row as f64 + 0.5) * step_m;
        [x as f32, y as f32]
    };
    let top = site.bounds.max.z + 1.0;
    let mut tilt = Grid::filled(EDGE, EDGE, 0.0_f32);
    let mut ground = Grid::filled(EDGE, EDGE, [1.0_f32; 3]);
    for row in 0..EDGE {
        for column in 0..EDGE {
            let [x, y] = place(column, row);
            let hit = site.bvh.closest(vec3(x, y, top), Vec3::NEG_Z, 0.0, f32::INFINITY);
            let Some(hit) = hit else { continue };
            let triangle = &site.triangles[hit.triangle as usize];
            let normal = triangle.normal();
            let normal = if normal.z < 0.0 { -normal } else { normal };
            let height = (top - hit.distance_m - site.bounds.min.z) / site.bounds.size().z.max(1.0);
            // Level ground is a middle grey, nothing is as light as what has no surface.
            let grey = (0.5 + 0.6 * normal.dot(LIGHT).max(0.0)) * (0.78 + 0.22 * height);
            let grey = grey.min(0.95);
            ground.data_mut()[row * EDGE + column] = [grey; 3];
            if let Some(pv) = site.face_of(hit.triangle).pv {
                // Exactly 0 is transparent.
                let shown = tilt_deg(site.pv[usize::from(pv)].normal).max(0.1);
                tilt.data_mut()[row * EDGE + column] = shown as f32;
            }
        }
    }
    let pixel =
        |p: DVec3| [(p.x - centre.x + reach_m) / step_m, (centre.y + reach_m - p.y) / step_m];
    let mut figure = Figure::new(&tilt, Scale::linear(90.0, "\u{b0}"));
    figure.title = format!("{name}: the site as it was understood");
    figure.subtitle = format!(
        "{} triangles, {} PV surface{}, {:.0} m\u{b2}",
        summary.triangles,
        summary.pv.len(),
        if summary.pv.len() == 1 { "" } else { "s" },
        summary.pv.iter().map(|p| p.area_m2).sum::<f64>()
    );
    figure.background = Some(&ground);
    figure.legend = "Tilt of the PV".to_owned();
    figure.bare = "no PV".to_owned();
    figure.opacity = 0.85;
    figure.metres_per_pixel = Some(step_m);
    figure.north_deg = Some(0.0);
    figure.caption.push(format!("True north: {}. Lightest grey: no surface below.", summary.north));
    let mut seen = BTreeSet::new();
    for (pv, surface) in summary.pv.iter().zip(&site.pv) {
        if seen.len() < NAMED && seen.insert(surface.entry) {
            let name = surface.name.split('/').next().unwrap_or_default();
            figure.markers.push(Marker { at: pixel(pv.centre_m), label: name.to_owned() });
        }
    }
    if PATH_M < reach_m {
        let points = (0..=120).map(|i| {
            let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / 120.0);
            pixel(centre + DVec3::new(PATH_M * cos, PATH_M * sin, 0.0))
        });
        let (points, label) = (points.collect(), "100 m".to_owned());
        figure.polylines.push(Polyline { points, color: CIRCLE, width: 1.0, label });
    }
    let path = folder.join(SITE_PLAN);
    figure.write_png(&path, &[])?;
    Ok(path)
}

/// Middle of the PV, and how far the plan reaches from it.
fn window(site: &Site) -> (DVec3, f64) {
    let triangles = site.pv.iter().flat_map(|s| &s.triangles);
    let corners = || triangles.clone().flat_map(|&t| site.triangles[t as usize].corners);
    let (low, high) = match site.pv.is_empty() {
        true => (site.bounds.min, site.bounds.max),
        false => (
            corners().fold(Vec3::INFINITY, Vec3::min),
            corners().fold(Vec3::NEG_INFINITY, Vec3::max),
        ),
    };
    let half = f64::from((high - low).truncate().max_element()) * 0.5;
    let centre = ((low + high) * 0.5).as_dvec3();
    let [least, most] = REACH_M;
    let scene = site.bounds.size().truncate().max_element();
    // The whole scene where it is small, else the paper's distance around the PV.
    let around = (half + 1.3 * PATH_M).min(f64::from(scene) * 0.75);
    (
        centre,
        around.max(half * 1.2).max(least.min(f64::from(scene).max(1.0))).min(most.max(half * 1.2)),
    )
}
