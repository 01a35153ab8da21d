//! Dates and times as people read them.

use jiff::civil::Date;
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};

use crate::project::SiteTable;
use crate::volume::TimeAxis;

/// Turns (day of year, hour of local standard time) into dates and civil times.
#[derive(Clone, Debug)]
pub struct Clock {
    year: i32,
    meridian_deg: f64,
    zone: Option<TimeZone>,
}

impl Clock {
    /// The clock of a site in a year. Without a time zone it shows the meridian's standard time.
    pub fn new(site: &SiteTable, year: i32) -> Self {
        // The name was checked when the project was resolved.
        let zone = site.timezone.as_deref().and_then(|name| TimeZone::get(name).ok());
        Self { year, meridian_deg: site.meridian, zone }
    }

    /// `06-21 08:30 CEST`, or with standard time `06-21 07:30 UTC+1`.
    pub fn show(&self, day: u32, hour: f64) -> String {
        let Some(start) = self.start_of_year() else { return format!("day {day}, {hour:.2} h") };
        let seconds = f64::from(day) * 86_400.0 + hour * 3600.0;
        let local = start + SignedDuration::from_secs_f64(seconds.round());
        match &self.zone {
            Some(zone) => {
                let offset = SignedDuration::from_secs_f64((self.meridian_deg * 240.0).round());
                (local - offset).to_zoned(zone.clone()).strftime("%m-%d %H:%M %Z").to_string()
            }
            None => {
                let plain = local.to_zoned(TimeZone::UTC).strftime("%m-%d %H:%M").to_string();
                format!("{plain} UTC{:+}", self.meridian_deg / 15.0)
            }
        }
    }

    /// `21 June`: a day of the year, 0 is 1 January.
    pub fn date(&self, day: u32) -> String {
        let Some(start) = self.start_of_year() else { return format!("day {day}") };
        let date = start + SignedDuration::from_hours(24 * i64::from(day) + 12);
        date.to_zoned(TimeZone::UTC).strftime("%-d %B").to_string()
    }

    /// `08:30`: the civil time at an hour of local standard time of a day.
    pub fn time(&self, day: u32, hour: f64) -> String {
        let text = self.show(day, hour);
        text.split(' ').nth(1).unwrap_or(&text).to_owned()
    }

    /// The civil hour of day at an hour of local standard time of a day; beyond 0 to 24 where the
    /// civil day is another one.
    pub fn civil_hour(&self, day: u32, hour: f64) -> f64 {
        let (Some(start), Some(zone)) = (self.start_of_year(), &self.zone) else { return hour };
        let seconds = f64::from(day) * 86_400.0 + hour * 3600.0;
        let standard_s = (self.meridian_deg * 240.0).round();
        let utc = start + SignedDuration::from_secs_f64((seconds - standard_s).round());
        hour + (f64::from(zone.to_offset(utc).seconds()) - standard_s) / 3600.0
    }

    /// What clocks show at each timestep of an axis, h from midnight.
    pub fn hours(&self, axis: &TimeAxis) -> Vec<f64> {
        let at = |(day, hour): (&u32, &f64)| self.civil_hour(*day, *hour).rem_euclid(24.0);
        axis.day.iter().zip(&axis.hour).map(at).collect()
    }

    /// The zone's name as people know it.
    pub fn zone(&self) -> String {
        match self.zone.as_ref().and_then(TimeZone::iana_name) {
            Some(name) => name.to_owned(),
            None => format!("UTC{:+}", self.meridian_deg / 15.0),
        }
    }

    fn start_of_year(&self) -> Option<Timestamp> {
        let date = Date::new(i16::try_from(self.year).ok()?, 1, 1).ok()?;
        Some(date.to_zoned(TimeZone::UTC).ok()?.timestamp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summer_time_is_an_hour_ahead_of_standard_time() {
        let mut site = SiteTable {
            name: "here".into(),
            latitude: 47.0,
            longitude: 8.0,
            meridian: 15.0,
            timezone: Some("Europe/Zurich".into()),
            elevation_m: 0.0,
            horizon: None,
        };
        let clock = Clock::new(&site, 2025);
        assert_eq!(clock.show(171, 7.5), "06-21 08:30 CEST");
        assert_eq!(clock.show(0, 12.0), "01-01 12:00 CET");
        assert_eq!((clock.date(0).as_str(), clock.date(171).as_str()), ("1 January", "21 June"));
        assert_eq!(clock.time(171, 7.5), "08:30");
        assert_eq!((clock.civil_hour(171, 7.5), clock.civil_hour(0, 7.5)), (8.5, 7.5));
        // Summer time begins on 30 March at 2 o'clock and ends on 26 October at 3 (standard: 2).
        let axis = |days: &[(u32, f64)]| {
            let suns = vec![glam::DVec3::Z; days.len()];
            TimeAxis {
                day: days.iter().map(|d| d.0).collect(),
                hour: days.iter().map(|d| d.1).collect(),
                sun: suns,
                weight_h: vec![1.0; days.len()],
                segment: vec![0; days.len()],
                step_h: 1.0,
                half_year: false,
                year: 2025,
                sun_diameter_deg: 0.5,
                basis: crate::base::SpectralBasis::Broadband,
            }
        };
        let days = [
            (87, 7.0),
            (88, 1.0),
            (88, 2.0),
            (88, 7.0),
            (297, 7.0),
            (298, 1.0),
            (298, 2.0),
            (171, 23.5),
        ];
        assert_eq!(clock.hours(&axis(&days)), [7.0, 1.0, 3.0, 8.0, 8.0, 2.0, 2.0, 0.5]);
        site.timezone = None;
        assert_eq!(Clock::new(&site, 2025).show(171, 7.5), "06-21 07:30 UTC+1");
    }
}
