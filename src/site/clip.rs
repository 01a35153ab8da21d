//! Cutting triangles at a polygon that is drawn on the map.
//!
//! The polygon is cut into triangles first, and a triangle of the scene is cut by the three edges
//! of each (Sutherland and Hodgman 1974): what is left of it after all of them lies outside.
//! Polygons with holes or that aren't convex need nothing more.

use glam::{DVec2, DVec3};

use super::triangulate::{MIN_AREA_M2, Triangulator};

/// A polygon drawn on the map: what lies above and below it is told from the rest.
#[derive(Debug)]
pub(super) struct Region {
    /// Its parts, counter-clockwise.
    triangles: Vec<[DVec2; 3]>,
}

impl Region {
    /// `None` where the polygon has no area.
    pub fn new(polygon: &[DVec2]) -> Option<Self> {
        let ring: Vec<DVec3> = polygon.iter().map(|p| p.extend(0.0)).collect();
        let mut cut = Vec::new();
        let plane = Triangulator::default().cut(&[&ring], &mut cut).ok()?;
        let flat = |[a, b, c]: [DVec3; 3]| {
            let [a, b, c] = [a, b, c].map(DVec3::truncate);
            if plane.normal.z < 0.0 { [a, c, b] } else { [a, b, c] }
        };
        Some(Self { triangles: cut.into_iter().map(flat).collect() })
    }

    /// Its parts, counter-clockwise.
    pub fn triangles(&self) -> &[[DVec2; 3]] {
        &self.triangles
    }

    /// Smallest and largest coordinates.
    pub fn extent(&self) -> [DVec2; 2] {
        let points = || self.triangles.iter().flatten().copied();
        [points().fold(DVec2::INFINITY, DVec2::min), points().fold(DVec2::NEG_INFINITY, DVec2::max)]
    }

    /// Cuts triangles at the polygon's edges, seen from above: those within, those without.
    pub fn split(&self, triangles: &[[DVec3; 3]]) -> (Vec<[DVec3; 3]>, Vec<[DVec3; 3]>) {
        let (mut within, mut without) = (Vec::new(), Vec::new());
        let [low, high] = self.extent();
        for triangle in triangles {
            let [min, max] = extent(triangle);
            if min.cmpgt(high).any() || max.cmplt(low).any() {
                without.push(*triangle);
                continue;
            }
            let mut rest = vec![triangle.to_vec()];
            let mut found = Vec::new();
            for part in &self.triangles {
                rest =
                    rest.into_iter().flat_map(|piece| outside(piece, part, &mut found)).collect();
            }
            let area = |pieces: &[Vec<DVec3>]| pieces.iter().map(|p| area_m2(p)).sum::<f64>();
            // What a cut along an edge leaves is rounding.
            if area(&found) < MIN_AREA_M2 {
                without.push(*triangle);
            } else if area(&rest) < MIN_AREA_M2 {
                within.push(*triangle);
            } else {
                found.iter().for_each(|piece| fan(piece, &mut within));
                rest.iter().for_each(|piece| fan(piece, &mut without));
            }
        }
        (within, without)
    }
}

fn extent(points: &[DVec3]) -> [DVec2; 2] {
    let flat = || points.iter().map(|p| p.truncate());
    [flat().fold(DVec2::INFINITY, DVec2::min), flat().fold(DVec2::NEG_INFINITY, DVec2::max)]
}

/// The parts of a convex piece outside a triangle; the part inside is added to `found`.
fn outside(piece: Vec<DVec3>, part: &[DVec2; 3], found: &mut Vec<Vec<DVec3>>) -> Vec<Vec<DVec3>> {
    let [min, max] = extent(&piece);
    let (low, high) = (part[0].min(part[1]).min(part[2]), part[0].max(part[1]).max(part[2]));
    if min.cmpge(high).any() || max.cmple(low).any() {
        return vec![piece];
    }
    let mut out = Vec::new();
    let mut inner = piece;
    for side in 0..3 {
        let (a, b) = (part[side], part[(side + 1) % 3]);
        let left = |p: DVec3| (b - a).perp_dot(p.truncate() - a);
        let beyond = half(&inner, |p| -left(p));
        inner = half(&inner, left);
        if beyond.len() > 2 && area_m2(&beyond) > 0.0 {
            out.push(beyond);
        }
        if inner.len() < 3 {
            return out;
        }
    }
    if area_m2(&inner) > 0.0 {
        found.push(inner);
    }
    out
}

/// The part of a convex polygon where `side` isn't negative (Sutherland and Hodgman 1974).
pub(super) fn half(polygon: &[DVec3], side: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (at_p, at_q) = (side(p), side(q));
        if at_p >= 0.0 {
            out.push(p);
        }
        if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
            out.push(p + (q - p) * (at_p / (at_p - at_q)));
        }
    }
    out
}

fn area_m2(polygon: &[DVec3]) -> f64 {
    let Some((&a, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2).map(|w| (w[0] - a).cross(w[1] - a)).sum::<DVec3>().length() * 0.5
}

/// Cuts a convex polygon into triangles.
pub(super) fn fan(polygon: &[DVec3], out: &mut Vec<[DVec3; 3]>) {
    let Some((&a, rest)) = polygon.split_first() else { return };
    out.extend(rest.windows(2).map(|w| [a, w[0], w[1]]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    /// Slow twin: crossings of a ray.
    fn holds(polygon: &[DVec2], p: DVec2) -> bool {
        (0..polygon.len()).fold(false, |odd, i| {
            let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            let crosses =
                (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x;
            odd != crosses
        })
    }

    fn on(t: &[DVec3; 3], p: DVec2) -> bool {
        holds(&t.map(DVec3::truncate), p)
    }

    #[test]
    fn a_roof_is_cut_along_a_concave_polygon() {
        let plane = |x: f64, y: f64| DVec3::new(x, y, 5.0 + 0.3 * x);
        let roof = [
            [plane(0., 0.), plane(10., 0.), plane(10., 8.)],
            [plane(0., 0.), plane(10., 8.), plane(0., 8.)],
        ];
        // Drawn clockwise, partly beyond the roof.
        let polygon = [[-2., 2.], [4., 6.], [12., 7.], [9., 1.], [5., 4.]].map(DVec2::from);
        let region = Region::new(&polygon).unwrap();
        let (within, without) = region.split(&roof);
        let total = |ts: &[[DVec3; 3]]| ts.iter().map(|t| area_m2(t)).sum::<f64>();
        assert!((total(&within) + total(&without) - total(&roof)).abs() < 1e-9);
        for t in within.iter().chain(&without) {
            let up = (t[1] - t[0]).cross(t[2] - t[0]);
            assert!(
                up.z > 0.0 && up.normalize().dot(DVec3::new(-0.3, 0., 1.).normalize()) > 0.999_999
            );
        }
        let mut random = Stream::new(5, Purpose::Survey, 0);
        for _ in 0..4000 {
            let p = DVec2::new(random.uniform() * 10.0, random.uniform() * 8.0);
            assert_eq!(within.iter().any(|t| on(t, p)), holds(&polygon, p), "{p}");
            assert_eq!(without.iter().any(|t| on(t, p)), !holds(&polygon, p), "{p}");
        }
    }

    #[test]
    fn what_lies_wholly_on_one_side_stays_as_it_is() {
        let t = [[DVec3::ZERO, DVec3::X, DVec3::Y]];
        let square = |a: f64, b: f64| {
            let corners = [[a, a], [b, a], [b, b], [a, b]].map(DVec2::from);
            Region::new(&corners).unwrap()
        };
        assert_eq!(square(-1.0, 2.0).split(&t), (t.to_vec(), vec![]));
        assert_eq!(square(3.0, 4.0).split(&t), (vec![], t.to_vec()));
        // A common edge is no overlap.
        assert_eq!(square(-1.0, 0.0).split(&t).0, vec![] as Vec<[DVec3; 3]>);
        assert!(Region::new(&[DVec2::ZERO, DVec2::X]).is_none());
    }
}
