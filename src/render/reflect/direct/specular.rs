use std::ops::Range;

use glam::DVec3;

use super::receiver::ReceiverPoint;
use super::suns::Suns;
use super::year::DirectYear;
use crate::base::Frame;
use crate::base::MIN_COS;
use crate::bsdf::Bsdf;
use crate::render::reflect::disc::{Disc, DiscPoint};
use crate::render::reflect::facet::Facet;
use crate::site::Site;

/// What an ideal mirror throws at one receiver: the receiver's mirror image behind the plane looks
/// at the sun through the facet; the share of the disc that it sees there is what arrives.
pub(super) struct Specular<'a> {
    pub site: &'a Site,
    pub facet: &'a Facet,
    pub bsdf: &'a Bsdf,
    pub disc: &'a Disc,
    /// Points of the disc in a sun's frame.
    pub points: &'a [DiscPoint],
    pub receiver: &'a ReceiverPoint,
    pub max_path_m: f64,
    pub sun_visibility: bool,
}

impl Specular<'_> {
    /// Adds one triangle of the facet.
    pub(super) fn add(
        &self,
        triangle: &[DVec3; 3],
        suns: &Suns,
        asked: Range<usize>,
        year: &mut DirectYear,
    ) {
        let normal = self.facet.frame.z;
        let before_m = self.facet.before_m(self.receiver.position);
        let image = self.receiver.position - normal * (2.0 * before_m);
        let corners = triangle.map(|c| c - image);
        let middle = (corners[0] + corners[1] + corners[2]).normalize();
        let angle = |c: &DVec3| libm::acos((c.dot(middle) / c.length()).clamp(-1.0, 1.0));
        // A triangle of directions lies in the cone around its corners.
        let reach = corners.iter().map(angle).fold(0.0, f64::max) + 1.01 * self.disc.radius_rad;
        let least = if reach < std::f64::consts::PI { libm::cos(reach) } else { -1.0 };
        let local = self.facet.frame.local_from_world(middle);
        for i in asked {
            let local_sun = suns.direction[i];
            if local_sun.dot(local) < least {
                continue;
            }
            let sun = suns.in_world(self.facet, i);
            let share = self.disc.share(&sun, &corners);
            let away_m = before_m / local_sun.z;
            // Where the reflected sun stands, seen from the receiver.
            let towards = sun.z - normal * (2.0 * local_sun.z);
            let cos = self.receiver.normal.dot(towards);
            if share <= 0.0 || cos <= 0.0 || away_m > self.max_path_m {
                continue;
            }
            let month = usize::from(suns.month[i]);
            let (free, crossed) = self.free(&sun, &corners, image, month);
            let strength = f64::from(suns.strength[i]);
            let beam = strength * self.bsdf.mirrored(local_sun) * share;
            let facing = cos / cos.max(f64::from(MIN_COS));
            // A border through the disc is known to one of its points.
            let doubt = if crossed { beam * cos / 16.0 } else { 0.0 };
            year.add(suns.step[i], beam * free * cos, beam * free * facing, doubt);
        }
    }

    /// Share of the light of the disc's points in the triangle that passes on both sides, and
    /// whether it isn't the same for all.
    fn free(&self, sun: &Frame, corners: &[DVec3; 3], image: DVec3, month: usize) -> (f64, bool) {
        let before_m = self.facet.before_m(self.receiver.position);
        let edges = [0, 1, 2].map(|i| corners[i].cross(corners[(i + 1) % 3]));
        let (mut inside, mut free) = (0.0, 0.0);
        let (mut least, mut most) = (1.0_f64, 0.0_f64);
        for [u, v, w] in self.points.iter().map(|p| p.at.map(f64::from)) {
            let at = sun.x * u + sun.y * v + sun.z * w;
            let cos = self.facet.frame.z.dot(at);
            if cos <= 0.0 || edges.iter().any(|e| e.dot(at) < 0.0) {
                continue;
            }
            inside += 1.0;
            let start = self.facet.lifted(image + at * (before_m / cos));
            let way = self.receiver.ray_end - start;
            let length = way.length();
            let passes = |way: DVec3, most: f64| {
                let (from, way) = (start.as_vec3(), way.as_vec3());
                f64::from(self.site.transmittance(from, way, most as f32, month))
            };
            let mut share = passes(way / length, (length - 1e-3).max(0.0));
            if self.sun_visibility && share > 0.0 {
                share *= passes(at, f64::INFINITY);
            }
            free += share;
            (least, most) = (least.min(share), most.max(share));
        }
        // A sliver of the disc between its points: taken as free.
        if inside > 0.0 { (free / inside, least < most) } else { (1.0, false) }
    }
}
