//! A wave: neighbouring strips of the picture, one a thread, through filter and threshold.
//!
//! Here the wings meet: the filter hands on its rows, which are compared with the threshold and, where
//! somebody wants the filtered volume, kept; what is above the threshold becomes slabs.

use std::ops::Range;

use rayon::prelude::*;

use super::events::counts::Counts;
use super::events::slab::{self, Place, Slab};
use super::events::threshold::{Above, RowRun};
use super::filter::kernel::Gaussian;
use super::filter::part::Part;
use super::filter::strip::{self, FilteredRows, Strip};
use super::filter::window::Window;
use super::settings::Connectivity;

/// Rows that one thread filters at a time: enough that the rows above and below, which are
/// filtered in time twice, don't matter.
pub(super) const STRIP_ROWS: usize = 32;

/// Neighbouring strips of the picture, at the timesteps of some parts.
pub(super) struct Wave<'a> {
    pub gaussian: &'a Gaussian,
    pub threshold: f32,
    pub connectivity: Connectivity,
    pub window: &'a Window,
    pub parts: &'a [Part],
    /// The rows; they begin where a strip does.
    pub rows: Range<usize>,
    /// Timesteps that are filtered together.
    pub batch: usize,
}

/// Buffers for one strip of a wave, used again in the next wave.
#[derive(Default)]
pub(super) struct Scratch {
    strip: strip::Scratch,
    slab: slab::Scratch,
}

impl Wave<'_> {
    /// Filters the strips and finds what lies above the threshold: for each strip a slab for each
    /// part. `keep` takes the filtered slices of all parts, of which only these rows are written.
    /// There is a scratch for each strip, or more.
    pub fn run(
        &self,
        counts: &mut Counts,
        keep: Option<&mut [f32]>,
        scratch: &mut [Scratch],
    ) -> Vec<Vec<Slab>> {
        if self.parts.is_empty() {
            return Vec::new();
        }
        let strips = self.rows.len().div_ceil(STRIP_ROWS);
        let (rows, columns) = (self.window.rows, self.window.columns);
        let mut kept: Vec<Vec<&mut [f32]>> = (0..strips).map(|_| Vec::new()).collect();
        for slice in keep.into_iter().flat_map(|all| all.chunks_mut(rows * columns)) {
            let here = &mut slice[self.rows.start * columns..self.rows.end * columns];
            for (strip, part) in kept.iter_mut().zip(here.chunks_mut(STRIP_ROWS * columns)) {
                strip.push(part);
            }
        }
        let counts = counts.strips(self.rows.clone(), STRIP_ROWS);
        let work = counts.into_par_iter().zip(kept).zip(scratch).enumerate().with_max_len(1);
        work.map(|(number, ((mut counts, mut kept), scratch))| {
            let first = self.rows.start + number * STRIP_ROWS;
            let rows = first..(first + STRIP_ROWS).min(self.rows.end);
            let slab = |part: &Part| {
                let found = self.above(part, &rows, &mut kept, &mut scratch.strip);
                let place = Place {
                    part,
                    rows: rows.clone(),
                    picture: [self.window.rows, columns],
                    connectivity: self.connectivity,
                };
                Slab::new(found, &place, &mut counts, &mut scratch.slab)
            };
            self.parts.iter().map(slab).collect()
        })
        .collect()
    }

    /// The row runs above the threshold in a strip, for each timestep of a part, whose filtered
    /// slices are taken from the front of `kept`.
    fn above(
        &self,
        part: &Part,
        rows: &Range<usize>,
        kept: &mut Vec<&mut [f32]>,
        scratch: &mut strip::Scratch,
    ) -> Vec<Vec<RowRun>> {
        let (gaussian, window) = (self.gaussian, self.window);
        let mut found = Vec::with_capacity(part.steps.len());
        for batch in part.batches(self.batch) {
            let steps = batch.steps.len();
            let mut out = Rows {
                first: rows.start,
                width: window.columns,
                column: 0,
                above: Above::new(self.threshold, steps),
                kept: kept.drain(..steps.min(kept.len())).collect(),
            };
            let strip = Strip { gaussian, window, batch: &batch, rows: rows.clone() };
            strip.run(scratch, &mut out);
            found.extend(out.above.finish());
        }
        found
    }
}

/// Where the filtered rows of a batch go.
struct Rows<'a> {
    /// The strip's first row.
    first: usize,
    /// Columns of the picture.
    width: usize,
    /// The first column of the piece.
    column: usize,
    above: Above,
    /// For each timestep where the filtered strip goes; empty where nobody wants it.
    kept: Vec<&'a mut [f32]>,
}

impl FilteredRows for Rows<'_> {
    fn begin(&mut self, columns: &Range<usize>) {
        self.column = columns.start;
        self.above.begin();
    }

    fn row(&mut self, step: usize, row: usize, values: &[f32]) {
        self.above.add(step, row, self.column, values);
        if let Some(kept) = self.kept.get_mut(step) {
            let at = (row - self.first) * self.width + self.column;
            kept[at..][..values.len()].copy_from_slice(values);
        }
    }

    fn dark(&mut self, rows: Range<usize>, columns: &Range<usize>) {
        for kept in &mut self.kept {
            for row in rows.clone() {
                kept[(row - self.first) * self.width..][columns.clone()].fill(0.0);
            }
        }
    }
}
