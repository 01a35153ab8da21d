use std::ops::Range;
use std::sync::Mutex;

use rayon::prelude::*;

use super::estimate::{Disc, MIN_COS};
use super::order::Order;
use super::{Error, Gather, HitMap};
use crate::base::{Progress, SeriesEntry, TileRect, TileSink};
use crate::pages::{Neighbour, Neighbours, Query, Store};

/// Which irradiance a series holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Quantity {
    /// E, on the surface.
    #[default]
    Surface,
    /// E_n, on a plane that faces each photon's beam.
    Normal,
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

    fn add(&mut self, other: &Self) {
        self.tiles_rendered += other.tiles_rendered;
        self.tiles_present += other.tiles_present;
        self.pixels += other.pixels;
        self.lit_pixels += other.lit_pixels;
        self.lit_timesteps += other.lit_timesteps;
        self.photons += other.photons;
        self.floored += other.floored;
    }
}

/// Timesteps up to which a pixel's sums lie in a table with a place for each of them; above, the
/// table would cost more memory than the photons.
const TABLE_TIMESTEPS: usize = 1 << 20;
/// Entries of a tile up to which it is put in order through a copy; above, in place.
const COPY_ENTRIES: usize = 1 << 22;

/// Sums photons per timestep, pixel by pixel, and puts a tile's entries in the order that sinks
/// expect. Keeps its buffers from tile to tile.
pub(super) struct TileSeries {
    /// Sum per timestep of the pixel at work; all 0 between pixels. Empty where there are more
    /// than [`TABLE_TIMESTEPS`].
    table: Vec<f64>,
    touched: Vec<u32>,
    pairs: Vec<(u32, f64)>,
    entries: Vec<SeriesEntry>,
    pixels: Vec<(u16, Range<usize>)>,
    starts: Vec<u32>,
    sorted: Vec<SeriesEntry>,
}

impl TileSeries {
    pub(super) fn new(timesteps: usize) -> Self {
        let table = if timesteps <= TABLE_TIMESTEPS { timesteps } else { 0 };
        Self::with_table(table)
    }

    fn with_table(timesteps: usize) -> Self {
        Self {
            table: vec![0.0; timesteps],
            touched: Vec::new(),
            pairs: Vec::new(),
            entries: Vec::new(),
            pixels: Vec::new(),
            starts: Vec::new(),
            sorted: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.entries.clear();
        self.pixels.clear();
    }

    /// Adds a pixel's photons: one disc for all timesteps, its photons summed per timestep in f64
    /// in the order of `items`. Returns how many timesteps are lit.
    pub(super) fn add(
        &mut self,
        pixel: u16,
        items: &[Neighbour],
        disc: &Disc,
        quantity: Quantity,
    ) -> usize {
        let first = self.entries.len();
        let area_m2 = disc.area_m2();
        let flux = |p: &Neighbour| match quantity {
            Quantity::Surface => f64::from(p.flux_w),
            Quantity::Normal => f64::from(p.flux_w) / f64::from(p.cos.max(MIN_COS)),
        };
        let counted = items.iter().enumerate().filter(|&(i, _)| Some(i) != disc.skip);
        let entries = &mut self.entries;
        let mut emit = |timestep: u32, sum: f64| {
            let irradiance_w_m2 = (sum / area_m2) as f32;
            if irradiance_w_m2 != 0.0 {
                entries.push(SeriesEntry { timestep, pixel, irradiance_w_m2 });
            }
        };
        if self.table.is_empty() {
            self.pairs.clear();
            self.pairs.extend(counted.map(|(_, p)| (p.timestep, flux(p))));
            // Stable: the photons of a timestep stay in store order.
            self.pairs.sort_by_key(|&(timestep, _)| timestep);
            for same in self.pairs.chunk_by(|a, b| a.0 == b.0) {
                emit(same[0].0, same.iter().fold(0.0, |sum, &(_, flux)| sum + flux));
            }
        } else {
            self.touched.clear();
            for (_, p) in counted {
                // A timestep out of range is damage that verify finds; it must not panic here.
                let Some(sum) = self.table.get_mut(p.timestep as usize) else { continue };
                if *sum == 0.0 {
                    self.touched.push(p.timestep);
                }
                *sum += flux(p);
            }
            for &timestep in &self.touched {
                emit(timestep, std::mem::take(&mut self.table[timestep as usize]));
            }
        }
        let lit = self.entries.len() - first;
        self.pixels.push((pixel, first..self.entries.len()));
        lit
    }

    /// The tile's entries by timestep, then pixel.
    pub(super) fn sorted(&mut self) -> &[SeriesEntry] {
        if self.table.is_empty() || self.entries.len() > COPY_ENTRIES {
            self.entries.sort_unstable_by_key(|e| (e.timestep, e.pixel));
            return &self.entries;
        }
        // Counting sort by timestep, the pixels in their order.
        self.pixels.sort_unstable_by_key(|&(pixel, _)| pixel);
        self.starts.clear();
        self.starts.resize(self.table.len() + 1, 0);
        for e in &self.entries {
            self.starts[e.timestep as usize + 1] += 1;
        }
        for t in 1..self.starts.len() {
            self.starts[t] += self.starts[t - 1];
        }
        let nothing = SeriesEntry { timestep: 0, pixel: 0, irradiance_w_m2: 0.0 };
        self.sorted.clear();
        self.sorted.resize(self.entries.len(), nothing);
        for (_, range) in &self.pixels {
            for e in &self.entries[range.clone()] {
                let at = &mut self.starts[e.timestep as usize];
                self.sorted[*at as usize] = *e;
                *at += 1;
            }
        }
        &self.sorted
    }
}

/// The time series: at every pixel the k nearest photons of all suns give one radius, and are
/// summed per timestep. Goes into `sink` tile by tile; tiles that are there already are passed
/// over, so that an interrupted run goes on where it stopped. Memory holds the tiles at work.
///
/// # Errors
/// [`Error::Settings`], [`Error::Pages`], [`Error::Sink`], [`Error::Interrupted`].
pub fn series(
    store: &Store,
    hits: &HitMap,
    settings: &Gather,
    quantity: Quantity,
    sink: &dyn TileSink,
    progress: &dyn Progress,
) -> Result<SeriesSummary, Error> {
    let max_radius_m = settings.radius_m(store)?;
    let order = Order::of(hits);
    let all = order.tiles();
    let todo: Vec<TileRect> = all.iter().copied().filter(|&tile| !sink.has(tile)).collect();
    let present = (all.len() - todo.len()) as u64;
    let total = Mutex::new(SeriesSummary { tiles_present: present, ..Default::default() });
    let pixels: u64 = todo.iter().map(|tile| tile.pixels() as u64).sum();
    progress.begin("time series", pixels, "pixels");
    todo.par_iter().try_for_each_init(
        || (Neighbours::default(), TileSeries::new(store.info().timesteps as usize)),
        |(found, tile_series), &tile| {
            progress.check()?;
            let mut summary = SeriesSummary { tiles_rendered: 1, ..Default::default() };
            tile_series.clear();
            for pixel in order.pixels(tile) {
                let hit = &hits.hits[order.index(tile, pixel)];
                let query = Query {
                    point: hit.position,
                    normal: hit.normal,
                    count: settings.bandwidth,
                    max_radius_m,
                };
                store.nearest(&query, found)?;
                let items = found.items();
                let disc = Disc::of(
                    items,
                    found.farthest(),
                    found.full(),
                    max_radius_m,
                    settings.estimator,
                );
                let lit = tile_series.add(pixel, items, &disc, quantity);
                summary.pixels += 1;
                summary.lit_pixels += u64::from(lit > 0);
                summary.lit_timesteps += lit as u64;
                summary.photons += (items.len() - usize::from(disc.skip.is_some())) as u64;
                summary.floored += u64::from(disc.floored);
            }
            sink.put(tile, tile_series.sorted())?;
            total.lock().unwrap_or_else(std::sync::PoisonError::into_inner).add(&summary);
            progress.advance(tile.pixels() as u64);
            Ok::<(), Error>(())
        },
    )?;
    progress.finish();
    Ok(total.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photons(count: u64, timesteps: u32) -> Vec<Neighbour> {
        (0..count)
            .map(|i| Neighbour {
                index: i,
                distance2_m2: (i * 7919 % 1009) as f32 * 1e-3,
                flux_w: 1.0 + (i * 31 % 17) as f32 * 0.1,
                cos: (i * 13 % 101) as f32 * 0.01,
                timestep: (i * 104_729 % u64::from(timesteps)) as u32,
                surface: 0,
            })
            .collect()
    }

    /// The slow twin: a map from (timestep, pixel) to a sum.
    fn slow(pixels: &[(u16, Vec<Neighbour>)], skip: usize, area: f64) -> Vec<SeriesEntry> {
        let mut sums = std::collections::BTreeMap::new();
        for (pixel, items) in pixels {
            for (i, p) in items.iter().enumerate().filter(|&(i, _)| i != skip) {
                let _ = i;
                *sums.entry((p.timestep, *pixel)).or_insert(0.0) +=
                    f64::from(p.flux_w) / f64::from(p.cos.max(0.05));
            }
        }
        sums.into_iter()
            .map(|((timestep, pixel), sum)| SeriesEntry {
                timestep,
                pixel,
                irradiance_w_m2: (sum / area) as f32,
            })
            .collect()
    }

    #[test]
    fn table_and_pairs_give_what_a_map_gives() {
        let pixels: Vec<(u16, Vec<Neighbour>)> = [(900u16, 400), (3, 17), (4, 0), (1023, 1500)]
            .into_iter()
            .map(|(pixel, count)| (pixel, photons(count, 97)))
            .collect();
        let disc = Disc { skip: Some(5), radius_m: 0.7, floored: false };
        let expected = slow(&pixels, 5, disc.area_m2());
        for table in [97, 0] {
            let mut tile = TileSeries::with_table(table);
            for round in 0..2 {
                tile.clear();
                let mut lit = 0;
                for (pixel, items) in &pixels {
                    lit += tile.add(*pixel, items, &disc, Quantity::Normal);
                }
                assert_eq!(tile.sorted(), expected, "table {table}, round {round}");
                assert_eq!(lit, expected.len());
            }
        }
    }

    #[test]
    fn what_is_zero_is_left_out() {
        let mut dark = photons(3, 3);
        dark[0].flux_w = 0.0;
        let disc = Disc { skip: None, radius_m: 1.0, floored: false };
        let mut tile = TileSeries::with_table(3);
        assert_eq!(tile.add(0, &dark, &disc, Quantity::Surface), 2);
        assert!(tile.sorted().iter().all(|e| e.irradiance_w_m2 > 0.0));
    }
}
