use glam::{DVec3, Vec3};

use super::MirrorReceiver;
use crate::base::Frame;
use crate::render::Error;
use crate::site::{Site, Triangle};

/// Points that a region may have.
const MOST_POINTS: usize = 1_000_000;

/// Points on the faces of all objects named `id` (PV left out), on a grid of `spacing_m` along
/// each plane: across, and up the slope. Each lies on the side of its face that looks at the
/// middle of the PV. In the order of the triangles.
///
/// # Errors
/// [`Error::Settings`]: no such object (the nearest names are told by the caller), a spacing that
/// isn't a length, too many points.
pub fn points_on(site: &Site, id: &str, spacing_m: f64) -> Result<Vec<MirrorReceiver>, Error> {
    let wrong = |what: String| Error::Settings { what };
    if !(1e-3..=1e4).contains(&spacing_m) {
        return Err(wrong(format!("the spacing is {spacing_m}, expected 0.001 to 10000 m")));
    }
    let shining = middle_of_pv(site);
    let mut out = Vec::new();
    for triangle in &site.triangles {
        let face = &site.faces[triangle.face as usize];
        if face.pv.is_some() || site.objects[face.object as usize].id != id {
            continue;
        }
        on(triangle, shining, spacing_m, &mut out);
        if out.len() > MOST_POINTS {
            return Err(wrong(format!(
                "{id} has more than {MOST_POINTS} points at {spacing_m} m; choose a wider spacing"
            )));
        }
    }
    if out.is_empty() {
        return Err(wrong(format!(
            "no point lies on an object `{id}`: expected the id of an object of the scene (without PV) that is larger than the spacing of {spacing_m} m"
        )));
    }
    Ok(out)
}

fn middle_of_pv(site: &Site) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut count = 0.0;
    for &t in site.pv.iter().flat_map(|pv| &pv.triangles) {
        sum += site.triangles[t as usize].corners.map(Vec3::as_dvec3).iter().sum::<DVec3>();
        count += 3.0;
    }
    if count > 0.0 { sum / count } else { sum }
}

/// The points of one triangle: grid places of its plane, counted from the origin, so that
/// triangles of one plane share the grid.
fn on(triangle: &Triangle, shining: DVec3, spacing_m: f64, out: &mut Vec<MirrorReceiver>) {
    let corners = triangle.corners.map(Vec3::as_dvec3);
    let Some(front) = (corners[1] - corners[0]).cross(corners[2] - corners[0]).try_normalize()
    else {
        return;
    };
    let normal = if (shining - corners[0]).dot(front) >= 0.0 { front } else { -front };
    let frame = Frame::around(front);
    let flat = corners.map(|c| (c.dot(frame.x), c.dot(frame.y)));
    let height = corners[0].dot(front);
    let span = |pick: fn(&(f64, f64)) -> f64| {
        let low = flat.iter().map(pick).fold(f64::INFINITY, f64::min);
        let high = flat.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
        ((low / spacing_m - 0.5).ceil() as i64, (high / spacing_m - 0.5).floor() as i64)
    };
    let ((left, right), (low, high)) = (span(|c| c.0), span(|c| c.1));
    for v in low..=high {
        for u in left..=right {
            let at = ((u as f64 + 0.5) * spacing_m, (v as f64 + 0.5) * spacing_m);
            let inside = (0..3).all(|i| {
                let (a, b) = (flat[i], flat[(i + 1) % 3]);
                let side = (b.0 - a.0) * (at.1 - a.1) - (b.1 - a.1) * (at.0 - a.0);
                // A point on a shared edge belongs to one of the two triangles.
                side > 0.0 || (side == 0.0 && (b.1 > a.1 || (b.1 == a.1 && b.0 < a.0)))
            });
            if inside {
                let position = frame.x * at.0 + frame.y * at.1 + front * height;
                out.push(MirrorReceiver { position, normal: Some(normal) });
                if out.len() > MOST_POINTS {
                    return;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_covered_once_and_looks_at_the_light() {
        let wall =
            [[0.0, 0.0], [8.0, 0.0], [8.0, 4.0], [0.0, 4.0]].map(|[y, z]| Vec3::new(2.0, y, z));
        let mut points = Vec::new();
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let triangle = Triangle { corners: [wall[a], wall[b], wall[c]], face: 0 };
            on(&triangle, DVec3::new(-5.0, 0.0, 0.0), 0.5, &mut points);
        }
        assert_eq!(points.len(), 16 * 8);
        let mut places: Vec<_> = points
            .iter()
            .map(|p| (p.position * 1000.0).round().to_array().map(|v| v as i64))
            .collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), 16 * 8);
        assert!(points.iter().all(|p| p.normal == Some(DVec3::NEG_X)));
        assert!(points.iter().all(|p| (p.position.x - 2.0).abs() < 1e-9));
    }
}
