//! What arrives in free air: the photons that crossed each virtual sensor, counted.
//!
//! A virtual sensor is a disc of known area, so there is nothing to search: `E = sum(Phi) / A` over
//! all of its photons. Its standard error is that of a count, as on surfaces.

use std::ops::Range;

use super::annual::Annual;
use super::error::Error;
use super::flux::{Beam, Fluxes, square};
use super::series::{PixelSeries, Series, TileSeries};
use crate::base::{
    Irradiance, SensorSheet, SeriesEntry, SinkError, TileRect, TileSink, VirtualSensor,
};
use crate::pages::{ALWAYS, Store};

/// The virtual sensors of a set of points and what crossed them.
#[derive(Clone, Copy)]
pub struct VirtualSensors<'a> {
    /// The crossings.
    pub store: &'a Store,
    /// The discs.
    pub discs: &'a [VirtualSensor],
    /// Where their crossings lie in the store.
    pub sheet: SensorSheet,
    /// The number of the point that each disc belongs to: its column in the set's one row.
    pub columns: &'a [usize],
}

fn area_m2(disc: &VirtualSensor) -> f64 {
    std::f64::consts::PI * disc.radius_m * disc.radius_m
}

impl<'a> VirtualSensors<'a> {
    /// Calls `each` with the photons of a disc.
    fn photons(&self, number: usize, mut each: impl FnMut(Beam)) -> Result<(), Error> {
        self.store.lit_in_box(self.sheet.cell(number), &ALWAYS, |_, _, _, light| {
            each(Beam { flux_w: light.flux_w, cos: light.cos, timestep: light.timestep });
            true
        })?;
        Ok(())
    }

    /// Fills in the year of the points in free air. `weights_h` are the hours of the timesteps.
    ///
    /// # Errors
    /// [`Error::Pages`].
    pub fn add_year(&self, annual: &mut Annual, weights_h: &[f64]) -> Result<(), Error> {
        let fluxes = Fluxes::of(self.store, weights_h.iter().copied().fold(0.0, f64::max));
        for (number, (disc, &at)) in self.discs.iter().zip(self.columns).enumerate() {
            let (mut surface, mut facing, mut squares) = (0i64, 0i64, 0i64);
            self.photons(number, |beam| {
                let weight = weights_h.get(beam.timestep as usize).copied().unwrap_or(0.0);
                let [e, e_n] = fluxes.integers(beam, weight);
                surface = surface.wrapping_add(e);
                facing = facing.wrapping_add(e_n);
                squares = squares.wrapping_add(square(e));
            })?;
            let over_area = |sum: f64| (sum / area_m2(disc)) as f32;
            annual.surface.data_mut()[at] = over_area(fluxes.surface.value(surface));
            annual.facing_beam.data_mut()[at] = over_area(fluxes.facing.value(facing));
            annual.error.data_mut()[at] = over_area(fluxes.surface.square_value(squares).sqrt());
            annual.radius_m.data_mut()[at] = disc.radius_m as f32;
        }
        Ok(())
    }

    /// A sink that adds the points in free air to the tiles that come to it.
    pub fn series<'s>(&'s self, sink: &'s dyn TileSink, quantity: Irradiance) -> SensorSeries<'s> {
        SensorSeries { sensors: self, sink, quantity }
    }

    /// Fills in what one photon stands for at the points in free air, and counts their photons.
    ///
    /// # Errors
    /// [`Error::Pages`].
    pub fn add_noise(&self, series: &mut Series, quantity: Irradiance) -> Result<(), Error> {
        let fluxes = Fluxes::of(self.store, 1.0);
        let mut out = TileSeries::new(0..self.store.info().timesteps);
        for (number, (disc, &at)) in self.discs.iter().zip(self.columns).enumerate() {
            let made = self.one(number, 0, (&fluxes, quantity), &mut out)?;
            series.photon_w_m2.data_mut()[at] = made.photon_w_m2;
            series.radius_m.data_mut()[at] = disc.radius_m as f32;
            series.summary.count(&made, false);
            out.clear();
        }
        Ok(())
    }

    /// The series of a disc, as a pixel of a tile.
    fn one(
        &self,
        number: usize,
        pixel: u16,
        (fluxes, quantity): (&Fluxes, Irradiance),
        out: &mut TileSeries,
    ) -> Result<PixelSeries, Error> {
        out.anew();
        self.photons(number, |beam| out.add(beam.timestep, fluxes.integer(quantity, beam)))?;
        Ok(out.spread(pixel, fluxes.scale(quantity), area_m2(&self.discs[number])))
    }

    /// The discs of the points in some columns.
    fn between(&self, columns: Range<usize>) -> Range<usize> {
        let first = self.columns.partition_point(|&c| c < columns.start);
        first..self.columns.partition_point(|&c| c < columns.end)
    }
}

/// See [`VirtualSensors::series`].
pub struct SensorSeries<'a> {
    sensors: &'a VirtualSensors<'a>,
    sink: &'a dyn TileSink,
    quantity: Irradiance,
}

impl TileSink for SensorSeries<'_> {
    fn has(&self, tile: TileRect) -> bool {
        self.sink.has(tile)
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let sensors = self.sensors;
        let fluxes = Fluxes::of(sensors.store, 1.0);
        let mut made = TileSeries::new(0..sensors.store.info().timesteps);
        for number in sensors.between(tile.column..tile.column + tile.columns) {
            let pixel = (sensors.columns[number] - tile.column) as u16;
            sensors
                .one(number, pixel, (&fluxes, self.quantity), &mut made)
                .map_err(|e| SinkError::Io(std::io::Error::other(e)))?;
        }
        let mut all = [entries, made.sorted()].concat();
        // A pixel is a point in free air or stands on a surface: there are no doubles.
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
