use glam::DVec3;

use crate::base::Frame;
use crate::bsdf::{Cone, on_circle};

/// The sun's disc: a cone of directions around the sun's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    /// 1 - cos of the disc's radius.
    versine: f64,
    cos: f64,
    sin: f64,
    radius_rad: f64,
}

impl Disc {
    pub(super) fn new(diameter_deg: f64) -> Self {
        let radius = (0.5 * diameter_deg).to_radians();
        let half = libm::sin(0.5 * radius);
        Self {
            versine: 2.0 * half * half,
            cos: libm::cos(radius),
            sin: libm::sin(radius),
            radius_rad: radius,
        }
    }

    /// The disc around a centre.
    pub(super) fn cone(&self, centre: DVec3) -> Cone {
        Cone::new(centre, self.radius_rad)
    }

    /// A direction of the disc, uniform in solid angle, from two uniform numbers.
    #[inline]
    pub(super) fn direction(&self, sun: &Frame, u: f64, v: f64) -> DVec3 {
        let height = u * self.versine;
        let radius = (height * (2.0 - height)).sqrt();
        let (cos, sin) = on_circle(v);
        sun.x * (radius * cos) + sun.y * (radius * sin) + sun.z * (1.0 - height)
    }

    /// Smallest and largest cosine to a normal over the disc, from the centre's.
    #[inline]
    pub(super) fn cosines(&self, centre: f64) -> (f64, f64) {
        let sin = (1.0 - centre * centre).max(0.0).sqrt();
        let low = centre * self.cos - sin * self.sin;
        let high = if centre >= self.cos { 1.0 } else { centre * self.cos + sin * self.sin };
        (low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    #[test]
    fn fills_the_disc_evenly_and_stays_within_its_cosines() {
        let disc = Disc::new(0.533);
        let sun = DVec3::new(0.5, -0.7, 0.2).normalize();
        let frame = Frame::around(sun);
        let normal = DVec3::new(0.1, 0.3, 1.0).normalize();
        let (low, high) = disc.cosines(normal.dot(sun));
        let mut inner = 0;
        for i in 0..20_000 {
            let mut random = Stream::new(1, Purpose::Survey, i);
            let d = disc.direction(&frame, random.uniform(), random.uniform());
            assert!((d.length() - 1.0).abs() < 1e-12);
            let angle = libm::asin(d.cross(sun).length()).to_degrees();
            assert!(angle <= 0.2665 + 1e-9, "{angle}");
            inner += usize::from(angle < 0.2665 * std::f64::consts::FRAC_1_SQRT_2);
            let cos = normal.dot(d);
            assert!(cos >= low - 1e-15 && cos <= high + 1e-15);
        }
        // Binomial, p = 1/2: 4 sigma are 283.
        assert!((inner as i64 - 10_000).abs() < 283, "{inner} of 20,000 in half the area");
    }
}
