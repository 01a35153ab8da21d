//! The time series in batches of timesteps, for an analysis that keeps no series.

use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

use super::annual::Fluxes;
use super::annual::Gather;
use super::series::TileSeries;
use super::series::{Quantity, Series, SeriesSummary};
use super::share::{Beam, Recorded, Scratch, Shared};
use super::surfaces::Surfaces;
use crate::base::{Grid, Progress, TileRect, TileSink};
use crate::pages::Store;
use crate::render::view::error::Error;
use crate::render::view::hits::HitMap;
use crate::render::view::order::Order;

/// A view whose discs are known: each pixel's radius, found once among the photons of all suns.
/// Batches give the numbers that [`super::series::series`] writes, to the last bit.
pub struct Fused<'a> {
    store: &'a Store,
    shared: Shared<'a>,
    fluxes: Fluxes,
    order: Order<'a>,
    quantity: Quantity,
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
    /// [`Error::Settings`], [`Error::Pages`], [`Error::Sink`], [`Error::Interrupted`].
    pub fn prepare(
        store: &'a Store,
        surfaces: Option<&'a Surfaces<'a>>,
        hits: &'a HitMap,
        settings: &Gather,
        (quantity, whole): (Quantity, Option<&dyn TileSink>),
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let shared = Shared::new(store, surfaces, settings)?;
        let fluxes = Fluxes::of(store, 1.0);
        let order = Order::of(hits);
        let timesteps = store.info().timesteps;
        let empty = || Grid::filled(hits.columns, hits.rows, 0.0);
        let found = Mutex::new(Found {
            tiles: Vec::new(),
            series: Series {
                summary: SeriesSummary::default(),
                photon_w_m2: empty(),
                radius_m: empty(),
            },
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
                let spots = order.spots(tile);
                let record = Some(&mut recorded);
                let mut entries = vec![0u64; timesteps as usize];
                shared.tile(&spots, scratch, &integers, record, |spot, mut found| {
                    let made = tile_series.pixel(spot.pixel, &mut found, &fluxes, quantity);
                    let disc = &found.disc;
                    let index = order.index(tile, spot.pixel);
                    noise.push((index, made.photon_w_m2, disc.radius_m as f32));
                    summary.pixels += 1;
                    summary.lit_pixels += u64::from(made.lit > 0);
                    summary.lit_timesteps += made.lit as u64;
                    summary.photons += made.photons;
                    summary.floored += u64::from(disc.floored);
                    if whole.is_none() {
                        tile_series.count(&mut entries);
                        tile_series.clear();
                    }
                })?;
                if let Some(sink) = whole {
                    tile_series.count(&mut entries);
                    sink.put(tile, tile_series.sorted())?;
                }
                let mut all = found.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                all.series.summary.add(&summary);
                for (index, photon_w_m2, radius_m) in noise {
                    all.series.photon_w_m2.data_mut()[index] = photon_w_m2;
                    all.series.radius_m.data_mut()[index] = radius_m;
                }
                for (sum, count) in all.entries.iter_mut().zip(entries) {
                    *sum += count;
                }
                if !spots.is_empty() {
                    all.tiles.push((number, tile, recorded));
                }
                drop(all);
                progress.advance(tile.pixels() as u64);
                Ok::<(), Error>(())
            },
        )?;
        progress.finish();
        let mut found = found.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        found.tiles.sort_unstable_by_key(|(number, ..)| *number);
        let tiles = found.tiles.into_iter().map(|(_, tile, recorded)| (tile, recorded)).collect();
        let (series, entries) = (found.series, found.entries);
        Ok(Self { store, shared, fluxes, order, quantity, tiles, series, entries })
    }

    /// Renders some timesteps of all tiles. Tiles without receiving surfaces are left out.
    ///
    /// # Errors
    /// [`Error::Pages`], [`Error::Sink`], [`Error::Interrupted`].
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
                let spots = self.order.spots(*tile);
                let what = (recorded, &timesteps);
                self.shared.again(&spots, scratch, &integers, what, |spot, mut found| {
                    tile_series.pixel(spot.pixel, &mut found, &self.fluxes, self.quantity);
                })?;
                sink.put(*tile, tile_series.sorted())?;
                Ok::<(), Error>(())
            },
        )
    }
}
