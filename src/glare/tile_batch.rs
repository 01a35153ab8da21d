//! A batch of a year, from a renderer's tiles to the slices of the analysis, in memory.

use std::io;
use std::ops::Range;
use std::sync::OnceLock;

use super::error::ReadFailure;
use super::slices::Slices;
use crate::base::limits::{MAX_TIMESTEPS, TILE_EDGE};
use crate::base::{FaultKind, SeriesEntry, SinkError, TileRect, TileSink};

/// Pixels of a tile.
const TILE: usize = TILE_EDGE * TILE_EDGE;
/// Timesteps that fit into the key of an [`Entry`] beside the pixel.
const MAX_BATCH: usize = (1 << 32) / TILE;
const _: () = assert!(TILE.is_power_of_two() && MAX_BATCH < MAX_TIMESTEPS);

/// The time series of some whole segments in memory, tile by tile as a renderer delivers it: what
/// stands between `render` and [`Session`](super::session::Session) where no series is kept on disk. It
/// takes 8 bytes for each number that isn't 0.
///
/// Timesteps are counted from the beginning of the year, not of the batch: entries that are put
/// have the numbers that the timeline gives them, and the shape is that of the whole year. Tiles
/// that were never put are dark.
#[derive(Debug)]
pub struct TileBatch {
    shape: [usize; 3],
    range: Range<usize>,
    /// For each tile what was put, in the order of timesteps and pixels.
    tiles: Vec<OnceLock<Vec<Entry>>>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    /// `timestep of the batch * 1024 + row of the tile * 32 + column of the tile`.
    key: u32,
    irradiance_w_m2: f32,
}

impl TileBatch {
    /// Room for the timesteps of `range` of a year of `shape`, `[timestep, row, column]`.
    pub fn new(shape: [usize; 3], range: Range<usize>) -> Self {
        let [_, rows, columns] = shape;
        let tiles = rows.div_ceil(TILE_EDGE) * columns.div_ceil(TILE_EDGE);
        Self { shape, range, tiles: (0..tiles).map(|_| OnceLock::new()).collect() }
    }

    /// Bytes that the entries take.
    pub fn bytes(&self) -> usize {
        let lengths = self.tiles.iter().filter_map(OnceLock::get).map(Vec::capacity);
        lengths.sum::<usize>() * size_of::<Entry>()
    }

    fn across(&self) -> usize {
        self.shape[2].div_ceil(TILE_EDGE)
    }

    fn rect(&self, number: usize) -> TileRect {
        let [_, rows, columns] = self.shape;
        let (row, column) =
            (number / self.across() * TILE_EDGE, number % self.across() * TILE_EDGE);
        TileRect {
            column,
            row,
            columns: TILE_EDGE.min(columns - column),
            rows: TILE_EDGE.min(rows - row),
        }
    }

    fn number(&self, tile: TileRect) -> Option<usize> {
        let inside = tile.row < self.shape[1] && tile.column < self.shape[2];
        let number = tile.row / TILE_EDGE * self.across() + tile.column / TILE_EDGE;
        (inside && self.rect(number) == tile).then_some(number)
    }

    /// The entries of a tile at one timestep of the batch.
    fn entries(&self, number: usize, timestep: usize) -> &[Entry] {
        let all = self.tiles[number].get().map_or(&[][..], Vec::as_slice);
        let start = all.partition_point(|e| (e.key as usize) < timestep * TILE);
        let end =
            start + all[start..].partition_point(|e| (e.key as usize) < (timestep + 1) * TILE);
        &all[start..end]
    }
}

fn wrong(what: String) -> SinkError {
    SinkError::Io(io::Error::new(io::ErrorKind::InvalidInput, what))
}

impl TileSink for TileBatch {
    fn has(&self, tile: TileRect) -> bool {
        self.number(tile).is_some_and(|number| self.tiles[number].get().is_some())
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let Range { start, end } = self.range;
        if end - start > MAX_BATCH {
            let found = end - start;
            return Err(wrong(format!("expected at most {MAX_BATCH} timesteps, found {found}")));
        }
        let Some(number) = self.number(tile) else {
            return Err(wrong(format!("{tile:?} is no tile of a picture of {:?}", self.shape)));
        };
        let mut kept: Vec<Entry> = Vec::with_capacity(entries.len());
        for entry in entries {
            let (timestep, pixel) = (entry.timestep as usize, usize::from(entry.pixel));
            if !(start..end).contains(&timestep) || pixel >= tile.pixels() {
                return Err(wrong(format!("{entry:?} lies outside {tile:?} of {start}..{end}")));
            }
            let place = pixel / tile.columns * TILE_EDGE + pixel % tile.columns;
            let key = ((timestep - start) * TILE + place) as u32;
            if kept.last().is_some_and(|last| last.key >= key) {
                return Err(wrong(format!("{entry:?} of {tile:?} is out of order")));
            }
            kept.push(Entry { key, irradiance_w_m2: entry.irradiance_w_m2 });
        }
        self.tiles[number].set(kept).map_err(|_| wrong(format!("{tile:?} was put twice")))
    }
}

impl Slices for TileBatch {
    fn shape(&self) -> [usize; 3] {
        self.shape
    }

    fn read_lit(
        &self,
        range: Range<usize>,
        rows: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure> {
        let columns = self.shape[2];
        if range.start < self.range.start || range.end > self.range.end {
            let what = format!("timesteps {range:?} aren't in the batch of {:?}", self.range);
            return Err(ReadFailure { kind: FaultKind::Failed, source: what.into() });
        }
        let first = rows.start / TILE_EDGE * self.across();
        let tiles = rows.len().div_ceil(TILE_EDGE) * self.across();
        let slices = out.chunks_exact_mut(rows.len() * columns).zip(lit.chunks_exact_mut(tiles));
        for (timestep, (out, lit)) in range.zip(slices) {
            for (number, lit) in (first..).zip(lit) {
                let tile = self.rect(number);
                let top = tile.row - rows.start;
                if *lit {
                    for row in out.chunks_exact_mut(columns).skip(top).take(tile.rows) {
                        row[tile.column..][..tile.columns].fill(0.0);
                    }
                }
                let entries = self.entries(number, timestep - self.range.start);
                for entry in entries {
                    let place = entry.key as usize % TILE;
                    let (row, column) = (place / TILE_EDGE, place % TILE_EDGE);
                    let at = (top + row) * columns + tile.column + column;
                    out[at] = entry.irradiance_w_m2;
                }
                *lit = !entries.is_empty();
            }
        }
        Ok(())
    }
}
