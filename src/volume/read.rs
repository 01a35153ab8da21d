//! A volume read slice by slice, tile by tile or pixel by pixel, whichever of its two kinds it is.
//!
//! The analysis asks for the same room again and again with later timesteps, most of them dark. So whoever
//! reads hands in what is known of the room (which tiles of it may hold anything but 0) and gets back
//! what is known of it now: a dark tile over a dark tile is neither read nor written.

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use glintmap_formats::npy;
use rayon::prelude::*;

use super::axis::{Axis, TimeAxis, segments_from_numbers};
use super::fault::Wrong;
use super::layout::{CHUNK_TIMESTEPS, CHUNK_VALUES, Tiling};
use super::tiles::{Scratch, Tiles};
use super::write::Summary;
use super::{Error, document, layout};
use crate::base::Irradiance;
use crate::base::TileRect;
use crate::base::limits::TILE_EDGE;

/// Memory that the indexes of all shards together take, unless the caller says otherwise: entries of
/// some 350,000 chunks. Reading in order needs one entry of each tile.
const INDEX_CACHE_BYTES: usize = 8 << 20;

/// A time series of pictures, `[timestep, row, column]`, W/m2: a volume of ours (Zarr) or an
/// `.npy` file of little-endian float32 in C order.
#[derive(Debug)]
pub struct Volume {
    path: PathBuf,
    tiling: Tiling,
    axis: Option<Axis>,
    pub(super) source: Source,
}

#[derive(Debug)]
pub(super) enum Source {
    Npy(npy::Reader<f32>),
    Zarr(Tiles),
}

impl Volume {
    /// Opens a volume; which kind it is is seen from what is there, not from its name.
    ///
    /// # Errors
    /// Neither kind of volume, one that isn't finished, another shape or type; nothing but
    /// metadata is read, so damaged numbers are found later.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::open_with(path, INDEX_CACHE_BYTES)
    }

    /// [`Self::open`] with a bound (approximate, at least one entry for each tile) of the memory
    /// that the indexes of shards may take. A small one costs more reading, nothing else.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(path: &Path, index_cache_bytes: usize) -> Result<Self, Error> {
        let path = path.to_owned();
        if path.is_dir() {
            let array = path.join(layout::ARRAY);
            if !path.join(document::NAME).exists() && !array.join(layout::GROWING).exists() {
                let found = "a folder without zarr.json".into();
                return Err(Error::NotAVolume { path, found });
            }
            let (tiles, axis) = Tiles::open(&path, index_cache_bytes)?;
            return Ok(Self { path, tiling: tiles.tiling, axis, source: Source::Zarr(tiles) });
        }
        let mut start = Vec::new();
        let file = File::open(&path).map_err(Error::io(&path))?;
        file.take(npy::MAGIC.len() as u64).read_to_end(&mut start).map_err(Error::io(&path))?;
        if start != npy::MAGIC {
            let found = format!("a file that begins with `{}`", start.escape_ascii());
            return Err(Error::NotAVolume { path, found });
        }
        let reader = npy::Reader::<f32>::open(&path).map_err(Error::npy(&path))?;
        let [timesteps, rows, columns] = reader.shape_of::<3>().map_err(Error::npy(&path))?;
        let tiling = Tiling::new([timesteps, rows, columns]);
        tiling.bounded().map_err(|wrong| wrong.at(path.clone()))?;
        Ok(Self { path, tiling, axis: None, source: Source::Npy(reader) })
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// `[timestep, row, column]`
    pub fn shape(&self) -> [usize; 3] {
        self.tiling.shape()
    }

    /// What the volume knows of its timesteps; `None` for `.npy` and for imports.
    pub fn axis(&self) -> Option<&TimeAxis> {
        match &self.axis {
            Some(Axis::Full(axis)) => Some(axis),
            _ => None,
        }
    }

    /// The timesteps of each segment, in order; one segment where nothing is known of them.
    pub fn segments(&self) -> Vec<Range<usize>> {
        match &self.axis {
            Some(axis) => segments_from_numbers(axis.segment()),
            None => std::iter::once(0..self.tiling.timesteps).collect(),
        }
    }

    /// Which irradiance it holds; `None` where the volume doesn't say.
    pub fn quantity(&self) -> Option<Irradiance> {
        match &self.source {
            Source::Zarr(tiles) => tiles.quantity,
            Source::Npy(_) => None,
        }
    }

    /// How much the volume holds and how much of it is not 0, as it was noted when it was
    /// written; `None` for `.npy` and for volumes that other programs wrote.
    pub fn summary(&self) -> Option<Summary> {
        match &self.source {
            Source::Zarr(tiles) => Some(Summary::new(&tiles.tiling, tiles.records()?.iter())),
            Source::Npy(_) => None,
        }
    }

    /// The natural step of reading: ranges that begin and end at multiples of it decode nothing
    /// twice.
    pub fn chunk_timesteps(&self) -> usize {
        match &self.source {
            Source::Zarr(_) => CHUNK_TIMESTEPS,
            Source::Npy(_) => 1,
        }
    }

    /// Fills `out` with the slices of `range`: `range.len() * rows * columns` numbers, in C order.
    ///
    /// # Errors
    /// A range beyond the volume, an `out` of another length; damaged or lost parts.
    pub fn read(&self, range: Range<usize>, out: &mut [f32]) -> Result<(), Error> {
        let mut lit = vec![true; range.len().saturating_mul(self.tiling.tiles.count())];
        self.read_rows(range, 0..self.tiling.tiles.rows, out, &mut lit)
    }

    /// [`Self::read`] for some rows of the slices, which begin at a row of tiles and end before one, or
    /// at the bottom, into room that was used before, where what is dark takes no time. `lit` has
    /// an entry for each slice and each tile of 32 x 32 pixels of those rows,
    /// `[slice, tile row, tile column]`. On entry `false` says that `out` is all +0 there, on return
    /// that the volume is; `true` says nothing.
    ///
    /// # Errors
    /// As [`Self::read`], other rows, and a `lit` of another length. After an error `lit` means
    /// nothing.
    pub fn read_rows(
        &self,
        range: Range<usize>,
        picked: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), Error> {
        let [_, rows, columns] = self.shape();
        let pixels = picked.len() * columns;
        self.check(&range, &picked, out.len(), lit.len())?;
        if range.is_empty() || picked.is_empty() {
            return Ok(());
        }
        match &self.source {
            Source::Npy(reader) => {
                lit.fill(true);
                let whole = picked.len() == rows;
                let piece = if whole { out.len() } else { pixels };
                for (timestep, out) in range.zip(out.chunks_mut(piece)) {
                    let first = (timestep * rows + picked.start) as u64 * columns as u64;
                    reader.read_at(first, out).map_err(Error::npy(&self.path))?;
                }
                Ok(())
            }
            Source::Zarr(tiles) => {
                self.cut(range, picked, out, lit).into_par_iter().try_for_each_init(
                    || Scratch::new(&self.path),
                    |scratch, work| {
                        let scratch = scratch.as_mut().map_err(|_| self.no_memory())?;
                        work.read(&self.tiling, tiles, scratch)
                    },
                )
            }
        }
    }

    /// Holds what is to be read against the volume, and the room for it against that.
    fn check(
        &self,
        range: &Range<usize>,
        picked: &Range<usize>,
        numbers: usize,
        flags: usize,
    ) -> Result<(), Wrong> {
        let [timesteps, rows, columns] = self.shape();
        let wrong = |what, expected, found| Err(Wrong { what, expected, found });
        if range.start > range.end || range.end > timesteps {
            let expected = format!("within 0..{timesteps}");
            return wrong("range of timesteps", expected, format!("{range:?}"));
        }
        let ends = picked.end == rows || picked.end.is_multiple_of(TILE_EDGE);
        let whole = picked.start.is_multiple_of(TILE_EDGE) && ends;
        if !whole || picked.start > picked.end || picked.end > rows {
            let expected = format!("whole rows of tiles within 0..{rows}");
            return wrong("range of rows", expected, format!("{picked:?}"));
        }
        let pixels = picked.len() * columns;
        if range.len().checked_mul(pixels) != Some(numbers) {
            let expected = format!("{} x {pixels} numbers", range.len());
            return wrong("room for the slices", expected, numbers.to_string());
        }
        let tiles = picked.len().div_ceil(TILE_EDGE) * self.tiling.tiles.across();
        let expected = range.len().saturating_mul(tiles);
        if flags != expected {
            return wrong("room for what is lit", format!("{expected} flags"), flags.to_string());
        }
        Ok(())
    }

    /// Cuts the room for some rows of some slices into pieces of work. What a chunk fills lies
    /// scattered over the slices, but no two rows of tiles share any of it: each of them, for each 16
    /// timesteps, is a piece of its own.
    fn cut<'a>(
        &self,
        range: Range<usize>,
        picked: Range<usize>,
        out: &'a mut [f32],
        lit: &'a mut [bool],
    ) -> Vec<TileRow<'a>> {
        let columns = self.tiling.tiles.columns;
        let (across, down) = (self.tiling.tiles.across(), picked.len().div_ceil(TILE_EDGE));
        let first_row = picked.start / TILE_EDGE;
        let mut slices = out.chunks_mut(picked.len() * columns).zip(lit.chunks_mut(down * across));
        let mut work: Vec<TileRow<'_>> = Vec::new();
        let mut from = range.start;
        while from < range.end {
            let to = (from / CHUNK_TIMESTEPS + 1).saturating_mul(CHUNK_TIMESTEPS).min(range.end);
            let (chunk, skip) = (from / CHUNK_TIMESTEPS, from % CHUNK_TIMESTEPS);
            let base = work.len();
            let row = |row| TileRow { chunk, skip, row: first_row + row, bands: Vec::new() };
            work.extend((0..down).map(row));
            for (slice, lit) in slices.by_ref().take(to - from) {
                let bands = slice.chunks_mut(TILE_EDGE * columns).zip(lit.chunks_mut(across));
                for (work, (numbers, lit)) in work[base..].iter_mut().zip(bands) {
                    work.bands.push(Band { numbers, lit });
                }
            }
            from = to;
        }
        work
    }

    fn no_memory(&self) -> Error {
        Error::io(&self.path)(std::io::ErrorKind::OutOfMemory.into())
    }

    /// How many tiles of at most 32 x 32 pixels there are, row by row; `None` for `.npy`, whose
    /// pixels can't be read one tile at a time.
    pub fn tiles(&self) -> Option<usize> {
        match &self.source {
            Source::Zarr(_) => Some(self.tiling.tiles.count()),
            Source::Npy(_) => None,
        }
    }

    /// Reads all timesteps of tile `number` in order, some at a time: `each` gets the first
    /// timestep and `[timestep, 32, 32]` numbers, W/m2. What is left out is 0; what lies beyond
    /// the picture or the year is padding. Returns the tile's pixels.
    ///
    /// # Errors
    /// A tile beyond the volume, an `.npy` file; damaged or lost parts.
    pub fn read_tile(
        &self,
        number: usize,
        mut each: impl FnMut(usize, &[f32]),
    ) -> Result<TileRect, Error> {
        let (Source::Zarr(tiles), true) = (&self.source, number < self.tiling.tiles.count()) else {
            return Err(Error::Shape {
                what: "tile",
                expected: format!("one of {} of a volume in Zarr", self.tiling.tiles.count()),
                found: number.to_string(),
            });
        };
        let mut scratch = Scratch::new(&self.path)?;
        let mut numbers = vec![0.0; CHUNK_VALUES];
        tiles.decode(number, 0..self.tiling.chunks(), &mut scratch, |chunk, plain| {
            for (number, bytes) in numbers.iter_mut().zip(plain.chunks_exact(4)) {
                *number = number_from(bytes);
            }
            let timesteps = self.tiling.chunk_timesteps(chunk);
            each(timesteps.start, &numbers[..timesteps.len() * TILE_EDGE * TILE_EDGE]);
        })?;
        Ok(self.tiling.tiles.rect(number))
    }

    /// The whole series of one pixel, W/m2, one number for each timestep.
    ///
    /// # Errors
    /// A pixel beyond the volume; damaged or lost parts.
    pub fn pixel(&self, column: usize, row: usize) -> Result<Vec<f32>, Error> {
        let [timesteps, rows, columns] = self.shape();
        if column >= columns || row >= rows {
            return Err(Error::Shape {
                what: "pixel",
                expected: format!("column below {columns}, row below {rows}"),
                found: format!("column {column}, row {row}"),
            });
        }
        let mut out = vec![0.0; timesteps];
        match &self.source {
            Source::Npy(reader) => {
                for (timestep, value) in out.iter_mut().enumerate() {
                    let at = (timestep as u64 * rows as u64 + row as u64) * columns as u64;
                    reader
                        .read_at(at + column as u64, std::slice::from_mut(value))
                        .map_err(Error::npy(&self.path))?;
                }
            }
            Source::Zarr(tiles) => {
                let tile = row / TILE_EDGE * self.tiling.tiles.across() + column / TILE_EDGE;
                let at = (row % TILE_EDGE * TILE_EDGE + column % TILE_EDGE) * 4;
                out.par_chunks_mut(CHUNK_TIMESTEPS * 8).enumerate().try_for_each_init(
                    || Scratch::new(&self.path),
                    |scratch, (part, out)| {
                        let scratch = scratch.as_mut().map_err(|_| self.no_memory())?;
                        let first = part * 8;
                        let last = first + out.len().div_ceil(CHUNK_TIMESTEPS);
                        tiles.decode(tile, first..last, scratch, |chunk, plain| {
                            let slices = plain.chunks_exact(TILE_EDGE * TILE_EDGE * 4);
                            let out = &mut out[(chunk - first) * CHUNK_TIMESTEPS..];
                            for (value, slice) in out.iter_mut().zip(slices) {
                                *value = number_from(&slice[at..at + 4]);
                            }
                        })
                    },
                )?;
            }
        }
        Ok(out)
    }
}

/// A row of tiles at the timesteps of one chunk: what one thread reads.
struct TileRow<'a> {
    /// Number of the chunk in its shard.
    chunk: usize,
    /// Timesteps of the chunk before the first that is read.
    skip: usize,
    /// Number of the row of tiles.
    row: usize,
    /// Where it goes, slice by slice.
    bands: Vec<Band<'a>>,
}

/// A row of tiles in one slice.
struct Band<'a> {
    numbers: &'a mut [f32],
    /// For each tile whether it may hold anything but +0.
    lit: &'a mut [bool],
}

impl TileRow<'_> {
    fn read(mut self, tiling: &Tiling, tiles: &Tiles, scratch: &mut Scratch) -> Result<(), Error> {
        for column in 0..tiling.tiles.across() {
            let number = self.row * tiling.tiles.across() + column;
            let tile = tiling.tiles.rect(number);
            let mut found = false;
            tiles.decode(number, self.chunk..self.chunk + 1, scratch, |_, plain| {
                found = true;
                let slices = plain.chunks_exact(TILE_EDGE * TILE_EDGE * 4).skip(self.skip);
                for (plain, band) in slices.zip(&mut self.bands) {
                    band.fill(column, &tile, tiling.tiles.columns, plain);
                }
            })?;
            if !found {
                self.bands
                    .iter_mut()
                    .for_each(|band| band.darken(column, &tile, tiling.tiles.columns));
            }
        }
        Ok(())
    }
}

impl Band<'_> {
    /// The rows of one tile.
    fn lines(&mut self, tile: &TileRect, columns: usize) -> impl Iterator<Item = &mut [f32]> {
        let within = tile.column..tile.column + tile.columns;
        self.numbers.chunks_exact_mut(columns).map(move |row| &mut row[within.clone()])
    }

    /// Takes the numbers of the tile at `column` of the row of tiles.
    fn fill(&mut self, column: usize, tile: &TileRect, columns: usize, plain: &[u8]) {
        self.lit[column] = true;
        let lines = plain.chunks_exact(TILE_EDGE * 4);
        for (to, from) in self.lines(tile, columns).zip(lines) {
            for (value, bytes) in to.iter_mut().zip(from.chunks_exact(4)) {
                *value = number_from(bytes);
            }
        }
    }

    /// The tile at `column` of the row of tiles is all 0.
    fn darken(&mut self, column: usize, tile: &TileRect, columns: usize) {
        if std::mem::replace(&mut self.lit[column], false) {
            self.lines(tile, columns).for_each(|line| line.fill(0.0));
        }
    }
}

/// The number in four little-endian bytes.
pub(super) fn number_from(bytes: &[u8]) -> f32 {
    f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}
