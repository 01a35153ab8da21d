use std::ops::Range;

use super::{Interrupted, Photon, TileRect, Tiles};

/// Why a sink could not take what it was given.
#[derive(Debug, thiserror::Error)]
pub enum SinkError {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Takes photons as they land. `trace` delivers, `pages` keeps them; `run` joins the two.
pub trait PhotonSink: Send {
    /// Takes the photons of the next batch. Batches come in their own order, one at a time, so
    /// that what is written doesn't depend on the number of threads.
    ///
    /// # Errors
    /// When the photons can't be kept (a full disk).
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError>;
}

/// One irradiance of a time series in a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeriesEntry {
    /// Index of the timestep.
    pub timestep: u32,
    /// Pixel in the tile: `row_in_tile * tile.columns + column_in_tile`.
    pub pixel: u16,
    /// Irradiance, W/m2; never 0 (what is absent is exactly 0).
    pub irradiance_w_m2: f32,
}

impl SinkError {
    /// What a sink was given that can't be: a mistake of who delivers.
    pub fn wrong(what: String) -> Self {
        Self::Io(std::io::Error::new(std::io::ErrorKind::InvalidInput, what))
    }
}

/// Holds what a [`TileSink`] is given against what it may be: one of `tiles`, whose number is
/// returned, and entries of `timesteps` and of the tile's pixels, in order.
///
/// # Errors
/// What isn't so.
pub fn checked_tile(
    tiles: &Tiles,
    timesteps: &Range<usize>,
    tile: TileRect,
    entries: &[SeriesEntry],
) -> Result<usize, SinkError> {
    let Some(number) = tiles.number(tile) else {
        return Err(SinkError::wrong(format!("{tile:?} is no tile of {tiles:?}")));
    };
    let outside = |e: &&SeriesEntry| {
        !timesteps.contains(&(e.timestep as usize)) || usize::from(e.pixel) >= tile.pixels()
    };
    if let Some(entry) = entries.iter().find(outside) {
        let what = format!("{entry:?} lies outside {tile:?} of timesteps {timesteps:?}");
        return Err(SinkError::wrong(what));
    }
    let key = |e: &SeriesEntry| (e.timestep, e.pixel);
    if let Some(pair) = entries.windows(2).find(|pair| key(&pair[0]) >= key(&pair[1])) {
        let what = format!("entries out of order: {:?}, then {:?}", pair[0], pair[1]);
        return Err(SinkError::wrong(what));
    }
    Ok(number)
}

/// Takes the time series of one tile at a time. `render` delivers, `volume` keeps them.
pub trait TileSink: Sync {
    /// Whether the tile was written and sealed before: then it isn't rendered again.
    fn has(&self, tile: TileRect) -> bool;

    /// Writes and seals a tile. `entries` are sorted by timestep, then pixel, without doubles.
    /// Called from many threads, for each tile once.
    ///
    /// # Errors
    /// When the tile can't be written (a full disk).
    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError>;

    /// Keeps numbers that were found out about a tile, at most two for each pixel, before it is
    /// put; a sink may forget them.
    ///
    /// # Errors
    /// When they can't be written.
    fn note(&self, _tile: TileRect, _numbers: &[f32]) -> Result<(), SinkError> {
        Ok(())
    }

    /// The numbers that were noted of a tile, maybe with zeros behind them; `None` where they were
    /// forgotten.
    fn noted(&self, _tile: TileRect) -> Option<Vec<f32>> {
        None
    }
}
