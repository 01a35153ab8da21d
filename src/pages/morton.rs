//! Morton codes: an octree cell as one number.

use glam::{DVec3, Vec3};

use crate::base::Aabb;

/// Levels of the octree: 21 bits an axis fill 63 bits.
pub(super) const LEVELS: u32 = 21;

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
        let mut low = [0.0; 3];
        let mut high = [0.0; 3];
        for axis in 0..3 {
            let cell = compact(first >> axis) >> level_up << level_up;
            let origin = f64::from(self.origin[axis]);
            let end = cell + size;
            low[axis] = if cell == 0 { f64::NEG_INFINITY } else { origin + cell as f64 * step };
            high[axis] =
                if end >> LEVELS != 0 { f64::INFINITY } else { origin + end as f64 * step };
        }
        (low.into(), high.into())
    }
}

/// Spreads the low 21 bits so that two zero bits lie between each two.
fn spread(v: u64) -> u64 {
    let mut v = v & 0x1F_FFFF;
    v = (v | v << 32) & 0x001F_0000_0000_FFFF;
    v = (v | v << 16) & 0x001F_0000_FF00_00FF;
    v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
    v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// The inverse of [`spread`].
fn compact(v: u64) -> u64 {
    let mut v = v & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10C3_0C30_C30C_30C3;
    v = (v | v >> 4) & 0x100F_00F0_0F00_F00F;
    v = (v | v >> 8) & 0x001F_0000_FF00_00FF;
    v = (v | v >> 16) & 0x001F_0000_0000_FFFF;
    (v | v >> 32) & 0x1F_FFFF
}

/// One code from three integers of up to 21 bits, x lowest.
pub(super) fn interleave(x: u64, y: u64, z: u64) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// The inverse of [`interleave`].
pub(super) fn deinterleave(code: u64) -> [u64; 3] {
    [compact(code), compact(code >> 1), compact(code >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_what_a_loop_over_bits_gives() {
        let mut random = crate::base::Stream::new(1, crate::base::Purpose::Survey, 0);
        for _ in 0..1000 {
            let axes: [u64; 3] = std::array::from_fn(|_| u64::from(random.bits() >> 11));
            let mut slow = 0u64;
            for bit in 0..21 {
                for (axis, v) in axes.iter().enumerate() {
                    slow |= (v >> bit & 1) << (3 * bit + axis);
                }
            }
            let code = interleave(axes[0], axes[1], axes[2]);
            assert_eq!(code, slow);
            assert_eq!(deinterleave(code), axes);
        }
    }

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
