use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::on_circle;

/// Added to every angle: covers the rounding of all that is computed here, many times over.
const SLACK_RAD: f64 = 1e-6;

/// All directions within an angle of an axis. What a cone is said to hold, it holds surely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector.
    pub axis: DVec3,
    /// From 0 to pi: pi holds every direction.
    pub angle_rad: f64,
    /// Cosine and sine of the angle.
    pub cos: f64,
    /// See `cos`.
    pub sin: f64,
}

impl Cone {
    /// Every direction.
    pub const ALL: Self = Self { axis: DVec3::Z, angle_rad: PI, cos: -1.0, sin: 0.0 };

    /// Directions within `angle_rad` of a unit vector.
    pub fn new(axis: DVec3, angle_rad: f64) -> Self {
        let angle_rad = angle_rad + SLACK_RAD;
        if angle_rad >= PI || angle_rad.is_nan() {
            return Self::ALL;
        }
        Self { axis, angle_rad, cos: libm::cos(angle_rad), sin: libm::sin(angle_rad) }
    }

    /// The same cone about another axis.
    #[must_use]
    pub fn about(&self, axis: DVec3) -> Self {
        if self.angle_rad >= PI { Self::ALL } else { Self { axis, ..*self } }
    }

    /// Smallest and largest cosine to the z axis.
    #[inline]
    pub fn heights(&self) -> (f64, f64) {
        let z = self.axis.z;
        let level = (1.0 - z * z).max(0.0).sqrt();
        let low = if z <= -self.cos { -1.0 } else { z * self.cos - level * self.sin };
        let high = if z >= self.cos { 1.0 } else { z * self.cos + level * self.sin };
        (low, high)
    }

    /// Smallest and largest sine to the z axis among the directions above the horizon.
    pub(super) fn radii(&self) -> (f64, f64) {
        let (low, high) = self.heights();
        let sine = |cos: f64| (1.0 - cos * cos).max(0.0).sqrt();
        (sine(high.max(0.0)), sine(low.max(0.0)))
    }

    /// Azimuth of the axis and how far the cone's directions are from it at most, turns; all
    /// around (a half) if the cone holds the z axis or its opposite.
    pub(super) fn turns(&self) -> (f64, f64) {
        let level = self.axis.x.hypot(self.axis.y);
        let centre = libm::atan2(self.axis.y, self.axis.x) / TAU;
        if self.angle_rad >= FRAC_PI_2 || self.sin >= level {
            return (centre, 0.5);
        }
        (centre, (libm::asin(self.sin / level) / TAU + 1e-9).min(0.5))
    }

    /// Directions whose sine to the z axis and whose azimuth (in turns, upwards) lie in a range,
    /// above the horizon.
    ///
    /// The farthest directions from the axis are corners: the cosine to the axis shrinks with the
    /// difference of azimuths, and at a fixed difference (below a quarter turn) it is `R cos(polar
    /// angle - something)` with a single hump, so smallest at an end.
    pub(super) fn of_patch(sines: [f64; 2], turns: [f64; 2]) -> Self {
        let [from, to] = sines.map(|s| s.clamp(0.0, 1.0));
        let half = 0.5 * (turns[1] - turns[0]);
        if half > 0.1251 {
            return Self::new(DVec3::Z, libm::asin(to));
        }
        let height = |sine: f64| (1.0 - sine * sine).max(0.0).sqrt();
        let middle = 0.5 * (turns[0] + turns[1]);
        let (cos, sin) = on_circle(middle - libm::floor(middle));
        let radius = 0.5 * (from + to);
        let axis = DVec3::new(radius * cos, radius * sin, height(radius));
        let spread = libm::cos(half * TAU);
        let to_corner = |sine: f64| axis.z * height(sine) + radius * sine * spread;
        let least = to_corner(from).min(to_corner(to));
        Self::new(axis, libm::acos(least.clamp(-1.0, 1.0)))
    }

    /// Directions to all points of a box; all of them if the box reaches a right angle.
    ///
    /// A cone of less than a right angle is convex, so it holds the box where it holds its corners.
    pub(super) fn of_box(low: DVec3, high: DVec3) -> Self {
        let Some(axis) = (low + high).try_normalize() else { return Self::ALL };
        let mut least = 1.0_f64;
        for i in 0..8 {
            let pick = |bit: u8, a: f64, b: f64| if i & bit == 0 { a } else { b };
            let corner =
                DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
            let Some(corner) = corner.try_normalize() else { return Self::ALL };
            least = least.min(axis.dot(corner));
        }
        if least <= 1e-6 { Self::ALL } else { Self::new(axis, libm::acos(least.min(1.0))) }
    }

    /// Whether a unit vector lies in it.
    pub fn holds(&self, direction: DVec3) -> bool {
        self.angle_rad >= PI || self.axis.dot(direction) >= self.cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    #[test]
    fn patches_and_boxes_lie_in_their_cones() {
        for i in 0..3000 {
            let mut random = Stream::new(5, Purpose::Survey, i);
            let from = random.uniform();
            let sines = [from, from + (1.0 - from) * random.uniform()];
            let first = 2.0 * random.uniform() - 1.0;
            let turns = [first, first + 0.4 * random.uniform()];
            let patch = Cone::of_patch(sines, turns);
            let low = DVec3::new(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform());
            let size = DVec3::new(random.uniform(), random.uniform(), random.uniform());
            let cuboid = Cone::of_box(low, low + size);
            for _ in 0..60 {
                let sine = sines[0] + (sines[1] - sines[0]) * random.uniform();
                let angle = TAU * (turns[0] + (turns[1] - turns[0]) * random.uniform());
                let height = (1.0 - sine * sine).max(0.0).sqrt();
                let d = DVec3::new(sine * libm::cos(angle), sine * libm::sin(angle), height);
                assert!(patch.holds(d), "{sines:?} {turns:?}: {d}");
                let (least, most) = patch.heights();
                assert!((least..=most).contains(&d.z));
                let (centre, spread) = patch.turns();
                let off = libm::fmod(angle / TAU - centre + 3.5, 1.0) - 0.5;
                assert!(off.abs() <= spread + 1e-9, "{off} of {spread}");
                let part = DVec3::new(random.uniform(), random.uniform(), random.uniform());
                assert!(cuboid.holds((low + size * part).normalize()));
            }
        }
    }
}
