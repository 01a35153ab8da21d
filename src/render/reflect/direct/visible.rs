use std::ops::Range;

use crate::render::reflect::pv::SEEN;

/// Parts that a cell on a border of what a receiver sees is asked in.
const PARTS: usize = 4;

/// What a receiver sees of a triangle's asked cells.
#[derive(Debug, Default)]
pub(super) struct VisibleCells {
    /// Sums up to each cell of what is seen of its parts, in [`SEEN`]ths.
    before: Vec<u64>,
    /// Cells up to each whose parts aren't seen alike.
    uneven_before: Vec<u32>,
}

impl VisibleCells {
    pub(super) fn clear(&mut self) {
        self.before.clear();
        self.before.push(0);
        self.uneven_before.clear();
        self.uneven_before.push(0);
    }

    /// Some cells more, of which all parts are seen by this much.
    pub(super) fn push_even(&mut self, cells: usize, seen: u16) {
        for _ in 0..cells {
            self.push_parts([seen; PARTS]);
        }
    }

    /// One cell more.
    pub(super) fn push_parts(&mut self, parts: [u16; PARTS]) {
        let last = |sum: Option<&u64>| sum.copied().unwrap_or(0);
        let sum: u64 = parts.iter().map(|p| u64::from(*p)).sum();
        self.before.push(last(self.before.last()) + sum);
        let uneven = parts.iter().any(|p| *p != parts[0]);
        let count = self.uneven_before.last().copied().unwrap_or(0);
        self.uneven_before.push(count + u32::from(uneven));
    }

    pub(super) fn any(&self) -> bool {
        self.before.last().is_some_and(|sum| *sum > 0)
    }

    /// What is seen of a cell, in [`SEEN`]ths of a part.
    pub(super) fn of(&self, i: usize) -> u64 {
        self.before[i + 1] - self.before[i]
    }

    /// Share of some cells that is seen.
    pub(super) fn share(&self, cells: &Range<usize>) -> f32 {
        let seen = self.before[cells.end] - self.before[cells.start];
        seen as f32 / (usize::from(SEEN) * PARTS * cells.len()) as f32
    }

    /// Share of some cells whose parts aren't seen alike.
    pub(super) fn uneven(&self, cells: &Range<usize>) -> f32 {
        let count = self.uneven_before[cells.end] - self.uneven_before[cells.start];
        count as f32 / cells.len() as f32
    }

    /// Whether some cells are seen by the same share all over.
    pub(super) fn is_even(&self, cells: &Range<usize>) -> bool {
        self.uneven_before[cells.end] == self.uneven_before[cells.start]
            && cells.clone().all(|i| self.of(i) == self.of(cells.start))
    }
}
