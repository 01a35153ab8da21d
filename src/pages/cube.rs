//! The cube that the octree divides, and the Morton codes of its cells.

use glam::{DVec3, Vec3};

use crate::base::Aabb;
use crate::base::morton::{LEVELS, deinterleave, interleave};

/// The cube that the octree divides.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Cube {
    /// Smallest corner, metres.
    pub origin: Vec3,
    /// Edge length, metres; above 0.
    pub edge_m: f32,
}

impl Cube {
    /// The cube around a box; any cube for an empty one.
    pub fn around(bounds: Aabb) -> Self {
        if bounds.is_empty() {
            return Self { origin: Vec3::ZERO, edge_m: 1.0 };
        }
        Self { origin: bounds.min, edge_m: bounds.size().max_element().max(1e-3) }
    }

    /// Whether the numbers make a cube.
    pub fn is_sound(&self) -> bool {
        self.origin.is_finite() && self.edge_m.is_finite() && self.edge_m > 0.0
    }

    /// The Morton code of a point; points outside belong to the nearest cell.
    pub fn code(&self, point: Vec3) -> u64 {
        let cells = f64::from(1u32 << LEVELS);
        let scaled = (point.as_dvec3() - self.origin.as_dvec3()) * (cells / f64::from(self.edge_m));
        // `as` saturates: below 0 becomes 0.
        let cell = |v: f64| (v as u64).min((1 << LEVELS) - 1);
        interleave(cell(scaled.x), cell(scaled.y), cell(scaled.z))
    }

    /// The smallest cell that holds both codes. Its outer sides are open, where they are the
    /// cube's: points outside belong to the nearest cell.
    pub fn cell_around(&self, first: u64, last: u64) -> (DVec3, DVec3) {
        let differ = 64 - (first ^ last).leading_zeros();
        let level_up = differ.div_ceil(3);
        let step = f64::from(self.edge_m) / f64::from(1u32 << LEVELS);
        let size = 1u64 << level_up;
        let corner = deinterleave(first);
        let mut low = [0.0; 3];
        let mut high = [0.0; 3];
        for axis in 0..3 {
            let cell = corner[axis] >> level_up << level_up;
            let origin = f64::from(self.origin[axis]);
            let end = cell + size;
            low[axis] = if cell == 0 { f64::NEG_INFINITY } else { origin + cell as f64 * step };
            high[axis] =
                if end >> LEVELS != 0 { f64::INFINITY } else { origin + end as f64 * step };
        }
        (low.into(), high.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cell_around_two_codes_holds_their_points() {
        let bounds = Aabb { min: Vec3::new(-3.0, 2.0, 0.0), max: Vec3::new(97.0, 50.0, 20.0) };
        let cube = Cube::around(bounds);
        let mut random = crate::base::Stream::new(2, crate::base::Purpose::Survey, 0);
        for _ in 0..1000 {
            let mut point = || {
                bounds.min
                    + bounds.size()
                        * Vec3::from_array(std::array::from_fn(|_| random.uniform() as f32))
            };
            let (p, q) = (point(), point());
            let (a, b) = (cube.code(p), cube.code(q));
            let (low, high) = cube.cell_around(a.min(b), a.max(b));
            for v in [p.as_dvec3(), q.as_dvec3()] {
                assert!(v.cmpge(low).all() && v.cmple(high).all(), "{v} in {low} {high}");
            }
            let own = cube.cell_around(a, a);
            assert!(p.as_dvec3().cmpge(own.0).all() && p.as_dvec3().cmplt(own.1).all());
        }
    }
}
