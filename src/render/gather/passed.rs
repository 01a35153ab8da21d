//! What arrives in free air: the photons that crossed each gate, counted.
//!
//! A gate is a disc of known area, so there is nothing to search: `E = sum(Phi) / A` over all of its
//! photons. Its standard error is that of a count, as on surfaces.

use std::ops::Range;

use super::annual::{Annual, Fluxes};
use super::fixed::square;
use super::series::TileSeries;
use super::series::{Quantity, Series};
use super::share::Beam;
use crate::base::{Gate, GateSheet, SeriesEntry, SinkError, TileRect, TileSink};
use crate::pages::{ALWAYS, Store};
use crate::render::view::error::Error;

/// The gates of a set of sensors and what crossed them.
#[derive(Clone, Copy)]
pub struct Passed<'a> {
    /// The crossings.
    pub store: &'a Store,
    /// The gates.
    pub gates: &'a [Gate],
    /// Where their crossings lie in the store.
    pub sheet: GateSheet,
    /// The number of the sensor that each gate belongs to: its column in the set's one row.
    pub sensors: &'a [usize],
}

fn area_m2(gate: &Gate) -> f64 {
    std::f64::consts::PI * gate.radius_m * gate.radius_m
}

impl<'a> Passed<'a> {
    /// Calls `each` with the photons of a gate.
    fn photons(&self, gate: usize, mut each: impl FnMut(Beam)) -> Result<(), Error> {
        self.store.lit_in_box(self.sheet.cell(gate), &ALWAYS, |_, _, _, light| {
            each(Beam { flux_w: light.flux_w, cos: light.cos, timestep: light.timestep });
            true
        })?;
        Ok(())
    }

    /// Fills in the year of the sensors in free air. `weights_h` are the hours of the timesteps.
    ///
    /// # Errors
    /// [`Error::Pages`].
    pub fn add_year(&self, annual: &mut Annual, weights_h: &[f64]) -> Result<(), Error> {
        let fluxes = Fluxes::of(self.store, weights_h.iter().copied().fold(0.0, f64::max));
        for (number, gate) in self.gates.iter().enumerate() {
            let (mut surface, mut normal, mut squares) = (0i64, 0i64, 0i64);
            self.photons(number, |beam| {
                let weight = weights_h.get(beam.timestep as usize).copied().unwrap_or(0.0);
                let [e, e_n] = fluxes.integers(beam, weight);
                surface = surface.wrapping_add(e);
                normal = normal.wrapping_add(e_n);
                squares = squares.wrapping_add(square(e));
            })?;
            let (of_e, of_n) = (fluxes.scale(Quantity::Surface), fluxes.scale(Quantity::Normal));
            let at = self.sensors[number];
            annual.surface.data_mut()[at] = (of_e.value(surface) / area_m2(gate)) as f32;
            annual.normal.data_mut()[at] = (of_n.value(normal) / area_m2(gate)) as f32;
            annual.error.data_mut()[at] =
                (of_e.square_value(squares).sqrt() / area_m2(gate)) as f32;
            annual.radius_m.data_mut()[at] = gate.radius_m as f32;
        }
        Ok(())
    }

    /// A sink that adds the sensors in free air to the tiles that come to it.
    pub fn series<'s>(&'s self, sink: &'s dyn TileSink, quantity: Quantity) -> PassedSeries<'s> {
        PassedSeries { passed: self, sink, quantity }
    }

    /// Fills in what one photon stands for at the sensors in free air, and counts their photons.
    ///
    /// # Errors
    /// [`Error::Pages`].
    pub fn add_noise(&self, series: &mut Series, quantity: Quantity) -> Result<(), Error> {
        let fluxes = Fluxes::of(self.store, 1.0);
        let mut made = TileSeries::new(0..self.store.info().timesteps);
        for (number, gate) in self.gates.iter().enumerate() {
            let (photon_w_m2, photons, lit) = self.one(number, 0, &fluxes, quantity, &mut made)?;
            let at = self.sensors[number];
            series.photon_w_m2.data_mut()[at] = photon_w_m2;
            series.radius_m.data_mut()[at] = gate.radius_m as f32;
            let summary = &mut series.summary;
            summary.pixels += 1;
            summary.lit_pixels += u64::from(lit > 0);
            summary.lit_timesteps += lit as u64;
            summary.photons += photons;
            made.clear();
        }
        Ok(())
    }

    /// The series of a gate, as a pixel of a tile: what a photon stands for, W/m2, how many there
    /// are, and lit timesteps.
    fn one(
        &self,
        gate: usize,
        pixel: u16,
        fluxes: &Fluxes,
        quantity: Quantity,
        out: &mut TileSeries,
    ) -> Result<(f32, u64, usize), Error> {
        let scale = fluxes.scale(quantity);
        let (mut sum, mut squares, mut photons) = (0i64, 0i64, 0);
        out.anew();
        self.photons(gate, |beam| {
            let timestep = beam.timestep;
            let [e, e_n] = fluxes.integers_of(quantity, beam);
            let own = match quantity {
                Quantity::Surface => e,
                Quantity::Normal => e_n,
            };
            out.add(timestep, own);
            sum = sum.wrapping_add(own);
            squares = squares.wrapping_add(square(own));
            photons += 1;
        })?;
        let area_m2 = area_m2(&self.gates[gate]);
        let value = |sum| (scale.value(sum) / area_m2) as f32;
        let lit = out.end(pixel, value);
        let mean = scale.square_value(squares) / scale.value(sum).max(f64::MIN_POSITIVE);
        Ok(((mean / area_m2) as f32, photons, lit))
    }

    /// The gates of the sensors in some columns.
    fn between(&self, columns: Range<usize>) -> Range<usize> {
        let first = self.sensors.partition_point(|&s| s < columns.start);
        first..self.sensors.partition_point(|&s| s < columns.end)
    }
}

/// See [`Passed::series`].
pub struct PassedSeries<'a> {
    passed: &'a Passed<'a>,
    sink: &'a dyn TileSink,
    quantity: Quantity,
}

impl TileSink for PassedSeries<'_> {
    fn has(&self, tile: TileRect) -> bool {
        self.sink.has(tile)
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let passed = self.passed;
        let fluxes = Fluxes::of(passed.store, 1.0);
        let mut made = TileSeries::new(0..passed.store.info().timesteps);
        for gate in passed.between(tile.column..tile.column + tile.columns) {
            let pixel = (passed.sensors[gate] - tile.column) as u16;
            passed
                .one(gate, pixel, &fluxes, self.quantity, &mut made)
                .map_err(|e| SinkError::Io(std::io::Error::other(e)))?;
        }
        let mut all = [entries, made.sorted()].concat();
        // A pixel is a gate or stands on a surface: there are no doubles.
        all.sort_unstable_by_key(|e| (e.timestep, e.pixel));
        self.sink.put(tile, &all)
    }

    fn note(&self, tile: TileRect, numbers: &[f32]) -> Result<(), SinkError> {
        self.sink.note(tile, numbers)
    }

    fn noted(&self, tile: TileRect) -> Option<Vec<f32>> {
        self.sink.noted(tile)
    }
}
