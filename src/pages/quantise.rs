//! Numbers to integers and back: unit vectors, flux. The format page states the errors.

use glam::Vec3;
use glintmap_formats::gmp::FLUX_SHIFT;

const SCALE: f32 = 32767.0;

/// A unit vector as a point of the octahedron's net (Cigolle et al. 2014, "A Survey of Efficient
/// Representations for Independent Unit Vectors", listing 1). The axes are exact.
pub(super) fn octahedral(v: Vec3) -> [i16; 2] {
    let sum = v.x.abs() + v.y.abs() + v.z.abs();
    if !(sum.is_finite() && sum > 0.0) {
        return [0, 0];
    }
    let (mut x, mut y) = (v.x / sum, v.y / sum);
    if v.z < 0.0 {
        (x, y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
    }
    // Rounded half away from 0; `as` saturates.
    [(x * SCALE).round() as i16, (y * SCALE).round() as i16]
}

/// The unit vector of [`octahedral`].
pub(super) fn unit(code: [i16; 2]) -> Vec3 {
    let (mut x, mut y) = (f32::from(code[0]) / SCALE, f32::from(code[1]) / SCALE);
    let z = 1.0 - x.abs() - y.abs();
    if z < 0.0 {
        (x, y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
    }
    let length = (x * x + y * y + z * z).sqrt();
    Vec3::new(x / length, y / length, z / length)
}

fn sign(v: f32) -> f32 {
    if v < 0.0 { -1.0 } else { 1.0 }
}

/// The code of a flux: finite and not negative.
pub(super) fn flux_code(flux_w: f32) -> u32 {
    let half = 1 << (FLUX_SHIFT - 1);
    ((flux_w.to_bits() + half) >> FLUX_SHIFT).min(f32::MAX.to_bits() >> FLUX_SHIFT)
}

/// The flux of a code, W.
pub(super) fn flux(code: u32) -> f32 {
    f32::from_bits(code << FLUX_SHIFT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    #[test]
    fn unit_vectors_lose_less_than_the_format_page_says() {
        let mut random = Stream::new(3, Purpose::Survey, 0);
        let mut worst = 0.0f64;
        for _ in 0..200_000 {
            let v = Vec3::from_array(std::array::from_fn(|_| random.uniform() as f32 - 0.5));
            if v.length() < 1e-3 {
                continue;
            }
            let v = v.normalize();
            let back = unit(octahedral(v));
            assert!((back.length() - 1.0).abs() < 1e-6);
            worst = worst.max((v.as_dvec3() - back.as_dvec3()).length());
        }
        assert!(worst < 7e-5, "worst {worst}");
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z] {
            assert_eq!(unit(octahedral(axis)), axis);
        }
        for code in [[i16::MIN, i16::MIN], [i16::MAX, i16::MIN], [0, 0]] {
            assert!(unit(code).is_finite(), "{code:?}");
        }
    }

    #[test]
    fn flux_loses_less_than_the_format_page_says() {
        let mut random = Stream::new(4, Purpose::Survey, 0);
        for _ in 0..100_000 {
            let exact = f32::from_bits(0x0080_0000 + (random.bits() >> 1) % 0x7E00_0000);
            let error = (f64::from(flux(flux_code(exact))) / f64::from(exact) - 1.0).abs();
            assert!(error <= 1.0 / 4096.0, "{exact}: {error}");
        }
        assert_eq!(flux(flux_code(0.0)), 0.0);
        assert!(flux(flux_code(f32::MAX)).is_finite());
    }
}
