use glam::{DVec3, Vec3};

use crate::base::Frame;
use crate::site::Site;

/// One side of a PV surface that shines: a plane with triangles in it.
#[derive(Clone, Debug)]
pub(in crate::render) struct Facet {
    /// The PV surface's number.
    pub surface: u16,
    /// Its frame; z is the normal of this side.
    pub frame: Frame,
    /// Height of its plane along the normal, m.
    pub height_m: f64,
    /// Height along the normal from which rays start, m: above all corners, however uneven they
    /// are, so that it never shades itself.
    pub start_m: f64,
    /// Corners, metres, counter-clockwise seen from this side.
    pub triangles: Vec<[DVec3; 3]>,
}

/// Cosine below which a ray grazes: it would begin some decimetres off.
const GRAZING: f64 = 0.01;
/// Rays start this far above a facet at least, m; or 30 times the rounding of f32 positions.
fn lift_m(site: &Site) -> f64 {
    if site.bounds.is_empty() {
        return 1e-3;
    }
    let reach = site.bounds.min.abs().max(site.bounds.max.abs()).max_element();
    (4e-6 * f64::from(reach)).max(1e-3)
}

/// All sides of the PV that shine, by surface, front before back. Surfaces without area are left
/// out.
pub(in crate::render) fn facets(site: &Site) -> Vec<Facet> {
    let lift = lift_m(site);
    let mut out = Vec::new();
    for (number, pv) in site.pv.iter().enumerate() {
        let Ok(surface) = u16::try_from(number) else { break };
        let usable = pv.area_m2 > 0.0 && pv.normal.is_finite() && pv.normal.length_squared() > 0.5;
        if !usable {
            continue;
        }
        let sides = if pv.two_sided { 2 } else { 1 };
        for normal in [pv.normal, -pv.normal].into_iter().take(sides) {
            let normal = normal.normalize();
            let mut triangles: Vec<[DVec3; 3]> = Vec::new();
            for &t in &pv.triangles {
                let [a, b, c] = site.triangles[t as usize].corners.map(Vec3::as_dvec3);
                let turn = (b - a).cross(c - a).dot(normal);
                if turn != 0.0 {
                    triangles.push(if turn > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
            let heights = || triangles.iter().flatten().map(|c| normal.dot(*c));
            let count = heights().count();
            if count == 0 {
                continue;
            }
            out.push(Facet {
                surface,
                frame: Frame::around(normal),
                height_m: heights().sum::<f64>() / count as f64,
                start_m: heights().fold(f64::NEG_INFINITY, f64::max) + lift,
                triangles,
            });
        }
    }
    out
}

impl Facet {
    /// `point` moved along the normal to where rays start.
    #[inline]
    pub(in crate::render) fn lifted(&self, point: DVec3) -> DVec3 {
        point + self.frame.z * (self.start_m - self.frame.z.dot(point))
    }

    /// Where a ray from a place of the PV begins: on its way, but above all of this side's corners, so
    /// that what it meets is what stands in the way of that very place. Where it grazes the PV, see
    /// [`Self::lifted`]. `way` is a unit vector.
    #[inline]
    pub(super) fn ray_start(&self, place: DVec3, way: DVec3) -> DVec3 {
        let (up_m, cos) = (self.start_m - self.frame.z.dot(place), self.frame.z.dot(way));
        if cos < GRAZING { self.lifted(place) } else { place + way * (up_m / cos) }
    }

    /// How far a place lies before this side, m; negative behind it.
    #[inline]
    pub(in crate::render) fn before_m(&self, place: DVec3) -> f64 {
        self.frame.z.dot(place) - self.height_m
    }
}
