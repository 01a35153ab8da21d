use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Mutex;

use super::maps::{Clock, Pixels, TILE, TileMaps, YearMap, YearRows, hand_on};
use crate::base::limits::TILE_EDGE;
use crate::base::{SeriesEntry, SinkError, TileRect, TileSink, Tiles, checked_tile};
use crate::glare::error::Error;
use crate::glare::settings::comparable;
use crate::volume::TimeAxis;

/// The maps of [`year`](super::maps::year) for a series that is never written: takes the whole year of
/// each tile as a renderer delivers it. What it finds waits in a file without a name, 4 KiB for
/// each tile and map.
pub struct YearTiles<'a> {
    threshold: f32,
    clock: Clock<'a>,
    maps: Vec<YearMap>,
    tiles: Tiles,
    found: Mutex<File>,
}

impl<'a> YearTiles<'a> {
    /// For a picture of `[row, column]` pixels; `clock_h` is what clocks show at each timestep, h
    /// (local standard time if left out), `spill` where the file lies.
    ///
    /// # Errors
    /// A threshold or a time step out of range; a folder that can't be written to.
    pub fn new(
        axis: &'a TimeAxis,
        clock_h: Option<&[f64]>,
        [rows, columns]: [usize; 2],
        threshold_w_m2: f64,
        spill: &Path,
    ) -> Result<Self, Error> {
        let (clock, threshold) = (Clock::new(axis, clock_h)?, comparable(threshold_w_m2)?);
        let tiles = Tiles { columns, rows, edge: TILE_EDGE };
        let found = Mutex::new(tempfile::tempfile_in(spill).map_err(Error::Maps)?);
        Ok(Self { threshold, clock, maps: YearMap::all(axis), tiles, found })
    }

    /// Hands on the maps, as [`year`](super::maps::year) does. Tiles that were never put are dark.
    ///
    /// # Errors
    /// What `rows` says; a file that can't be read back.
    pub fn finish(self, rows: YearRows<'_>) -> Result<(), Error> {
        let mut file = self.found.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let block = self.maps.len() * TILE * 4;
        // Tiles at the end that were never put make it longer: zeros.
        file.set_len((block * self.tiles.count()) as u64).map_err(Error::Maps)?;
        file.rewind().map_err(Error::Maps)?;
        let mut bytes = vec![0u8; block];
        let mut read = |number: usize| {
            file.read_exact(&mut bytes)?;
            let values = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
            Ok(TileMaps { tile: self.tiles.rect(number), values: values.collect() })
        };
        let across = self.tiles.across();
        for row in 0..self.tiles.down() {
            let found: io::Result<Vec<TileMaps>> =
                (row * across..(row + 1) * across).map(&mut read).collect();
            let found = found.map_err(Error::Maps)?;
            hand_on(&self.maps, &found, self.tiles.columns, &mut *rows)?;
        }
        Ok(())
    }
}

impl TileSink for YearTiles<'_> {
    fn has(&self, _: TileRect) -> bool {
        false
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let number = checked_tile(&self.tiles, &(0..self.clock.timesteps()), tile, entries)?;
        let mut pixels = Pixels::new(self.threshold, &self.clock);
        for e in entries {
            let pixel = usize::from(e.pixel);
            let place = pixel / tile.columns * TILE_EDGE + pixel % tile.columns;
            pixels.one(place, e.timestep as usize, e.irradiance_w_m2);
        }
        let values = pixels.finish(&self.maps);
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut file = self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let at = number as u64 * bytes.len() as u64;
        let written = file.seek(SeekFrom::Start(at)).and_then(|_| file.write_all(&bytes));
        written.map_err(SinkError::Io)
    }
}
