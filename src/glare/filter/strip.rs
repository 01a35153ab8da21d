use std::ops::Range;

use super::kernel::reflect;
use super::smooth::{Batch, Smoother, Strip};
use super::vector::{Across, Aligned, Along, LANES, dispatch};
use super::window::{GROUP, Window};
use crate::glare::events::threshold::{FindRuns, Run, stitch};

/// Rows that are filtered along y together: their lines are then loaded three times for four rows
/// instead of nine times for each.
const GROUP_ROWS: usize = 4;
/// Columns that are filtered together, so that all that is needed stays in the second cache.
const BLOCK_COLUMNS: usize = 1024;

/// Buffers of one thread.
#[derive(Default)]
pub(in crate::glare) struct Scratch {
    ring: Vec<f32>,
    /// Which rows of the ring hold nothing but 0.
    zero: Vec<bool>,
    /// Some rows filtered in time and along y, with what lies beyond the borders.
    lines: Aligned,
    /// A filtered row.
    out: Vec<f32>,
    /// For filters that don't fit into registers.
    room: Vec<[f64; LANES]>,
}

/// One strip of one batch.
pub(in crate::glare) struct Work<'a> {
    smoother: &'a Smoother,
    window: &'a Window,
    batch: &'a Batch,
    rows: Range<usize>,
    /// The rows of the picture that the filter looks at.
    rows_seen: Range<usize>,
    /// For each row seen and group of columns: whether any slice seen holds anything but 0 there.
    occupied: Vec<bool>,
    /// For each timestep where the filtered strip goes; empty where nobody wants it.
    kept: Vec<&'a mut [f32]>,
    scratch: &'a mut Scratch,
}

/// Columns that are filtered together.
struct Block {
    /// The columns.
    columns: Range<usize>,
    /// What the filter along x looks at, inside the picture.
    seen: Range<usize>,
    /// The groups of columns that those lie in.
    groups: Range<usize>,
}

impl<'a> Work<'a> {
    pub fn new(
        smoother: &'a Smoother,
        window: &'a Window,
        batch: &'a Batch,
        rows: Range<usize>,
        kept: Vec<&'a mut [f32]>,
        scratch: &'a mut Scratch,
    ) -> Self {
        let radius = smoother.y.radius();
        let rows_seen = rows.start.saturating_sub(radius)..(rows.end + radius).min(window.rows);
        let groups = window.groups;
        let mut occupied = vec![false; rows_seen.len() * groups];
        for timestep in batch.sees(smoother.t.radius()) {
            for (row, out) in rows_seen.clone().zip(occupied.chunks_exact_mut(groups)) {
                for (out, occupied) in out.iter_mut().zip(window.occupied(timestep, row)) {
                    *out |= occupied;
                }
            }
        }
        Self { smoother, window, batch, rows, rows_seen, occupied, kept, scratch }
    }

    /// The runs above the threshold, for each timestep.
    pub fn run(mut self) -> Strip {
        let columns = self.window.columns;
        let radius = self.smoother.x.radius();
        let mut found: Vec<Vec<Vec<Run>>> = vec![Vec::new(); self.batch.steps.len()];
        for (within, lit) in self.spans() {
            let seen = within.start.saturating_sub(radius)..(within.end + radius).min(columns);
            let groups = seen.start / GROUP..seen.end.div_ceil(GROUP);
            let block = Block { columns: within, seen, groups };
            if !lit {
                for step in 0..self.kept.len() {
                    self.rows.clone().for_each(|row| self.keep(step, row, &block, None));
                }
                continue;
            }
            for found in &mut found {
                found.push(Vec::new());
            }
            if self.smoother.is_identity() {
                self.copy(&block, &mut found);
            } else {
                self.filter(&block, &mut found);
            }
        }
        let stitched = |blocks: &Vec<Vec<Run>>| {
            let mut runs = Vec::with_capacity(blocks.iter().map(Vec::len).sum());
            stitch(blocks, &mut runs);
            runs
        };
        found.iter().map(stitched).collect()
    }

    /// The columns cut into spans, and of each whether the filter sees anything but 0 there in any
    /// row: where light is rare most columns of a strip are dark, and cost nothing.
    fn spans(&self) -> Vec<(Range<usize>, bool)> {
        let (columns, groups) = (self.window.columns, self.window.groups);
        let mut occupied = vec![false; groups];
        for row in self.occupied.chunks_exact(groups) {
            occupied.iter_mut().zip(row).for_each(|(any, occupied)| *any |= occupied);
        }
        let reach = self.smoother.x.radius().div_ceil(GROUP);
        let lit = |group: usize| {
            occupied[group.saturating_sub(reach)..(group + reach + 1).min(groups)].contains(&true)
        };
        let mut spans = Vec::new();
        let mut first = 0;
        while first < groups {
            let bright = lit(first);
            let end = (first + 1..groups).find(|&group| lit(group) != bright).unwrap_or(groups);
            let span = first * GROUP..(end * GROUP).min(columns);
            let blocks = if bright { span.len().div_ceil(BLOCK_COLUMNS) } else { 1 };
            let width = span.len().div_ceil(blocks).next_multiple_of(GROUP);
            let cut = span.clone().step_by(width);
            spans.extend(cut.map(|start| (start..(start + width).min(span.end), bright)));
            first = end;
        }
        spans
    }

    /// Whether the filter sees anything but 0 in a row of a block.
    fn is_lit(&self, row: usize, block: &Block) -> bool {
        let flags = &self.occupied[(row - self.rows_seen.start) * self.window.groups..];
        flags[block.groups.clone()].contains(&true)
    }

    /// No filter at all: the input is compared as it is.
    fn copy(&mut self, block: &Block, found: &mut [Vec<Vec<Run>>]) {
        for (step, timestep) in self.batch.steps.clone().enumerate() {
            for row in self.rows.clone() {
                let values = &self.window.row(timestep, row)[block.columns.clone()];
                self.keep(step, row, block, Some(values));
                if self.is_lit(row, block) {
                    self.compare(values, row, block, &mut found[step]);
                }
            }
        }
    }

    fn filter(&mut self, block: &Block, found: &mut [Vec<Vec<Run>>]) {
        let slots = (2 * self.smoother.y.radius() + GROUP_ROWS).min(self.window.rows);
        let mut ring = Ring {
            rows: std::mem::take(&mut self.scratch.ring),
            zero: std::mem::take(&mut self.scratch.zero),
            slots,
            steps: self.batch.room,
            width: block.seen.len(),
        };
        ring.clear();
        let mut next = self.rows_seen.start;
        for first in self.rows.clone().step_by(GROUP_ROWS) {
            let rows = first..(first + GROUP_ROWS).min(self.rows.end);
            let needed = (rows.end + self.smoother.y.radius()).min(self.rows_seen.end);
            while next < needed {
                self.filter_in_time(next, block, &mut ring);
                next += 1;
            }
            self.filter_in_space(&rows, block, &ring, found);
        }
        (self.scratch.ring, self.scratch.zero) = (ring.rows, ring.zero);
    }

    /// Filters a row in time, for all timesteps of the batch, into the ring.
    fn filter_in_time(&mut self, row: usize, block: &Block, ring: &mut Ring) {
        if !self.is_lit(row, block) {
            ring.set_zero(row);
            return;
        }
        let Batch { segment, steps, room } = self.batch;
        let radius = self.smoother.t.radius() as isize;
        let first = (steps.start - segment.start) as isize;
        // Behind the last timestep of the batch stands what is there: those results are of no use.
        let last = (steps.len() - 1) as isize;
        let lines: Vec<&[f32]> = (-radius..*room as isize + radius)
            .map(|i| segment.start + reflect(first + i.min(last + radius), segment.len()))
            .map(|timestep| &self.window.row(timestep, row)[block.seen.clone()])
            .collect();
        let width = ring.width;
        dispatch(Across {
            lines: &lines,
            weights: self.smoother.t.weights(),
            width,
            out: ring.row_mut(row),
            stride: width,
            room: &mut self.scratch.room,
        });
    }

    /// Filters some rows along y and x, and finds what lies above the threshold.
    fn filter_in_space(
        &mut self,
        rows: &Range<usize>,
        block: &Block,
        ring: &Ring,
        found: &mut [Vec<Vec<Run>>],
    ) {
        let (y, x) = (&self.smoother.y, &self.smoother.x);
        let radius = y.radius() as isize;
        let last = (rows.len() - 1) as isize;
        let slots: Vec<usize> = (-radius..GROUP_ROWS as isize + radius)
            .map(|i| reflect(rows.start as isize + i.min(last + radius), self.window.rows))
            .collect();
        if slots.iter().all(|&row| ring.is_zero(row)) {
            for step in 0..self.kept.len() {
                rows.clone().for_each(|row| self.keep(step, row, block, None));
            }
            return;
        }
        let out_width = block.columns.len().next_multiple_of(LANES);
        let stride = (out_width.max(ring.width) + 2 * x.radius()).next_multiple_of(8);
        let line_start = block.columns.start as isize - x.radius() as isize;
        let line_end = block.columns.len() + 2 * x.radius();
        let inside = block.seen.start.wrapping_add_signed(-line_start);
        let mut lines = std::mem::take(&mut self.scratch.lines);
        let mut out = std::mem::take(&mut self.scratch.out);
        out.resize(out_width, 0.0);
        for (step, found) in found.iter_mut().enumerate() {
            let across: Vec<&[f32]> = slots.iter().map(|&row| ring.row(row, step)).collect();
            let lines = lines.of(GROUP_ROWS * stride);
            dispatch(Across {
                lines: &across,
                weights: y.weights(),
                width: ring.width,
                out: &mut lines[inside..],
                stride,
                room: &mut self.scratch.room,
            });
            for (line, row) in lines.chunks_exact_mut(stride).zip(rows.clone()) {
                let within = &mut line[..line_end];
                beyond_the_borders(within, line_start, &block.seen, self.window.columns);
                dispatch(Along { line, weights: x.weights(), out: &mut out });
                let values = &out[..block.columns.len()];
                self.compare(values, row, block, found);
                self.keep(step, row, block, Some(values));
            }
        }
        (self.scratch.lines, self.scratch.out) = (lines, out);
    }

    /// Keeps a filtered row, or 0, where that is wanted.
    fn keep(&mut self, step: usize, row: usize, block: &Block, values: Option<&[f32]>) {
        let Some(kept) = self.kept.get_mut(step) else { return };
        let to = &mut kept[(row - self.rows.start) * self.window.columns..][block.columns.clone()];
        match values {
            Some(values) => to.copy_from_slice(values),
            None => to.fill(0.0),
        }
    }

    fn compare(&self, values: &[f32], row: usize, block: &Block, found: &mut [Vec<Run>]) {
        let Some(runs) = found.last_mut() else { return };
        let threshold = self.smoother.threshold;
        // Rows and columns are bounded by MAX_VIEW_PIXELS.
        let (row, column) = (row as u32, block.columns.start as u32);
        dispatch(FindRuns { values, threshold, row, column, runs });
    }
}

/// Rows filtered in time, as many as the filter along y looks at together: slot, timestep of the
/// batch, column.
struct Ring {
    rows: Vec<f32>,
    zero: Vec<bool>,
    slots: usize,
    /// Timesteps for which there is room.
    steps: usize,
    width: usize,
}

impl Ring {
    /// Nothing that was left in it is looked at before it is written over.
    fn clear(&mut self) {
        self.rows.resize(self.slots * self.steps * self.width, 0.0);
        self.zero.clear();
        self.zero.resize(self.slots, false);
    }

    fn set_zero(&mut self, row: usize) {
        if !self.is_zero(row) {
            self.row_mut(row).fill(0.0);
            self.zero[row % self.slots] = true;
        }
    }

    fn is_zero(&self, row: usize) -> bool {
        self.zero[row % self.slots]
    }

    /// All timesteps of a row, to be written.
    fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let slot = row % self.slots;
        self.zero[slot] = false;
        let length = self.steps * self.width;
        &mut self.rows[slot * length..][..length]
    }

    fn row(&self, row: usize, step: usize) -> &[f32] {
        &self.rows[(row % self.slots * self.steps + step) * self.width..][..self.width]
    }
}

/// Fills a line, which begins at column `start`, where it isn't `seen`: outside the picture.
fn beyond_the_borders(line: &mut [f64], start: isize, seen: &Range<usize>, columns: usize) {
    let inside = seen.start.wrapping_add_signed(-start)..seen.end.wrapping_add_signed(-start);
    for i in (0..inside.start).chain(inside.end..line.len()) {
        let column = reflect(start + i as isize, columns);
        line[i] = line[column.wrapping_add_signed(-start)];
    }
}
