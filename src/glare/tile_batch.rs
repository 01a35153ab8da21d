//! A batch of a year, from a renderer's tiles to the slices of the analysis, in memory.

use std::ops::Range;
use std::sync::OnceLock;

use super::error::ReadFailure;
use super::slices::Slices;
use crate::base::limits::{MAX_TIMESTEPS, TILE_EDGE};
use crate::base::{FaultKind, SeriesEntry, SinkError, TileRect, TileSink, Tiles, checked_tile};

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
    tiles: Tiles,
    /// For each tile what was put, in the order of timesteps and pixels.
    entries: Vec<OnceLock<Vec<Entry>>>,
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
        let tiles = Tiles { columns, rows, edge: TILE_EDGE };
        let entries = (0..tiles.count()).map(|_| OnceLock::new()).collect();
        Self { shape, range, tiles, entries }
    }

    /// Bytes that the entries take.
    pub fn bytes(&self) -> usize {
        let lengths = self.entries.iter().filter_map(OnceLock::get).map(Vec::capacity);
        lengths.sum::<usize>() * size_of::<Entry>()
    }

    /// The entries of a tile at one timestep of the batch.
    fn entries(&self, number: usize, timestep: usize) -> &[Entry] {
        let all = self.entries[number].get().map_or(&[][..], Vec::as_slice);
        let start = all.partition_point(|e| (e.key as usize) < timestep * TILE);
        let end =
            start + all[start..].partition_point(|e| (e.key as usize) < (timestep + 1) * TILE);
        &all[start..end]
    }
}

impl TileSink for TileBatch {
    fn has(&self, tile: TileRect) -> bool {
        self.tiles.number(tile).is_some_and(|number| self.entries[number].get().is_some())
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let found = self.range.len();
        if found > MAX_BATCH {
            let what = format!("expected at most {MAX_BATCH} timesteps, found {found}");
            return Err(SinkError::wrong(what));
        }
        let number = checked_tile(&self.tiles, &self.range, tile, entries)?;
        let entry = |e: &SeriesEntry| {
            let (timestep, pixel) = (e.timestep as usize, usize::from(e.pixel));
            let place = pixel / tile.columns * TILE_EDGE + pixel % tile.columns;
            let key = ((timestep - self.range.start) * TILE + place) as u32;
            Entry { key, irradiance_w_m2: e.irradiance_w_m2 }
        };
        let twice = |_| SinkError::wrong(format!("{tile:?} was put twice"));
        self.entries[number].set(entries.iter().map(entry).collect()).map_err(twice)
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
        let first = rows.start / TILE_EDGE * self.tiles.across();
        let tiles = rows.len().div_ceil(TILE_EDGE) * self.tiles.across();
        let slices = out.chunks_exact_mut(rows.len() * columns).zip(lit.chunks_exact_mut(tiles));
        for (timestep, (out, lit)) in range.zip(slices) {
            for (number, lit) in (first..).zip(lit) {
                let tile = self.tiles.rect(number);
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
