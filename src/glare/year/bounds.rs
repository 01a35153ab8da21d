//! Hours above a threshold with what noise leaves open: at least, as measured, at most.

use std::ops::Range;

use rayon::prelude::*;

use crate::base::{Grid, Progress, TileRect, limits, tiles};
use crate::glare::Slices;
use crate::glare::error::Error;

/// Slices that are read together.
const TOGETHER_BYTES: usize = 32 << 20;

/// Unfiltered hours of the year above a threshold, for each pixel: with two standard errors taken
/// off every value, as they are, and with two added. A limit between the first and the last is
/// undecided.
#[derive(Clone, Debug)]
pub struct HourBounds {
    /// At least, h.
    pub low_h: Grid<f32>,
    /// As the photons say, h.
    pub hours_h: Grid<f32>,
    /// At most, h.
    pub high_h: Grid<f32>,
}

impl HourBounds {
    /// Whether noise decides if `limit_h` is exceeded at a pixel; `None` where it does.
    pub fn exceeds(&self, pixel: (usize, usize), limit_h: f32) -> Option<bool> {
        match (self.low_h[pixel] > limit_h, self.high_h[pixel] > limit_h) {
            (true, _) => Some(true),
            (_, false) => Some(false),
            _ => None,
        }
    }
}

/// Counts the hours slice by slice.
pub struct HourCounter {
    /// For each pixel the three irradiances that are exceeded or not.
    limits: Vec<[f32; 3]>,
    hours: Vec<[f64; 3]>,
    size: (usize, usize),
}

impl HourCounter {
    /// For a threshold. `open_w_m2`: between which irradiances noise decides at a pixel whether
    /// it is exceeded.
    pub fn new(threshold_w_m2: f64, open_w_m2: &Grid<(f32, f32)>) -> Self {
        let limits = open_w_m2.data().iter().map(|&(low, high)| [high, threshold_w_m2 as f32, low]);
        Self {
            limits: limits.collect(),
            hours: vec![[0.0; 3]; open_w_m2.data().len()],
            size: (open_w_m2.columns(), open_w_m2.rows()),
        }
    }

    /// Adds a timestep that stands for `weight_h`.
    pub fn push(&mut self, slice: &[f32], weight_h: f64) {
        let pixels = self.hours.par_iter_mut().zip(&self.limits).zip(slice);
        pixels.with_min_len(1 << 15).for_each(|((hours, limits), &value)| {
            if value > limits[2] {
                for (hours, limit) in hours.iter_mut().zip(limits) {
                    *hours += if value > *limit { weight_h } else { 0.0 };
                }
            }
        });
    }

    /// All hours.
    pub fn finish(self) -> HourBounds {
        let (columns, rows) = self.size;
        let grid = |i: usize| {
            let hours = self.hours.iter().map(|h| h[i] as f32).collect();
            Grid::from_vec(columns, rows, hours)
        };
        HourBounds { low_h: grid(0), hours_h: grid(1), high_h: grid(2) }
    }
}

/// Hands the slices of a source on, one by one.
///
/// # Errors
/// A source that can't be read, an interruption.
pub fn each_slice(
    source: &dyn Slices,
    range: Range<usize>,
    progress: &dyn Progress,
    mut each: impl FnMut(usize, &[f32]),
) -> Result<(), Error> {
    let [_, rows, columns] = source.shape();
    let pixels = rows * columns;
    let blocks: Vec<TileRect> = tiles(columns, rows, limits::TILE_EDGE);
    let unit = source.chunk_timesteps().max(1);
    let step = (TOGETHER_BYTES / 4 / pixels / unit).max(1) * unit;
    let mut numbers = vec![0.0f32; step.min(range.len()) * pixels];
    let mut lit = vec![false; step.min(range.len()) * blocks.len()];
    let mut first = range.start;
    while first < range.end {
        progress.check()?;
        let last = (first / unit * unit + step).min(range.end);
        let (count, part) = (last - first, &mut numbers[..(last - first) * pixels]);
        source.read_lit(first..last, 0..rows, part, &mut lit[..count * blocks.len()])?;
        for (i, slice) in part.chunks_exact(pixels).enumerate() {
            each(first + i, slice);
        }
        first = last;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_near_the_threshold_is_left_open() {
        // One photon is 0.4 W/m2: at 10 W/m2 the band reaches from 6.721 to 14.879.
        let open = Grid::filled(3, 1, (6.721f32, 14.879));
        let mut counter = HourCounter::new(10.0, &open);
        counter.push(&[5.0, 9.0, 30.0], 0.5);
        counter.push(&[6.7, 11.0, 14.9], 0.25);
        counter.push(&[0.0, 6.8, 14.8], 0.125);
        let band = counter.finish();
        assert_eq!(band.low_h.data(), [0.0, 0.0, 0.75]);
        assert_eq!(band.hours_h.data(), [0.0, 0.25, 0.875]);
        assert_eq!(band.high_h.data(), [0.0, 0.875, 0.875]);
        let say = |x: usize| band.exceeds((x, 0), 0.5);
        assert_eq!([say(0), say(1), say(2)], [Some(false), None, Some(true)]);
    }
}
