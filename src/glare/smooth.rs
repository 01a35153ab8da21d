use std::ops::Range;

use rayon::prelude::*;

use super::error::Error;
use super::kernel::{Kernel, reflect};
use super::settings::Settings;
use super::threshold::{FindRuns, Run, stitch};
use super::vector::{Aligned, LANES, Stencil, Widen, dispatch};
use super::window::{GROUP, Window};

/// Rows that one thread filters at a time: enough that the rows above and below, which are
/// filtered in time twice, don't matter.
const STRIP_ROWS: usize = 64;
/// Rows that are filtered along y together: their lines are then fetched from the second cache
/// three times for four rows instead of nine for each.
const GROUP_ROWS: usize = 4;
/// Columns that are filtered together, so that all that is needed stays in the second cache.
const BLOCK_COLUMNS: usize = 512;

/// The separable Gaussian along t, then y, then x, each rounded to float32, and the threshold.
///
/// It works through strips of rows and blocks of columns: each row of the window is filtered in
/// time once for several timesteps, kept in a ring for the filter along y, and what that gives is
/// filtered along x and compared while it is still in the cache.
#[derive(Clone, Debug)]
pub(super) struct Smoother {
    pub t: Kernel,
    pub y: Kernel,
    pub x: Kernel,
    pub threshold: f32,
}

/// Consecutive timesteps of one segment.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    /// The segment.
    pub segment: Range<usize>,
    /// The timesteps to filter.
    pub steps: Range<usize>,
}

impl Batch {
    /// The timesteps that the filter looks at.
    pub fn sees(&self, radius: usize) -> Range<usize> {
        let first = self.steps.start.saturating_sub(radius).max(self.segment.start);
        first..(self.steps.end + radius).min(self.segment.end)
    }
}

/// What lies above the threshold in a strip of rows: for each timestep of the batch its runs,
/// sorted by row and column.
pub(super) type Strip = Vec<Vec<Run>>;

impl Smoother {
    /// The filter and the threshold that are asked for.
    pub fn new(settings: &Settings) -> Result<Self, Error> {
        let [t, y, x] = settings.kernels()?;
        Ok(Self { t, y, x, threshold: settings.threshold_f32()? })
    }

    /// Whether no axis is filtered.
    pub fn is_identity(&self) -> bool {
        [&self.t, &self.y, &self.x].iter().all(|kernel| kernel.is_identity())
    }

    /// Filters a batch. `keep` takes the filtered slices, one after the other.
    pub fn run(&self, window: &Window, batch: &Batch, keep: Option<&mut [f32]>) -> Vec<Strip> {
        let (rows, columns) = (window.rows, window.columns);
        let strips = rows.div_ceil(STRIP_ROWS);
        let mut kept: Vec<Vec<&mut [f32]>> = (0..strips).map(|_| Vec::new()).collect();
        for slice in keep.into_iter().flat_map(|all| all.chunks_mut(rows * columns)) {
            for (strip, part) in kept.iter_mut().zip(slice.chunks_mut(STRIP_ROWS * columns)) {
                strip.push(part);
            }
        }
        kept.into_par_iter()
            .enumerate()
            .map_init(Scratch::default, |scratch, (number, kept)| {
                let first = number * STRIP_ROWS;
                let rows = first..(first + STRIP_ROWS).min(rows);
                Work { smoother: self, window, batch, rows, kept, scratch }.run()
            })
            .collect()
    }
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    /// One row of each slice that the filter sees.
    slices: Aligned,
    /// Rows filtered in time: ring row, timestep of the batch, column.
    ring: Aligned,
    /// Which rows of the ring hold nothing but 0.
    zero: Vec<bool>,
    /// A row filtered in time and along y, with what lies beyond the borders.
    line: Aligned,
    /// A filtered row.
    out: Vec<f32>,
}

/// One strip of one batch.
struct Work<'a> {
    smoother: &'a Smoother,
    window: &'a Window,
    batch: &'a Batch,
    rows: Range<usize>,
    /// For each timestep where the filtered strip goes; empty where nobody wants it.
    kept: Vec<&'a mut [f32]>,
    scratch: &'a mut Scratch,
}

impl Work<'_> {
    fn run(mut self) -> Strip {
        let steps = self.batch.steps.len();
        let occupied = self.occupied();
        let columns = self.window.columns;
        let blocks = columns.div_ceil(BLOCK_COLUMNS);
        let width = columns.div_ceil(blocks).next_multiple_of(GROUP);
        let mut found: Vec<Vec<Vec<Run>>> = vec![Vec::new(); steps];
        for start in (0..columns).step_by(width) {
            for found in &mut found {
                found.push(Vec::new());
            }
            let block = start..(start + width).min(columns);
            if self.smoother.is_identity() {
                self.copy(&block, &occupied, &mut found);
            } else {
                self.filter(&block, &occupied, &mut found);
            }
        }
        found
            .iter()
            .map(|blocks| {
                let mut runs = Vec::with_capacity(blocks.iter().map(Vec::len).sum());
                stitch(blocks, &mut runs);
                runs
            })
            .collect()
    }

    /// The rows of the picture that the filter looks at.
    fn rows_seen(&self) -> Range<usize> {
        let radius = self.smoother.y.radius();
        self.rows.start.saturating_sub(radius)..(self.rows.end + radius).min(self.window.rows)
    }

    /// For each row seen and group of columns: whether any slice seen holds anything but 0 there.
    fn occupied(&self) -> Vec<bool> {
        let groups = self.window.groups;
        let rows = self.rows_seen();
        let mut out = vec![false; rows.len() * groups];
        for timestep in self.batch.sees(self.smoother.t.radius()) {
            for (row, out) in rows.clone().zip(out.chunks_exact_mut(groups)) {
                for (out, occupied) in out.iter_mut().zip(self.window.occupied(timestep, row)) {
                    *out |= occupied;
                }
            }
        }
        out
    }

    /// No filter at all: the input is compared as it is.
    fn copy(&mut self, block: &Range<usize>, occupied: &[bool], found: &mut [Vec<Vec<Run>>]) {
        let groups = block.start / GROUP..block.end.div_ceil(GROUP);
        for (step, timestep) in self.batch.steps.clone().enumerate() {
            for (index, row) in self.rows.clone().enumerate() {
                let values = &self.window.row(timestep, row)[block.clone()];
                if let Some(kept) = self.kept.get_mut(step) {
                    kept[index * self.window.columns..][block.clone()].copy_from_slice(values);
                }
                if occupied[index * self.window.groups..][groups.clone()].contains(&true) {
                    compare(self.smoother.threshold, values, row, block.start, &mut found[step]);
                }
            }
        }
    }

    fn filter(&mut self, block: &Range<usize>, occupied: &[bool], found: &mut [Vec<Vec<Run>>]) {
        let Smoother { t, y, x, threshold } = self.smoother;
        let window = self.window;
        let steps = self.batch.steps.len();
        let sees = self.batch.sees(t.radius());
        // What the filter along x looks at, inside the picture.
        let seen =
            block.start.saturating_sub(x.radius())..(block.end + x.radius()).min(window.columns);
        let width = seen.len().next_multiple_of(LANES);
        let out_width = block.len().next_multiple_of(LANES);
        let groups = seen.start / GROUP..seen.end.div_ceil(GROUP);
        let rows_seen = self.rows_seen();
        let mut rows_occupied = occupied.chunks_exact(window.groups);
        if !rows_occupied.any(|row| row[groups.clone()].contains(&true)) {
            for kept in &mut self.kept {
                for row in kept.chunks_exact_mut(window.columns) {
                    row[block.clone()].fill(0.0);
                }
            }
            return;
        }
        let ring_rows = (2 * y.radius() + GROUP_ROWS).min(window.rows);

        let Scratch { slices, ring, zero, line, out } = &mut *self.scratch;
        let slices = slices.of(sees.len() * width);
        let line_stride = (out_width.max(width) + 2 * x.radius()).next_multiple_of(8);
        let line = line.of(GROUP_ROWS * line_stride);
        // What is left in the ring from before is written over before it is looked at.
        let ring = ring.of(ring_rows * steps * width);
        zero.clear();
        zero.resize(ring_rows, false);
        out.resize(out_width, 0.0);

        let in_time: Vec<usize> = (self.batch.steps.clone())
            .flat_map(|timestep| {
                let segment = &self.batch.segment;
                let place =
                    |index| (segment.start + reflect(index, segment.len()) - sees.start) * width;
                offsets(timestep - segment.start, t.radius(), place)
            })
            .collect();
        let across: Vec<usize> = offsets(0, x.radius(), |i| x.radius().wrapping_add_signed(i));
        let line_start = block.start as isize - x.radius() as isize;
        let inside = seen.start.wrapping_add_signed(-line_start);
        let line_end = block.len() + 2 * x.radius();

        let mut next = rows_seen.start;
        for first in self.rows.clone().step_by(GROUP_ROWS) {
            let rows = first..(first + GROUP_ROWS).min(self.rows.end);
            while next < rows_seen.end && next < rows.end + y.radius() {
                let slot = next % ring_rows;
                let into = &mut ring[slot * steps * width..][..steps * width];
                let seen_row = &occupied[(next - rows_seen.start) * window.groups..];
                if seen_row[groups.clone()].contains(&true) {
                    for (timestep, slice) in sees.clone().zip(slices.chunks_exact_mut(width)) {
                        let from = &window.row(timestep, next)[seen.clone()];
                        dispatch(Widen { from, to: slice });
                    }
                    dispatch(Stencil {
                        lines: slices,
                        offsets: &in_time,
                        weights: t.weights(),
                        width,
                        out: into,
                        stride: width,
                    });
                    zero[slot] = false;
                } else if !zero[slot] {
                    into.fill(0.0);
                    zero[slot] = true;
                }
                next += 1;
            }
            let slots: Vec<usize> = (rows.clone())
                .flat_map(|row| offsets(row, y.radius(), |i| reflect(i, window.rows) % ring_rows))
                .collect();
            let empty = slots.iter().all(|&slot| zero[slot]);
            let kept_at = (first - self.rows.start) * window.columns;
            for (step, found) in found.iter_mut().enumerate() {
                let mut kept = self.kept.get_mut(step).map(|kept| &mut kept[kept_at..]);
                if empty {
                    for row in
                        kept.iter_mut().flat_map(|k| k.chunks_mut(window.columns)).take(rows.len())
                    {
                        row[block.clone()].fill(0.0);
                    }
                    continue;
                }
                let lines: Vec<usize> =
                    slots.iter().map(|slot| (slot * steps + step) * width).collect();
                dispatch(Stencil {
                    lines: ring,
                    offsets: &lines,
                    weights: y.weights(),
                    width,
                    out: &mut line[inside..],
                    stride: line_stride,
                });
                for (line, row) in line.chunks_exact_mut(line_stride).zip(rows.clone()) {
                    beyond_the_borders(&mut line[..line_end], line_start, &seen, window.columns);
                    dispatch(Stencil {
                        lines: line,
                        offsets: &across,
                        weights: x.weights(),
                        width: out_width,
                        out: &mut out[..],
                        stride: 0,
                    });
                    let out = &out[..block.len()];
                    compare(*threshold, out, row, block.start, found);
                    if let Some(kept) = &mut kept {
                        kept[(row - first) * window.columns..][block.clone()].copy_from_slice(out);
                    }
                }
            }
        }
    }
}

/// The places of the centre and, for each distance, of the one before and the one after.
fn offsets(centre: usize, radius: usize, place: impl Fn(isize) -> usize) -> Vec<usize> {
    let centre = centre as isize;
    let pairs = (1..=radius as isize).flat_map(|j| [centre - j, centre + j]);
    std::iter::once(centre).chain(pairs).map(place).collect()
}

/// Fills a line, which begins at column `start`, where it isn't `seen`: outside the picture.
fn beyond_the_borders(line: &mut [f64], start: isize, seen: &Range<usize>, columns: usize) {
    let inside = seen.start.wrapping_add_signed(-start)..seen.end.wrapping_add_signed(-start);
    for i in (0..inside.start).chain(inside.end..line.len()) {
        let column = reflect(start + i as isize, columns);
        line[i] = line[column.wrapping_add_signed(-start)];
    }
}

fn compare(threshold: f32, values: &[f32], row: usize, column: usize, found: &mut [Vec<Run>]) {
    let Some(runs) = found.last_mut() else { return };
    // Rows and columns are bounded by MAX_VIEW_PIXELS.
    dispatch(FindRuns { values, threshold, row: row as u32, column: column as u32, runs });
}
