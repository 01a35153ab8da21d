//! Regions as points: samples over the faces of objects, and over polygons on the ground.

use glam::{DVec3, Vec3};

use super::pv_visibility::PvVisibility;
use super::sensors::Sensor;
use crate::base::Aabb;
use crate::site::Site;

/// A piece of a surface that a region is sampled by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Where, and the side that may see PV.
    pub sensor: Sensor,
    /// The area it stands for, m2.
    pub area_m2: f64,
}

/// Spreads samples over the faces of some objects: a square lattice of `spacing_m` in the plane of
/// each face. Of the two sides of a face that one is taken that sees PV, the front where neither
/// or both do. A face that no lattice point meets gets one sample in its largest triangle. PV is
/// left out. The samples of a face stand for equal parts of its area.
pub fn sample_objects(site: &Site, objects: &[u32], spacing_m: f64, seed: u64) -> Vec<Sample> {
    let seen = PvVisibility::spread(site, seed);
    let wanted: std::collections::BTreeSet<u32> = objects.iter().copied().collect();
    let mut by_face: std::collections::BTreeMap<u32, Vec<u32>> = std::collections::BTreeMap::new();
    for (t, triangle) in site.triangles.iter().enumerate() {
        let face = &site.faces[triangle.face as usize];
        if face.pv.is_none() && wanted.contains(&face.object) {
            by_face.entry(triangle.face).or_default().push(t as u32);
        }
    }
    let mut out = Vec::new();
    for triangles in by_face.values() {
        let mut places: Vec<(DVec3, Vec3)> = Vec::new();
        for &t in triangles {
            lattice(site, t, spacing_m, |place, normal| places.push((place, normal)));
        }
        let area = |t: &u32| f64::from(site.triangles[*t as usize].area_m2());
        let area_m2: f64 = triangles.iter().map(area).sum();
        if area_m2 <= 0.0 {
            continue;
        }
        if places.is_empty() {
            let largest = triangles.iter().max_by(|a, b| area(a).total_cmp(&area(b)));
            places.extend(largest.map(|t| {
                let triangle = &site.triangles[*t as usize];
                let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
                ((a + b + c) / 3.0, triangle.normal())
            }));
        }
        let share = area_m2 / places.len() as f64;
        out.extend(places.into_iter().map(|(position, front)| {
            let sees = |n: Vec3| seen.nearest_m(site, position.as_vec3(), n).is_some();
            let normal = if !sees(front) && sees(-front) { -front } else { front };
            let sensor = Sensor { position, normal: normal.as_dvec3() };
            Sample { sensor, area_m2: share }
        }));
    }
    out
}

/// Calls `each` with the lattice points inside a triangle and its normal. The lattice depends on
/// the plane alone, and an edge belongs to the triangle above or to the left of it: triangles of a
/// face share neither points nor gaps.
fn lattice(site: &Site, triangle: u32, spacing_m: f64, mut each: impl FnMut(DVec3, Vec3)) {
    let triangle = &site.triangles[triangle as usize];
    let normal = triangle.normal();
    if normal == Vec3::ZERO {
        return;
    }
    let frame = crate::base::Frame::around(normal.as_dvec3());
    let corners = triangle.corners.map(|c| frame.local_from_world(c.as_dvec3()));
    let cell = |v: f64| libm::floor(v / spacing_m);
    let [low, high] = [f64::min, f64::max].map(|pick| {
        corners
            .iter()
            .skip(1)
            .fold([corners[0].x, corners[0].y], |b, c| [pick(b[0], c.x), pick(b[1], c.y)])
    });
    let z = (corners[0].z + corners[1].z + corners[2].z) / 3.0;
    let count = |axis: usize| (cell(high[axis]) - cell(low[axis]) + 1.0).min(65_536.0) as u64;
    for j in 0..count(1) {
        for i in 0..count(0) {
            let x = (cell(low[0]) + i as f64 + 0.5) * spacing_m;
            let y = (cell(low[1]) + j as f64 + 0.5) * spacing_m;
            if inside(&corners, x, y) {
                each(frame.world_from_local(DVec3::new(x, y, z)), normal);
            }
        }
    }
}

/// Whether a point lies in a polygon, by the half-open rule: of two polygons that share an edge
/// exactly one holds a point on it.
fn inside(corners: &[DVec3], x: f64, y: f64) -> bool {
    let mut odd = false;
    for (at, a) in corners.iter().enumerate() {
        let b = &corners[(at + 1) % corners.len()];
        // Both polygons of an edge must compute the same crossing: from its lower end.
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        if (a.y > y) != (b.y > y) && x < a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x) {
            odd = !odd;
        }
    }
    odd
}

/// Spreads samples over a polygon in plan, `height_m` above the ground and facing up; on the
/// ground itself, in its plane, where no height is given. The ground is the lowest surface that
/// faces up (the highest of all where none does): what a plot is under its trees. Where there is
/// none the sample is left out; how many were is returned beside them.
pub fn sample_polygon(
    site: &Site,
    polygon: &[[f64; 2]],
    height_m: Option<f64>,
    spacing_m: f64,
) -> (Vec<Sample>, usize) {
    let corners: Vec<DVec3> = polygon.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect();
    let bounds = Aabb::around(corners.iter().map(|c| c.as_vec3()));
    let mut out = Vec::new();
    let mut missing = 0;
    if bounds.is_empty() {
        return (out, missing);
    }
    let size = bounds.size().as_dvec3();
    let count = |length: f64| (libm::ceil(length / spacing_m)).clamp(1.0, 65_536.0) as u64;
    let (columns, rows) = (count(size.x), count(size.y));
    let step = |length: f64, n: u64| length / n as f64;
    let (dx, dy) = (step(size.x, columns), step(size.y, rows));
    for j in 0..rows {
        for i in 0..columns {
            let x = f64::from(bounds.min.x) + (i as f64 + 0.5) * dx;
            let y = f64::from(bounds.min.y) + (j as f64 + 0.5) * dy;
            if !inside(&corners, x, y) {
                continue;
            }
            let Some((ground, normal)) = ground(site, x, y) else {
                missing += 1;
                continue;
            };
            let sensor = match height_m {
                Some(h) => Sensor { position: ground + DVec3::Z * h, normal: DVec3::Z },
                None => Sensor { position: ground, normal },
            };
            out.push(Sample { sensor, area_m2: dx * dy });
        }
    }
    (out, missing)
}

/// Surfaces under each other that are looked through for the ground.
const STOREYS: usize = 64;

fn ground(site: &Site, x: f64, y: f64) -> Option<(DVec3, DVec3)> {
    let mut from = site.bounds.max.z + 1.0;
    let (mut top, mut lowest) = (None, None);
    for _ in 0..STOREYS {
        let origin = Vec3::new(x as f32, y as f32, from);
        let Some(found) = site.bvh.closest(origin, Vec3::NEG_Z, 0.0, f32::INFINITY) else { break };
        let front = site.triangles[found.triangle as usize].normal();
        let z = from - found.distance_m;
        let up = if front.z < 0.0 { -front } else { front };
        let place = (DVec3::new(x, y, f64::from(z)), up.as_dvec3());
        if site.face_of(found.triangle).pv.is_none() {
            top = top.or(Some(place));
            if front.z > 0.1 {
                lowest = Some(place);
            }
        }
        from = z - 1e-3 * (1.0 + z.abs() * 1e-2);
    }
    lowest.or(top)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::view::sensors::tests::site;

    #[test]
    fn samples_stand_for_the_whole_area_and_look_at_the_pv() {
        let site = site();
        for spacing in [0.3, 1.0, 2.7, 50.0] {
            for (object, area) in [(0, 64.0), (1, 24.0)] {
                let samples = sample_objects(&site, &[object], spacing, 1);
                let sum: f64 = samples.iter().map(|s| s.area_m2).sum();
                assert!((sum - area).abs() < 1e-6, "{object} {spacing}: {sum}");
                let whole = (area / (spacing * spacing)) as usize;
                assert!(
                    samples.len().abs_diff(whole) * 4 <= whole.max(4),
                    "{spacing}: {}",
                    samples.len()
                );
            }
            // Where the wall sees the PV's lower side its samples look at it, not to the front.
            for s in sample_objects(&site, &[1], spacing, 1) {
                let east = s.sensor.normal.x > 0.9;
                assert_eq!(east, s.sensor.position.z < 2.0, "{spacing}: {s:?}");
            }
        }
        // The PV has no samples of its own.
        assert!(sample_objects(&site, &[2], 0.1, 1).is_empty());
    }

    #[test]
    fn polygons_lie_on_the_ground_or_above_it() {
        let site = site();
        let triangle = [[1.0, 1.0], [7.0, 1.0], [1.0, 7.0]];
        let (ground, missing) = sample_polygon(&site, &triangle, None, 0.1);
        assert_eq!(missing, 0);
        let sum: f64 = ground.iter().map(|s| s.area_m2).sum();
        assert!((sum - 18.0).abs() < 0.6, "{sum}");
        // Also under the PV.
        assert!(ground.iter().all(|s| s.sensor.position.z.abs() < 1e-5));
        let (above, _) = sample_polygon(&site, &triangle, Some(2.0), 0.5);
        assert!(above.iter().all(|s| (s.sensor.position.z - 2.0).abs() < 1e-5));
        let beyond = [[20.0, 20.0], [21.0, 20.0], [21.0, 21.0]];
        let (none, missing) = sample_polygon(&site, &beyond, None, 0.1);
        assert!(none.is_empty() && missing > 10);
    }

    /// Points on shared edges and corners belong to exactly one of the triangles.
    #[test]
    fn neighbours_share_neither_points_nor_gaps() {
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let parts =
            [[p(0.0, 0.0), p(8.0, 0.0), p(8.0, 8.0)], [p(0.0, 0.0), p(8.0, 8.0), p(0.0, 8.0)]];
        for i in 0..16 {
            for j in 0..16 {
                let (x, y) = (f64::from(i) * 0.5, f64::from(j) * 0.5);
                let holders = parts.iter().filter(|t| inside(&t[..], x, y)).count();
                let whole = [p(0.0, 0.0), p(8.0, 0.0), p(8.0, 8.0), p(0.0, 8.0)];
                assert_eq!(holders, usize::from(inside(&whole, x, y)), "{x} {y}");
                assert_eq!(holders, 1, "{x} {y}");
            }
        }
    }
}
