//! Why times, places or suns can't be used: one variant for each mistake.

use std::path::PathBuf;

use crate::base::FaultKind;

/// Why times, places or suns can't be used. All of them are mistakes of an input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A number of the site lies outside its range.
    #[error(
        "{field}: expected {expected}, found {found}; longitude and meridian are positive EAST"
    )]
    Place {
        /// The setting.
        field: &'static str,
        /// Its range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The year can't be computed.
    #[error("year: expected 1583 to 5999 (the Gregorian calendar), found {0}")]
    Year(i32),
    /// A word that should be a day.
    #[error("day: expected a day of the year (0 is 1 January) or a date \"MM-DD\", found `{0}`")]
    Day(String),
    /// A date that the year doesn't have.
    #[error("day: expected a date of {year}, found `{found}`, which that year doesn't have")]
    Date {
        /// The year.
        year: i32,
        /// What was given.
        found: String,
    },
    /// A range that isn't one.
    #[error("{what}: expected {expected}, found `{found}`")]
    Range {
        /// `days` or `hours`.
        what: &'static str,
        /// How it should look.
        expected: &'static str,
        /// What was given.
        found: String,
    },
    /// Days outside the year.
    #[error("days: expected days 0 to {last} of {year}, from <= to, found {from} to {to}")]
    DaysOutside {
        /// The year.
        year: i32,
        /// Its last day.
        last: u32,
        /// First day given.
        from: u32,
        /// Last day given.
        to: u32,
    },
    /// A step of zero days.
    #[error("days: expected a step of 1 day or more, found 0")]
    DayStep,
    /// Hours outside the day.
    #[error(
        "hours: expected 0 <= from <= to < 24, found {from} to {to}; a whole day at a step of S hours ends at 24 - S (0:23.75:0.25)"
    )]
    HoursOutside {
        /// First hour given.
        from: f64,
        /// Last hour given.
        to: f64,
    },
    /// A step that can't be used.
    #[error("hours: expected a step of 1 second (0.000277) to 24 hours, found {0}")]
    HourStep(f64),
    /// A stretch of finer steps that can't be.
    #[error(
        "finer: expected stretches of `hours` ({hours}) with smaller steps, in order and apart, the next one from {least} on; found {from} to {to}, step {step}"
    )]
    Finer {
        /// First hour given.
        from: f64,
        /// Last hour given.
        to: f64,
        /// Step given, h.
        step: f64,
        /// Where the stretch before ends.
        least: f64,
        /// What it should be a stretch of.
        hours: String,
    },
    /// Equation (1) beyond half a year.
    #[error(
        "half_year: Equation (1) doubles half a year, so it takes days 0 to 182 only, found {from} to {to}; leave half_year out to compute the days as they are"
    )]
    HalfYear {
        /// First day given.
        from: u32,
        /// Last day given.
        to: u32,
    },
    /// Equation (1) with measured weather.
    #[error(
        "half_year: Equation (1) lets spring stand for autumn, whose weather is another; leave half_year out, and compute the whole year"
    )]
    HalfYearOfWeather,
    /// More instants than the program computes.
    #[error("days and hours: expected at most {most} instants, found {found}; take larger steps")]
    TooMany {
        /// The limit.
        most: usize,
        /// What the ranges ask for.
        found: u64,
    },
    /// It is night all the time.
    #[error(
        "the sun is below the horizon at each of the {candidates} instants; check latitude, longitude and meridian (positive EAST), days and hours (standard time)"
    )]
    Night {
        /// Instants looked at.
        candidates: u64,
    },
    /// A name that no algorithm has.
    #[error("sun: expected gensky-2018, gensky or spa, found `{0}`")]
    SunModel(String),
    /// A weather file that can't be used.
    #[error("{path}:{line}: {field}: expected {expected}, found `{found}`")]
    Weather {
        /// The file.
        path: String,
        /// Line, from 1; 0 for the file as a whole.
        line: usize,
        /// What it is about.
        field: String,
        /// What would do.
        expected: String,
        /// What is there.
        found: String,
    },
    /// A weather file of another place.
    #[error(
        "weather of {station}: its {what} is {file} degrees, the site's {site}; a station within 2 degrees and in the same standard time is needed (east is positive)"
    )]
    WeatherPlace {
        /// What differs.
        what: &'static str,
        /// The site's, degrees.
        site: f64,
        /// The file's, degrees.
        file: f64,
        /// The station's name.
        station: String,
    },
    /// A weather file that doesn't cover the run.
    #[error(
        "weather of {station}: holds nothing for {month:02}-{day:02} at {hour:.2} h; choose days that it covers"
    )]
    WeatherGap {
        /// The station's name.
        station: String,
        /// Month, from 1.
        month: u32,
        /// Day of the month, from 1.
        day: u32,
        /// Local standard time.
        hour: f64,
    },
    /// A strength that no sun has.
    #[error("irradiance: expected {expected}, found {found}")]
    Irradiance {
        /// What would do.
        expected: &'static str,
        /// What was given.
        found: String,
    },
    /// A far horizon that can't be.
    #[error(
        "far horizon: expected 1 to 36,000 pairs of azimuth (-360 to 360, clockwise from north) and altitude (-90 to 90) in degrees, each azimuth once, found {found}"
    )]
    Horizon {
        /// What was given.
        found: String,
    },
    /// A file of a far horizon that can't be read.
    #[error("{}{}: expected a text with an azimuth and an altitude in degrees on each line, found {found}", path.display(), at(*line))]
    HorizonFile {
        /// The file.
        path: PathBuf,
        /// From 1; 0 where it is about no single line.
        line: usize,
        /// What is there.
        found: String,
    },
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        FaultKind::Input
    }
}

fn at(line: usize) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}
