use glam::{DVec3, Vec3};

use crate::base::{Purpose, Stream};
use crate::site::Site;

/// Points on the PV that are asked for visibility; enough for roofs of some ten metres to be
/// covered every two metres.
const POINTS: usize = 64;
/// Rays start this far before the surface, m: beyond the rounding of f32 in scenes of kilometres,
/// below anything that a picture shows.
pub(in crate::render) const LIFT_M: f32 = 2e-3;

/// What a point sees of the PV, by the 64 points that are tested on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PvInView {
    /// Distance to the nearest visible one, m.
    pub nearest_m: f64,
    /// Largest angle between two visible ones, degrees.
    pub widest_deg: f64,
    /// Solid angle of the visible share of the PV, sr.
    pub solid_angle_sr: f64,
}

/// Points spread over the PV by area; what of the PV a place sees is judged by them.
pub(in crate::render) struct PvVisibility {
    points: Vec<PvPoint>,
    /// Of all PV, m2.
    area_m2: f64,
}

struct PvPoint {
    position: Vec3,
    normal: Vec3,
    two_sided: bool,
}

impl PvVisibility {
    /// Spreads the points: stratified over the area, and by the R2 sequence (Roberts 2018, "The
    /// unreasonable effectiveness of quasirandom sequences") inside the triangles.
    pub(in crate::render) fn spread(site: &Site, seed: u64) -> Self {
        let parts: Vec<(usize, u32)> = site
            .pv
            .iter()
            .enumerate()
            .flat_map(|(s, pv)| pv.triangles.iter().map(move |&t| (s, t)))
            .collect();
        let area = |t: u32| f64::from(site.triangles[t as usize].area_m2());
        let total: f64 = parts.iter().map(|&(_, t)| area(t)).sum();
        let mut points = Vec::new();
        if total <= 0.0 {
            return Self { points, area_m2: 0.0 };
        }
        let mut random = Stream::new(seed, Purpose::Picture, 0);
        let start = [random.uniform(), random.uniform()];
        let mut part = 0;
        let mut before = 0.0;
        for i in 0..POINTS {
            let at = (i as f64 + 0.5) / POINTS as f64 * total;
            while part + 1 < parts.len() && before + area(parts[part].1) < at {
                before += area(parts[part].1);
                part += 1;
            }
            let (surface, triangle) = parts[part];
            let mut u = (start[0] + i as f64 * 0.754_877_666_246_692_7).fract() as f32;
            let mut v = (start[1] + i as f64 * 0.569_840_290_998_053_2).fract() as f32;
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = site.triangles[triangle as usize].corners;
            let pv = &site.pv[surface];
            points.push(PvPoint {
                position: a + (b - a) * u + (c - a) * v,
                normal: pv.normal.as_vec3(),
                two_sided: pv.two_sided,
            });
        }
        Self { points, area_m2: total }
    }

    /// Distance from a place on a surface (its normal turned to the side that is looked at) to the
    /// nearest visible point on a shining side of the PV, m.
    pub(in crate::render) fn nearest_m(
        &self,
        site: &Site,
        place: Vec3,
        normal: Vec3,
    ) -> Option<f32> {
        let mut order = [(0.0f32, 0u8); POINTS];
        let mut count = 0;
        for (i, p) in self.points.iter().enumerate() {
            let way = p.position - place;
            let front = -way.dot(p.normal);
            let shines = if p.two_sided { front != 0.0 } else { front > 0.0 };
            if shines && way.dot(normal) > 0.0 {
                order[count] = (way.length(), i as u8);
                count += 1;
            }
        }
        let order = &mut order[..count];
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let from = place + normal * LIFT_M;
        order.iter().find(|(_, i)| self.visible(site, from, usize::from(*i))).map(|&(d, _)| d)
    }

    /// What a place sees of the PV on the side of `normal`: distance, angle, solid angle. `None`
    /// where none of the points is visible.
    pub(in crate::render) fn in_view(
        &self,
        site: &Site,
        place: Vec3,
        normal: Vec3,
    ) -> Option<PvInView> {
        let from = place + normal * LIFT_M;
        let mut ways: Vec<DVec3> = Vec::new();
        let mut seen = PvInView { nearest_m: f64::INFINITY, ..PvInView::default() };
        for (i, p) in self.points.iter().enumerate() {
            let way = p.position - place;
            let front = -way.dot(p.normal);
            let shines = if p.two_sided { front != 0.0 } else { front > 0.0 };
            if !shines || way.dot(normal) <= 0.0 || !self.visible(site, from, i) {
                continue;
            }
            let way = way.as_dvec3();
            let distance_m = way.length();
            let cos = f64::from(front.abs()) / distance_m;
            seen.nearest_m = seen.nearest_m.min(distance_m);
            seen.solid_angle_sr += self.area_m2 / POINTS as f64 * cos / (distance_m * distance_m);
            ways.push(way / distance_m);
        }
        let mut smallest_cos = 1.0f64;
        for (i, a) in ways.iter().enumerate() {
            for b in &ways[i + 1..] {
                smallest_cos = smallest_cos.min(a.dot(*b));
            }
        }
        seen.widest_deg = libm::acos(smallest_cos.clamp(-1.0, 1.0)).to_degrees();
        (!ways.is_empty()).then_some(seen)
    }

    fn visible(&self, site: &Site, from: Vec3, point: usize) -> bool {
        let p = &self.points[point];
        let side = if (from - p.position).dot(p.normal) < 0.0 { -p.normal } else { p.normal };
        let way = p.position + side * LIFT_M - from;
        let length = way.length();
        length <= 2.0 * LIFT_M || !site.bvh.occluded(from, way / length, 0.0, length)
    }
}

const _: () = assert!(POINTS <= u8::MAX as usize);
