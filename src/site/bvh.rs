//! Rays against the scene; the only file that knows obvhs.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::{Boundable, BvhBuildParams};

use super::Triangle;

/// Where a ray met the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance along the ray, in lengths of its direction (metres for a unit direction).
    pub distance_m: f32,
    /// The triangle, an index into the scene's.
    pub triangle: u32,
}

/// A bounding volume hierarchy over triangles; opaque from both sides.
///
/// What lies closer than 0.1 mm to the origin may be missed (the hierarchy's own epsilon): rays
/// start a little off their surface anyway.
pub struct Bvh {
    tree: CwBvh,
    /// In the order of the tree's primitives, so that a leaf's triangles lie side by side.
    triangles: Vec<[Vec3A; 3]>,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh of {} triangles", self.triangles.len())
    }
}

/// A triangle as the builder sees it: its box a little larger than it is, because the slab test
/// of a ray against a box rounds, and a ray aimed at a box's very edge could miss it.
struct Padded {
    corners: [Vec3A; 3],
    padding_m: f32,
}

impl Boundable for Padded {
    fn aabb(&self) -> Aabb {
        let mut out = Aabb::from_points(&self.corners);
        out.min -= self.padding_m;
        out.max += self.padding_m;
        out
    }
}

/// Levels that the traversal's stack holds (obvhs's own, which is private; beyond it it panics).
const MAX_LEVELS: usize = 31;
/// Levels of a binary tree up to which it is worth converting; its conversion is recursive.
const MAX_BINARY_LEVELS: usize = 2000;
const PER_LEAF: u32 = 3;

/// obvhs's `build_cwbvh`, but for trees that its traversal can't walk: long slivers whose boxes
/// lie in each other (a comb of a thousand teeth) make trees of hundreds of levels. Those scenes
/// get a balanced tree, which is slower to walk and never deep.
fn tree_over(source: &[Padded]) -> CwBvh {
    let how = BvhBuildParams::medium_build();
    let mut binary = PlocBuilder::with_capacity(source.len()).build(
        how.ploc_search_distance,
        source,
        (0..source.len() as u32).collect::<Vec<_>>(),
        how.sort_precision,
        how.search_depth_threshold,
    );
    if binary_levels(&binary) <= MAX_BINARY_LEVELS {
        ReinsertionOptimizer::default().run(&mut binary, how.reinsertion_batch_ratio, None);
        let tree = bvh2_to_cwbvh(&binary, PER_LEAF, true, false);
        if levels(&tree) <= MAX_LEVELS {
            return tree;
        }
    }
    bvh2_to_cwbvh(&balanced(source), PER_LEAF, true, false)
}

fn binary_levels(tree: &Bvh2) -> usize {
    let mut most = 0;
    let mut open = vec![(0_usize, 1)];
    while let Some((i, level)) = open.pop() {
        most = most.max(level);
        if let Some(node) = tree.nodes.get(i).filter(|node| !node.is_leaf()) {
            let first = node.first_index as usize;
            open.extend([(first, level + 1), (first + 1, level + 1)]);
        }
    }
    most
}

fn levels(tree: &CwBvh) -> usize {
    let mut most = 0;
    let mut open = vec![(0_usize, 1)];
    while let Some((i, level)) = open.pop() {
        most = most.max(level);
        let Some(node) = tree.nodes.get(i) else { continue };
        for child in (0..8).filter(|&c| node.child_meta[c] != 0 && !node.is_leaf(c)) {
            open.push((node.child_node_index(child) as usize, level + 1));
        }
    }
    most
}

/// A binary tree that halves the number of triangles at each level, by their middles along the
/// longest axis: as deep as the logarithm of their number.
fn balanced(source: &[Padded]) -> Bvh2 {
    let boxes: Vec<Aabb> = source.iter().map(Boundable::aabb).collect();
    let middles: Vec<Vec3A> = boxes.iter().map(|b| (b.min + b.max) * 0.5).collect();
    let mut order: Vec<u32> = (0..source.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::new(Aabb::empty(), 0, 0)];
    let mut open = vec![(0_usize, 0..source.len())];
    while let Some((i, range)) = open.pop() {
        let part = &mut order[range.clone()];
        let mut bounds = Aabb::empty();
        let mut spread = Aabb::empty();
        for &p in part.iter() {
            bounds.min = bounds.min.min(boxes[p as usize].min);
            bounds.max = bounds.max.max(boxes[p as usize].max);
            spread.min = spread.min.min(middles[p as usize]);
            spread.max = spread.max.max(middles[p as usize]);
        }
        if part.len() <= 1 {
            nodes[i] = Bvh2Node::new(bounds, part.len() as u32, range.start as u32);
            continue;
        }
        let size = spread.max - spread.min;
        let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |&a, &b| {
            let (x, y) = (middles[a as usize][axis], middles[b as usize][axis]);
            x.total_cmp(&y).then(a.cmp(&b))
        });
        let first = nodes.len();
        nodes[i] = Bvh2Node::new(bounds, 0, first as u32);
        nodes.extend([Bvh2Node::new(Aabb::empty(), 0, 0), Bvh2Node::new(Aabb::empty(), 0, 0)]);
        open.push((first, range.start..range.start + half));
        open.push((first + 1, range.start + half..range.end));
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

impl Bvh {
    /// Builds the hierarchy. One thread, so that it doesn't depend on timing.
    pub fn build(triangles: &[Triangle]) -> Self {
        let reach = triangles
            .iter()
            .flat_map(|t| t.corners)
            .fold(0.0_f32, |most, corner| most.max(corner.abs().max_element()));
        let source: Vec<_> = triangles
            .iter()
            .map(|t| Padded { corners: t.corners.map(Vec3A::from), padding_m: reach * 1e-6 })
            .collect();
        let tree = tree_over(&source);
        let ordered = tree.primitive_indices.iter().map(|&i| source[i as usize].corners).collect();
        Self { tree, triangles: ordered }
    }

    /// The first triangle between `min_m` and `max_m` along the ray; of several at the same
    /// distance, the one with the lowest index.
    pub fn closest(&self, origin: Vec3, direction: Vec3, min_m: f32, max_m: f32) -> Option<RayHit> {
        if self.triangles.is_empty() {
            return None;
        }
        let direction = without_minus_zero(direction);
        let sheared = Sheared::new(origin, direction);
        let ray = obvhs::ray::Ray::new(origin.into(), direction.into(), min_m, max_m);
        let mut hit = obvhs::ray::RayHit::none();
        let mut best: Option<RayHit> = None;
        self.tree.ray_traverse(ray, &mut hit, |ray, id| {
            let distance_m = sheared.distance(&self.triangles[id], ray.tmin, ray.tmax);
            if distance_m < f32::INFINITY {
                let triangle = self.tree.primitive_indices[id];
                // The traversal shortens the ray to the best distance so far, so what arrives
                // here is as close as that or closer.
                let closer = best.is_none_or(|b| {
                    distance_m < b.distance_m
                        || (distance_m == b.distance_m && triangle < b.triangle)
                });
                if closer {
                    best = Some(RayHit { distance_m, triangle });
                }
            }
            distance_m
        });
        best
    }

    /// Whether anything lies between `min_m` and `max_m` along the ray.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, min_m: f32, max_m: f32) -> bool {
        if self.triangles.is_empty() {
            return false;
        }
        let direction = without_minus_zero(direction);
        let sheared = Sheared::new(origin, direction);
        let ray = obvhs::ray::Ray::new(origin.into(), direction.into(), min_m, max_m);
        let mut found = false;
        self.tree.ray_traverse_miss(ray, |ray, id| {
            let t = sheared.distance(&self.triangles[id], ray.tmin, ray.tmax);
            if t < f32::INFINITY {
                found = true;
                // Any distance below the ray's end ends the traversal.
                return f32::NEG_INFINITY;
            }
            t
        });
        found
    }
}

/// The traversal takes the side of a direction's zero from its sign in one place and from a
/// comparison in another: a ray along an axis with -0 in it would miss everything.
fn without_minus_zero(direction: Vec3) -> Vec3 {
    direction + Vec3::ZERO
}

/// What the triangle test needs of a ray: a shear that turns the ray into the z axis (Woop,
/// Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", JCGT 2-1). A corner's sheared
/// coordinates don't depend on the triangle that it belongs to, and the sign of an edge function is
/// exact, so no ray passes between two triangles that share an edge or a corner.
struct Sheared {
    origin: Vec3A,
    axes: [usize; 3],
    shear: [f32; 3],
}

impl Sheared {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let [x, y, z] = axes.map(|axis| direction[axis]);
        Self { origin: origin.into(), axes, shear: [x / z, y / z, 1.0 / z] }
    }

    /// Distance to a triangle, infinity for a miss.
    #[inline(always)]
    fn distance(&self, corners: &[Vec3A; 3], min_m: f32, max_m: f32) -> f32 {
        let [kx, ky, kz] = self.axes;
        let flat = corners.map(|corner| {
            let v = (corner - self.origin).to_array();
            [v[kx] - self.shear[0] * v[kz], v[ky] - self.shear[1] * v[kz], v[kz]]
        });
        let [a, b, c] = flat;
        let mut u = c[0] * b[1] - c[1] * b[0];
        let mut v = a[0] * c[1] - a[1] * c[0];
        let mut w = b[0] * a[1] - b[1] * a[0];
        if u == 0.0 || v == 0.0 || w == 0.0 {
            // Products of two f32 are exact in f64, so zero means zero here.
            let edge = |p: [f32; 3], q: [f32; 3]| {
                (f64::from(p[0]) * f64::from(q[1]) - f64::from(p[1]) * f64::from(q[0])) as f32
            };
            (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        }
        let outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        let volume = u + v + w;
        if outside || volume == 0.0 {
            return f32::INFINITY;
        }
        let t = (u * a[2] + v * b[2] + w * c[2]) * self.shear[2] / volume;
        if t >= min_m && t <= max_m { t } else { f32::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    fn point(random: &mut Stream, scale: f32) -> Vec3 {
        let mut one = || (random.uniform() as f32 - 0.5) * scale;
        Vec3::new(one(), one(), one())
    }

    fn soup(count: usize, size: f32, seed: u64) -> Vec<Triangle> {
        (0..count)
            .map(|i| {
                let mut random = Stream::new(seed, Purpose::Survey, i as u64);
                let at = point(&mut random, 20.0);
                let corners = [0; 3].map(|_| at + point(&mut random, size));
                Triangle { corners, face: 0 }
            })
            .collect()
    }

    /// The twin: Möller-Trumbore in f64, all triangles one after another.
    fn linear(triangles: &[Triangle], o: Vec3, d: Vec3, min: f64, max: f64) -> Option<(f64, u32)> {
        let mut best: Option<(f64, u32)> = None;
        for (i, t) in triangles.iter().enumerate() {
            let [a, b, c] = t.corners.map(Vec3::as_dvec3);
            let (o, d) = (o.as_dvec3(), d.as_dvec3());
            let (e1, e2) = (b - a, c - a);
            let p = d.cross(e2);
            let det = e1.dot(p);
            let u = (o - a).dot(p) / det;
            let q = (o - a).cross(e1);
            let v = d.dot(q) / det;
            let distance = e2.dot(q) / det;
            let hit = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance >= min && distance <= max;
            if hit && best.is_none_or(|(t, _)| distance < t) {
                best = Some((distance, i as u32));
            }
        }
        best
    }

    /// Seen first where sensors looked for the wall behind them: `-normal` of an axis holds -0.
    #[test]
    fn a_zero_has_no_sign() {
        let [a, b, c] = [Vec3::new(0.0, -9.0, -9.0), Vec3::new(0.0, 9.0, -9.0), Vec3::Z * 9.0];
        let mut triangles = soup(40, 1.0, 7);
        triangles.iter_mut().for_each(|t| t.corners = t.corners.map(|p| p + Vec3::X * 50.0));
        triangles.push(Triangle { corners: [a, b, c], face: 0 });
        let bvh = Bvh::build(&triangles);
        let origin = Vec3::new(1.0, 0.0, 0.0);
        for direction in [Vec3::NEG_X, -Vec3::X, Vec3::new(-1.0, 0.0, -0.0)] {
            let found = bvh.closest(origin, direction, 0.0, 2.0);
            assert_eq!(found.map(|f| f.triangle), Some(40), "{direction:?}");
            assert!(bvh.occluded(origin, direction, 0.0, 2.0), "{direction:?}");
        }
    }

    #[test]
    fn finds_what_a_linear_search_finds_within_its_limits() {
        let triangles = soup(700, 3.0, 5);
        let bvh = Bvh::build(&triangles);
        let (mut hits, mut differ) = (0, 0);
        for i in 0..3000 {
            let mut random = Stream::new(6, Purpose::Survey, i);
            let origin = point(&mut random, 24.0);
            let direction = point(&mut random, 1.0).normalize();
            for (min, max) in [(0.001, f32::INFINITY), (0.001, 4.0), (3.0, 9.0)] {
                let fast = bvh.closest(origin, direction, min, max);
                let slow = linear(&triangles, origin, direction, min.into(), max.into());
                assert_eq!(fast.is_some(), bvh.occluded(origin, direction, min, max), "ray {i}");
                if let Some(hit) = fast {
                    assert!(hit.distance_m >= min && hit.distance_m <= max);
                }
                hits += usize::from(slow.is_some());
                let same = match (fast, slow) {
                    (Some(f), Some((t, triangle))) => {
                        f.triangle == triangle && (f64::from(f.distance_m) - t).abs() < 1e-4
                    }
                    (None, None) => true,
                    _ => false,
                };
                // Rays through an edge within f32's rounding are the only ones that may differ.
                differ += usize::from(!same);
            }
        }
        assert!(hits > 1200, "{hits} hits");
        assert!(differ <= 2, "{differ} of 9000 differ");
    }

    #[test]
    fn no_ray_slips_through_a_closed_surface() {
        // A bumpy sphere of 2 x 24 x 48 triangles, rays aimed exactly at its edges and corners.
        let at = |i: usize, j: usize| {
            let (theta, phi) = (i as f64 / 24.0 * std::f64::consts::PI, (j % 48) as f64 / 24.0);
            let phi = phi * std::f64::consts::PI;
            let r = 10.0 + 0.3 * ((i * 7 + (j % 48) * 5) % 11) as f64 * libm::sin(theta);
            let v = glam::DVec3::new(
                libm::sin(theta) * libm::cos(phi),
                libm::sin(theta) * libm::sin(phi),
                libm::cos(theta),
            );
            // The poles are one point each.
            if i == 0 || i == 24 {
                Vec3::new(0.0, 0.0, if i == 0 { 10.0 } else { -10.0 })
            } else {
                (v * r).as_vec3()
            }
        };
        let mut triangles = Vec::new();
        for i in 0..24 {
            for j in 0..48 {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                triangles.push(Triangle { corners: [a, b, c], face: 0 });
                triangles.push(Triangle { corners: [a, c, d], face: 0 });
            }
        }
        let bvh = Bvh::build(&triangles);
        let mut leaks = 0;
        for i in 0..40_000u64 {
            let mut random = Stream::new(9, Purpose::Survey, i);
            let origin = point(&mut random, 8.0);
            let triangle = &triangles[(random.uniform() * triangles.len() as f64) as usize];
            let along = if i % 8 == 0 { 0.0 } else { random.uniform() as f32 };
            let target = triangle.corners[0].lerp(triangle.corners[1], along);
            let direction = (target - origin).normalize();
            leaks += usize::from(!bvh.occluded(origin, direction, 0.0, f32::INFINITY));
        }
        assert_eq!(leaks, 0, "of 40,000 rays");
    }

    #[test]
    fn a_balanced_tree_finds_what_the_other_finds() {
        let triangles = soup(700, 3.0, 8);
        let source: Vec<Padded> = triangles
            .iter()
            .map(|t| Padded { corners: t.corners.map(Vec3A::from), padding_m: 1e-5 })
            .collect();
        let tree = bvh2_to_cwbvh(&balanced(&source), PER_LEAF, true, false);
        tree.validate(&source, false);
        let ordered = tree.primitive_indices.iter().map(|&i| source[i as usize].corners).collect();
        let slow = Bvh { tree, triangles: ordered };
        let fast = Bvh::build(&triangles);
        for i in 0..2000 {
            let mut random = Stream::new(3, Purpose::Survey, i);
            let origin = point(&mut random, 24.0);
            let direction = point(&mut random, 1.0).normalize();
            let ask = |bvh: &Bvh| bvh.closest(origin, direction, 0.001, f32::INFINITY);
            assert_eq!(ask(&fast), ask(&slow), "ray {i}");
        }
    }

    #[test]
    fn trees_stay_walkable_whatever_the_triangles() {
        // Teeth of a comb, cut like a polygon's: every box holds the one before. The library's tree
        // would have 144 levels, its traversal a stack of 32.
        let triangles: Vec<Triangle> = (0..2000)
            .map(|i| {
                let x = i as f32 * 0.01;
                let corners =
                    [Vec3::ZERO, Vec3::new(x + 0.01, 900.0, 0.0), Vec3::new(x, 1.0 - x, 0.0)];
                Triangle { corners, face: 0 }
            })
            .collect();
        let bvh = Bvh::build(&triangles);
        assert!(levels(&bvh.tree) <= MAX_LEVELS);
        let down = |x: f32, y: f32| {
            bvh.closest(Vec3::new(x, y, 5.0), Vec3::NEG_Z, 0.0, 9.0).map(|hit| hit.distance_m)
        };
        assert!((down(0.5, 100.0).expect("the teeth are there") - 5.0).abs() < 1e-4);
        assert_eq!(down(-0.5, 100.0), None);
    }

    #[test]
    fn degenerate_and_missing_triangles_are_never_hit() {
        let flat = Triangle { corners: [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], face: 0 };
        let bvh = Bvh::build(&[flat]);
        assert_eq!(bvh.closest(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z, 0.0, 9.0), None);
        let bvh = Bvh::build(&[]);
        assert_eq!(bvh.closest(Vec3::ZERO, Vec3::X, 0.0, f32::INFINITY), None);
        assert!(!bvh.occluded(Vec3::ZERO, Vec3::X, 0.0, f32::INFINITY));
    }

    #[test]
    fn the_lowest_of_coincident_triangles_wins() {
        let t = Triangle { corners: [Vec3::ZERO, Vec3::X, Vec3::Y], face: 0 };
        let bvh = Bvh::build(&[t; 9]);
        for down in [true, false] {
            let (z, d) = if down { (1.0, Vec3::NEG_Z) } else { (-1.0, Vec3::Z) };
            let hit = bvh.closest(Vec3::new(0.2, 0.2, z), d, 0.0, 9.0).expect("hit");
            assert_eq!((hit.triangle, hit.distance_m), (0, 1.0));
        }
    }
}
