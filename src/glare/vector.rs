//! The inner loops, written so that the compiler turns them into vector instructions; `pulp`
//! picks the widest set that the machine has. Every value is computed on its own, in a fixed
//! order, so the width doesn't show in the result.

use pulp::{Arch, NullaryFnOnce};

/// Values whose sums are kept in registers together. Buffers of the filter are made so long that
/// there is no rest.
pub(super) const LANES: usize = 32;
/// Bytes of a cache line: vectors that lie on its borders are loaded at once.
const LINE_BYTES: usize = 64;
const LINE_NUMBERS: usize = LINE_BYTES / size_of::<f64>();

/// A buffer whose numbers begin at the border of a cache line.
#[derive(Debug, Default)]
pub(super) struct Aligned(Vec<f64>);

impl Aligned {
    /// `length` numbers: what they were, or 0 where the buffer was never as long.
    pub fn of(&mut self, length: usize) -> &mut [f64] {
        if self.0.len() < length + LINE_NUMBERS {
            self.0.resize(length + LINE_NUMBERS, 0.0);
        }
        let start = self.0.as_ptr().align_offset(LINE_BYTES).min(LINE_NUMBERS);
        &mut self.0[start..start + length]
    }
}

/// Runs `op` with the machine's vector instructions.
#[inline]
pub(super) fn dispatch<T>(op: impl NullaryFnOnce<Output = T>) -> T {
    Arch::new().dispatch(op)
}

/// What a filtered value is rounded to: float32, kept as such or widened again for the next axis.
pub(super) trait Rounded: Copy {
    fn rounded(value: f64) -> Self;
}

impl Rounded for f32 {
    #[inline(always)]
    fn rounded(value: f64) -> Self {
        value as f32
    }
}

impl Rounded for f64 {
    #[inline(always)]
    fn rounded(value: f64) -> Self {
        f64::from(value as f32)
    }
}

/// A symmetric filter over lines that lie side by side in one buffer. Several results from the
/// same lines are computed together, block by block, so that the lines come from the first cache.
pub(super) struct Stencil<'a, T> {
    /// The buffer that holds all lines.
    pub lines: &'a [f64],
    /// For each result where its lines begin: the centre's, then for each distance the one before
    /// and the one after.
    pub offsets: &'a [usize],
    /// Weight of the centre, then of each distance.
    pub weights: &'a [f64],
    /// How many values each result has; a multiple of [`LANES`].
    pub width: usize,
    /// The results.
    pub out: &'a mut [T],
    /// From the beginning of one result to that of the next.
    pub stride: usize,
}

impl<T: Rounded> NullaryFnOnce for Stencil<'_, T> {
    type Output = ();

    /// `acc = x[0] w[0]`, then from the farthest to the nearest `acc += (x[-j] + x[j]) w[j]`: the
    /// order of SciPy's `NI_Correlate1D` for symmetric filters.
    #[inline(always)]
    fn call(self) {
        let Self { lines, offsets, weights, width, out, stride } = self;
        let taps = 2 * weights.len() - 1;
        for at in (0..width).step_by(LANES) {
            for (result, offsets) in offsets.chunks_exact(taps).enumerate() {
                let mut sums = [0.0; LANES];
                let centre = lane(lines, offsets[0] + at);
                for (sum, c) in sums.iter_mut().zip(centre) {
                    *sum = c * weights[0];
                }
                for (weight, pair) in weights[1..].iter().zip(offsets[1..].chunks_exact(2)).rev() {
                    let (before, after) = (lane(lines, pair[0] + at), lane(lines, pair[1] + at));
                    for ((sum, b), a) in sums.iter_mut().zip(before).zip(after) {
                        *sum += (b + a) * weight;
                    }
                }
                let out = &mut out[result * stride + at..][..LANES];
                for (to, sum) in out.iter_mut().zip(sums) {
                    *to = T::rounded(sum);
                }
            }
        }
    }
}

#[inline(always)]
fn lane(lines: &[f64], at: usize) -> &[f64; LANES] {
    let Some(found) = lines[at..].first_chunk() else {
        unreachable!("a line ends before its block does");
    };
    found
}

/// Widens float32 to f64.
pub(super) struct Widen<'a> {
    pub from: &'a [f32],
    pub to: &'a mut [f64],
}

impl NullaryFnOnce for Widen<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for (to, from) in self.to.iter_mut().zip(self.from) {
            *to = f64::from(*from);
        }
    }
}

/// Looks at what a row of input holds.
pub(super) struct Look<'a> {
    pub row: &'a [f32],
    /// For each so many columns: whether anything there isn't +0.
    pub occupied: &'a mut [bool],
    pub group: usize,
}

impl NullaryFnOnce for Look<'_> {
    /// Whether there is NaN or an infinity.
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let mut largest = 0_u32;
        for (values, occupied) in self.row.chunks(self.group).zip(self.occupied) {
            let mut all = 0_u32;
            for value in values {
                let bits = value.to_bits();
                all |= bits;
                largest = largest.max(bits & 0x7fff_ffff);
            }
            *occupied = all != 0;
        }
        largest >= 0x7f80_0000
    }
}

/// Which of at most 64 values lie strictly above a threshold: bit i for value i.
#[inline(always)]
pub(super) fn above(values: &[f32], threshold: f32) -> u64 {
    let mut flags = [0_u8; 64];
    for (flag, value) in flags.iter_mut().zip(values) {
        *flag = u8::from(*value > threshold);
    }
    let mut word = 0;
    for (i, eight) in flags.chunks_exact(8).enumerate() {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(eight);
        // Gathers the lowest bits of eight bytes into the topmost byte.
        let gathered = u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
        word |= gathered << (8 * i);
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_stand_for_their_values() {
        for length in 0..=64 {
            let values: Vec<f32> = (0..length).map(|i| (i * 37 % 11) as f32).collect();
            let expected: u64 = (0..length).filter(|&i| values[i] > 5.0).map(|i| 1_u64 << i).sum();
            assert_eq!(above(&values, 5.0), expected);
        }
    }

    #[test]
    fn content_is_seen() {
        let look = |row: &[f32]| {
            let mut occupied = [false; 2];
            let nonfinite = dispatch(Look { row, occupied: &mut occupied, group: 64 });
            (occupied, nonfinite)
        };
        let mut row = [0.0; 70];
        assert_eq!(look(&row), ([false, false], false));
        row[69] = -0.0;
        assert_eq!(look(&row), ([false, true], false));
        row[3] = f32::MIN;
        assert_eq!(look(&row), ([true, true], false));
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            row[68] = bad;
            assert_eq!(look(&row), ([true, true], true));
        }
    }
}
