use std::f64::consts::PI;

use glam::DVec3;

use crate::base::Frame;

/// The sun's disc: its radius, and points that stand for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub radius_rad: f64,
}

impl Disc {
    pub(super) fn new(diameter_deg: f64) -> Self {
        Self { radius_rad: 0.5 * diameter_deg.to_radians() }
    }

    /// Points of the unit disc, each for the same share of it, that integrate what is wide beside
    /// the disc: 4 of degree 3, 16 of degree 5 (Stroud 1971, S2), or 64 on four rings.
    pub(super) fn points(count: usize) -> Vec<(f64, f64)> {
        let ring = |r2: f64, around: usize, turn: f64| {
            (0..around).map(move |i| {
                let a = 2.0 * PI * (i as f64 + turn) / around as f64;
                (r2.sqrt() * libm::cos(a), r2.sqrt() * libm::sin(a))
            })
        };
        let root = 3.0_f64.sqrt();
        match count {
            4 => ring(0.5, 4, 0.0).collect(),
            16 => {
                ring((3.0 - root) / 6.0, 8, 0.0).chain(ring((3.0 + root) / 6.0, 8, 0.5)).collect()
            }
            _ => (0..4)
                .flat_map(|i| ring((f64::from(i) + 0.5) / 4.0, 16, 0.25 * f64::from(i)))
                .collect(),
        }
    }

    /// The direction to a point of the disc around a sun.
    #[inline]
    pub(super) fn direction(&self, sun: &Frame, (u, v): (f64, f64)) -> DVec3 {
        let (u, v) = (u * self.radius_rad, v * self.radius_rad);
        (sun.z + sun.x * u + sun.y * v).normalize()
    }

    /// Share of the disc around `sun` that is seen through a triangle of directions, in closed
    /// form: on the plane across the sun's direction the disc is a circle, the triangle a
    /// polygon.
    pub(super) fn share(&self, sun: &Frame, corners: &[DVec3; 3]) -> f64 {
        let scale = 1.0 / libm::tan(self.radius_rad);
        let mut flat = [(0.0, 0.0); 4];
        let mut count = 0;
        // What lies more than 84 degrees off the sun is cut away.
        let depth = |c: DVec3| c.dot(sun.z) - 0.1 * c.length();
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let (at_a, at_b) = (depth(a), depth(b));
            let mut push = |c: DVec3| {
                let z = c.dot(sun.z);
                if count < 4 && z > 0.0 {
                    flat[count] = (c.dot(sun.x) / z * scale, c.dot(sun.y) / z * scale);
                    count += 1;
                }
            };
            if at_a >= 0.0 {
                push(a);
            }
            if (at_a >= 0.0) != (at_b >= 0.0) {
                push(a.lerp(b, at_a / (at_a - at_b)));
            }
        }
        let flat = &flat[..count];
        let area: f64 = (0..count).map(|i| sector(flat[i], flat[(i + 1) % count])).sum();
        (area.abs() / PI).min(1.0)
    }
}

/// Signed area of the unit circle inside the triangle (origin, a, b).
fn sector(a: (f64, f64), b: (f64, f64)) -> f64 {
    let cross = |p: (f64, f64), q: (f64, f64)| p.0 * q.1 - p.1 * q.0;
    let dot = |p: (f64, f64), q: (f64, f64)| p.0 * q.0 + p.1 * q.1;
    let wedge = |p, q| 0.5 * libm::atan2(cross(p, q), dot(p, q));
    let way = (b.0 - a.0, b.1 - a.1);
    let (aa, ab, bb) = (dot(way, way), dot(a, way), dot(a, a) - 1.0);
    let root = ab * ab - aa * bb;
    if root <= 0.0 || aa == 0.0 {
        return wedge(a, b);
    }
    let root = root.sqrt();
    let (enter, leave) = ((-ab - root) / aa, (-ab + root) / aa);
    if leave <= 0.0 || enter >= 1.0 {
        return wedge(a, b);
    }
    let at = |t: f64| (a.0 + way.0 * t, a.1 + way.1 * t);
    let (first, last) = (at(enter.max(0.0)), at(leave.min(1.0)));
    let before = if enter > 0.0 { wedge(a, first) } else { 0.0 };
    let after = if leave < 1.0 { wedge(last, b) } else { 0.0 };
    before + 0.5 * cross(first, last) + after
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_the_disc_are_those_that_counting_gives() {
        let disc = Disc::new(0.533);
        let sun = Frame::around(DVec3::new(0.3, -0.5, 0.7).normalize());
        let r = libm::tan(disc.radius_rad);
        for (i, flat) in [
            [(-9.0, -9.0), (9.0, -9.0), (0.0, 9.0)],
            [(0.3, -5.0), (5.0, 0.0), (0.3, 5.0)],
            [(-0.2, -0.3), (0.4, 0.1), (-0.1, 0.5)],
            [(0.0, 0.0), (3.0, 0.2), (0.1, 3.0)],
            [(2.0, 2.0), (3.0, 2.0), (2.0, 3.0)],
        ]
        .into_iter()
        .enumerate()
        {
            let corners = flat.map(|(x, y)| (sun.z + sun.x * (x * r) + sun.y * (y * r)) * 17.0);
            let inside = |p: (f64, f64)| {
                (0..3).all(|i| {
                    let (a, b): ((f64, f64), (f64, f64)) = (flat[i], flat[(i + 1) % 3]);
                    (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) >= 0.0
                })
            };
            let n = 1000;
            let mut count = [0.0, 0.0];
            for j in 0..n * n {
                let at = |k: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
                let p = (at(j % n), at(j / n));
                if p.0 * p.0 + p.1 * p.1 <= 1.0 {
                    count[0] += 1.0;
                    count[1] += f64::from(u8::from(inside(p)));
                }
            }
            let share = disc.share(&sun, &corners);
            assert!((share - count[1] / count[0]).abs() < 1e-3, "{i}: {share} {count:?}");
        }
        // A corner behind the eye.
        let wide =
            [sun.z * -5.0 + sun.x * 30.0, sun.y * 30.0 + sun.z, (sun.x + sun.y) * -30.0 + sun.z];
        assert!((disc.share(&sun, &wide) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn points_of_the_disc_integrate_its_moments() {
        for (count, exact) in [(4, false), (16, true), (64, false)] {
            let points = Disc::points(count);
            assert_eq!(points.len(), count);
            let mean = |f: &dyn Fn(f64, f64) -> f64| {
                points.iter().map(|p| f(p.0, p.1)).sum::<f64>() / count as f64
            };
            assert!(mean(&|x, _| x).abs() < 1e-12 && mean(&|x, y| x * y).abs() < 1e-12);
            assert!((mean(&|x, _| x * x) - 0.25).abs() < 1e-12, "{count}");
            if exact {
                assert!((mean(&|x, _| x.powi(4)) - 0.125).abs() < 1e-12);
            }
        }
    }
}
