use std::f64::consts::PI;

use glam::DVec3;

use super::kernel::Place;
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

    /// Points of the unit disc, each for the same share of it: 4 of degree 3, 16 of degree 7
    /// across rings (Stroud 1971, S2), or 64 on the four rings of Chebyshev's rule of equal
    /// weights.
    pub(super) fn points(count: usize) -> Vec<(f64, f64)> {
        const FOUR: [f64; 4] = [
            -0.794_654_472_291_766_1,
            -0.187_592_474_085_079_9,
            0.187_592_474_085_079_9,
            0.794_654_472_291_766_1,
        ];
        let ring = |at: f64, around: usize, turn: f64| {
            let r = (0.5 * (1.0 + at)).sqrt();
            (0..around).map(move |i| {
                let a = 2.0 * PI * (i as f64 + turn) / around as f64;
                (r * libm::cos(a), r * libm::sin(a))
            })
        };
        let third = (1.0 / 3.0_f64).sqrt();
        match count {
            4 => ring(0.0, 4, 0.0).collect(),
            16 => ring(-third, 8, 0.0).chain(ring(third, 8, 0.5)).collect(),
            _ => (0..4).flat_map(|i| ring(FOUR[i], 16, 0.25 * i as f64)).collect(),
        }
    }

    /// The same as directions in the frame of a sun.
    pub(super) fn places(&self, count: usize) -> Vec<Place> {
        let share = 1.0 / count as f32;
        let place = |(u, v)| Place { at: self.at(u, v), share, second: [0.0; 2] };
        Self::points(count).into_iter().map(place).collect()
    }

    /// The middle, with all of the disc around it.
    pub(super) fn middle(&self) -> Place {
        let second = (0.125 * self.radius_rad * self.radius_rad) as f32;
        Place { at: [0.0, 0.0, 1.0], share: 1.0, second: [second; 2] }
    }

    /// Places to the side of the middle, by the rule of Gauss and Chebyshev for the breadths of a
    /// circle (Abramowitz and Stegun 25.4.40), each with what lies above and below it.
    pub(super) fn line(&self, count: u32) -> Vec<Place> {
        let place = |k: u32| {
            let angle = PI * f64::from(k) / f64::from(count + 1);
            let (sin, u) = (libm::sin(angle), libm::cos(angle));
            let above = self.radius_rad * self.radius_rad * sin * sin / 6.0;
            Place {
                at: self.at(u, 0.0),
                share: (2.0 * sin * sin / f64::from(count + 1)) as f32,
                second: [0.0, above as f32],
            }
        };
        (1..=count).map(place).collect()
    }

    fn at(&self, u: f64, v: f64) -> [f32; 3] {
        let at = DVec3::new(u * self.radius_rad, v * self.radius_rad, 1.0).normalize();
        at.as_vec3().to_array()
    }

    /// Share of the disc around `sun` that is seen through a triangle of directions, in closed
    /// form: on the plane across the sun's direction the disc is a circle, the triangle a
    /// polygon.
    pub(super) fn share(&self, sun: &Frame, corners: &[DVec3; 3]) -> f64 {
        let scale = 1.0 / libm::tan(self.radius_rad);
        let mut flat = [(0.0, 0.0); 4];
        let mut count = 0;
        // What lies a right angle off the sun, or nearly, is cut away.
        let depth = |c: DVec3| c.dot(sun.z) - 1e-3 * c.length();
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
        // What is left by rounding of a disc that is passed by.
        let share = area.abs() / PI;
        if share < 1e-12 { 0.0 } else { share.min(1.0) }
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
            [sun.z * -1.0 + sun.x * 30.0, sun.y * 30.0 + sun.z, (sun.x + sun.y) * -30.0 + sun.z];
        assert!((disc.share(&sun, &wide) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn points_of_the_disc_integrate_its_moments() {
        for (count, exact) in [(4, false), (16, true), (64, true)] {
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
