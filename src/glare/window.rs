use std::collections::VecDeque;
use std::ops::Range;

use rayon::prelude::*;

use super::error::Error;
use super::slices::Slices;
use super::vector::{Look, dispatch};
use crate::base::limits::TILE_EDGE;

/// Columns that share one note on whether they hold anything but 0.
pub(super) const GROUP: usize = 64;
/// Voxels that a thread looks at before another may help.
const VOXELS_PER_TASK: usize = 1 << 16;
/// Tiles that share such a note.
const TILES_PER_GROUP: usize = GROUP / TILE_EDGE;
const _: () = assert!(GROUP.is_multiple_of(TILE_EDGE));

/// Some slices that were read together.
#[derive(Debug, Default)]
pub(super) struct Block {
    first: usize,
    slices: usize,
    data: Vec<f32>,
    /// For each row and group of columns: whether anything there isn't +0.
    occupied: Vec<bool>,
    /// For each slice and tile: whether the volume may hold anything but +0 there.
    lit: Vec<bool>,
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
        let (across, down) = (columns.div_ceil(TILE_EDGE), rows.div_ceil(TILE_EDGE));
        let room = self.slices * rows * columns;
        if self.data.is_empty() {
            // Zeroed memory that the system hands out takes no room until it is written.
            self.data = vec![0.0; room];
            self.lit = vec![false; self.slices * down * across];
        }
        // What is left from before is written over: clearing it first would touch it twice. The
        // last block of a volume may be shorter, and no block follows it.
        self.data.resize(room, 0.0);
        self.lit.resize(self.slices * down * across, true);
        self.occupied.resize(self.slices * rows * groups, false);
        volume.read_lit(range, &mut self.data, &mut self.lit)?;
        let lit = &self.lit;
        let counts = self
            .data
            .par_chunks(columns)
            .zip(self.occupied.par_chunks_mut(groups))
            .enumerate()
            .with_min_len((VOXELS_PER_TASK / columns).max(1))
            .map(|(number, (row, occupied))| {
                let (slice, tile_row) = (number / rows, number % rows / TILE_EDGE);
                let lit = &lit[(slice * down + tile_row) * across..][..across];
                look_at_row(row, lit, occupied)
            });
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

/// Notes which groups of a row hold anything but +0, looking only where something may be; how many
/// numbers there are not finite.
fn look_at_row(row: &[f32], lit: &[bool], occupied: &mut [bool]) -> u64 {
    let may = |group: usize| {
        let tiles = group * TILES_PER_GROUP..((group + 1) * TILES_PER_GROUP).min(lit.len());
        lit[tiles].contains(&true)
    };
    let (mut group, mut nonfinite) = (0, 0);
    while group < occupied.len() {
        let first = group;
        let bright = may(first);
        while group < occupied.len() && may(group) == bright {
            group += 1;
        }
        let occupied = &mut occupied[first..group];
        if !bright {
            occupied.fill(false);
            continue;
        }
        let row = &row[first * GROUP..(group * GROUP).min(row.len())];
        if dispatch(Look { row, occupied, group: GROUP }) {
            nonfinite += row.iter().filter(|v| !v.is_finite()).count() as u64;
        }
    }
    nonfinite
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
