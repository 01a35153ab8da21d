//! One strip of rows through the filter, at the timesteps of one batch.
//!
//! The Gaussian is separable: along t, then y, then x, each axis rounded to float32 as SciPy does it.
//! Three passes over a slice would fetch it from memory three times, and along t once for each
//! timestep that the filter reaches. So the work is cut until all of it stays in the second cache: a
//! strip of rows, in pieces of [`PIECE_COLUMNS`] columns. Each row of a piece is filtered in time
//! once, for all timesteps of the batch, and kept in a ring as long as the filter along y needs it;
//! [`GROUP_ROWS`] rows are filtered along y together; and what that gives is filtered along x and
//! handed on while it is still in the nearest cache.
//!
//! Most of a picture is dark most of the time. The window knows for each row and [`GROUP`] of columns
//! whether anything there isn't +0; columns that see nothing else are handed on as dark, unread.
//!
//! What lost: filtering whole slices axis by axis, which at sigma 1 fetches each slice of the window
//! nine times from memory instead of twice; and a recursive Gaussian, whose result isn't SciPy's.

use std::ops::Range;

use super::kernel::{Gaussian, reflect};
use super::part::Batch;
use super::vector::{Across, Aligned, Along, LANES, dispatch};
use super::window::{GROUP, Window};

/// Rows that are filtered along y together: their lines are then loaded three times for four rows
/// instead of nine times for each.
pub(in crate::glare) const GROUP_ROWS: usize = 4;
/// Columns that are filtered together, so that all that is needed stays in the second cache.
pub(in crate::glare) const PIECE_COLUMNS: usize = 1024;

/// Takes what the filter delivers of a strip: pieces of columns from left to right, and in each of
/// them, for each timestep of the batch, rows from the top.
pub(in crate::glare) trait FilteredRows {
    /// A piece begins that isn't all dark.
    fn begin(&mut self, columns: &Range<usize>);
    /// A row of the piece, at timestep number `step` of the batch.
    fn row(&mut self, step: usize, row: usize, values: &[f32]);
    /// Rows that are all 0 in some columns, at all timesteps.
    fn dark(&mut self, rows: Range<usize>, columns: &Range<usize>);
}

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
pub(in crate::glare) struct Strip<'a> {
    pub gaussian: &'a Gaussian,
    pub window: &'a Window,
    pub batch: &'a Batch,
    pub rows: Range<usize>,
}

/// A strip at work.
struct Work<'a, R> {
    strip: Strip<'a>,
    /// The rows of the picture that the filter looks at.
    rows_seen: Range<usize>,
    /// For each row seen and group of columns: whether any slice seen holds anything but 0 there.
    occupied: Vec<bool>,
    scratch: &'a mut Scratch,
    out: &'a mut R,
}

/// Columns that are filtered together.
struct Piece {
    /// The columns.
    columns: Range<usize>,
    /// What the filter along x looks at, inside the picture.
    seen: Range<usize>,
    /// The groups of columns that those lie in.
    groups: Range<usize>,
}

/// Columns that are all lit, or all dark.
struct Span {
    columns: Range<usize>,
    lit: bool,
}

impl Strip<'_> {
    /// Filters the strip.
    pub fn run(self, scratch: &mut Scratch, out: &mut impl FilteredRows) {
        let Self { gaussian, window, batch, ref rows } = self;
        let radius = gaussian.y.radius();
        let rows_seen = rows.start.saturating_sub(radius)..(rows.end + radius).min(window.rows);
        let groups = window.groups;
        let mut occupied = vec![false; rows_seen.len() * groups];
        for timestep in batch.sees(gaussian.t.radius()) {
            for (row, out) in rows_seen.clone().zip(occupied.chunks_exact_mut(groups)) {
                for (out, occupied) in out.iter_mut().zip(window.occupied(timestep, row)) {
                    *out |= occupied;
                }
            }
        }
        Work { strip: self, rows_seen, occupied, scratch, out }.run();
    }
}

impl<R: FilteredRows> Work<'_, R> {
    fn run(&mut self) {
        let columns = self.strip.window.columns;
        let radius = self.strip.gaussian.x.radius();
        for Span { columns: within, lit } in self.spans() {
            if !lit {
                self.out.dark(self.strip.rows.clone(), &within);
                continue;
            }
            let seen = within.start.saturating_sub(radius)..(within.end + radius).min(columns);
            let groups = seen.start / GROUP..seen.end.div_ceil(GROUP);
            let piece = Piece { columns: within, seen, groups };
            self.out.begin(&piece.columns);
            if self.strip.gaussian.is_identity() {
                self.copy(&piece);
            } else {
                self.filter(&piece);
            }
        }
    }

    /// The columns cut into spans, and of each whether the filter sees anything but 0 there in any
    /// row: where light is rare most columns of a strip are dark, and cost nothing.
    fn spans(&self) -> Vec<Span> {
        let (columns, groups) = (self.strip.window.columns, self.strip.window.groups);
        let mut occupied = vec![false; groups];
        for row in self.occupied.chunks_exact(groups) {
            occupied.iter_mut().zip(row).for_each(|(any, occupied)| *any |= occupied);
        }
        let reach = self.strip.gaussian.x.radius().div_ceil(GROUP);
        let is_lit = |group: usize| {
            occupied[group.saturating_sub(reach)..(group + reach + 1).min(groups)].contains(&true)
        };
        let mut spans = Vec::new();
        let mut first = 0;
        while first < groups {
            let lit = is_lit(first);
            let end = (first + 1..groups).find(|&group| is_lit(group) != lit).unwrap_or(groups);
            let span = first * GROUP..(end * GROUP).min(columns);
            let pieces = if lit { span.len().div_ceil(PIECE_COLUMNS) } else { 1 };
            let width = span.len().div_ceil(pieces).next_multiple_of(GROUP);
            let cut = |start: usize| Span { columns: start..(start + width).min(span.end), lit };
            spans.extend(span.clone().step_by(width).map(cut));
            first = end;
        }
        spans
    }

    /// Whether the filter sees anything but 0 in a row of a piece.
    fn is_lit(&self, row: usize, piece: &Piece) -> bool {
        let flags = &self.occupied[(row - self.rows_seen.start) * self.strip.window.groups..];
        flags[piece.groups.clone()].contains(&true)
    }

    /// No filter at all: the input is handed on as it is.
    fn copy(&mut self, piece: &Piece) {
        for row in self.strip.rows.clone() {
            if !self.is_lit(row, piece) {
                self.out.dark(row..row + 1, &piece.columns);
                continue;
            }
            for (step, timestep) in self.strip.batch.steps.clone().enumerate() {
                let values = &self.strip.window.row(timestep, row)[piece.columns.clone()];
                self.out.row(step, row, values);
            }
        }
    }

    fn filter(&mut self, piece: &Piece) {
        let radius = self.strip.gaussian.y.radius();
        let mut ring = Ring {
            rows: std::mem::take(&mut self.scratch.ring),
            zero: std::mem::take(&mut self.scratch.zero),
            slots: (2 * radius + GROUP_ROWS).min(self.strip.window.rows),
            steps: self.strip.batch.room,
            width: piece.seen.len(),
        };
        ring.clear();
        let mut next = self.rows_seen.start;
        for first in self.strip.rows.clone().step_by(GROUP_ROWS) {
            let rows = first..(first + GROUP_ROWS).min(self.strip.rows.end);
            let needed = (rows.end + radius).min(self.rows_seen.end);
            while next < needed {
                self.filter_in_time(next, piece, &mut ring);
                next += 1;
            }
            self.filter_in_space(&rows, piece, &ring);
        }
        (self.scratch.ring, self.scratch.zero) = (ring.rows, ring.zero);
    }

    /// Filters a row in time, for all timesteps of the batch, into the ring.
    fn filter_in_time(&mut self, row: usize, piece: &Piece, ring: &mut Ring) {
        if !self.is_lit(row, piece) {
            ring.set_zero(row);
            return;
        }
        let Strip { gaussian, window, batch: Batch { segment, steps, room }, .. } = &self.strip;
        let radius = gaussian.t.radius() as isize;
        let first = (steps.start - segment.start) as isize;
        // Behind the last timestep of the batch stands what is there: those results are of no use.
        let last = (steps.len() - 1) as isize;
        let lines: Vec<&[f32]> = (-radius..*room as isize + radius)
            .map(|i| segment.start + reflect(first + i.min(last + radius), segment.len()))
            .map(|timestep| &window.row(timestep, row)[piece.seen.clone()])
            .collect();
        let width = ring.width;
        dispatch(Across {
            lines: &lines,
            weights: gaussian.t.weights(),
            width,
            out: ring.row_mut(row),
            stride: width,
            room: &mut self.scratch.room,
        });
    }

    /// Filters some rows along y and x, and hands them on.
    fn filter_in_space(&mut self, rows: &Range<usize>, piece: &Piece, ring: &Ring) {
        let Strip { gaussian: Gaussian { y, x, .. }, window, batch, .. } = &self.strip;
        let radius = y.radius() as isize;
        let last = (rows.len() - 1) as isize;
        let slots: Vec<usize> = (-radius..GROUP_ROWS as isize + radius)
            .map(|i| reflect(rows.start as isize + i.min(last + radius), window.rows))
            .collect();
        if slots.iter().all(|&row| ring.is_zero(row)) {
            self.out.dark(rows.clone(), &piece.columns);
            return;
        }
        let out_width = piece.columns.len().next_multiple_of(LANES);
        // Lines begin at the border of a cache line: 8 numbers of 8 bytes.
        let stride = (out_width.max(ring.width) + 2 * x.radius()).next_multiple_of(8);
        let line_start = piece.columns.start as isize - x.radius() as isize;
        let line_end = piece.columns.len() + 2 * x.radius();
        let inside = piece.seen.start.wrapping_add_signed(-line_start);
        let Scratch { lines, out, room, .. } = &mut *self.scratch;
        out.resize(out_width, 0.0);
        for step in 0..batch.steps.len() {
            let across: Vec<&[f32]> = slots.iter().map(|&row| ring.row(row, step)).collect();
            let lines = lines.of(GROUP_ROWS * stride);
            dispatch(Across {
                lines: &across,
                weights: y.weights(),
                width: ring.width,
                out: &mut lines[inside..],
                stride,
                room,
            });
            for (line, row) in lines.chunks_exact_mut(stride).zip(rows.clone()) {
                let within = &mut line[..line_end];
                beyond_the_borders(within, line_start, &piece.seen, window.columns);
                dispatch(Along { line, weights: x.weights(), out: &mut out[..] });
                self.out.row(step, row, &out[..piece.columns.len()]);
            }
        }
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
