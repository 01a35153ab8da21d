use std::collections::VecDeque;
use std::ops::Range;

use rayon::prelude::*;

use super::error::Error;
use super::slices::Slices;
use super::vector::{Look, dispatch};

/// Columns that share one note on whether they hold anything but 0.
pub(super) const GROUP: usize = 64;
/// Voxels that a thread looks at before another may help.
const VOXELS_PER_TASK: usize = 1 << 16;

/// Some slices that were read together.
#[derive(Debug, Default)]
pub(super) struct Block {
    first: usize,
    slices: usize,
    data: Vec<f32>,
    /// For each row and group of columns: whether anything there isn't +0.
    occupied: Vec<bool>,
    /// How many voxels are NaN or infinite.
    pub nonfinite: u64,
}

impl Block {
    /// Reads the slices of `range` into a block that is no longer needed.
    pub fn read(
        mut self,
        volume: &dyn Slices,
        range: Range<usize>,
        allow_nonfinite: bool,
    ) -> Result<Self, Error> {
        let [_, rows, columns] = volume.shape();
        let groups = columns.div_ceil(GROUP);
        self.first = range.start;
        self.slices = range.len();
        // What is left from before is overwritten: clearing it first would touch it twice.
        self.data.resize(self.slices * rows * columns, 0.0);
        self.occupied.resize(self.slices * rows * groups, false);
        volume.read(range, &mut self.data)?;
        let counts = self
            .data
            .par_chunks(columns)
            .zip(self.occupied.par_chunks_mut(groups))
            .with_min_len((VOXELS_PER_TASK / columns).max(1))
            .map(|(row, occupied)| look_at_row(row, occupied));
        self.nonfinite = counts.sum();
        if self.nonfinite > 0 && !allow_nonfinite {
            return Err(self.first_nonfinite(rows, columns));
        }
        Ok(self)
    }

    fn first_nonfinite(&self, rows: usize, columns: usize) -> Error {
        let at = self.data.iter().position(|v| !v.is_finite()).unwrap_or(0);
        Error::NonFinite {
            timestep: self.first + at / (rows * columns),
            row: at / columns % rows,
            column: at % columns,
            value: self.data[at],
        }
    }

    fn end(&self) -> usize {
        self.first + self.slices
    }
}

fn look_at_row(row: &[f32], occupied: &mut [bool]) -> u64 {
    if dispatch(Look { row, occupied, group: GROUP }) {
        row.iter().filter(|v| !v.is_finite()).count() as u64
    } else {
        0
    }
}

/// The slices that the filter can see.
#[derive(Debug)]
pub(super) struct Window {
    blocks: VecDeque<Block>,
    spare: Vec<Block>,
    /// Slices of a block; blocks begin at multiples of it.
    step: usize,
    pub rows: usize,
    pub columns: usize,
    /// Groups of columns in a row.
    pub groups: usize,
}

impl Window {
    pub fn new(rows: usize, columns: usize, step: usize) -> Self {
        let groups = columns.div_ceil(GROUP);
        Self { blocks: VecDeque::new(), spare: Vec::new(), step, rows, columns, groups }
    }

    /// Drops the blocks that end before `timestep`.
    pub fn forget_before(&mut self, timestep: usize) {
        while self.blocks.front().is_some_and(|block| block.end() <= timestep) {
            self.spare.extend(self.blocks.pop_front());
        }
    }

    /// A block to read into.
    pub fn spare(&mut self) -> Block {
        self.spare.pop().unwrap_or_default()
    }

    pub fn push(&mut self, block: Block) {
        self.blocks.push_back(block);
    }

    fn block(&self, timestep: usize) -> (&Block, usize) {
        let first = self.blocks.front().map_or(0, |block| block.first / self.step);
        let block = &self.blocks[timestep / self.step - first];
        (block, timestep - block.first)
    }

    /// One row of a slice that is in the window.
    pub fn row(&self, timestep: usize, row: usize) -> &[f32] {
        let (block, slice) = self.block(timestep);
        &block.data[(slice * self.rows + row) * self.columns..][..self.columns]
    }

    /// For each group of columns of a row, whether anything there isn't +0.
    pub fn occupied(&self, timestep: usize, row: usize) -> &[bool] {
        let (block, slice) = self.block(timestep);
        &block.occupied[(slice * self.rows + row) * self.groups..][..self.groups]
    }
}
