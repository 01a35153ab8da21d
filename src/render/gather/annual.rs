//! The annual map: of each pixel, the photons of the whole year as one irradiance.
//!
//! Each photon counts with its flux times the hours of its timestep; [`super::share`] finds the
//! photons of a pixel and says which of them came and went since the pixel before, so that a sum is
//! kept instead of made anew. Sums are of integers ([`super::flux`]), hence the same for any order
//! of tiles and threads.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::candidates::Change;
use super::error::Error;
use super::flux::{Beam, Fluxes, square, weighed};
use super::settings::Gather;
use super::share::{Scratch, Shared};
use super::surfaces::Surfaces;
use crate::base::{Grid, Progress};
use crate::pages::Store;
use crate::render::view::hits::HitMap;
use crate::render::view::order::Order;

/// The year's maps of a view; exactly 0 where nothing is hit or nothing arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct Annual {
    /// Radiant exposure of the surface, Wh/m2.
    pub surface: Grid<f32>,
    /// Radiant exposure on planes that face the beams (E_n), Wh/m2.
    pub facing_beam: Grid<f32>,
    /// Standard error of `surface`, Wh/m2: what photons landing at random make of it.
    pub error: Grid<f32>,
    /// Radius of the disc behind each value, m.
    pub radius_m: Grid<f32>,
    /// Pixels whose photons all lie within a millimetre, so that the disc was held at that.
    pub floored: u64,
}

struct Value {
    index: usize,
    surface: f32,
    facing_beam: f32,
    error: f32,
    radius_m: f32,
    floored: bool,
}

/// The annual map: every photon counts with the hours of its timestep, `weights_h`. Without
/// `surfaces` a disc is a disc wherever it lies.
///
/// # Errors
/// [`Error::View`]: settings, interruption; [`Error::Pages`].
pub fn annual(
    store: &Store,
    surfaces: Option<&Surfaces<'_>>,
    hits: &HitMap,
    weights_h: &[f64],
    settings: &Gather,
    progress: &dyn Progress,
) -> Result<Annual, Error> {
    let timesteps = store.info().timesteps as usize;
    if weights_h.len() != timesteps {
        return Err(Error::settings(format!(
            "the photon store was made for {timesteps} timesteps, the timeline has {}; trace again",
            weights_h.len()
        )));
    }
    let shared = Shared::new(store, surfaces, settings)?;
    let fluxes = Fluxes::of(store, weights_h.iter().copied().fold(0.0, f64::max));
    let order = Order::of(hits);
    let empty = || Grid::filled(hits.columns, hits.rows, 0.0f32);
    let result = Mutex::new(Annual {
        surface: empty(),
        facing_beam: empty(),
        error: empty(),
        radius_m: empty(),
        floored: 0,
    });
    progress.begin("annual map", (hits.columns * hits.rows) as u64, "pixels");
    // A timestep out of range is damage that verify finds; it must not panic here.
    let weight = |t: u32| weights_h.get(t as usize).copied().unwrap_or(0.0);
    let integers = |beam: Beam| fluxes.integers(beam, weight(beam.timestep));
    order.tiles().par_iter().try_for_each_init(
        || (Scratch::default(), Vec::new()),
        |(scratch, values), &tile| {
            progress.check()?;
            values.clear();
            let (mut surface, mut facing_beam, mut squares) = (0i64, 0i64, 0i64);
            shared.tile(
                &order.query_points(tile),
                scratch,
                &integers,
                None,
                |point, mut found| {
                    found.changes(|change| match change {
                        Change::Anew => (surface, facing_beam, squares) = (0, 0, 0),
                        Change::In(light, kernel) => {
                            let own = weighed(light.surface, kernel);
                            surface = surface.wrapping_add(own);
                            facing_beam = facing_beam.wrapping_add(weighed(light.facing, kernel));
                            squares = squares.wrapping_add(square(own));
                        }
                        Change::Out(light) => {
                            surface = surface.wrapping_sub(light.surface);
                            facing_beam = facing_beam.wrapping_sub(light.facing);
                            squares = squares.wrapping_sub(square(light.surface));
                        }
                    });
                    let disc = &found.disc;
                    values.push(Value {
                        index: order.index(tile, point.pixel),
                        surface: (fluxes.surface.value(surface) / disc.area_m2) as f32,
                        facing_beam: (fluxes.facing.value(facing_beam) / disc.area_m2) as f32,
                        error: (fluxes.surface.square_value(squares).sqrt() / disc.area_m2) as f32,
                        radius_m: disc.radius_m as f32,
                        floored: disc.floored,
                    });
                },
            )?;
            // Tiles don't overlap: the lock decides who writes first, not what is written.
            let mut all = result.lock().unwrap_or_else(PoisonError::into_inner);
            for v in values.iter() {
                all.surface.data_mut()[v.index] = v.surface;
                all.facing_beam.data_mut()[v.index] = v.facing_beam;
                all.error.data_mut()[v.index] = v.error;
                all.radius_m.data_mut()[v.index] = v.radius_m;
                all.floored += u64::from(v.floored);
            }
            drop(all);
            progress.advance(tile.pixels() as u64);
            Ok::<(), Error>(())
        },
    )?;
    progress.finish();
    Ok(result.into_inner().unwrap_or_else(PoisonError::into_inner))
}
