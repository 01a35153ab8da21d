use pulp::NullaryFnOnce;

use crate::glare::filter::vector::{above, any_above};

/// Neighbouring voxels of one row above the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::glare) struct Run {
    /// The row.
    pub row: u32,
    /// First column.
    pub start: u32,
    /// One past the last column.
    pub end: u32,
    /// The first column that has the highest value.
    pub peak_column: u32,
    /// The highest value, W/m2.
    pub peak_w_m2: f32,
}

/// Where a run lies: all that matters to what touches it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::glare) struct Span {
    /// The row.
    pub row: u32,
    /// First column.
    pub start: u32,
    /// One past the last column.
    pub end: u32,
}

/// What covers columns of a row, from the first to one past the last.
pub(in crate::glare) trait Columns {
    fn columns(&self) -> (u32, u32);
}

impl Columns for Run {
    #[inline]
    fn columns(&self) -> (u32, u32) {
        (self.start, self.end)
    }
}

impl Columns for Span {
    #[inline]
    fn columns(&self) -> (u32, u32) {
        (self.start, self.end)
    }
}

impl Run {
    pub fn span(&self) -> Span {
        Span { row: self.row, start: self.start, end: self.end }
    }

    /// This run with `next`, which begins where this one ends.
    fn joined(self, next: Self) -> Self {
        let higher = if next.peak_w_m2 > self.peak_w_m2 { next } else { self };
        Self { start: self.start, end: next.end, ..higher }
    }
}

/// Appends the runs of a piece of a row that begins at `column`.
pub(in crate::glare) struct FindRuns<'a> {
    pub values: &'a [f32],
    pub threshold: f32,
    pub row: u32,
    pub column: u32,
    pub runs: &'a mut Vec<Run>,
}

impl NullaryFnOnce for FindRuns<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { values, threshold, row, column, runs } = self;
        let mut open: Option<usize> = None;
        let mut close = |start: usize, end: usize| runs.push(run(values, row, column, start, end));
        for (number, piece) in values.chunks(64).enumerate() {
            let at = number * 64;
            if open.is_none() && !any_above(piece, threshold) {
                continue;
            }
            let mut word = above(piece, threshold);
            if let Some(start) = open {
                if word == u64::MAX {
                    continue;
                }
                let end = word.trailing_ones() as usize;
                close(start, at + end);
                open = None;
                word &= u64::MAX << end;
            }
            while word != 0 {
                let start = word.trailing_zeros() as usize;
                let length = (word >> start).trailing_ones() as usize;
                if start + length == 64 {
                    open = Some(at + start);
                    break;
                }
                close(at + start, at + start + length);
                word &= u64::MAX << (start + length);
            }
        }
        if let Some(start) = open {
            close(start, values.len());
        }
    }
}

#[inline(always)]
fn run(values: &[f32], row: u32, column: u32, start: usize, end: usize) -> Run {
    let (mut peak, mut at) = (values[start], start);
    for (i, value) in values[start..end].iter().enumerate().skip(1) {
        if *value > peak {
            (peak, at) = (*value, start + i);
        }
    }
    // A row has at most MAX_VIEW_EDGE columns.
    let absolute = |index: usize| column + index as u32;
    Run {
        row,
        start: absolute(start),
        end: absolute(end),
        peak_column: absolute(at),
        peak_w_m2: peak,
    }
}

/// Puts the runs of neighbouring blocks of columns, each sorted by row, into one list sorted by
/// row and column; runs that meet at a block's border become one.
pub(in crate::glare) fn stitch(blocks: &[Vec<Run>], out: &mut Vec<Run>) {
    if let [only] = blocks {
        out.extend_from_slice(only);
        return;
    }
    let mut next = vec![0; blocks.len()];
    loop {
        let heads = blocks.iter().zip(&next).filter_map(|(block, &at)| block.get(at));
        let Some(row) = heads.map(|run| run.row).min() else { return };
        for (block, at) in blocks.iter().zip(&mut next) {
            while let Some(run) = block.get(*at).filter(|run| run.row == row) {
                match out.last_mut() {
                    Some(last) if last.row == row && last.end == run.start => {
                        *last = last.joined(*run);
                    }
                    _ => out.push(*run),
                }
                *at += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};
    use crate::glare::filter::vector::dispatch;

    fn slow(values: &[f32], threshold: f32) -> Vec<Run> {
        let mut out: Vec<Run> = Vec::new();
        for (column, &value) in values.iter().enumerate().filter(|(_, v)| **v > threshold) {
            let column = column as u32;
            match out.last_mut() {
                Some(last) if last.end == column => {
                    last.end += 1;
                    if value > last.peak_w_m2 {
                        (last.peak_w_m2, last.peak_column) = (value, column);
                    }
                }
                _ => out.push(Run {
                    row: 3,
                    start: column,
                    end: column + 1,
                    peak_column: column,
                    peak_w_m2: value,
                }),
            }
        }
        out
    }

    #[test]
    fn runs_are_those_found_one_by_one_whatever_the_blocks() {
        let mut random = Stream::new(1, Purpose::Survey, 0);
        for length in [1, 2, 63, 64, 65, 127, 128, 129, 200, 300] {
            for share in [0.0, 0.05, 0.5, 0.9, 1.0] {
                let values: Vec<f32> = (0..length)
                    .map(|_| {
                        let up = random.uniform() < share;
                        let level = (random.uniform() * 4.0) as f32;
                        if up { 11.0 + level.floor() } else { level }
                    })
                    .collect();
                for width in [64, 128, 512] {
                    let blocks: Vec<Vec<Run>> = values
                        .chunks(width)
                        .enumerate()
                        .map(|(i, values)| {
                            let mut runs = Vec::new();
                            let column = (i * width) as u32;
                            let runs_out = &mut runs;
                            let threshold = 10.0;
                            dispatch(FindRuns {
                                values,
                                threshold,
                                row: 3,
                                column,
                                runs: runs_out,
                            });
                            runs
                        })
                        .collect();
                    let mut found = Vec::new();
                    stitch(&blocks, &mut found);
                    assert_eq!(found, slow(&values, 10.0), "{length} values, blocks of {width}");
                }
            }
        }
    }
}
