//! The time series: of each pixel, the irradiance of every timestep.
//!
//! A disc of its own for each timestep would be ideal and costs a search per timestep; with k
//! photons of one sun in it, it would also be so large that shadows blur. As Radiance's `rcontrib`
//! does, all suns share one disc: the k nearest photons of the whole year give one radius, and are
//! summed by timestep. A pixel's sums are kept from its neighbour and changed by the photons that
//! came and went; [`TileSeries`] keeps them, and puts a tile's entries in the order that a
//! [`TileSink`] expects.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::candidates::Change;
use super::error::Error;
use super::flux::{Beam, Fluxes, Scale, square, weighed};
use super::photon_set::Light;
use super::settings::Gather;
use super::share::{Found, Scratch, Shared};
use super::surfaces::Surfaces;
use crate::base::{Grid, Irradiance, Progress, SeriesEntry, TileSink};
use crate::pages::Store;
use crate::render::view::hits::HitMap;
use crate::render::view::order::{Order, QueryPoint};

/// What is known of a time series beside its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What was met.
    pub summary: SeriesSummary,
    /// The irradiance that one photon stands for at each pixel, W/m2 (the mean over its photons,
    /// weighted by their flux). A value E of the series has the standard error
    /// `sqrt(E * photon_w_m2)`; see [`undecided`](super::confidence::undecided).
    pub photon_w_m2: Grid<f32>,
    /// Radius of the disc behind each pixel's series, m.
    pub radius_m: Grid<f32>,
}

impl Series {
    /// Nothing met yet.
    pub(in crate::render) fn empty(hits: &HitMap) -> Self {
        let grid = || Grid::filled(hits.columns, hits.rows, 0.0);
        Self { summary: SeriesSummary::default(), photon_w_m2: grid(), radius_m: grid() }
    }

    /// Adds what a tile gave.
    pub(in crate::render) fn keep(&mut self, summary: &SeriesSummary, noise: &[Noise]) {
        self.summary.add(summary);
        for pixel in noise {
            self.photon_w_m2.data_mut()[pixel.index] = pixel.photon_w_m2;
            self.radius_m.data_mut()[pixel.index] = pixel.radius_m;
        }
    }
}

/// What was met while rendering a time series; only of tiles that were rendered now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SeriesSummary {
    /// Tiles rendered now.
    pub tiles_rendered: u64,
    /// Tiles that were there already.
    pub tiles_present: u64,
    /// Pixels where photons may lie.
    pub pixels: u64,
    /// Pixels where photons were found.
    pub lit_pixels: u64,
    /// Lit timesteps, summed over the pixels.
    pub lit_timesteps: u64,
    /// Photons in the sums, summed over the pixels.
    pub photons: u64,
    /// Pixels whose disc was held at a millimetre.
    pub floored: u64,
}

impl SeriesSummary {
    /// Photons per lit timestep of a pixel, on average: below 10, noise decides over durations.
    /// `None` where nothing was lit.
    pub fn photons_per_lit_timestep(&self) -> Option<f64> {
        (self.lit_timesteps > 0).then(|| self.photons as f64 / self.lit_timesteps as f64)
    }

    /// Counts a pixel.
    pub(in crate::render) fn count(&mut self, made: &PixelSeries, floored: bool) {
        self.pixels += 1;
        self.lit_pixels += u64::from(made.lit > 0);
        self.lit_timesteps += made.lit as u64;
        self.photons += made.photons;
        self.floored += u64::from(floored);
    }

    pub(in crate::render) fn add(&mut self, other: &Self) {
        self.tiles_rendered += other.tiles_rendered;
        self.tiles_present += other.tiles_present;
        self.pixels += other.pixels;
        self.lit_pixels += other.lit_pixels;
        self.lit_timesteps += other.lit_timesteps;
        self.photons += other.photons;
        self.floored += other.floored;
    }
}

/// What is known of a pixel's noise.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Noise {
    /// Index of the pixel in the view.
    pub index: usize,
    pub photon_w_m2: f32,
    pub radius_m: f32,
}

/// What a pixel's series was made of.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct PixelSeries {
    pub photons: u64,
    /// Lit timesteps.
    pub lit: usize,
    pub photon_w_m2: f32,
}

/// Entries of a tile up to which it is put in order through a copy; above, in place.
const COPY_ENTRIES: usize = 1 << 22;

/// Sums photons per timestep, pixel by pixel, and puts a tile's entries in the order that sinks
/// expect. Keeps its buffers from tile to tile.
pub(in crate::render) struct TileSeries {
    /// The first timestep that is kept; sums and bits count from it.
    first: u32,
    /// Photons of the pixel at work, the sum of all, and of their squares.
    photons: u64,
    sum: i64,
    squares: i64,
    /// The sum per timestep.
    sums: Vec<i64>,
    /// One bit for each timestep whose sum may not be 0.
    lit: Vec<u64>,
    entries: Vec<SeriesEntry>,
    pixels: Vec<(u16, Range<usize>)>,
    starts: Vec<u32>,
    sorted: Vec<SeriesEntry>,
}

impl TileSeries {
    pub(in crate::render) fn new(timesteps: Range<u32>) -> Self {
        let count = timesteps.len();
        Self {
            first: timesteps.start,
            photons: 0,
            sum: 0,
            squares: 0,
            sums: vec![0; count],
            lit: vec![0; count.div_ceil(64)],
            entries: Vec::new(),
            pixels: Vec::new(),
            starts: Vec::new(),
            sorted: Vec::new(),
        }
    }

    pub(in crate::render) fn clear(&mut self) {
        self.entries.clear();
        self.pixels.clear();
    }

    /// Begins anew: nothing is left of the pixel before.
    pub(in crate::render) fn anew(&mut self) {
        (self.photons, self.sum, self.squares) = (0, 0, 0);
        for (word, bits) in self.lit.iter_mut().enumerate() {
            let mut left = std::mem::take(bits);
            while left != 0 {
                self.sums[word * 64 + left.trailing_zeros() as usize] = 0;
                left &= left - 1;
            }
        }
    }

    /// Adds a photon to the pixel at work.
    #[inline]
    pub(in crate::render) fn add(&mut self, timestep: u32, integer: i64) {
        self.photons += 1;
        self.sum = self.sum.wrapping_add(integer);
        self.squares = self.squares.wrapping_add(square(integer));
        let at = timestep.wrapping_sub(self.first) as usize;
        // A timestep out of range is damage that verify finds; it must not panic here.
        if let Some(sum) = self.sums.get_mut(at) {
            *sum = sum.wrapping_add(integer);
            self.lit[at / 64] |= 1 << (at % 64);
        }
    }

    /// Takes a photon of the pixel before away.
    #[inline]
    pub(in crate::render) fn remove(&mut self, timestep: u32, integer: i64) {
        self.photons = self.photons.wrapping_sub(1);
        self.sum = self.sum.wrapping_sub(integer);
        self.squares = self.squares.wrapping_sub(square(integer));
        let at = timestep.wrapping_sub(self.first) as usize;
        if let Some(sum) = self.sums.get_mut(at) {
            *sum = sum.wrapping_sub(integer);
        }
    }

    /// Goes from the photons of the pixel before to those of a pixel's disc and ends it.
    pub(in crate::render) fn pixel(
        &mut self,
        pixel: u16,
        found: &mut Found<'_>,
        fluxes: &Fluxes,
        quantity: Irradiance,
    ) -> PixelSeries {
        let scale = fluxes.scale(quantity);
        let of = |light: &Light| match quantity {
            Irradiance::Surface => light.surface,
            Irradiance::FacingBeam => light.facing,
        };
        found.changes(|change| match change {
            Change::Anew => self.anew(),
            Change::In(light, kernel) => self.add(light.timestep, weighed(of(light), kernel)),
            Change::Out(light) => self.remove(light.timestep, of(light)),
        });
        self.spread(pixel, scale, found.disc.area_m2)
    }

    /// Ends a pixel whose photons are spread over an area.
    pub(in crate::render) fn spread(
        &mut self,
        pixel: u16,
        scale: Scale,
        area_m2: f64,
    ) -> PixelSeries {
        let lit = self.end(pixel, |sum| (scale.value(sum) / area_m2) as f32);
        let mean = scale.square_value(self.squares) / scale.value(self.sum).max(f64::MIN_POSITIVE);
        PixelSeries { photons: self.photons, lit, photon_w_m2: (mean / area_m2) as f32 }
    }

    /// Ends a pixel: `value` turns sums into W/m2. Returns how many timesteps are lit.
    pub(in crate::render) fn end(&mut self, pixel: u16, value: impl Fn(i64) -> f32) -> usize {
        let from = self.entries.len();
        for (word, &bits) in self.lit.iter().enumerate() {
            let mut left = bits;
            while left != 0 {
                let at = word * 64 + left.trailing_zeros() as usize;
                left &= left - 1;
                let sum = self.sums[at];
                let irradiance_w_m2 = if sum == 0 { 0.0 } else { value(sum) };
                if irradiance_w_m2 != 0.0 {
                    let timestep = self.first + at as u32;
                    self.entries.push(SeriesEntry { timestep, pixel, irradiance_w_m2 });
                }
            }
        }
        self.pixels.push((pixel, from..self.entries.len()));
        self.entries.len() - from
    }

    /// How many entries each timestep has.
    pub(in crate::render) fn count(&self, entries: &mut [u64]) {
        for entry in &self.entries {
            entries[entry.timestep as usize] += 1;
        }
    }

    /// The tile's entries by timestep, then pixel.
    pub(in crate::render) fn sorted(&mut self) -> &[SeriesEntry] {
        if self.entries.len() > COPY_ENTRIES {
            self.entries.sort_unstable_by_key(|e| (e.timestep, e.pixel));
            return &self.entries;
        }
        // Counting sort by timestep, the pixels in their order.
        self.pixels.sort_unstable_by_key(|&(pixel, _)| pixel);
        self.starts.clear();
        self.starts.resize(self.sums.len() + 1, 0);
        let first = self.first;
        for e in &self.entries {
            self.starts[(e.timestep - first) as usize + 1] += 1;
        }
        for t in 1..self.starts.len() {
            self.starts[t] += self.starts[t - 1];
        }
        let nothing = SeriesEntry { timestep: 0, pixel: 0, irradiance_w_m2: 0.0 };
        self.sorted.clear();
        self.sorted.resize(self.entries.len(), nothing);
        for (_, range) in &self.pixels {
            for e in &self.entries[range.clone()] {
                let at = &mut self.starts[(e.timestep - first) as usize];
                self.sorted[*at as usize] = *e;
                *at += 1;
            }
        }
        &self.sorted
    }
}

/// The time series: at every pixel the k nearest photons of all suns give one radius, and are
/// summed per timestep. Goes into `sink` tile by tile; of tiles that are there already only the
/// noise is computed again, and that only where the sink didn't keep it. Memory holds the
/// tiles at work. Without `surfaces` a disc is a disc wherever it lies.
///
/// # Errors
/// [`Error::View`]: settings, a sink that fails, interruption; [`Error::Pages`].
pub fn series(
    store: &Store,
    surfaces: Option<&Surfaces<'_>>,
    hits: &HitMap,
    settings: &Gather,
    quantity: Irradiance,
    sink: &dyn TileSink,
    progress: &dyn Progress,
) -> Result<Series, Error> {
    let shared = Shared::new(store, surfaces, settings)?;
    let fluxes = Fluxes::of(store, 1.0);
    let order = Order::of(hits);
    let total = Mutex::new(Series::empty(hits));
    // Tiles don't overlap: the lock decides who writes first, not what is written.
    let keep = |summary: &SeriesSummary, noise: &[Noise]| {
        total.lock().unwrap_or_else(PoisonError::into_inner).keep(summary, noise);
    };
    progress.begin("time series", (hits.columns * hits.rows) as u64, "pixels");
    let integers = |beam: Beam| fluxes.integers_of(quantity, beam);
    order.tiles().par_iter().try_for_each_init(
        || (Scratch::default(), TileSeries::new(0..store.info().timesteps), Vec::new()),
        |(scratch, tile_series, noise), &tile| {
            progress.check()?;
            let mut summary = SeriesSummary::default();
            tile_series.clear();
            noise.clear();
            let points = order.query_points(tile);
            let there = sink.has(tile);
            let noted = if there { sink.noted(tile) } else { None };
            if let Some(noted) = noted.filter(|n| n.len() >= 2 * tile.pixels()) {
                let (photon, radius) = noted.split_at(tile.pixels());
                let of = |point: &QueryPoint| {
                    let pixel = usize::from(point.pixel);
                    let index = order.index(tile, point.pixel);
                    Noise { index, photon_w_m2: photon[pixel], radius_m: radius[pixel] }
                };
                noise.extend(points.iter().map(of));
                keep(&SeriesSummary { tiles_present: 1, ..summary }, noise);
                progress.advance(tile.pixels() as u64);
                return Ok(());
            }
            let mut notes = vec![0.0; 2 * tile.pixels()];
            shared.tile(&points, scratch, &integers, None, |point, mut found| {
                let made = tile_series.pixel(point.pixel, &mut found, &fluxes, quantity);
                let disc = &found.disc;
                let radius_m = disc.radius_m as f32;
                let (index, photon_w_m2) = (order.index(tile, point.pixel), made.photon_w_m2);
                noise.push(Noise { index, photon_w_m2, radius_m });
                notes[usize::from(point.pixel)] = made.photon_w_m2;
                notes[tile.pixels() + usize::from(point.pixel)] = radius_m;
                summary.count(&made, disc.floored);
            })?;
            sink.note(tile, &notes)?;
            if there {
                summary = SeriesSummary { tiles_present: 1, ..Default::default() };
            } else {
                sink.put(tile, tile_series.sorted())?;
                summary.tiles_rendered = 1;
            }
            keep(&summary, noise);
            progress.advance(tile.pixels() as u64);
            Ok::<(), Error>(())
        },
    )?;
    progress.finish();
    Ok(total.into_inner().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// The slow twin: a map from (timestep, pixel) to a sum.
    #[test]
    fn entries_are_those_of_a_map() {
        let photons =
            |count: u64| (0..count).map(|i| ((i * 104_729 % 90) as u32 + 5, (i * 31 % 17) as i64));
        let pixels = [(900u16, 400), (3, 17), (4, 0), (1023, 1500)];
        let mut expected = BTreeMap::new();
        for &(pixel, count) in &pixels {
            for (timestep, integer) in photons(count) {
                *expected.entry((timestep, pixel)).or_insert(0) += integer;
            }
        }
        let expected: Vec<SeriesEntry> = expected
            .into_iter()
            .filter(|&(_, sum)| sum != 0)
            .map(|((timestep, pixel), sum)| SeriesEntry {
                timestep,
                pixel,
                irradiance_w_m2: sum as f32 / 8.0,
            })
            .collect();
        let mut tile = TileSeries::new(5..95);
        for round in 0..2 {
            tile.clear();
            let mut lit = 0;
            for &(pixel, count) in &pixels {
                for (timestep, integer) in photons(count) {
                    tile.add(timestep, integer);
                }
                // Neither before nor behind what is kept.
                tile.add(4, 1);
                tile.add(95, 1);
                lit += tile.end(pixel, |sum| sum as f32 / 8.0);
                if pixel % 2 == 1 {
                    tile.anew();
                } else {
                    photons(count).for_each(|(timestep, integer)| tile.remove(timestep, integer));
                }
            }
            assert_eq!(tile.sorted(), expected, "round {round}");
            assert_eq!(lit, expected.len());
        }
    }
}
