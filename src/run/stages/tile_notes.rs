//! What was found out about the tiles of a series, kept beside it, so that an interrupted run
//! doesn't render a tile again for it.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Mutex;

use crate::base::limits::TILE_EDGE;
use crate::base::{SeriesEntry, SinkError, TileRect, TileSink};
use crate::run::error::Error;

/// Numbers of a tile at most: two for each pixel.
const NUMBERS: usize = 2 * TILE_EDGE * TILE_EDGE;
/// A checksum, then the numbers.
const RECORD: usize = 8 + 4 * NUMBERS;

/// A sink with a file of notes beside it: a record for each tile, in the order of the tiles.
pub(super) struct TileNotes<'a> {
    sink: &'a dyn TileSink,
    path: &'a Path,
    across: usize,
    file: Mutex<File>,
}

impl<'a> TileNotes<'a> {
    /// Opens the file or makes it. `columns`: of the picture.
    pub fn open(sink: &'a dyn TileSink, path: &'a Path, columns: usize) -> Result<Self, Error> {
        let mut how = OpenOptions::new();
        let file = how.read(true).write(true).create(true).truncate(false).open(path);
        let file = file.map_err(|source| Error::Write { path: path.to_owned(), source })?;
        let across = columns.div_ceil(TILE_EDGE);
        Ok(Self { sink, path, across, file: Mutex::new(file) })
    }

    fn at(&self, tile: TileRect) -> SeekFrom {
        let number = tile.row / TILE_EDGE * self.across + tile.column / TILE_EDGE;
        SeekFrom::Start((number * RECORD) as u64)
    }

    fn checksum(&self, tile: TileRect, numbers: &[u8]) -> [u8; 8] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&[tile.row, tile.column].map(|n| n as u64).map(u64::to_le_bytes).concat());
        hasher.update(numbers);
        let mut out = [0; 8];
        out.copy_from_slice(&hasher.finalize().as_bytes()[..8]);
        out
    }

    fn read(&self, tile: TileRect) -> io::Result<Vec<u8>> {
        let mut record = vec![0; RECORD];
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.seek(self.at(tile))?;
        file.read_exact(&mut record)?;
        Ok(record)
    }
}

impl TileSink for TileNotes<'_> {
    fn has(&self, tile: TileRect) -> bool {
        self.sink.has(tile)
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        self.sink.put(tile, entries)
    }

    fn note(&self, tile: TileRect, numbers: &[f32]) -> Result<(), SinkError> {
        let mut bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        bytes.resize(4 * NUMBERS, 0);
        let record = [&self.checksum(tile, &bytes)[..], &bytes].concat();
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let written = file.seek(self.at(tile)).and_then(|_| file.write_all(&record));
        written.map_err(|e| {
            let what =
                format!("{}: noting a tile, {} bytes: {e}", self.path.display(), record.len());
            SinkError::Io(io::Error::new(e.kind(), what))
        })
    }

    fn noted(&self, tile: TileRect) -> Option<Vec<f32>> {
        // A file that can't be read says nothing: the tile is computed again.
        let record = self.read(tile).ok()?;
        let (checksum, bytes) = record.split_at(8);
        if checksum != self.checksum(tile, bytes) {
            return None;
        }
        Some(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
    }
}
