//! The sun's disc: points, lines and chords that stand for it, and the share of it that is seen
//! through a triangle.

use std::f64::consts::PI;

use glam::DVec3;

use crate::base::Frame;

/// A point of the sun's disc that stands for a part of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct DiscPoint {
    /// In the sun's frame: to the side, up, and along.
    pub at: [f32; 3],
    /// Share of the disc.
    pub share: f32,
    /// Halves of the mean squares of the rest of the disc around it, to the side and up: the
    /// second order of its mean.
    pub second: [f32; 2],
    /// Half of the height of the chord that it stands for, rad: over that the lobe's mean is exact.
    /// 0 for a point.
    pub chord: f32,
}

/// A straight strip of the disc, from one point of its rim to another.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct DiscLine {
    /// Direction to its middle; not a unit vector.
    pub middle: DVec3,
    /// From there to an end.
    pub way: DVec3,
    /// Share of the disc.
    pub share: f64,
}

/// The sun's disc: its radius, and points that stand for it.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Disc {
    pub radius_rad: f64,
}

impl Disc {
    pub(in crate::render) fn new(diameter_deg: f64) -> Self {
        Self { radius_rad: 0.5 * diameter_deg.to_radians() }
    }

    /// Sixteen places all over the disc: two rings by the rule of Gauss and Legendre for the square of
    /// the radius, the outer one turned by half a step.
    pub(in crate::render) fn rings(&self) -> Vec<DiscPoint> {
        const AT: f64 = 0.577_350_269_189_625_8;
        const AROUND: u32 = 8;
        let mut out = Vec::new();
        for (ring, x) in [-AT, AT].into_iter().enumerate() {
            let r = (0.5 * (1.0 + x)).sqrt();
            for i in 0..AROUND {
                let turn = f64::from(i) + 0.5 * ring as f64;
                let angle = 2.0 * PI * turn / f64::from(AROUND);
                out.push(DiscPoint {
                    at: self.at(r * libm::cos(angle), r * libm::sin(angle)),
                    share: 0.5 / AROUND as f32,
                    second: [0.0; 2],
                    chord: 0.0,
                });
            }
        }
        out
    }

    /// The middle, with all of the disc around it.
    pub(in crate::render) fn middle(&self) -> DiscPoint {
        let second = (0.125 * self.radius_rad * self.radius_rad) as f32;
        DiscPoint { at: [0.0, 0.0, 1.0], share: 1.0, second: [second; 2], chord: 0.0 }
    }

    /// Places to the side of the middle, by the rule of Gauss and Chebyshev for the breadths of a
    /// circle (Abramowitz and Stegun 25.4.40), each with what lies above and below it.
    pub(in crate::render) fn line(&self, count: u32) -> Vec<DiscPoint> {
        let place = |k: u32| {
            let angle = PI * f64::from(k) / f64::from(count + 1);
            let (sin, u) = (libm::sin(angle), libm::cos(angle));
            let above = self.radius_rad * self.radius_rad * sin * sin / 6.0;
            DiscPoint {
                at: self.at(u, 0.0),
                share: (2.0 * sin * sin / f64::from(count + 1)) as f32,
                second: [0.0, above as f32],
                chord: 0.0,
            }
        };
        (1..=count).map(place).collect()
    }

    /// The same with what lies above and below taken as a chord, however high the sun stands.
    pub(in crate::render) fn chords(&self, count: u32) -> Vec<DiscPoint> {
        let mut out = self.line(count);
        for (k, place) in (1..=count).zip(&mut out) {
            let sin = libm::sin(PI * f64::from(k) / f64::from(count + 1));
            place.chord = (self.radius_rad * sin) as f32;
            place.second = [0.0; 2];
        }
        out
    }

    /// Strips of even breadth around `sun` that run at half a right angle to the frame's axes.
    pub(in crate::render) fn askew_lines(
        &self,
        sun: DVec3,
        count: u32,
    ) -> impl Iterator<Item = DiscLine> {
        let frame = Frame::around(sun);
        let radius = libm::tan(self.radius_rad) * std::f64::consts::FRAC_1_SQRT_2;
        let (along, across) = ((frame.x + frame.y) * radius, (frame.x - frame.y) * radius);
        // Area of the unit circle up to a chord.
        let up_to = |x: f64| x * (1.0 - x * x).max(0.0).sqrt() + libm::asin(x);
        (0..count).map(move |i| {
            let [low, high] = [i, i + 1].map(|k| 2.0 * f64::from(k) / f64::from(count) - 1.0);
            let x = 0.5 * (low + high);
            DiscLine {
                middle: sun + across * x,
                way: along * (1.0 - x * x).sqrt(),
                share: (up_to(high) - up_to(low)) / PI,
            }
        })
    }

    fn at(&self, u: f64, v: f64) -> [f32; 3] {
        let at = DVec3::new(u * self.radius_rad, v * self.radius_rad, 1.0).normalize();
        at.as_vec3().to_array()
    }

    /// Share of the disc around `sun` that is seen through a triangle of directions, in closed
    /// form: on the plane across the sun's direction the disc is a circle, the triangle a
    /// polygon.
    pub(in crate::render) fn share(&self, sun: &Frame, corners: &[DVec3; 3]) -> f64 {
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
    fn places_of_the_disc_integrate_its_moments() {
        let disc = Disc::new(0.533);
        let ways = [(disc.rings(), 16, 7)];
        for (places, count, degree) in ways {
            assert_eq!(places.len(), count);
            let mean = |f: &dyn Fn(f64, f64) -> f64| {
                let of = |p: &DiscPoint| {
                    let [u, v, w] = p.at.map(f64::from);
                    f64::from(p.share) * f(u / w / disc.radius_rad, v / w / disc.radius_rad)
                };
                places.iter().map(of).sum::<f64>()
            };
            assert!((mean(&|_, _| 1.0) - 1.0).abs() < 1e-6);
            assert!(mean(&|x, _| x).abs() < 1e-6 && mean(&|x, y| x * y).abs() < 1e-6);
            // Means of even powers over the unit disc: 1/4, 1/8, 5/64, 7/128, ..
            let mut expected = 1.0;
            for half in 1..=degree / 2 {
                expected *= f64::from(2 * half - 1) / f64::from(2 * half + 2);
                let found = mean(&|x, _| x.powi(2 * half));
                assert!((found / expected - 1.0).abs() < 1e-5, "{count}, {half}: {found}");
            }
        }
        for count in [3, 5, 9, 17] {
            let line = disc.line(count);
            let share: f64 = line.iter().map(|p| f64::from(p.share)).sum();
            let squares = |of: &dyn Fn(&DiscPoint) -> f64| {
                line.iter().map(|p| f64::from(p.share) * of(p)).sum::<f64>()
            };
            let radius2 = disc.radius_rad * disc.radius_rad;
            let side = squares(&|p| f64::from(p.at[0]).powi(2)) / radius2;
            // Halves of mean squares, a third of the breadth's above and below.
            let up = squares(&|p| f64::from(p.second[1])) / radius2;
            assert!((share - 1.0).abs() < 1e-6 && (side - 0.25).abs() < 1e-4, "{share} {side}");
            assert!((up - 0.125).abs() < 1e-5, "{up}");
        }
    }
}
