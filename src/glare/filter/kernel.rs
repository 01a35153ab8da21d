use crate::glare::error::Error;

/// Farthest that a filter may reach, voxels.
const MAX_RADIUS: usize = 1 << 14;
/// SciPy leaves an axis alone whose sigma is not above this.
const SMALLEST_SIGMA: f64 = 1e-15;

/// One half of a symmetric filter along one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    weights: Vec<f64>,
}

impl Kernel {
    /// The Gaussian of SciPy's `gaussian_filter1d` (`_gaussian_kernel1d`, order 0): weights
    /// `exp(-x^2 / (2 sigma^2))` out to `int(truncate * sigma + 0.5)`, divided by their sum, which
    /// is added up in NumPy's order. A sigma of (nearly) zero gives the filter that changes
    /// nothing.
    ///
    /// # Errors
    /// A sigma that is negative or not finite; a radius beyond 16,384 voxels.
    pub fn gaussian(axis: char, sigma: f64, truncate: f64) -> Result<Self, Error> {
        if !(sigma.is_finite() && sigma >= 0.0) {
            return Err(Error::Sigma { axis, value: sigma });
        }
        if sigma <= SMALLEST_SIGMA {
            return Ok(Self { weights: vec![1.0] });
        }
        let reach = (truncate * sigma + 0.5).trunc();
        if reach > MAX_RADIUS as f64 {
            return Err(Error::Radius { axis, sigma, truncate, radius: reach, limit: MAX_RADIUS });
        }
        let radius = reach as usize;
        let scale = -0.5 / (sigma * sigma);
        let value = |x: usize| libm::exp(scale * (x * x) as f64);
        let whole: Vec<f64> = (0..2 * radius + 1).map(|i| value(i.abs_diff(radius))).collect();
        let sum = numpy_sum(&whole);
        Ok(Self { weights: whole[radius..].iter().map(|v| v / sum).collect() })
    }

    /// How far the filter reaches to each side, voxels.
    pub fn radius(&self) -> usize {
        self.weights.len() - 1
    }

    /// The weight at each distance from the centre, `radius + 1` of them.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

/// The separable Gaussian: along t, then y, then x, each rounded to float32.
#[derive(Clone, Debug)]
pub(in crate::glare) struct Gaussian {
    pub t: Kernel,
    pub y: Kernel,
    pub x: Kernel,
}

impl Gaussian {
    /// Whether no axis is filtered.
    pub fn is_identity(&self) -> bool {
        [&self.t, &self.y, &self.x].iter().all(|kernel| kernel.weights.len() == 1)
    }
}

/// The sum as `numpy.sum` adds up contiguous f64: pairwise, in blocks of at most 128 with eight
/// running sums (NumPy, `loops_utils.h.src`, `pairwise_sum`).
fn numpy_sum(values: &[f64]) -> f64 {
    match values.len() {
        n if n < 8 => values.iter().fold(-0.0, |sum, v| sum + v),
        n if n <= 128 => {
            let mut sums = [0.0; 8];
            sums.copy_from_slice(&values[..8]);
            let whole = n - n % 8;
            for block in values[8..whole].chunks_exact(8) {
                for (sum, value) in sums.iter_mut().zip(block) {
                    *sum += value;
                }
            }
            let [a, b, c, d, e, f, g, h] = sums;
            let joined = ((a + b) + (c + d)) + ((e + f) + (g + h));
            values[whole..].iter().fold(joined, |sum, v| sum + v)
        }
        n => {
            let half = n / 2;
            let half = half - half % 8;
            numpy_sum(&values[..half]) + numpy_sum(&values[half..])
        }
    }
}

/// The index that stands for `index` on an axis of `length` whose borders reflect
/// (`d c b a | a b c d | d c b a`), however often.
pub(in crate::glare) fn reflect(index: isize, length: usize) -> usize {
    let period = 2 * length;
    let folded = index.rem_euclid(period as isize).unsigned_abs();
    if folded < length { folded } else { period - 1 - folded }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_reflect_however_often() {
        let seen: Vec<usize> = (-7..8).map(|i| reflect(i, 3)).collect();
        assert_eq!(seen, [0, 0, 1, 2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
        assert!((-9..9).all(|i| reflect(i, 1) == 0));
    }

    #[test]
    fn radius_follows_scipy() {
        let radius = |sigma, truncate| Kernel::gaussian('t', sigma, truncate).unwrap().radius();
        assert_eq!(radius(1.0, 4.0), 4);
        assert_eq!(radius(0.7, 4.0), 3);
        assert_eq!(radius(2.3, 4.0), 9);
        assert_eq!(radius(0.1, 4.0), 0);
        assert_eq!(radius(0.0, 4.0), 0);
        assert_eq!(radius(1.0, 0.0), 0);
        assert_eq!(radius(1.0, 0.5), 1);
    }

    #[test]
    fn weights_of_sigma_1_are_numpys_to_the_last_bit() {
        let kernel = Kernel::gaussian('t', 1.0, 4.0).unwrap();
        let bits: Vec<u64> = kernel.weights().iter().map(|w| w.to_bits()).collect();
        assert_eq!(bits, NUMPY_SIGMA_1);
    }

    // scipy 1.17.1, numpy 2.4.6: _gaussian_kernel1d(1.0, 0, 4)[4:].view('u8')
    const NUMPY_SIGMA_1: [u64; 5] = [
        0x3fd9_884a_3075_94fb,
        0x3fce_f8eb_9ad4_99ba,
        0x3fab_a4b9_9d17_99ab,
        0x3f72_2724_cb7e_b269,
        0x3f21_8a9c_4fd5_36c6,
    ];

    #[test]
    fn bad_sigmas_are_named() {
        assert!(matches!(Kernel::gaussian('y', -1.0, 4.0), Err(Error::Sigma { axis: 'y', .. })));
        assert!(matches!(Kernel::gaussian('x', f64::NAN, 4.0), Err(Error::Sigma { .. })));
        assert!(matches!(Kernel::gaussian('x', 1e9, 4.0), Err(Error::Radius { .. })));
        assert!(matches!(Kernel::gaussian('x', 1e300, 1e300), Err(Error::Radius { .. })));
    }
}
