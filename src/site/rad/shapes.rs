//! Curved primitives of Radiance as triangles: balls, cylinders, cones, rings.
//!
//! The number of chords follows from the largest distance that a chord may lie inside its circle, a
//! centimetre: what matters is where a shadow's edge falls, not how round a ball looks.

use glam::DVec3;

use crate::base::Frame;

/// Largest distance between a curved surface and the chord that stands for it, m.
const CHORD_ERROR_M: f64 = 0.01;
/// Fewest chords of a full circle.
const FEWEST: usize = 16;
/// Most chords of a circle: the bound is kept up to a radius of 8 km.
const MOST: usize = 2048;
/// Most chords of a ball's equator: the bound is kept up to a radius of 500 m.
const MOST_OF_BALL: usize = 512;

/// How many chords a circle gets so that none lies further than a centimetre inside it.
fn segments(radius_m: f64, most: usize) -> usize {
    if radius_m <= CHORD_ERROR_M {
        return FEWEST;
    }
    let half_angle = libm::acos(1.0 - CHORD_ERROR_M / radius_m);
    let n = libm::ceil(std::f64::consts::PI / half_angle);
    // Even, so that a ball is symmetric.
    (n as usize).next_multiple_of(2).clamp(FEWEST, most)
}

/// Points of a circle in the plane of a frame.
fn circle(frame: &Frame, centre: DVec3, radius_m: f64, n: usize) -> Vec<DVec3> {
    (0..n)
        .map(|i| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
            centre + (frame.x * cos + frame.y * sin) * radius_m
        })
        .collect()
}

fn flip_if(inward: bool, mut corners: Vec<DVec3>) -> Vec<DVec3> {
    if inward {
        for t in corners.chunks_exact_mut(3) {
            t.swap(1, 2);
        }
    }
    corners
}

/// A ball: corners of triangles, three each, fronts outward, or inward for a bubble.
pub(super) fn sphere(centre: DVec3, radius_m: f64, inward: bool) -> Vec<DVec3> {
    let n = segments(radius_m, MOST_OF_BALL);
    let bands = n / 2;
    let frame = Frame::around(DVec3::Z);
    let ring = |band: usize| {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * band as f64 / bands as f64);
        circle(&frame, centre + DVec3::Z * (radius_m * cos), radius_m * sin, n)
    };
    let mut corners = Vec::with_capacity(6 * n * bands);
    let top = centre + DVec3::Z * radius_m;
    let bottom = centre - DVec3::Z * radius_m;
    let mut above = ring(1);
    for i in 0..n {
        corners.extend([top, above[i], above[(i + 1) % n]]);
    }
    for band in 2..bands {
        let below = ring(band);
        band_between(&above, &below, &mut corners);
        above = below;
    }
    for i in 0..n {
        corners.extend([bottom, above[(i + 1) % n], above[i]]);
    }
    flip_if(inward, corners)
}

/// Quadrilaterals between two circles, fronts away from the axis when `above` lies above.
fn band_between(above: &[DVec3], below: &[DVec3], corners: &mut Vec<DVec3>) {
    let n = above.len();
    for i in 0..n {
        let j = (i + 1) % n;
        corners.extend([above[i], below[i], below[j], above[i], below[j], above[j]]);
    }
}

/// The mantle of a cone, or of a cylinder where both radii are equal: fronts outward, or inward
/// for a cup or tube. No caps, as in Radiance.
pub(super) fn cone(
    ends: [DVec3; 2],
    radii_m: [f64; 2],
    inward: bool,
) -> Result<Vec<DVec3>, &'static str> {
    let axis = ends[1] - ends[0];
    let length_m = axis.length();
    if length_m == 0.0 {
        return Err("its two ends are one point");
    }
    let frame = Frame::around(axis / length_m);
    let n = segments(radii_m[0].max(radii_m[1]), MOST);
    let below = circle(&frame, ends[0], radii_m[0], n);
    let above = circle(&frame, ends[1], radii_m[1], n);
    let mut corners = Vec::with_capacity(6 * n);
    for i in 0..n {
        let j = (i + 1) % n;
        if radii_m[0] > 0.0 {
            corners.extend([above[i], below[i], below[j]]);
        }
        if radii_m[1] > 0.0 {
            corners.extend([above[i], below[j], above[j]]);
        }
    }
    Ok(flip_if(inward, corners))
}

/// A flat ring: its outer circle counter-clockwise about `normal`, and its inner one if it has one.
pub(super) fn ring(
    centre: DVec3,
    normal: DVec3,
    radii_m: [f64; 2],
) -> Result<Vec<Vec<DVec3>>, &'static str> {
    let length = normal.length();
    if length == 0.0 {
        return Err("its direction has no length");
    }
    let frame = Frame::around(normal / length);
    let (inner, outer) = (radii_m[0].min(radii_m[1]), radii_m[0].max(radii_m[1]));
    let mut rings = vec![circle(&frame, centre, outer, segments(outer, MOST))];
    if inner > 0.0 {
        rings.push(circle(&frame, centre, inner, segments(inner, MOST)));
    }
    Ok(rings)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Signed volume by the divergence theorem: positive where fronts look outward.
    fn volume(corners: &[DVec3]) -> f64 {
        corners.chunks_exact(3).map(|t| t[0].dot(t[1].cross(t[2])) / 6.0).sum()
    }

    #[test]
    fn balls_are_closed_and_face_outward() {
        for radius in [0.05, 1.0, 4.0] {
            let ball = sphere(DVec3::new(3.0, 4.0, 5.0), radius, false);
            let exact = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
            let got = volume(&ball);
            assert!(got < exact && got > 0.93 * exact, "{got} of {exact}");
            assert!((volume(&sphere(DVec3::ZERO, radius, true)) + got).abs() < 1e-9 * exact);
            for t in ball.chunks_exact(3) {
                for edge in 0..3 {
                    let (a, b) = (t[edge], t[(edge + 1) % 3]);
                    let sagitta = radius - ((a + b) * 0.5).distance(DVec3::new(3.0, 4.0, 5.0));
                    // A diagonal of a quadrilateral sags by up to both chords.
                    assert!(sagitta < 2.1 * CHORD_ERROR_M.max(radius * 0.02), "{sagitta}");
                }
            }
        }
    }

    #[test]
    fn cones_face_outward_and_tips_have_no_flat_triangles() {
        let tip = cone([DVec3::ZERO, DVec3::Z * 2.0], [1.0, 0.0], false).unwrap();
        assert_eq!(tip.len() % 3, 0);
        let mantle: f64 = tip
            .chunks_exact(3)
            .map(|t| {
                let area = (t[1] - t[0]).cross(t[2] - t[0]) * 0.5;
                let out = (t[0] + t[1] + t[2]) / 3.0;
                assert!(area.x * out.x + area.y * out.y > 0.0);
                area.length()
            })
            .sum();
        let exact = std::f64::consts::PI * 5f64.sqrt();
        assert!(mantle < exact && mantle > 0.98 * exact);
        let tube = cone([DVec3::ZERO, DVec3::X], [1.0, 1.0], true).unwrap();
        for t in tube.chunks_exact(3) {
            let out = (t[0] + t[1] + t[2]) / 3.0;
            assert!((t[1] - t[0]).cross(t[2] - t[0]).dot(out * DVec3::new(0.0, 1.0, 1.0)) < 0.0);
        }
        assert!(cone([DVec3::X, DVec3::X], [1.0, 1.0], false).is_err());
    }

    #[test]
    fn circles_get_as_many_chords_as_they_need() {
        assert_eq!(segments(0.1, MOST), 16);
        for radius in [1.0, 5.0, 20.0, 1000.0] {
            let n = segments(radius, MOST);
            let sagitta = |n: f64| radius * (1.0 - libm::cos(std::f64::consts::PI / n));
            assert!(sagitta(n as f64) <= CHORD_ERROR_M * 1.000_001);
            assert!(n == 16 || sagitta(n as f64 - 2.0) > CHORD_ERROR_M);
        }
    }
}
