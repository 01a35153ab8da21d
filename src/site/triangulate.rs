//! Cutting polygons with holes into triangles, and telling what is no polygon.
//!
//! Polygons of city models are flat to centimetres, repeat points, touch themselves and have
//! slivers. They are projected onto their plane (Newell's normal) and cut by ear clipping
//! (`earcut`); the areas before and after show where edges cross.

use earcut::Earcut;
use glam::{DVec2, DVec3};

use crate::base::Frame;

/// Smallest area of a face, m2: a square millimetre. City models hold faces whose points fall
/// together or lie on a line after rounding to millimetres.
pub(super) const MIN_AREA_M2: f64 = 1e-6;
/// Points closer than this are one, m.
const SAME_POINT_M: f64 = 1e-6;
/// Triangles flatter than this whose rounded normal points elsewhere are left out, m.
const SLIVER_M: f64 = 1e-3;

/// What a polygon is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    /// Unit normal (Newell's), towards which the outer ring runs counter-clockwise.
    pub normal: DVec3,
    /// Area less its holes, m2.
    pub area_m2: f64,
    /// Largest distance of a point from the plane, m.
    pub warp_m: f64,
    /// Area of the triangles in the plane, m2; another than the polygon's where it crosses itself.
    pub covered_m2: f64,
}

/// Why a polygon gives no triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flaw {
    /// Fewer than three different points.
    Points,
    /// No area.
    Area,
}

/// Cuts polygons with holes into triangles; keeps its scratch memory.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Option<Earcut<f64>>,
    points: Vec<DVec3>,
    flat: Vec<[f64; 2]>,
    holes: Vec<u32>,
    cut: Vec<u32>,
}

impl Triangulator {
    /// Appends the triangles of a polygon, counter-clockwise about its normal. `rings`: the outer
    /// ring and holes, whose sense doesn't matter. A point that repeats its neighbour counts once;
    /// holes without area are ignored.
    pub fn cut(&mut self, rings: &[&[DVec3]], out: &mut Vec<[DVec3; 3]>) -> Result<Plane, Flaw> {
        self.points.clear();
        self.holes.clear();
        let Some(outer) = rings.first() else { return Err(Flaw::Points) };
        push_distinct(&mut self.points, outer);
        if self.points.len() < 3 {
            return Err(Flaw::Points);
        }
        let vector = area_vector(&self.points);
        let mut area_m2 = vector.length();
        if area_m2 < MIN_AREA_M2 {
            return Err(Flaw::Area);
        }
        let normal = vector / area_m2;
        for hole in &rings[1..] {
            let first = self.points.len();
            push_distinct(&mut self.points, hole);
            let hole_m2 = area_vector(&self.points[first..]).dot(normal).abs();
            if self.points.len() - first < 3 || hole_m2 < MIN_AREA_M2 {
                self.points.truncate(first);
            } else {
                self.holes.push(first as u32);
                area_m2 -= hole_m2;
            }
        }
        if area_m2 < MIN_AREA_M2 {
            return Err(Flaw::Area);
        }
        self.project(normal);
        self.indices();
        let mut plane = Plane { normal, area_m2, warp_m: self.warp(normal), covered_m2: 0.0 };
        self.emit(&mut plane, out);
        Ok(plane)
    }

    fn project(&mut self, normal: DVec3) {
        let frame = Frame::around(normal);
        let base = self.points[0];
        self.flat.clear();
        self.flat.extend(self.points.iter().map(|&p| {
            let local = frame.local_from_world(p - base);
            [local.x, local.y]
        }));
    }

    fn warp(&self, normal: DVec3) -> f64 {
        let middle = self.points.iter().sum::<DVec3>() / self.points.len() as f64;
        self.points.iter().map(|&p| (p - middle).dot(normal).abs()).fold(0.0, f64::max)
    }

    fn indices(&mut self) {
        self.cut.clear();
        let n = self.flat.len();
        if n == 3 {
            self.cut.extend([0, 1, 2]);
        } else if n == 4 && self.holes.is_empty() && self.is_convex() {
            self.cut.extend([0, 1, 2, 0, 2, 3]);
        } else {
            let earcut = self.earcut.get_or_insert_with(Earcut::new);
            earcut.earcut_slice(&self.flat, &self.holes, &mut self.cut);
        }
    }

    fn is_convex(&self) -> bool {
        let n = self.flat.len();
        (0..n).all(|i| self.doubled(i, (i + 1) % n, (i + 2) % n) > 1e-9)
    }

    /// Twice the signed area of a triangle in the plane, m2.
    fn doubled(&self, a: usize, b: usize, c: usize) -> f64 {
        let [a, b, c] = [a, b, c].map(|i| DVec2::from(self.flat[i]));
        (b - a).perp_dot(c - a)
    }

    fn emit(&self, plane: &mut Plane, out: &mut Vec<[DVec3; 3]>) {
        for corner in self.cut.chunks_exact(3) {
            let [a, mut b, mut c] = [corner[0], corner[1], corner[2]].map(|i| i as usize);
            let doubled = self.doubled(a, b, c);
            if doubled < 0.0 {
                (b, c) = (c, b);
            }
            plane.covered_m2 += 0.5 * doubled.abs();
            let triangle = [a, b, c].map(|i| self.points[i]);
            if keeps_its_normal(&triangle, plane.normal) {
                out.push(triangle);
            }
        }
    }
}

/// Whether a triangle still faces where its polygon does after rounding to f32. Slivers may not;
/// light that meets one would leave in any direction, so they are left out: a gap of less than a
/// millimetre.
pub(super) fn keeps_its_normal(triangle: &[DVec3; 3], normal: DVec3) -> bool {
    let [a, b, c] = triangle.map(|p| p.as_vec3());
    let area = (b - a).cross(c - a);
    let doubled = area.length();
    if doubled == 0.0 || !doubled.is_finite() {
        return false;
    }
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    f64::from(doubled / longest) > SLIVER_M
        || f64::from(doubled) * 0.9 < area.as_dvec3().dot(normal)
}

fn push_distinct(points: &mut Vec<DVec3>, ring: &[DVec3]) {
    let first = points.len();
    for &p in ring {
        if points[first..].last().is_none_or(|q| q.distance(p) > SAME_POINT_M) {
            points.push(p);
        }
    }
    while points.len() > first + 1
        && points[points.len() - 1].distance(points[first]) <= SAME_POINT_M
    {
        points.pop();
    }
}

/// Newell's method about the ring's first point: normal times area, m2.
fn area_vector(ring: &[DVec3]) -> DVec3 {
    let Some(&base) = ring.first() else { return DVec3::ZERO };
    ring.windows(2).map(|w| (w[0] - base).cross(w[1] - base)).sum::<DVec3>() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(points: &[[f64; 3]]) -> Vec<DVec3> {
        points.iter().copied().map(DVec3::from).collect()
    }

    fn cut(rings: &[&[DVec3]]) -> (Result<Plane, Flaw>, Vec<[DVec3; 3]>) {
        let mut out = Vec::new();
        let plane = Triangulator::default().cut(rings, &mut out);
        (plane, out)
    }

    fn area(triangles: &[[DVec3; 3]]) -> DVec3 {
        triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a) * 0.5).sum()
    }

    /// Slow twin: whether a point lies in a polygon by counting crossings.
    fn inside(p: DVec2, rings: &[&[DVec3]]) -> bool {
        let mut odd = false;
        for ring in rings {
            for (i, a) in ring.iter().enumerate() {
                let b = ring[(i + 1) % ring.len()];
                if (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x
                {
                    odd = !odd;
                }
            }
        }
        odd
    }

    fn covered(p: DVec2, triangles: &[[DVec3; 3]]) -> bool {
        triangles.iter().any(|t| inside(p, &[&t[..]]))
    }

    #[test]
    fn concave_polygons_and_holes_cover_just_their_inside() {
        let outer = ring(&[[0., 0., 1.], [8., 0., 1.], [8., 6., 1.], [4., 2., 1.], [0., 6., 1.]]);
        // A hole that runs in the same sense as the outer ring, as some exporters write it.
        let hole = ring(&[[0.5, 0.5, 1.], [1.5, 0.5, 1.], [1.5, 2.5, 1.], [0.5, 2.5, 1.]]);
        let rings: [&[DVec3]; 2] = [&outer, &hole];
        let (plane, triangles) = cut(&rings);
        let plane = plane.unwrap();
        assert!((plane.normal - DVec3::Z).length() < 1e-12);
        assert!((plane.area_m2 - 30.0).abs() < 1e-12);
        assert!((area(&triangles) - DVec3::Z * 30.0).length() < 1e-9);
        let mut stream = crate::base::Stream::new(1, crate::base::Purpose::Survey, 0);
        for _ in 0..4000 {
            let p = DVec2::new(stream.uniform() * 9.0 - 0.5, stream.uniform() * 7.0 - 0.5);
            assert_eq!(inside(p, &rings), covered(p, &triangles), "{p}");
        }
    }

    #[test]
    fn a_hole_joined_to_the_outer_ring_by_a_seam() {
        // Radiance's way to write a hole: the edges of the seam coincide.
        let keyhole = ring(&[
            [0., 0., 0.],
            [10., 0., 0.],
            [10., 10., 0.],
            [0., 10., 0.],
            [0., 0., 0.],
            [2., 2., 0.],
            [2., 8., 0.],
            [8., 8., 0.],
            [8., 2., 0.],
            [2., 2., 0.],
        ]);
        let (plane, triangles) = cut(&[&keyhole]);
        assert!((plane.unwrap().area_m2 - 64.0).abs() < 1e-9);
        assert!((area(&triangles) - DVec3::Z * 64.0).length() < 1e-9);
        assert!(!covered(DVec2::new(5.0, 5.1), &triangles));
        assert!(covered(DVec2::new(1.0, 5.1), &triangles));
    }

    #[test]
    fn walls_keep_their_front() {
        let wall = ring(&[[0., 0., 0.], [0., 4., 0.], [0., 4., 3.], [0., 2., 5.], [0., 0., 3.]]);
        let (plane, triangles) = cut(&[&wall]);
        assert!((plane.unwrap().normal - DVec3::X).length() < 1e-12);
        for [a, b, c] in &triangles {
            assert!((*b - *a).cross(*c - *a).x > 0.0);
        }
    }

    #[test]
    fn flaws_are_named() {
        let p = [1., 2., 3.];
        assert_eq!(cut(&[]).0, Err(Flaw::Points));
        assert_eq!(cut(&[&ring(&[p, p, [4., 4., 4.], p])]).0, Err(Flaw::Points));
        assert_eq!(
            cut(&[&ring(&[[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [5., 0., 0.]])]).0,
            Err(Flaw::Area)
        );
    }

    #[test]
    fn a_bow_tie_shows_in_the_covered_area() {
        let tie = ring(&[[0., 0., 0.], [4., 4., 0.], [4., 0., 0.], [0., 5., 0.]]);
        let plane = cut(&[&tie]).0.unwrap();
        assert!((plane.covered_m2 - plane.area_m2).abs() > 0.1, "{plane:?}");
    }
}
