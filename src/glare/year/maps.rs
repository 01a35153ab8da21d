//! Maps of the unfiltered year: how much, how often and when each pixel is above a threshold.
//!
//! A series is stored by tile, so that the whole year of a tile's pixels is gone through at once and
//! each pixel needs a handful of counters. Two maps ask for the irradiance that is exceeded for half an
//! hour of a day and for 50 hours of the year: a pixel keeps its highest values, as few as last that
//! long together. Hours are summed as whole billionths, so that the order of a sum doesn't show.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::io;

use rayon::prelude::*;

use super::lengths::{Lengths, SLACK_H};
use crate::base::limits::TILE_EDGE;
use crate::base::{Progress, TileRect};
use crate::glare::error::{Error, ReadFailure};
use crate::glare::settings::comparable;
use crate::volume::{TimeAxis, Volume};

/// How long the irradiance is exceeded of which [`YearMap::ExceededInYear`] speaks, h.
pub(super) const YEAR_H: f64 = 50.0;
/// Hours are summed as whole billionths, so that their order doesn't matter.
pub(super) const BILLIONTHS: f64 = 1e9;
/// Pixels of a tile.
pub(in crate::glare) const TILE: usize = TILE_EDGE * TILE_EDGE;

/// What is known of each pixel over the year, from the volume as it is, without any filter: the
/// measure that rules judge. A timestep counts where its irradiance lies strictly above the
/// threshold; 0 stands wherever none does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YearMap {
    /// Hours of the year above the threshold: the sum of the weights, h.
    Above,
    /// Days of the timeline with glare, d.
    Days,
    /// The longest uninterrupted run inside a segment, h.
    LongestRun,
    /// The most glare of one day, h.
    LongestDay,
    /// The earliest clock time with glare on any day, h; local standard time unless the caller
    /// told another one.
    FirstHour,
    /// The latest clock time with glare on any day, h; as [`Self::FirstHour`].
    LastHour,
    /// The highest irradiance that is reached or exceeded for 30 minutes of some day, W/m2: a
    /// threshold below it is exceeded for at least so long on the worst day.
    ExceededOnWorstDay,
    /// The highest irradiance that is reached or exceeded for 50 hours of the year, W/m2.
    ExceededInYear,
    /// Hours above the threshold in a month, 1 to 12, h.
    Month(u8),
}

impl YearMap {
    /// The maps of a volume in the order in which [`year`] hands them on. Where half a year
    /// stands for the year the dates of the other half aren't known: there are no months.
    pub fn all(axis: &TimeAxis) -> Vec<Self> {
        let mut out = vec![
            Self::Above,
            Self::Days,
            Self::LongestRun,
            Self::LongestDay,
            Self::FirstHour,
            Self::LastHour,
            Self::ExceededOnWorstDay,
            Self::ExceededInYear,
        ];
        if !axis.half_year {
            out.extend((1..=12).map(Self::Month));
        }
        out
    }

    /// The name in files, its unit last.
    pub fn name(self) -> String {
        match self {
            Self::Above => "above_h".into(),
            Self::Days => "days".into(),
            Self::LongestRun => "longest_run_h".into(),
            Self::LongestDay => "longest_day_h".into(),
            Self::FirstHour => "first_hour".into(),
            Self::LastHour => "last_hour".into(),
            Self::ExceededOnWorstDay => "exceeded_30min_w_m2".into(),
            Self::ExceededInYear => "exceeded_50h_w_m2".into(),
            Self::Month(month) => format!("month_{month:02}_h"),
        }
    }
}

/// Takes the rows of a map from top to bottom, some at a time.
pub type YearRows<'a> = &'a mut dyn FnMut(YearMap, &[f32]) -> io::Result<()>;

/// Goes through a volume tile by tile and hands on the maps of [`YearMap::all`]. Memory doesn't
/// depend on the length of the year nor on the height of the picture: a row of tiles is in work at
/// a time. `clock_h` is what clocks show at each timestep, h; local standard time if left out. Where
/// timesteps differ in length they count as on the finest regular grid, see
/// [`Regular`](crate::glare::regular::Regular). Returns whether there are any maps: `.npy` files and imports know no
/// calendar.
///
/// # Errors
/// A threshold or a time step out of range, a volume that can't be read, what `rows` says, an
/// interruption.
pub fn year(
    volume: &Volume,
    threshold_w_m2: f64,
    clock_h: Option<&[f64]>,
    rows: YearRows<'_>,
    progress: &dyn Progress,
) -> Result<bool, Error> {
    let (Some(axis), Some(tiles)) = (volume.axis(), volume.tiles()) else { return Ok(false) };
    let threshold = comparable(threshold_w_m2)?;
    let clock = Clock::new(axis, clock_h)?;
    let maps = YearMap::all(axis);
    let columns = volume.shape()[2];
    let across = columns.div_ceil(TILE_EDGE);
    progress.begin("year of each pixel", tiles as u64, "tiles");
    for first in (0..tiles).step_by(across) {
        let found: Vec<TileMaps> = (first..first + across)
            .into_par_iter()
            .map(|number| {
                progress.check()?;
                let mut pixels = Pixels::new(threshold, &clock);
                let tile = volume
                    .read_tile(number, |timestep, numbers| pixels.add(timestep, numbers))
                    .map_err(ReadFailure::from)?;
                progress.advance(1);
                Ok(TileMaps { tile, values: pixels.finish(&maps) })
            })
            .collect::<Result<_, Error>>()?;
        hand_on(&maps, &found, columns, &mut *rows)?;
    }
    progress.finish();
    Ok(true)
}

/// The maps of a tile's pixels: [`TILE`] numbers for each map.
pub(in crate::glare) struct TileMaps {
    pub tile: TileRect,
    pub values: Vec<f32>,
}

/// Hands on the maps of a row of tiles, which cover `columns`.
pub(in crate::glare) fn hand_on(
    maps: &[YearMap],
    found: &[TileMaps],
    columns: usize,
    rows: YearRows<'_>,
) -> Result<(), Error> {
    let height = found.first().map_or(0, |found| found.tile.rows);
    let mut band = vec![0.0; height * columns];
    for (index, map) in maps.iter().enumerate() {
        for TileMaps { tile, values } in found {
            let values = values[index * TILE..][..TILE].chunks_exact(TILE_EDGE);
            for (line, from) in band.chunks_exact_mut(columns).zip(values) {
                line[tile.column..][..tile.columns].copy_from_slice(&from[..tile.columns]);
            }
        }
        rows(*map, &band).map_err(Error::Maps)?;
    }
    Ok(())
}

/// What a tile's pixels need to know of time.
pub(in crate::glare) struct Clock<'a> {
    axis: &'a TimeAxis,
    /// Weight of each timestep, billionths of an hour.
    weight: Vec<u64>,
    /// 0 to 11 for each timestep.
    month: Vec<u8>,
    /// What clocks show at each timestep, h.
    hour: Vec<f64>,
    lengths: Lengths,
    /// Instants of the regular grid that fill half an hour.
    half_hour: usize,
}

impl<'a> Clock<'a> {
    pub fn new(axis: &'a TimeAxis, clock_h: Option<&[f64]>) -> Result<Self, Error> {
        let lengths = Lengths::of(axis)?;
        let half_hour = lengths.half_hour()?;
        let (hour, timesteps) = (clock_h.unwrap_or(&axis.hour).to_vec(), axis.day.len());
        if hour.len() != timesteps {
            return Err(Error::Calendar { found: hour.len(), timesteps });
        }
        // A weight that isn't a number, or below 0, becomes 0.
        let weight = axis.weight_h.iter().map(|h| (h * BILLIONTHS).round() as u64).collect();
        let month = axis.day.iter().map(|day| month(axis.year, *day)).collect();
        Ok(Self { axis, weight, month, hour, lengths, half_hour })
    }

    pub fn timesteps(&self) -> usize {
        self.weight.len()
    }
}

/// The month, 0 to 11, of a day of the year, 0 is 1 January.
pub(in crate::glare) fn month(year: i32, day: u32) -> u8 {
    let leap = u32::from(year % 4 == 0 && (year % 100 != 0 || year % 400 == 0));
    let lengths = [31, 28 + leap, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut left = day;
    for (month, length) in (0..).zip(lengths) {
        if left < length {
            return month;
        }
        left -= length;
    }
    11
}

/// The pixels of one tile.
pub(in crate::glare) struct Pixels<'a> {
    threshold: f32,
    clock: &'a Clock<'a>,
    pixels: Vec<Pixel>,
}

#[derive(Clone, Debug, Default)]
struct Pixel {
    above: u64,
    months: [u64; 12],
    days: u32,
    /// The day after that of the last timestep above the threshold; 0 before any.
    day_after: u32,
    today: u32,
    longest_day: u32,
    /// One past the last timestep above the threshold.
    end: u32,
    run: u32,
    longest_run: u32,
    hours: Option<(f64, f64)>,
    /// The day after that of `highest`; 0 before any.
    highest_day_after: u32,
    /// The highest irradiances of a day, the highest first.
    highest: Vec<f32>,
    worst_day: f32,
    /// The highest irradiances of the year, as few as have [`YEAR_H`] together: bits and
    /// timestep, the lowest on top.
    year: BinaryHeap<Reverse<(u32, u32)>>,
    /// Weight of all that is in `year`.
    year_weight: u64,
}

impl<'a> Pixels<'a> {
    pub fn new(threshold: f32, clock: &'a Clock<'a>) -> Self {
        Self { threshold, clock, pixels: vec![Pixel::default(); TILE] }
    }

    /// Adds `[timestep, 32, 32]` numbers. Timesteps that are left out are dark.
    fn add(&mut self, first: usize, numbers: &[f32]) {
        for (timestep, slice) in (first..).zip(numbers.chunks_exact(TILE)) {
            for (place, &value) in slice.iter().enumerate() {
                self.one(place, timestep, value);
            }
        }
    }

    /// Adds a number; those of a pixel come in the order of time.
    #[inline]
    pub fn one(&mut self, place: usize, timestep: usize, value: f32) {
        if value > 0.0 {
            let pixel = &mut self.pixels[place];
            pixel.raise(timestep, value, self.clock);
            if value > self.threshold {
                pixel.dazzle(timestep, self.clock);
            }
        }
    }

    /// [`TILE`] numbers for each map.
    pub fn finish(mut self, maps: &[YearMap]) -> Vec<f32> {
        for pixel in &mut self.pixels {
            pixel.end_day(self.clock.half_hour);
        }
        let step_h = self.clock.lengths.step_h();
        let value = |map: &YearMap, pixel: &Pixel| pixel.value(*map, step_h);
        maps.iter().flat_map(|map| self.pixels.iter().map(move |p| value(map, p))).collect()
    }
}

impl Pixel {
    /// There is some irradiance.
    fn raise(&mut self, timestep: usize, value: f32, clock: &Clock<'_>) {
        let day_after = clock.axis.day[timestep].saturating_add(1);
        if self.highest_day_after != day_after {
            self.end_day(clock.half_hour);
            self.highest_day_after = day_after;
        }
        let at = self.highest.partition_point(|v| *v >= value);
        for _ in 0..(clock.lengths.instants(timestep) as usize).min(clock.half_hour - at) {
            self.highest.truncate(clock.half_hour - 1);
            self.highest.insert(at, value);
        }

        // Positive numbers are ordered as their bits are.
        let bits = value.to_bits();
        let full = self.year_weight >= year_weight();
        if full && self.year.peek().is_some_and(|Reverse((lowest, _))| bits <= *lowest) {
            return;
        }
        // Timesteps are bounded by MAX_TIMESTEPS.
        self.year.push(Reverse((bits, timestep as u32)));
        self.year_weight += clock.weight[timestep];
        while let Some(Reverse((_, lowest))) = self.year.peek() {
            let rest = self.year_weight - clock.weight[*lowest as usize];
            if rest < year_weight() {
                break;
            }
            self.year_weight = rest;
            self.year.pop();
        }
    }

    fn end_day(&mut self, half_hour: usize) {
        if let Some(lowest) = self.highest.get(half_hour - 1) {
            self.worst_day = self.worst_day.max(*lowest);
        }
        self.highest.clear();
    }

    /// The irradiance lies above the threshold.
    fn dazzle(&mut self, timestep: usize, clock: &Clock<'_>) {
        let axis = clock.axis;
        self.above += clock.weight[timestep];
        self.months[usize::from(clock.month[timestep])] += clock.weight[timestep];
        let day_after = axis.day[timestep].saturating_add(1);
        if self.day_after != day_after {
            self.day_after = day_after;
            self.today = 0;
            self.days += 1;
        }
        self.today += clock.lengths.instants(timestep);
        self.longest_day = self.longest_day.max(self.today);
        let goes_on = self.end as usize == timestep
            && timestep > 0
            && axis.segment[timestep] == axis.segment[timestep - 1];
        self.run = if goes_on { self.run } else { 0 } + clock.lengths.instants(timestep);
        self.end = timestep as u32 + 1;
        self.longest_run = self.longest_run.max(self.run);
        let hour = clock.hour[timestep];
        let (first, last) = self.hours.unwrap_or((hour, hour));
        self.hours = Some((first.min(hour), last.max(hour)));
    }

    fn value(&self, map: YearMap, step_h: f64) -> f32 {
        let hours = |billionths: u64| (billionths as f64 / BILLIONTHS) as f32;
        let steps = |count: u32| (f64::from(count) * step_h) as f32;
        match map {
            YearMap::Above => hours(self.above),
            YearMap::Days => self.days as f32,
            YearMap::LongestRun => steps(self.longest_run),
            YearMap::LongestDay => steps(self.longest_day),
            YearMap::FirstHour => self.hours.map_or(0.0, |(first, _)| first as f32),
            YearMap::LastHour => self.hours.map_or(0.0, |(_, last)| last as f32),
            YearMap::ExceededOnWorstDay => self.worst_day,
            YearMap::ExceededInYear => match self.year.peek() {
                Some(Reverse((bits, _))) if self.year_weight >= year_weight() => {
                    f32::from_bits(*bits)
                }
                _ => 0.0,
            },
            YearMap::Month(month) => {
                hours(self.months.get(usize::from(month) - 1).copied().unwrap_or(0))
            }
        }
    }
}

fn year_weight() -> u64 {
    ((YEAR_H - SLACK_H) * BILLIONTHS) as u64
}

#[cfg(test)]
mod tests {
    use super::month;

    #[test]
    fn days_lie_in_their_months() {
        assert_eq!((month(2025, 0), month(2025, 30), month(2025, 31)), (0, 0, 1));
        assert_eq!((month(2025, 58), month(2025, 59)), (1, 2));
        assert_eq!((month(2024, 59), month(2024, 60)), (1, 2));
        assert_eq!((month(2000, 59), month(1900, 59)), (1, 2));
        assert_eq!((month(2025, 364), month(2024, 365), month(2025, 9999)), (11, 11, 11));
    }
}
