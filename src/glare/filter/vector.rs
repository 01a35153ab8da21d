//! The inner loops, written so that the compiler turns them into vector instructions; `pulp`
//! picks the widest set that the machine has. Every value is computed on its own, in a fixed
//! order, so the width doesn't show in the result.

use pulp::{Arch, NullaryFnOnce};

/// Values whose sums are kept in registers together. Buffers of the filter are made so long that
/// there is no rest.
pub(in crate::glare) const LANES: usize = 32;
/// Bytes of a cache line: vectors that lie on its borders are loaded at once.
const LINE_BYTES: usize = 64;
const LINE_NUMBERS: usize = LINE_BYTES / size_of::<f64>();

/// A buffer whose numbers begin at the border of a cache line.
#[derive(Debug, Default)]
pub(in crate::glare) struct Aligned(Vec<f64>);

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
pub(in crate::glare) fn dispatch<T>(op: impl NullaryFnOnce<Output = T>) -> T {
    Arch::new().dispatch(op)
}

/// What a filtered value is rounded to: float32, kept as such or widened again for the next axis.
pub(in crate::glare) trait Rounded: Copy {
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

/// The radius that has loops of its own, in which all lines stay in registers: that of sigma 1.
const FIXED_RADIUS: usize = 4;
/// Columns that such a loop takes at a time: one vector of the widest instructions.
const FIXED_LANES: usize = 8;

/// A symmetric filter across lines: result `r` has line `r + radius` as its centre.
pub(in crate::glare) struct Across<'a, T> {
    /// As many lines as there are results, and the radius more on either side.
    pub lines: &'a [&'a [f32]],
    /// Weight of the centre, then of each distance.
    pub weights: &'a [f64],
    /// How many values each result has, at most as many as each line.
    pub width: usize,
    /// The results.
    pub out: &'a mut [T],
    /// From the beginning of one result to that of the next.
    pub stride: usize,
    /// Room for `lines.len() *` [`LANES`] numbers.
    pub room: &'a mut Vec<[f64; LANES]>,
}

impl<T: Rounded> NullaryFnOnce for Across<'_, T> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let radius = self.weights.len() - 1;
        match (radius, self.lines.len()) {
            (FIXED_RADIUS, 16) => self.fixed::<16>(),
            (FIXED_RADIUS, 12) => self.fixed::<12>(),
            _ => self.any(0),
        }
    }
}

impl<T: Rounded> Across<'_, T> {
    #[inline(always)]
    fn fixed<const LINES: usize>(mut self) {
        let mut weights = [0.0; FIXED_RADIUS + 1];
        weights.copy_from_slice(self.weights);
        let whole = self.width / FIXED_LANES * FIXED_LANES;
        let mut lines = [&[][..]; LINES];
        for (line, from) in lines.iter_mut().zip(self.lines) {
            *line = &from[..whole];
        }
        let results = LINES - 2 * FIXED_RADIUS;
        for at in (0..whole).step_by(FIXED_LANES) {
            let mut wide = [[0.0; FIXED_LANES]; LINES];
            for (wide, line) in wide.iter_mut().zip(lines) {
                for (wide, value) in wide.iter_mut().zip(&line[at..][..FIXED_LANES]) {
                    *wide = f64::from(*value);
                }
            }
            for result in 0..results {
                let sums = weighted(&wide[result..][..2 * FIXED_RADIUS + 1], &weights);
                let out = &mut self.out[result * self.stride + at..][..FIXED_LANES];
                for (to, sum) in out.iter_mut().zip(sums) {
                    *to = T::rounded(sum);
                }
            }
        }
        if whole < self.width {
            self.any(whole);
        }
    }

    /// From column `start` on, whatever the radius and the number of lines.
    #[inline(always)]
    fn any(&mut self, start: usize) {
        let Self { lines, weights, width, out, stride, room } = self;
        let taps = 2 * weights.len() - 1;
        room.resize(lines.len(), [0.0; LANES]);
        for at in (start..*width).step_by(LANES) {
            let lanes = LANES.min(*width - at);
            for (wide, line) in room.iter_mut().zip(*lines) {
                for (wide, value) in wide.iter_mut().zip(&line[at..at + lanes]) {
                    *wide = f64::from(*value);
                }
            }
            for (result, lines) in room.windows(taps).enumerate() {
                let sums = weighted(lines, weights);
                let out = &mut out[result * *stride + at..][..lanes];
                for (to, sum) in out.iter_mut().zip(sums) {
                    *to = T::rounded(sum);
                }
            }
        }
    }
}

/// `acc = x[0] w[0]`, then from the farthest to the nearest `acc += (x[-j] + x[j]) w[j]`: the order
/// of SciPy's `NI_Correlate1D` for symmetric filters.
#[inline(always)]
fn weighted<const L: usize>(lines: &[[f64; L]], weights: &[f64]) -> [f64; L] {
    let radius = weights.len() - 1;
    let mut sums = lines[radius];
    for sum in &mut sums {
        *sum *= weights[0];
    }
    for j in (1..=radius).rev() {
        let (before, after) = (&lines[radius - j], &lines[radius + j]);
        for ((sum, b), a) in sums.iter_mut().zip(before).zip(after) {
            *sum += (b + a) * weights[j];
        }
    }
    sums
}

/// The same filter along a line.
pub(in crate::glare) struct Along<'a> {
    /// The line with the radius more on either side, and room for the last vector to read.
    pub line: &'a [f64],
    /// Weight of the centre, then of each distance.
    pub weights: &'a [f64],
    /// The result; its length is a multiple of [`LANES`].
    pub out: &'a mut [f32],
}

impl NullaryFnOnce for Along<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        match self.weights.first_chunk::<{ FIXED_RADIUS + 1 }>() {
            Some(weights) if self.weights.len() == FIXED_RADIUS + 1 => {
                along(self.line, weights, self.out);
            }
            _ => along(self.line, self.weights, self.out),
        }
    }
}

#[inline(always)]
fn along(line: &[f64], weights: &[f64], out: &mut [f32]) {
    let radius = weights.len() - 1;
    for (block, out) in out.chunks_exact_mut(LANES).enumerate() {
        let at = block * LANES + radius;
        let mut sums = *lane(line, at);
        for sum in &mut sums {
            *sum *= weights[0];
        }
        for j in (1..=radius).rev() {
            let (before, after) = (lane(line, at - j), lane(line, at + j));
            for ((sum, b), a) in sums.iter_mut().zip(before).zip(after) {
                *sum += (b + a) * weights[j];
            }
        }
        for (to, sum) in out.iter_mut().zip(sums) {
            *to = sum as f32;
        }
    }
}

#[inline(always)]
fn lane(line: &[f64], at: usize) -> &[f64; LANES] {
    let Some(found) = line[at..].first_chunk() else {
        unreachable!("a line ends before its block does");
    };
    found
}

/// Looks at what a row of input holds.
pub(in crate::glare) struct Look<'a> {
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

/// Whether any value lies strictly above a threshold.
#[inline(always)]
pub(in crate::glare) fn any_above(values: &[f32], threshold: f32) -> bool {
    values.iter().fold(false, |any, value| any | (*value > threshold))
}

/// Which of at most 64 values lie strictly above a threshold: bit i for value i.
#[inline(always)]
pub(in crate::glare) fn above(values: &[f32], threshold: f32) -> u64 {
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
