use std::sync::Mutex;

use rayon::prelude::*;

use super::candidates::Change;
use super::estimate::Estimator;
use super::estimate::{Kernel, MIN_COS};
use super::fixed::{MOST_PHOTONS, Scale, square};
use super::series::Quantity;
use super::share::{Beam, Scratch, Shared};
use super::surfaces::{Surfaces, Tolerance};
use crate::base::{Grid, Progress};
use crate::pages::Store;
use crate::render::view::error::Error;
use crate::render::view::hits::HitMap;
use crate::render::view::order::Order;

/// Radiance draws from 0 to 0.02 (`PMAP_NORM_TOL`) the cosine of normals up to which it rejects a
/// photon: all within 88.9 degrees count, none beyond 90. This is the middle, `acos(0.01)`.
const RADIANCE_NORMAL_DEG: f32 = 89.43;

/// How photons are gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gather {
    /// Photons per point, at least 2.
    pub bandwidth: usize,
    /// Bound on the search, m; the store's own rule where it is left out.
    pub max_radius_m: Option<f32>,
    /// How they become irradiance.
    pub estimator: Estimator,
    /// How they are weighed.
    pub kernel: Kernel,
    /// Largest angle between the normals of pixel and photon, degrees.
    pub normal_tolerance_deg: f32,
    /// How far a photon may lie off the pixel's tangent plane, m; any distance where it is left
    /// out.
    pub plane_tolerance_m: Option<f32>,
    /// Whether a disc ends where its surface ends and at walls that stand on it.
    pub edges: bool,
}

impl Default for Gather {
    fn default() -> Self {
        Self {
            bandwidth: 400,
            max_radius_m: None,
            estimator: Estimator::Photons,
            kernel: Kernel::Flat,
            normal_tolerance_deg: 60.0,
            plane_tolerance_m: Some(0.25),
            edges: true,
        }
    }
}

impl Gather {
    /// The bound on the search that holds for a store, m, after the settings were checked.
    pub(in crate::render) fn radius_m(&self, store: &Store) -> Result<f32, Error> {
        if !(2..=MOST_PHOTONS).contains(&self.bandwidth) {
            let what =
                format!("bandwidth is {}, expected 2 to {MOST_PHOTONS} photons", self.bandwidth);
            return Err(Error::Settings { what });
        }
        if !(self.normal_tolerance_deg > 0.0 && self.normal_tolerance_deg <= 90.0) {
            let what = format!(
                "normal_tolerance_deg is {}, expected an angle above 0 and at most 90",
                self.normal_tolerance_deg
            );
            return Err(Error::Settings { what });
        }
        if self.plane_tolerance_m.is_some_and(|t| !(t >= 0.01 && t.is_finite())) {
            let what = format!(
                "plane_tolerance_m is {}, expected 0.01 m or more",
                self.plane_tolerance_m.unwrap_or_default()
            );
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

    /// What is done: the paper's estimator knows neither kernels nor edges, and takes photons of
    /// nearly every normal on the same side.
    pub(in crate::render) fn as_used(self) -> Self {
        match self.estimator {
            Estimator::Photons => self,
            Estimator::Radiance => Self {
                kernel: Kernel::Flat,
                normal_tolerance_deg: RADIANCE_NORMAL_DEG,
                plane_tolerance_m: None,
                edges: false,
                ..self
            },
        }
    }

    /// The same with discs that end nowhere and take photons of any height.
    pub fn open(self) -> Self {
        Self { plane_tolerance_m: None, edges: false, ..self }
    }

    /// Whether the store's own search finds what counts: discs without end or tolerance.
    pub(in crate::render) fn is_open(&self) -> bool {
        !self.edges && self.plane_tolerance_m.is_none() && self.normal_tolerance_deg == 60.0
    }

    pub(in crate::render) fn tolerance(&self) -> Tolerance {
        // The store's own search has exactly a half for 60 degrees.
        let open = self.normal_tolerance_deg == 60.0;
        Tolerance {
            normal_cos: if open { 0.5 } else { libm::cosf(self.normal_tolerance_deg.to_radians()) },
            plane_m: self.plane_tolerance_m.unwrap_or(f32::INFINITY),
        }
    }
}

/// The year's maps of a view; exactly 0 where nothing is hit or nothing arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct Annual {
    /// Radiant exposure of the surface, Wh/m2.
    pub surface: Grid<f32>,
    /// Radiant exposure on planes that face the beams (E_n), Wh/m2.
    pub normal: Grid<f32>,
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
    normal: f32,
    error: f32,
    radius_m: f32,
    floored: bool,
}

/// What photons add to E and E_n, as integers: flux in W times the weight of their timestep.
pub(in crate::render) struct Fluxes {
    surface: Scale,
    normal: Scale,
}

impl Fluxes {
    pub fn of(store: &Store, largest_weight: f64) -> Self {
        let largest = f64::from(store.info().flux_max_w) * largest_weight;
        Self { surface: Scale::up_to(largest), normal: Scale::up_to(largest / f64::from(MIN_COS)) }
    }

    pub fn integers(&self, beam: Beam, weight: f64) -> [i64; 2] {
        let flux = f64::from(beam.flux_w) * weight;
        let normal = flux / f64::from(beam.cos.max(MIN_COS));
        [self.surface.integer(flux), self.normal.integer(normal)]
    }

    /// The same where only one quantity is asked for; the other is 0.
    pub fn integers_of(&self, quantity: Quantity, beam: Beam) -> [i64; 2] {
        let flux = f64::from(beam.flux_w);
        match quantity {
            Quantity::Surface => [self.surface.integer(flux), 0],
            Quantity::Normal => [0, self.normal.integer(flux / f64::from(beam.cos.max(MIN_COS)))],
        }
    }

    /// How integers of a quantity become W again.
    pub fn scale(&self, quantity: Quantity) -> Scale {
        match quantity {
            Quantity::Surface => self.surface,
            Quantity::Normal => self.normal,
        }
    }
}

/// An integer under a kernel's weight.
pub(in crate::render) fn weighed(integer: i64, kernel: f64) -> i64 {
    if kernel == 1.0 { integer } else { (integer as f64 * kernel).round_ties_even() as i64 }
}

/// The annual map: every photon counts with the hours of its timestep, `weights_h`. Without
/// `surfaces` a disc is a disc wherever it lies.
///
/// # Errors
/// [`Error::Settings`], [`Error::Pages`], [`Error::Interrupted`].
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
        return Err(Error::Settings {
            what: format!(
                "the photon store was made for {timesteps} timesteps, the timeline has {}; trace again",
                weights_h.len()
            ),
        });
    }
    let shared = Shared::new(store, surfaces, settings)?;
    let fluxes = Fluxes::of(store, weights_h.iter().copied().fold(0.0, f64::max));
    let order = Order::of(hits);
    let empty = || Grid::filled(hits.columns, hits.rows, 0.0f32);
    let result = Mutex::new(Annual {
        surface: empty(),
        normal: empty(),
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
            let (mut surface, mut normal, mut squares) = (0i64, 0i64, 0i64);
            shared.tile(&order.spots(tile), scratch, &integers, None, |spot, mut found| {
                found.changes(|change| match change {
                    Change::Anew => (surface, normal, squares) = (0, 0, 0),
                    Change::In(light, kernel) => {
                        let own = weighed(light.surface, kernel);
                        surface = surface.wrapping_add(own);
                        normal = normal.wrapping_add(weighed(light.normal, kernel));
                        squares = squares.wrapping_add(square(own));
                    }
                    Change::Out(light) => {
                        surface = surface.wrapping_sub(light.surface);
                        normal = normal.wrapping_sub(light.normal);
                        squares = squares.wrapping_sub(square(light.surface));
                    }
                });
                let disc = &found.disc;
                values.push(Value {
                    index: order.index(tile, spot.pixel),
                    surface: (fluxes.surface.value(surface) / disc.area_m2) as f32,
                    normal: (fluxes.normal.value(normal) / disc.area_m2) as f32,
                    error: (fluxes.surface.square_value(squares).sqrt() / disc.area_m2) as f32,
                    radius_m: disc.radius_m as f32,
                    floored: disc.floored,
                });
            })?;
            // Tiles don't overlap: the lock decides who writes first, not what is written.
            let mut all = result.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            for v in values.iter() {
                all.surface.data_mut()[v.index] = v.surface;
                all.normal.data_mut()[v.index] = v.normal;
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
    Ok(result.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}
