//! The timesteps of a run: instants with a sun above the horizon, their weights and segments.

use super::spec::Instant;
use super::{Error, Place, SunStrength, TimeSpec, altitude_azimuth_deg, clear_sky, gensky};
use super::{Weather, date_of_day, days_in_year, sun_direction};
use crate::base::{SpectralBasis, Timeline, Timestep, limits};

/// The timesteps of a run: all instants of the ranges whose sun stands above the horizon
/// (geometric altitude of its centre above 0), in chronological order.
///
/// Weights: with `half_year` the paper's Equation (1), `2 step_h step_d`; otherwise
/// `step_h step_d`, a day's step clipped at the end of the year, so that a full year sums to 365
/// (366) days. Segments: maximal runs of timesteps, each `step_h` after the one before.
///
/// With stretches of finer steps each instant stands for the time to half the way to its
/// neighbours, nothing of the day is counted twice or left out, a segment is a run of instants that
/// follow each other, and the timeline's step is the shortest.
///
/// # Errors
/// See [`Error`]: a place, range, year or strength that can't be, too many instants, or none with
/// a sun.
pub fn timeline(place: &Place, spec: &TimeSpec) -> Result<Timeline, Error> {
    place.check()?;
    spec.check()?;
    let candidates = spec.candidates();
    let instants = spec.instants();
    let even_h = spec.hours.step;
    let gaps_h = instants.windows(2).map(|pair| pair[1].hour - pair[0].hour);
    let step_h = if spec.finer.is_empty() { even_h } else { gaps_h.fold(even_h, f64::min) };
    // The first instant of the next day follows the last of this one where a step lies between; a
    // finer step may.
    let (first, last) = (instants.first(), instants.last());
    let gap_h = first.zip(last).map_or(24.0, |(first, last)| 24.0 + first.hour - last.hour);
    let short = !spec.finer.is_empty() && gap_h <= even_h;
    let over_midnight = spec.days.step == 1 && (short || (gap_h - even_h).abs() <= 0.01 * even_h);

    let mut steps: Vec<Timestep> = Vec::new();
    let mut segment = 0_u32;
    let mut weather = match &spec.irradiance {
        SunStrength::Epw(weather) => {
            weather.check(place)?;
            Some(Strength { weather, place, spec, last: None })
        }
        _ => None,
    };
    for (nth, (day, stands_for)) in spec.days.days(spec.year).enumerate() {
        let turbidity = turbidity(spec, day);
        for (i, &Instant { hour, length_h }) in instants.iter().enumerate() {
            let weight_h = if spec.half_year {
                2.0 * length_h * f64::from(spec.days.step)
            } else {
                length_h * f64::from(stands_for)
            };
            let sun = sun_direction(place, spec.sun, spec.year, day, hour);
            // Whoever computes with NaN would silently lose the instant.
            if !sun.is_finite() {
                return Err(Error::Year(spec.year));
            }
            if sun.z <= 0.0 {
                // Night ends a segment; empty ones get no number.
                if steps.last().is_some_and(|last| last.segment == segment) {
                    segment += 1;
                }
                continue;
            }
            if i == 0
                && nth > 0
                && !over_midnight
                && steps.last().is_some_and(|last| last.segment == segment)
            {
                segment += 1;
            }
            if steps.len() == limits::MAX_TIMESTEPS {
                return Err(Error::TooMany { most: limits::MAX_TIMESTEPS, found: candidates });
            }
            let irradiance_w_m2 = match &spec.irradiance {
                SunStrength::Gensky => gensky::irradiance_w_m2(sun.z),
                SunStrength::Constant(w_m2) => *w_m2,
                SunStrength::Epw(_) => match &mut weather {
                    Some(strength) => strength.at(day, hour, sun)?,
                    None => 0.0,
                },
                SunStrength::ClearSky | SunStrength::Ineichen { .. } => {
                    let (altitude_deg, _) = altitude_azimuth_deg(sun);
                    clear_sky::direct_normal_w_m2(altitude_deg, place.elevation_m, turbidity, day)
                }
            };
            steps.push(Timestep { day, hour, sun, irradiance_w_m2, weight_h, segment });
        }
    }
    if steps.is_empty() {
        return Err(Error::Night { candidates });
    }
    let visible = spec.irradiance == SunStrength::Gensky;
    Ok(Timeline {
        steps,
        step_h,
        year: spec.year,
        half_year: spec.half_year,
        sun_diameter_deg: if visible { gensky::DIAMETER_DEG } else { clear_sky::DIAMETER_DEG },
        basis: if visible { SpectralBasis::Visible } else { SpectralBasis::Broadband },
    })
}

/// Weather at instants. A record holds a mean; within it the sun's strength follows the clear sky,
/// which knows how low the sun stands and when it rises.
struct Strength<'a> {
    weather: &'a Weather,
    place: &'a Place,
    spec: &'a TimeSpec,
    /// The last record asked for and the clear sky's mean over it.
    last: Option<(usize, f64)>,
}

/// Instants at which the clear sky's mean over a record is taken.
const INSTANTS: u32 = 12;
/// What no direct sun exceeds: a record that holds more than its minutes of sun allow isn't kept.
const STRONGEST_W_M2: f64 = 1400.0;

/// No air is clearer than this share of the clear sky's strength.
const MOST_CLEAR: f64 = 2.0;

/// A day some days later, the year's end joined to its beginning.
fn wrapped(year: i32, day: u32, later: i32) -> u32 {
    let length = days_in_year(year) as i32;
    (day as i32 + later).rem_euclid(length) as u32
}

impl Strength<'_> {
    fn clear_w_m2(&self, day: u32, sun: glam::DVec3) -> f64 {
        if sun.z <= 0.0 {
            return 0.0;
        }
        let (altitude_deg, _) = altitude_azimuth_deg(sun);
        clear_sky::direct_normal_w_m2(altitude_deg, self.place.elevation_m, clear_sky::LINKE, day)
    }

    /// Where records are instants: between two of them the clearness (the share of the clear sky's
    /// strength) is interpolated. An instant at night says nothing; the other one then counts.
    fn between(&self, day: u32, hour: f64, sun: glam::DVec3, offset_h: f64) -> Result<f64, Error> {
        let (model, year) = (self.spec.sun, self.spec.year);
        let ahead_h = self.place.meridian_deg / 15.0;
        // Records name hours from 1 to 24 of UTC's days.
        let at = hour - ahead_h - offset_h - 1.0;
        let before = at.floor();
        let clearness = |record: f64| {
            let local_h = record + 1.0 + offset_h + ahead_h;
            // The sun of the instant; a day's change at the year's end doesn't matter.
            let clear = self.clear_w_m2(day, sun_direction(self.place, model, year, day, local_h));
            let days = (record / 24.0).floor();
            let (month, of_month) = date_of_day(year, wrapped(year, day, days as i32));
            let hour = record - 24.0 * days;
            let slot = self.weather.slot(month, of_month, hour).ok_or_else(|| {
                let station = self.weather.station.clone();
                Error::WeatherGap { station, month, day: of_month, hour }
            })?;
            let least = 0.02 * STRONGEST_W_M2;
            Ok((clear > least).then(|| (self.weather.mean_w_m2(slot) / clear).min(MOST_CLEAR)))
        };
        let share = match (clearness(before)?, clearness(before + 1.0)?) {
            (Some(a), Some(b)) => a + (b - a) * (at - before),
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) => 0.0,
        };
        Ok((share * self.clear_w_m2(day, sun)).min(STRONGEST_W_M2))
    }

    fn at(&mut self, day: u32, hour: f64, sun: glam::DVec3) -> Result<f64, Error> {
        if let Some(offset_h) = self.weather.instant_offset_h {
            return self.between(day, hour, sun, offset_h);
        }
        let (month, of_month) = date_of_day(self.spec.year, day);
        let slot = self.weather.slot(month, of_month, hour).ok_or_else(|| Error::WeatherGap {
            station: self.weather.station.clone(),
            month,
            day: of_month,
            hour,
        })?;
        let mean_w_m2 = self.weather.mean_w_m2(slot);
        if mean_w_m2 <= 0.0 {
            return Ok(0.0);
        }
        let clear_mean = match self.last {
            Some((last, mean)) if last == slot => mean,
            _ => {
                let (from, length) = self.weather.span_h(slot);
                let sum: f64 = (0..INSTANTS)
                    .map(|i| {
                        let at = from + length * (f64::from(i) + 0.5) / f64::from(INSTANTS);
                        let (model, year) = (self.spec.sun, self.spec.year);
                        self.clear_w_m2(day, sun_direction(self.place, model, year, day, at))
                    })
                    .sum();
                let mean = sum / f64::from(INSTANTS);
                self.last = Some((slot, mean));
                mean
            }
        };
        if clear_mean <= 0.0 {
            return Ok(0.0);
        }
        Ok((mean_w_m2 * self.clear_w_m2(day, sun) / clear_mean).min(STRONGEST_W_M2))
    }
}

fn turbidity(spec: &TimeSpec, day: u32) -> f64 {
    match &spec.irradiance {
        SunStrength::Ineichen { linke } => clear_sky::linke_of_day(linke, spec.year, day),
        _ => clear_sky::LINKE,
    }
}
