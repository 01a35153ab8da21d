//! Rays against the scene; the only file that knows obvhs.

use glam::Vec3;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;

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
pub struct Bvh {
    tree: CwBvh,
    /// In the order of the tree's primitives, so that a leaf's triangles lie side by side.
    triangles: Vec<obvhs::triangle::Triangle>,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh of {} triangles", self.triangles.len())
    }
}

impl Bvh {
    /// Builds the hierarchy. One thread, so that ties between coincident triangles don't depend
    /// on timing.
    pub fn build(triangles: &[Triangle]) -> Self {
        let source: Vec<_> = triangles
            .iter()
            .map(|t| obvhs::triangle::Triangle {
                v0: t.corners[0].into(),
                v1: t.corners[1].into(),
                v2: t.corners[2].into(),
            })
            .collect();
        let mut took = std::time::Duration::default();
        // Pre-splits would put a triangle into several leaves; without them a leaf's primitive
        // index is the triangle's.
        let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
        let tree = build_cwbvh_from_tris(&source, params, &mut took);
        let ordered = tree.primitive_indices.iter().map(|&i| source[i as usize]).collect();
        Self { tree, triangles: ordered }
    }

    /// The first triangle between `min_m` and `max_m` along the ray.
    pub fn closest(&self, origin: Vec3, direction: Vec3, min_m: f32, max_m: f32) -> Option<RayHit> {
        if self.triangles.is_empty() {
            return None;
        }
        let ray = obvhs::ray::Ray::new(origin.into(), direction.into(), min_m, max_m);
        let mut hit = obvhs::ray::RayHit::none();
        let found =
            self.tree.ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        found.then(|| RayHit {
            distance_m: hit.t,
            triangle: self.tree.primitive_indices[hit.primitive_id as usize],
        })
    }

    /// Whether anything lies between `min_m` and `max_m` along the ray.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, min_m: f32, max_m: f32) -> bool {
        if self.triangles.is_empty() {
            return false;
        }
        let ray = obvhs::ray::Ray::new(origin.into(), direction.into(), min_m, max_m);
        !self.tree.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }
}
