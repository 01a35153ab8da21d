use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

use super::scene::Direct;
use super::series::{Buffers, Tiles};
use super::series::{DirectSummary, TileYear};
use crate::base::Irradiance;
use crate::base::{Progress, SinkError, TileRect, TileSink};
use crate::render::view::error::Error;
use crate::render::view::hits::HitMap;

/// The series of a view that is integrated directly in batches of timesteps, for an analysis that
/// keeps no series: the numbers that [`super::series::direct_series`] writes, to the last bit.
pub struct FusedDirect<'a> {
    tiles: Tiles<'a>,
    quantity: Irradiance,
    /// What was met.
    pub summary: DirectSummary,
    /// Numbers other than 0 in all pixels, by timestep.
    pub entries: Vec<u64>,
}

impl<'a> FusedDirect<'a> {
    /// Integrates the whole year once: `keep` takes each tile's sums, `whole` its series.
    ///
    /// # Errors
    /// [`Error::Sink`], [`Error::Interrupted`].
    pub fn prepare(
        direct: &'a Direct<'a>,
        hits: &'a HitMap,
        (quantity, whole): (Irradiance, Option<&dyn TileSink>),
        keep: &(dyn Fn(TileRect, &TileYear) -> Result<(), SinkError> + Sync),
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let tiles = Tiles::new(direct, hits);
        let all = tiles.all();
        let found = Mutex::new((DirectSummary::default(), vec![0_u64; all.len()]));
        let pixels = (hits.columns * hits.rows) as u64;
        progress.begin("direct integration", pixels, "pixels");
        let quantities = [Some(quantity), None];
        let each = tiles.order.tiles();
        each.par_iter().with_max_len(1).try_for_each_init(Buffers::default, |buffers, &tile| {
            let (summary, sums) = tiles.integrate(tile, &all, quantities, buffers, progress)?;
            let [entries, _] = &buffers.entries;
            keep(tile, &sums)?;
            if let Some(sink) = whole {
                sink.put(tile, entries)?;
            }
            let mut found = found.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            found.0.add(&summary);
            for entry in entries {
                found.1[entry.timestep as usize] += 1;
            }
            drop(found);
            progress.advance(tile.pixels() as u64);
            Ok::<(), Error>(())
        })?;
        progress.finish();
        let (summary, entries) =
            found.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        Ok(Self { tiles, quantity, summary, entries })
    }

    /// Integrates some timesteps of all tiles.
    ///
    /// # Errors
    /// [`Error::Sink`], [`Error::Interrupted`].
    pub fn batch(
        &self,
        timesteps: Range<u32>,
        sink: &dyn TileSink,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let quantities = [Some(self.quantity), None];
        let tiles = self.tiles.order.tiles();
        tiles.par_iter().with_max_len(1).try_for_each_init(Buffers::default, |buffers, &tile| {
            self.tiles.integrate(tile, &timesteps, quantities, buffers, progress)?;
            let [entries, _] = &buffers.entries;
            if !entries.is_empty() {
                sink.put(tile, entries)?;
            }
            Ok::<(), Error>(())
        })
    }
}
