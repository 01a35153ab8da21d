//! The threshold: filtered rows of a strip become row runs, neighbouring voxels of one row above it.
//!
//! All that follows works on row runs, never on voxels. Where little is above the threshold that is
//! little work; where noise is, a run is a voxel or two, and this file is what decides the speed: 64
//! values are compared at once into the bits of a word, and runs are read off its zeros and ones.
//! Rows come in pieces of columns ([`FilteredRows`](crate::glare::filter::strip::FilteredRows)); a run
//! that goes on across the border of a piece is joined in the end.

use pulp::NullaryFnOnce;

use crate::glare::filter::vector::{above, any_above, dispatch};

/// Neighbouring voxels of one row above the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::glare) struct RowRun {
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

/// Where a row run lies: all that matters to what touches it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::glare) struct Span {
    /// The row.
    pub row: u32,
    /// First column.
    pub start: u32,
    /// One past the last column.
    pub end: u32,
}

/// What lies above a threshold at the timesteps of a batch, while its filtered rows come in: for
/// each timestep, for each piece of columns, the row runs from the top.
pub(in crate::glare) struct Above {
    threshold: f32,
    found: Vec<Vec<Vec<RowRun>>>,
}

impl Above {
    /// Nothing yet, at so many timesteps.
    pub fn new(threshold: f32, steps: usize) -> Self {
        Self { threshold, found: vec![Vec::new(); steps] }
    }

    /// A piece of columns begins.
    pub fn begin(&mut self) {
        self.found.iter_mut().for_each(|pieces| pieces.push(Vec::new()));
    }

    /// A row of the piece, which begins at `column`, at timestep number `step`.
    pub fn add(&mut self, step: usize, row: usize, column: usize, values: &[f32]) {
        let Some(runs) = self.found[step].last_mut() else { return };
        // Rows and columns are bounded by MAX_VIEW_PIXELS.
        let (row, column) = (row as u32, column as u32);
        dispatch(FindRuns { values, threshold: self.threshold, row, column, runs });
    }

    /// For each timestep its row runs, sorted by row and column.
    pub fn finish(self) -> impl Iterator<Item = Vec<RowRun>> {
        self.found.into_iter().map(|pieces| stitch(&pieces))
    }
}

impl RowRun {
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
struct FindRuns<'a> {
    values: &'a [f32],
    threshold: f32,
    row: u32,
    column: u32,
    runs: &'a mut Vec<RowRun>,
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
fn run(values: &[f32], row: u32, column: u32, start: usize, end: usize) -> RowRun {
    let (mut peak, mut at) = (values[start], start);
    for (i, value) in values[start..end].iter().enumerate().skip(1) {
        if *value > peak {
            (peak, at) = (*value, start + i);
        }
    }
    // A row has at most MAX_VIEW_EDGE columns.
    let absolute = |index: usize| column + index as u32;
    RowRun {
        row,
        start: absolute(start),
        end: absolute(end),
        peak_column: absolute(at),
        peak_w_m2: peak,
    }
}

/// The runs of neighbouring pieces of columns, each sorted by row, as one list sorted by row and
/// column; runs that meet at the border of a piece become one.
fn stitch(pieces: &[Vec<RowRun>]) -> Vec<RowRun> {
    let mut out = Vec::with_capacity(pieces.iter().map(Vec::len).sum());
    if let [only] = pieces {
        out.extend_from_slice(only);
        return out;
    }
    let mut next = vec![0; pieces.len()];
    loop {
        let heads = pieces.iter().zip(&next).filter_map(|(piece, &at)| piece.get(at));
        let Some(row) = heads.map(|run| run.row).min() else { return out };
        for (piece, at) in pieces.iter().zip(&mut next) {
            while let Some(run) = piece.get(*at).filter(|run| run.row == row) {
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

/// Where a run begins and ends.
pub(in crate::glare) trait Columns {
    fn columns(&self) -> [u32; 2];
}

impl Columns for RowRun {
    #[inline]
    fn columns(&self) -> [u32; 2] {
        [self.start, self.end]
    }
}

impl Columns for Span {
    #[inline]
    fn columns(&self) -> [u32; 2] {
        [self.start, self.end]
    }
}

/// Calls `each` with the indices of runs of two rows that lie at most `gap` columns apart
/// diagonally (0: they share a column).
pub(in crate::glare) fn touching<T: Columns>(
    a: &[T],
    b: &[T],
    gap: u32,
    mut each: impl FnMut(usize, usize),
) {
    let (mut i, mut j) = (0, 0);
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        let ([x_start, x_end], [y_start, y_end]) = (x.columns(), y.columns());
        if x_start < y_end + gap && y_start < x_end + gap {
            each(i, j);
        }
        // Runs of one row are at least a column apart, so the one that ends first touches no other.
        if x_end < y_end {
            i += 1;
        } else {
            j += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    fn slow(values: &[f32], threshold: f32) -> Vec<RowRun> {
        let mut out: Vec<RowRun> = Vec::new();
        for (column, &value) in values.iter().enumerate().filter(|(_, v)| **v > threshold) {
            let column = column as u32;
            match out.last_mut() {
                Some(last) if last.end == column => {
                    last.end += 1;
                    if value > last.peak_w_m2 {
                        (last.peak_w_m2, last.peak_column) = (value, column);
                    }
                }
                _ => out.push(RowRun {
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
                    let mut above = Above::new(10.0, 1);
                    for (i, values) in values.chunks(width).enumerate() {
                        above.begin();
                        above.add(0, 3, i * width, values);
                    }
                    let found = above.finish().next().unwrap();
                    assert_eq!(found, slow(&values, 10.0), "{length} values, pieces of {width}");
                }
            }
        }
    }
}
