//! What the filter can see of the volume.
//!
//! Two kinds of memory: of the timesteps that are being read, some rows of tiles, which come at the
//! bottom as the work goes down the picture and leave at the top; of the timesteps before, all rows, but
//! no more timesteps than the filter reaches back. What leaves at the top is copied into the past,
//! unless neither was lit nor is: for each tile and each [`GROUP`] of columns it is noted whether
//! anything there isn't +0, which is what makes dark places cost nothing.

use std::collections::VecDeque;
use std::ops::Range;

use rayon::prelude::*;

use super::vector::{Look, dispatch};
use crate::base::limits::TILE_EDGE;
use crate::glare::error::Error;
use crate::glare::slices::Slices;

/// Columns that share one note on whether they hold anything but 0.
pub(in crate::glare) const GROUP: usize = 64;
/// Tiles that share such a note.
const TILES_PER_GROUP: usize = GROUP / TILE_EDGE;
const _: () = assert!(GROUP.is_multiple_of(TILE_EDGE));

/// A row of tiles at the timesteps that are read together.
#[derive(Debug, Default)]
pub(in crate::glare) struct Block {
    timesteps: Range<usize>,
    rows: Range<usize>,
    /// `[slice, row, column]`; room for as many slices as were ever read.
    data: Vec<f32>,
    /// For each slice, row and group of columns: whether anything there isn't +0.
    occupied: Vec<bool>,
    /// For each slice and tile: whether the volume may hold anything but +0 there.
    lit: Vec<bool>,
    /// How many voxels are NaN or infinite.
    pub nonfinite: u64,
}

impl Block {
    /// Reads rows of tiles into a block that is no longer needed and had as many rows.
    pub fn read(
        mut self,
        volume: &dyn Slices,
        timesteps: Range<usize>,
        rows: Range<usize>,
        allow_nonfinite: bool,
    ) -> Result<Self, Error> {
        let [_, _, columns] = volume.shape();
        let (groups, across) = (columns.div_ceil(GROUP), columns.div_ceil(TILE_EDGE));
        let lines = timesteps.len() * rows.len();
        let (room, tiles) = (lines * columns, timesteps.len() * across);
        // What is left from before is written over: clearing it first would touch it twice.
        if self.data.len() < room {
            self.data.resize(room, 0.0);
        }
        self.lit.resize(self.lit.len().max(tiles), false);
        self.occupied.resize(self.occupied.len().max(lines * groups), false);
        (self.timesteps, self.rows) = (timesteps, rows);
        let (data, lit) = (&mut self.data[..room], &mut self.lit[..tiles]);
        volume.read_lit(self.timesteps.clone(), self.rows.clone(), data, lit)?;
        let tall = self.rows.len();
        let occupied = self.occupied.chunks_exact_mut(groups);
        let counts =
            data.chunks_exact(columns).zip(occupied).enumerate().map(|(line, (row, o))| {
                look_at_row(row, &lit[line / tall * across..][..across], o)
            });
        self.nonfinite = counts.sum();
        if self.nonfinite > 0 && !allow_nonfinite {
            return Err(self.first_nonfinite(columns));
        }
        Ok(self)
    }

    fn first_nonfinite(&self, columns: usize) -> Error {
        let at = self.data.iter().position(|v| !v.is_finite()).unwrap_or(0);
        let tall = self.rows.len();
        Error::NonFinite {
            timestep: self.timesteps.start + at / (tall * columns),
            row: self.rows.start + at / columns % tall,
            column: at % columns,
            value: self.data[at],
        }
    }

    /// The number of a line of `[slice, row]`.
    fn line(&self, timestep: usize, row: usize) -> usize {
        (timestep - self.timesteps.start) * self.rows.len() + row - self.rows.start
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

/// What the filter can see: it slides down the picture, and then on in time. Of the timesteps that
/// were read last only some rows of tiles are there, of those before all rows, but no more
/// timesteps than the filter reaches back.
#[derive(Debug)]
pub(in crate::glare) struct Window {
    pub rows: usize,
    pub columns: usize,
    /// Groups of columns in a row.
    pub groups: usize,
    /// The first timestep of the blocks.
    fresh: usize,
    blocks: VecDeque<Block>,
    spare: Vec<Block>,
    /// The timesteps before: timestep `t` has the place `t % depth`.
    past: Vec<Slice>,
}

/// All rows of one timestep.
#[derive(Debug)]
struct Slice {
    data: Vec<f32>,
    occupied: Vec<bool>,
    lit: Vec<bool>,
}

/// So many zeros, written: memory that the system has only promised may be missing when, hours
/// later, light reaches the last corner of the picture.
fn dark(pixels: usize) -> Vec<f32> {
    let mut data = std::hint::black_box(Vec::with_capacity(pixels));
    data.resize(pixels, 0.0);
    data
}

impl Window {
    /// A window that keeps `depth` timesteps before those that are read.
    pub fn new(rows: usize, columns: usize, depth: usize) -> Self {
        let (groups, across) = (columns.div_ceil(GROUP), columns.div_ceil(TILE_EDGE));
        let slice = || Slice {
            data: dark(rows * columns),
            occupied: vec![false; rows * groups],
            lit: vec![false; rows.div_ceil(TILE_EDGE) * across],
        };
        let past = (0..depth).map(|_| slice()).collect();
        let (blocks, spare) = (VecDeque::new(), Vec::new());
        Self { rows, columns, groups, fresh: 0, blocks, spare, past }
    }

    /// Goes on in time: what follows is read from `timestep` on, from the top.
    pub fn begin(&mut self, timestep: usize) {
        self.retire(self.rows);
        self.fresh = timestep;
    }

    /// Lets go of the rows of tiles that end at `row` or above; of what they hold the past keeps
    /// what it needs.
    pub fn retire(&mut self, row: usize) {
        while self.blocks.front().is_some_and(|block| block.rows.end <= row) {
            let Some(block) = self.blocks.pop_front() else { return };
            self.keep(&block);
            self.spare.push(block);
        }
    }

    fn keep(&mut self, block: &Block) {
        let (columns, groups, depth) = (self.columns, self.groups, self.past.len());
        let across = columns.div_ceil(TILE_EDGE);
        let (tall, first) = (block.rows.len(), block.timesteps.start);
        let kept = block.timesteps.end.saturating_sub(depth).max(first)..block.timesteps.end;
        self.past.par_iter_mut().enumerate().for_each(|(place, slice)| {
            let Some(timestep) = kept.clone().find(|t| t % depth == place) else { return };
            let line = block.line(timestep, block.rows.start);
            let (row, count) = (block.rows.start, tall * groups);
            slice.occupied[row * groups..][..count]
                .copy_from_slice(&block.occupied[line * groups..][..count]);
            let from = &block.data[line * columns..][..tall * columns];
            let to = &mut slice.data[row * columns..][..tall * columns];
            let lit = &block.lit[(timestep - first) * across..][..across];
            let was_lit = &mut slice.lit[row / TILE_EDGE * across..][..across];
            let same = |a: usize, b: usize| lit[a] == lit[b] && was_lit[a] == was_lit[b];
            let mut tile = 0;
            while tile < across {
                let end = (tile + 1..across).find(|&t| !same(tile, t)).unwrap_or(across);
                let within = tile * TILE_EDGE..(end * TILE_EDGE).min(columns);
                if lit[tile] || was_lit[tile] {
                    let lines = from.chunks_exact(columns).zip(to.chunks_exact_mut(columns));
                    for (from, to) in lines {
                        to[within.clone()].copy_from_slice(&from[within.clone()]);
                    }
                }
                tile = end;
            }
            was_lit.copy_from_slice(lit);
        });
    }

    /// The rows of tiles that some rows consist of, with room to read each into.
    pub fn rooms(&mut self, rows: Range<usize>) -> Vec<(Range<usize>, Block)> {
        let cut = rows.clone().step_by(TILE_EDGE);
        let mut room = |first: usize| {
            let here = first..(first + TILE_EDGE).min(rows.end);
            // What is left in it lies in its place only if it had as many rows.
            let at = self.spare.iter().position(|block| block.rows.len() == here.len());
            (here, at.map_or_else(Block::default, |at| self.spare.swap_remove(at)))
        };
        cut.map(&mut room).collect()
    }

    /// The next row of tiles.
    pub fn push(&mut self, block: Block) {
        self.blocks.push_back(block);
    }

    fn block(&self, row: usize) -> &Block {
        let first = self.blocks.front().map_or(0, |block| block.rows.start / TILE_EDGE);
        &self.blocks[row / TILE_EDGE - first]
    }

    /// One row of a timestep.
    pub fn row(&self, timestep: usize, row: usize) -> &[f32] {
        let columns = self.columns;
        if timestep < self.fresh {
            let slice = &self.past[timestep % self.past.len()];
            return &slice.data[row * columns..][..columns];
        }
        let block = self.block(row);
        &block.data[block.line(timestep, row) * columns..][..columns]
    }

    /// For each group of columns of a row, whether anything there isn't +0.
    pub fn occupied(&self, timestep: usize, row: usize) -> &[bool] {
        let groups = self.groups;
        if timestep < self.fresh {
            let slice = &self.past[timestep % self.past.len()];
            return &slice.occupied[row * groups..][..groups];
        }
        let block = self.block(row);
        &block.occupied[block.line(timestep, row) * groups..][..groups]
    }
}
