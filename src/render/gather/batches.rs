//! The time series in batches of timesteps, for an analysis that keeps no series.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::error::Error;
use super::flux::{Beam, Fluxes};
use super::series::{Noise, Series, SeriesSummary, TileSeries};
use super::settings::Gather;
use super::share::{Recorded, Scratch, Shared};
use super::surfaces::Surfaces;
use crate::base::{Irradiance, Progress, TileRect, TileSink};
use crate::pages::Store;
use crate::render::view::hits::HitMap;
use crate::render::view::order::Order;

/// A view whose discs are known: each pixel's radius, found once among the photons of all suns.
/// Batches give the numbers that [`super::series::series`] writes, to the last bit.
pub struct Fused<'a> {
    store: &'a Store,
    shared: Shared<'a>,
    fluxes: Fluxes,
    order: Order<'a>,
    quantity: Irradiance,
    tiles: Vec<(TileRect, Recorded)>,
    /// What is known of the series.
    pub series: Series,
    /// Numbers other than 0 in all pixels, by timestep.
    pub entries: Vec<u64>,
}

/// What the tiles found, while they find it.
struct Found {
    tiles: Vec<(usize, TileRect, Recorded)>,
    series: Series,
    entries: Vec<u64>,
}

impl<'a> Fused<'a> {
    /// Finds the discs of all pixels. Each tile's whole year passes by meanwhile: a sink gets it.
    ///
    /// # Errors
    /// [`Error::View`]: settings, a sink that fails, interruption; [`Error::Pages`].
    pub fn prepare(
        store: &'a Store,
        surfaces: Option<&'a Surfaces<'a>>,
        hits: &'a HitMap,
        settings: &Gather,
        (quantity, whole): (Irradiance, Option<&dyn TileSink>),
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let shared = Shared::new(store, surfaces, settings)?;
        let fluxes = Fluxes::of(store, 1.0);
        let order = Order::of(hits);
        let timesteps = store.info().timesteps;
        let found = Mutex::new(Found {
            tiles: Vec::new(),
            series: Series::empty(hits),
            entries: vec![0; timesteps as usize],
        });
        progress.begin("radius of each pixel", (hits.columns * hits.rows) as u64, "pixels");
        let integers = |beam: Beam| fluxes.integers_of(quantity, beam);
        order.tiles().par_iter().enumerate().try_for_each_init(
            || (Scratch::default(), TileSeries::new(0..timesteps)),
            |(scratch, tile_series), (number, &tile)| {
                progress.check()?;
                tile_series.clear();
                let mut summary = SeriesSummary { tiles_rendered: 1, ..Default::default() };
                let mut recorded = Recorded::default();
                let mut noise = Vec::new();
                let points = order.query_points(tile);
                let record = Some(&mut recorded);
                let mut entries = vec![0u64; timesteps as usize];
                shared.tile(&points, scratch, &integers, record, |point, mut found| {
                    let made = tile_series.pixel(point.pixel, &mut found, &fluxes, quantity);
                    let index = order.index(tile, point.pixel);
                    let (photon_w_m2, radius_m) = (made.photon_w_m2, found.disc.radius_m as f32);
                    noise.push(Noise { index, photon_w_m2, radius_m });
                    summary.count(&made, found.disc.floored);
                    if whole.is_none() {
                        tile_series.count(&mut entries);
                        tile_series.clear();
                    }
                })?;
                if let Some(sink) = whole {
                    tile_series.count(&mut entries);
                    sink.put(tile, tile_series.sorted())?;
                }
                let mut all = found.lock().unwrap_or_else(PoisonError::into_inner);
                all.series.keep(&summary, &noise);
                for (sum, count) in all.entries.iter_mut().zip(entries) {
                    *sum += count;
                }
                if !points.is_empty() {
                    all.tiles.push((number, tile, recorded));
                }
                drop(all);
                progress.advance(tile.pixels() as u64);
                Ok::<(), Error>(())
            },
        )?;
        progress.finish();
        let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
        found.tiles.sort_unstable_by_key(|(number, ..)| *number);
        let tiles = found.tiles.into_iter().map(|(_, tile, recorded)| (tile, recorded)).collect();
        let (series, entries) = (found.series, found.entries);
        Ok(Self { store, shared, fluxes, order, quantity, tiles, series, entries })
    }

    /// Renders some timesteps of all tiles. Tiles without receiving surfaces are left out.
    ///
    /// # Errors
    /// [`Error::Pages`]; [`Error::View`]: a sink that fails, interruption.
    pub fn batch(
        &self,
        timesteps: Range<u32>,
        sink: &dyn TileSink,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let timesteps = timesteps.start..timesteps.end.min(self.store.info().timesteps);
        let integers = |beam: Beam| self.fluxes.integers_of(self.quantity, beam);
        self.tiles.par_iter().try_for_each_init(
            || (Scratch::default(), TileSeries::new(timesteps.clone())),
            |(scratch, tile_series), (tile, recorded)| {
                progress.check()?;
                tile_series.clear();
                let points = self.order.query_points(*tile);
                let what = (recorded, &timesteps);
                self.shared.again(&points, scratch, &integers, what, |point, mut found| {
                    tile_series.pixel(point.pixel, &mut found, &self.fluxes, self.quantity);
                })?;
                sink.put(*tile, tile_series.sorted())?;
                Ok::<(), Error>(())
            },
        )
    }
}
