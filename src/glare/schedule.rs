//! The order of the work: passes over time, and steps down the picture in each.
//!
//! A pass reads the timesteps of one chunk; how many of them can be filtered then depends on how far
//! the filter reaches ahead, and on where the segment ends. [`Passes`] cuts the segments so, and
//! [`Schedule`] cuts each pass into steps: some rows, and what must be read before they are filtered.

use std::ops::Range;
use std::sync::Arc;

use super::filter::part::Part;
use super::wave::STRIP_ROWS;
use crate::base::limits::TILE_EDGE;

/// One way down the picture: what is read on it, and the timesteps whose events can be found then.
#[derive(Clone, Debug, Default)]
pub(super) struct Pass {
    /// The timesteps to read; none where what was read before isn't all used up.
    pub reads: Range<usize>,
    /// What the filter can do once they are there.
    pub parts: Vec<Part>,
}

impl Pass {
    /// Timesteps of all parts.
    pub fn steps(&self) -> usize {
        self.parts.iter().map(|part| part.steps.len()).sum()
    }
}

/// A step of a pass: the rows of one wave.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub pass: Arc<Pass>,
    /// The rows that are filtered.
    pub rows: Range<usize>,
    /// The rows of tiles that are read before; none where all that the filter sees is there.
    pub reads: Range<usize>,
    /// Whether it is the last one of its pass.
    pub ends: bool,
}

impl Step {
    /// Whether it is the first one of its pass.
    pub fn begins(&self) -> bool {
        self.rows.start == 0
    }
}

/// Cuts passes into steps, from the top of the picture to the bottom.
#[derive(Debug)]
pub(super) struct Schedule<'a> {
    passes: Passes<'a>,
    pass: Arc<Pass>,
    /// Rows of the picture.
    rows: usize,
    /// Rows of a step.
    step_rows: usize,
    /// How far the filter reaches up and down.
    reach: usize,
    /// First row that isn't in a step of the present pass.
    next: usize,
    /// End of the rows that were read in the present pass.
    read: usize,
}

impl<'a> Schedule<'a> {
    /// The steps of `passes` down a picture of `rows` rows, `strips` strips at a time.
    pub fn new(passes: Passes<'a>, rows: usize, strips: usize, reach: usize) -> Self {
        let (pass, step_rows) = (Arc::default(), STRIP_ROWS * strips);
        Self { passes, pass, rows, step_rows, reach, next: rows, read: 0 }
    }

    /// The next step; none at the end. `to_the_end`: should a pass begin, it doesn't go beyond the
    /// end of its first segment.
    pub fn next(&mut self, to_the_end: bool) -> Option<Step> {
        if self.next == self.rows {
            self.pass = Arc::new(self.passes.next(to_the_end)?);
            (self.next, self.read) = (0, 0);
        }
        let rows = self.next..(self.next + self.step_rows).min(self.rows);
        let mut reads = self.read..self.read;
        if !self.pass.reads.is_empty() {
            reads.end = (rows.end + self.reach).next_multiple_of(TILE_EDGE).min(self.rows);
        }
        (self.next, self.read) = (rows.end, reads.end);
        Some(Step { pass: Arc::clone(&self.pass), ends: rows.end == self.rows, rows, reads })
    }
}

/// Blocks of timesteps that are filtered in one pass at most: where a filter reaches far, much is
/// ready at the end of a segment, and what is found of it takes memory.
const MOST_BLOCKS: usize = 2;
/// A block counts for so many timesteps there at least, that a wave is worth its threads.
const LEAST_BLOCK: usize = 8;

/// Cuts whole segments into passes.
#[derive(Debug)]
pub(super) struct Passes<'a> {
    /// Segments that aren't done.
    segments: &'a [Range<usize>],
    /// How many segments there were before those.
    segments_before: usize,
    /// First timestep that wasn't read.
    read: usize,
    /// First timestep that wasn't filtered.
    done: usize,
    /// Timesteps that are read together, from a multiple of that number on.
    block: usize,
    /// How far the filter reaches.
    radius: usize,
}

impl<'a> Passes<'a> {
    pub fn new(
        segments: &'a [Range<usize>],
        segments_before: usize,
        block: usize,
        radius: usize,
    ) -> Self {
        let first = segments.first().map_or(0, |segment| segment.start);
        Self { segments, segments_before, read: first, done: first, block, radius }
    }

    /// The next pass. `to_the_end`: it doesn't go beyond the end of the segment that it begins in.
    pub fn next(&mut self, to_the_end: bool) -> Option<Pass> {
        let end = self.segments.last()?.end;
        let mut reads = self.read..self.read;
        if self.ready() <= self.done && self.read < end {
            let aligned = (self.read / self.block + 1) * self.block;
            let here = self.segments.iter().find(|segment| segment.end > self.read);
            let most = if to_the_end { here.map_or(end, |segment| segment.end) } else { end };
            reads.end = aligned.min(most);
            self.read = reads.end;
        }
        let mut parts = Vec::new();
        let mut left = MOST_BLOCKS * self.block.max(LEAST_BLOCK);
        while let Some(segment) = self.segments.first() {
            let ready = self.ready();
            let steps = self.done..ready.min(self.done + left);
            if !steps.is_empty() {
                left -= steps.len();
                self.done = steps.end;
                let segments_before = self.segments_before;
                parts.push(Part { segment: segment.clone(), steps, segments_before });
            }
            if self.done < segment.end {
                break;
            }
            self.segments_before += 1;
            self.segments = &self.segments[1..];
            if left == 0 {
                break;
            }
        }
        Some(Pass { reads, parts })
    }

    /// Behind the last timestep of the first segment that can be filtered.
    fn ready(&self) -> usize {
        match self.segments.first() {
            Some(segment) if segment.end <= self.read => segment.end,
            Some(_) => self.read.saturating_sub(self.radius).max(self.done),
            None => self.done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_read_and_filter_every_timestep_once_when_all_that_is_seen_is_there() {
        let all: [&[usize]; 4] = [&[1], &[5, 49, 49, 1, 1, 1, 30], &[300], &[16, 16, 3, 200, 7]];
        for lengths in all {
            let mut segments: Vec<Range<usize>> = Vec::new();
            let mut end = 11;
            for length in lengths {
                segments.push(end..end + length);
                end += length;
            }
            for block in [1, 3, 16, 64] {
                for radius in [0, 1, 4, 40, 1000] {
                    for to_the_end in [false, true] {
                        let mut passes = Passes::new(&segments, 2, block, radius);
                        let (mut read, mut done) = (11, 11);
                        while let Some(pass) = passes.next(to_the_end) {
                            assert_eq!(pass.reads.start, read);
                            assert!(pass.reads.len() <= block);
                            assert!(pass.reads.len() + pass.parts.len() > 0, "nothing to do");
                            read = pass.reads.end;
                            for part in &pass.parts {
                                assert_eq!(part.steps.start, done);
                                done = part.steps.end;
                                let at = segments.iter().position(|s| *s == part.segment).unwrap();
                                assert_eq!(part.segments_before, at + 2);
                                assert!(part.segment.start <= part.steps.start);
                                assert!(part.steps.end <= part.segment.end);
                                // What the filter sees was read, and not longer ago than it reaches
                                // back and forth.
                                assert!((done - 1 + radius).min(part.segment.end - 1) < read);
                                let oldest = part.steps.start.saturating_sub(radius);
                                let oldest = oldest.max(part.segment.start);
                                assert!(oldest + 2 * radius >= pass.reads.start, "{radius}");
                            }
                            let ends = |p: &Part| p.steps.end == p.segment.end;
                            let count = pass.parts.iter().filter(|p| ends(p)).count();
                            assert!(!to_the_end || count <= 1);
                        }
                        assert_eq!((read, done), (end, end));
                    }
                }
            }
        }
    }
}
