use std::sync::Mutex;

use rayon::prelude::*;

use super::order::Order;
use super::{Error, Estimator, HitMap, estimate};
use crate::base::{Grid, Progress};
use crate::pages::{Neighbours, Query, Store};

/// How photons are gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gather {
    /// Photons per point, at least 2.
    pub bandwidth: usize,
    /// Bound on the search, m; the store's own rule where it is left out.
    pub max_radius_m: Option<f32>,
    /// How they become irradiance.
    pub estimator: Estimator,
}

impl Gather {
    /// The bound on the search that holds for a store, m, after the settings were checked.
    pub(super) fn radius_m(&self, store: &Store) -> Result<f32, Error> {
        if self.bandwidth < 2 {
            let what = format!("bandwidth is {}, expected at least 2 photons", self.bandwidth);
            return Err(Error::Settings { what });
        }
        let radius = self.max_radius_m.unwrap_or_else(|| store.max_radius_m(self.bandwidth));
        if radius.is_finite() && radius > 0.0 {
            return Ok(radius);
        }
        if self.max_radius_m.is_none() && store.info().photons == 0 {
            // An empty store has no rule to offer, and nothing to find either.
            return Ok(1.0);
        }
        let what = format!("max_radius_m is {radius}, expected a length above 0");
        Err(Error::Settings { what })
    }
}

/// The year's maps of a view; exactly 0 where nothing is hit or nothing arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct Annual {
    /// Radiant exposure of the surface, Wh/m2.
    pub surface: Grid<f32>,
    /// Radiant exposure on planes that face the beams (E_n), Wh/m2.
    pub normal: Grid<f32>,
    /// Radius of the disc behind each value, m.
    pub radius_m: Grid<f32>,
    /// Pixels whose photons all lie within a millimetre, so that the disc was held at that.
    pub floored: u64,
}

/// The annual map: every photon counts with the hours of its timestep, `weights_h`.
///
/// # Errors
/// [`Error::Settings`], [`Error::Pages`], [`Error::Interrupted`].
pub fn annual(
    store: &Store,
    hits: &HitMap,
    weights_h: &[f64],
    settings: &Gather,
    progress: &dyn Progress,
) -> Result<Annual, Error> {
    let timesteps = store.info().timesteps as usize;
    if weights_h.len() != timesteps {
        return Err(Error::Settings {
            what: format!(
                "the photon store was made for {timesteps} timesteps, the timeline has {}; trace again",
                weights_h.len()
            ),
        });
    }
    let max_radius_m = settings.radius_m(store)?;
    let order = Order::of(hits);
    let empty = || Grid::filled(hits.columns, hits.rows, 0.0f32);
    let result =
        Mutex::new(Annual { surface: empty(), normal: empty(), radius_m: empty(), floored: 0 });
    progress.begin("annual map", (hits.columns * hits.rows) as u64, "pixels");
    order.tiles().par_iter().try_for_each_init(
        || (Neighbours::default(), Vec::new()),
        |(found, values), &tile| {
            progress.check()?;
            values.clear();
            for pixel in order.pixels(tile) {
                let index = order.index(tile, pixel);
                let hit = &hits.hits[index];
                let query = Query {
                    point: hit.position,
                    normal: hit.normal,
                    count: settings.bandwidth,
                    max_radius_m,
                };
                store.nearest(&query, found)?;
                let e = estimate(
                    found.items(),
                    found.farthest(),
                    found.full(),
                    max_radius_m,
                    settings.estimator,
                    // A timestep out of range is damage that verify finds; it must not panic here.
                    |t| weights_h.get(t as usize).copied().unwrap_or(0.0),
                );
                values.push((index, e));
            }
            // Tiles don't overlap: the lock decides who writes first, not what is written.
            let mut all = result.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            for &(index, e) in values.iter() {
                all.surface.data_mut()[index] = e.surface as f32;
                all.normal.data_mut()[index] = e.normal as f32;
                all.radius_m.data_mut()[index] = e.radius_m as f32;
                all.floored += u64::from(e.floored);
            }
            drop(all);
            progress.advance(tile.pixels() as u64);
            Ok::<(), Error>(())
        },
    )?;
    progress.finish();
    Ok(result.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}
