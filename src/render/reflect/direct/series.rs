//! Direct integration for all pixels of a view, tile by tile: year, series and error bound in one pass;
//! tiles that are finished aren't integrated again when a run is resumed.

use std::ops::Range;
use std::sync::Mutex;

use glam::Vec3;
use rayon::prelude::*;

use super::scene::{Direct, DirectScratch};
use super::year::DirectYear;
use crate::base::Irradiance;
use crate::base::{Progress, SeriesEntry, SinkError, TileRect, TileSink};
use crate::render::view::error::Error;
use crate::render::view::hits::HitMap;
use crate::render::view::order::Order;

/// The year of a tile's pixels, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileYear {
    /// Radiant exposure of the surface, Wh/m2.
    pub surface_wh_m2: Vec<f32>,
    /// Radiant exposure on planes that face the beams, Wh/m2.
    pub normal_wh_m2: Vec<f32>,
    /// Bound of the error in the first, Wh/m2.
    pub error_wh_m2: Vec<f32>,
}

/// What was met; only of tiles that were integrated now.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct DirectSummary {
    /// Tiles integrated now.
    pub tiles_rendered: u64,
    /// Tiles that were there already.
    pub tiles_present: u64,
    /// Pixels where light may arrive.
    pub pixels: u64,
    /// Pixels where it does.
    pub lit_pixels: u64,
    /// Lit timesteps, summed over the pixels.
    pub lit_timesteps: u64,
    /// Largest bound of the error of a pixel and timestep, W/m2.
    pub most_error_w_m2: f64,
}

impl DirectSummary {
    pub(super) fn add(&mut self, other: &Self) {
        self.tiles_rendered += other.tiles_rendered;
        self.tiles_present += other.tiles_present;
        self.pixels += other.pixels;
        self.lit_pixels += other.lit_pixels;
        self.lit_timesteps += other.lit_timesteps;
        self.most_error_w_m2 = self.most_error_w_m2.max(other.most_error_w_m2);
    }
}

/// Where a view's years go.
#[derive(Clone, Copy)]
pub struct DirectSinks<'a> {
    /// The time series of a quantity. Tiles that it has are passed over, so that an interrupted
    /// run goes on where it stopped.
    pub series: (Irradiance, &'a dyn TileSink),
    /// The series of the other quantity; sealed before.
    pub other: Option<(Irradiance, &'a dyn TileSink)>,
    /// Takes a tile's sums over the year before its series is sealed.
    pub keep: &'a (dyn Fn(TileRect, &TileYear) -> Result<(), SinkError> + Sync),
}

/// Integrates every pixel of a view over the year, tile by tile. Memory holds the tiles at work.
///
/// # Errors
/// [`Error::Sink`], [`Error::Interrupted`].
pub fn direct_series(
    direct: &Direct<'_>,
    hits: &HitMap,
    sinks: DirectSinks<'_>,
    progress: &dyn Progress,
) -> Result<DirectSummary, Error> {
    let order = Order::of(hits);
    let all = order.tiles();
    let todo: Vec<TileRect> =
        all.iter().copied().filter(|&tile| !sinks.series.1.has(tile)).collect();
    let present = (all.len() - todo.len()) as u64;
    let total = Mutex::new(DirectSummary { tiles_present: present, ..Default::default() });
    let pixels: u64 = todo.iter().map(|tile| tile.pixels() as u64).sum();
    progress.begin("direct integration", pixels, "pixels");
    let tiles = Tiles::new(direct, hits);
    // Tiles take from nothing to minutes: each may go to another thread.
    todo.par_iter().with_max_len(1).try_for_each_init(Buffers::default, |buffers, &tile| {
        let quantities = [Some(sinks.series.0), sinks.other.map(|(quantity, _)| quantity)];
        let (summary, sums) = tiles.integrate(tile, &tiles.all(), quantities, buffers, progress)?;
        let [entries, others] = &buffers.entries;
        if let Some((_, other)) = sinks.other.filter(|(_, other)| !other.has(tile)) {
            other.put(tile, others)?;
        }
        (sinks.keep)(tile, &sums)?;
        sinks.series.1.put(tile, entries)?;
        total.lock().unwrap_or_else(std::sync::PoisonError::into_inner).add(&summary);
        progress.advance(tile.pixels() as u64);
        Ok::<(), Error>(())
    })?;
    progress.finish();
    Ok(total.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Buffers of a thread.
#[derive(Default)]
pub(super) struct Buffers {
    scratch: DirectScratch,
    year: DirectYear,
    /// By quantity that was asked for, in the order of time, then of pixels.
    pub entries: [Vec<SeriesEntry>; 2],
}

/// A view, tile by tile.
pub(super) struct Tiles<'a> {
    direct: &'a Direct<'a>,
    hits: &'a HitMap,
    pub order: Order<'a>,
    weights_h: Vec<f64>,
}

impl<'a> Tiles<'a> {
    pub(super) fn new(direct: &'a Direct<'a>, hits: &'a HitMap) -> Self {
        let weights_h = direct.timeline().steps.iter().map(|s| s.weight_h).collect();
        Self { direct, hits, order: Order::of(hits), weights_h }
    }

    /// All timesteps.
    pub(super) fn all(&self) -> Range<u32> {
        0..self.weights_h.len() as u32
    }

    /// Integrates some timesteps of a tile into the buffers.
    pub(super) fn integrate(
        &self,
        tile: TileRect,
        timesteps: &Range<u32>,
        quantities: [Option<Irradiance>; 2],
        Buffers { scratch, year, entries }: &mut Buffers,
        progress: &dyn Progress,
    ) -> Result<(DirectSummary, TileYear), Error> {
        let mut summary = DirectSummary { tiles_rendered: 1, ..Default::default() };
        let zero = || vec![0.0_f32; tile.pixels()];
        let mut sums =
            TileYear { surface_wh_m2: zero(), normal_wh_m2: zero(), error_wh_m2: zero() };
        entries.iter_mut().for_each(Vec::clear);
        for pixel in self.order.pixels(tile) {
            progress.check()?;
            let hit = &self.hits.hits[self.order.index(tile, pixel)];
            let [position, normal] = [hit.position, hit.normal].map(Vec3::as_dvec3);
            self.direct.part((position, normal), timesteps, scratch, year);
            // A fixed order of sums.
            year.lit.sort_unstable();
            let (mut surface, mut facing, mut error) = (0.0, 0.0, 0.0);
            let first = entries[0].len();
            for &step in &year.lit {
                let i = step as usize;
                surface += year.surface_w_m2[i] * self.weights_h[i];
                facing += year.normal_w_m2[i] * self.weights_h[i];
                error += year.error_w_m2[i] * self.weights_h[i];
                summary.most_error_w_m2 = summary.most_error_w_m2.max(year.error_w_m2[i]);
                for (list, quantity) in entries.iter_mut().zip(quantities.into_iter().flatten()) {
                    let value = match quantity {
                        Irradiance::Surface => year.surface_w_m2[i],
                        Irradiance::FacingBeam => year.normal_w_m2[i],
                    } as f32;
                    if value > 0.0 {
                        list.push(SeriesEntry { timestep: step, pixel, irradiance_w_m2: value });
                    }
                }
            }
            let at = usize::from(pixel);
            sums.surface_wh_m2[at] = surface as f32;
            sums.normal_wh_m2[at] = facing as f32;
            sums.error_wh_m2[at] = error as f32;
            summary.pixels += 1;
            summary.lit_pixels += u64::from(entries[0].len() > first);
            summary.lit_timesteps += (entries[0].len() - first) as u64;
        }
        for list in entries.iter_mut() {
            list.sort_unstable_by_key(|e: &SeriesEntry| (e.timestep, e.pixel));
        }
        Ok((summary, sums))
    }
}
