//! Weather files: direct normal irradiance by hour, and what a record's time means.

use std::path::Path;
use std::sync::Arc;

use super::calendar::parse_day;
use super::{Error, Place, date_of_day};

/// Bytes of a weather file: a leap year of minutes has some 200 MB.
const MOST_BYTES: u64 = 512 << 20;
/// No sun on Earth is stronger, W/m2.
const MOST_W_M2: f64 = 1500.0;
/// A station farther away than this isn't the site's, degrees.
const FARTHEST_DEG: f64 = 2.0;

/// Direct normal irradiance of a year from an EnergyPlus weather file (EPW; Auxiliary Programs,
/// "EnergyPlus Weather File Data Dictionary"). A record of hour H holds the mean over the hour
/// that *ends* at H o'clock of local standard time.
///
/// PVGIS writes instants instead and says so in a comment, `Irradiance Time Offset (h):-0.8239`:
/// record H holds the instant H - 0.8239 of **UTC**, whatever the time zone in the header (its
/// files are dark at night under no other reading: a test holds that).
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Weather {
    /// The station, as the file calls it.
    pub station: String,
    /// Degrees north.
    pub latitude_deg: f64,
    /// Degrees east.
    pub longitude_deg: f64,
    /// Hours ahead of UTC.
    pub zone_h: f64,
    /// Above the sea, m.
    pub elevation_m: f64,
    /// Records an hour.
    pub per_hour: usize,
    /// Where records are instants: their time, in hours of UTC after the hour they name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instant_offset_h: Option<f64>,
    /// W/m2 by day of a leap year, hour and record; NaN where the file has none.
    #[serde(skip)]
    direct_w_m2: Arc<Vec<f32>>,
}

fn wrong(path: &str, line: usize, field: &str, expected: &str, found: &str) -> Error {
    Error::Weather {
        path: path.to_owned(),
        line,
        field: field.to_owned(),
        expected: expected.to_owned(),
        found: found.chars().take(40).collect(),
    }
}

impl Weather {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Weather`] with the line: no EPW, numbers that can't be, missing values (9999).
    pub fn read(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let failed = |found: &str| wrong(&name, 0, "file", "a readable file", found);
        let length = std::fs::metadata(path).map_err(|e| failed(&e.to_string()))?.len();
        if length > MOST_BYTES {
            return Err(failed("more than 512 MiB"));
        }
        let bytes = std::fs::read(path).map_err(|e| failed(&e.to_string()))?;
        Self::parse(&String::from_utf8_lossy(&bytes), &name)
    }

    /// Reads a file's text; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, path: &str) -> Result<Self, Error> {
        let mut lines = text.lines().enumerate().map(|(i, l)| (i + 1, l));
        let (_, first) = lines.next().unwrap_or((1, ""));
        let header: Vec<&str> = first.split(',').map(str::trim).collect();
        if header[0].trim_start_matches('\u{feff}') != "LOCATION" || header.len() < 10 {
            return Err(wrong(path, 1, "header", "LOCATION and nine fields", first));
        }
        let number = |index: usize, field: &str, most: f64| {
            header[index].parse::<f64>().ok().filter(|v| v.abs() <= most).ok_or_else(|| {
                wrong(path, 1, field, &format!("a number up to {most}"), header[index])
            })
        };
        let mut weather = Self {
            station: header[1].to_owned(),
            latitude_deg: number(6, "latitude", 90.0)?,
            longitude_deg: number(7, "longitude", 180.0)?,
            zone_h: number(8, "time zone", 14.0)?,
            elevation_m: number(9, "elevation", 9000.0)?,
            per_hour: 1,
            instant_offset_h: None,
            direct_w_m2: Arc::default(),
        };
        let mut begun = false;
        for (line, row) in lines.by_ref() {
            if let Some((_, offset)) = row.split_once("Irradiance Time Offset (h):")
                && row.starts_with("COMMENTS")
            {
                let offset = offset.trim().trim_matches('"');
                weather.instant_offset_h =
                    Some(offset.parse().ok().filter(|h: &f64| h.abs() <= 2.0).ok_or_else(
                        || wrong(path, line, "Irradiance Time Offset", "-2 to 2 hours", offset),
                    )?);
            }
            if !row.starts_with("DATA PERIODS") {
                if line > 60 {
                    break;
                }
                continue;
            }
            let per_hour = row.split(',').nth(2).unwrap_or("").trim();
            weather.per_hour =
                per_hour.parse().ok().filter(|n| (1..=60).contains(n) && 60 % n == 0).ok_or_else(
                    || wrong(path, line, "records an hour", "a divisor of 60", per_hour),
                )?;
            begun = true;
            break;
        }
        if !begun {
            return Err(wrong(path, 1, "header", "a line DATA PERIODS", "none"));
        }
        if weather.instant_offset_h.is_some() && weather.per_hour != 1 {
            let found = format!("{} an hour", weather.per_hour);
            return Err(wrong(path, 1, "records", "one an hour where they are instants", &found));
        }
        let mut table = vec![f32::NAN; 366 * 24 * weather.per_hour];
        let mut rows = 0_usize;
        for (line, row) in lines.filter(|(_, row)| !row.trim().is_empty()) {
            weather.record(path, line, row, &mut table)?;
            rows += 1;
        }
        if rows == 0 {
            return Err(wrong(path, 1, "data", "at least one record", "none"));
        }
        let day = 24 * weather.per_hour;
        for (at, values) in table.chunks_exact(day).enumerate() {
            let lost = values.iter().filter(|v| v.is_nan()).count();
            if lost > 0 && lost < day {
                let (month, of_month) = date_of_day(2000, at as u32);
                let found = format!("{} of {month:02}-{of_month:02}", day - lost);
                return Err(wrong(path, 0, "records", &format!("{day} a day"), &found));
            }
        }
        weather.direct_w_m2 = Arc::new(table);
        Ok(weather)
    }

    fn record(&self, path: &str, line: usize, row: &str, table: &mut [f32]) -> Result<(), Error> {
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() < 15 {
            let found = format!("{} fields", fields.len());
            return Err(wrong(path, line, "record", "15 comma-separated fields or more", &found));
        }
        let date = format!("{}-{}", fields[1], fields[2]);
        // Typical years are put together from several; 2000 has every day that one can have.
        let day = parse_day(&date, 2000)
            .map_err(|_| wrong(path, line, "month and day", "a date", &date))?;
        let hour: usize = fields[3]
            .parse()
            .ok()
            .filter(|h| (1..=24).contains(h))
            .ok_or_else(|| wrong(path, line, "hour", "1 to 24", fields[3]))?;
        let minute: f64 = fields[4]
            .parse()
            .ok()
            .filter(|m| (0.0..=60.0).contains(m))
            .ok_or_else(|| wrong(path, line, "minute", "0 to 60", fields[4]))?;
        let direct: f64 = fields[14].parse().map_err(|_| {
            wrong(path, line, "direct normal irradiance (field 15)", "a number", fields[14])
        })?;
        if direct >= 9999.0 {
            return Err(wrong(
                path,
                line,
                "direct normal irradiance (field 15)",
                "a measured or modelled value; take another file, or `clear-sky`",
                "9999 (missing)",
            ));
        }
        if !(0.0..=MOST_W_M2).contains(&direct) {
            let expected = format!("0 to {MOST_W_M2} W/m2");
            return Err(wrong(
                path,
                line,
                "direct normal irradiance (field 15)",
                &expected,
                fields[14],
            ));
        }
        let start = (day as usize * 24 + hour - 1) * self.per_hour;
        let slot = if self.per_hour == 1 {
            0
        } else {
            // Records carry the minute at which they end; some files write 0 for the last one.
            let exact = minute * self.per_hour as f64 / 60.0;
            let nth = exact.round() as usize;
            if (exact - exact.round()).abs() > 0.02 {
                let expected = format!("the end of a record, {} an hour", self.per_hour);
                return Err(wrong(path, line, "minute", &expected, fields[4]));
            }
            if nth == 0 { self.per_hour - 1 } else { nth - 1 }
        };
        let value = &mut table[start + slot.min(self.per_hour - 1)];
        if !value.is_nan() {
            let found = format!("{date} hour {hour} minute {minute} a second time");
            return Err(wrong(path, line, "date", "each record once", &found));
        }
        *value = direct as f32;
        Ok(())
    }

    /// Whether the weather can be that of a place: the same standard time, and not far away.
    ///
    /// # Errors
    /// [`Error::WeatherPlace`].
    pub(super) fn check(&self, place: &Place) -> Result<(), Error> {
        let off = |what: &'static str, site: f64, file: f64| {
            Err(Error::WeatherPlace { what, site, file, station: self.station.clone() })
        };
        // Instants are UTC's.
        let zoned = self.instant_offset_h.is_none();
        if zoned && (self.zone_h * 15.0 - place.meridian_deg).abs() > 0.01 {
            return off("meridian of the standard time", place.meridian_deg, self.zone_h * 15.0);
        }
        if (self.latitude_deg - place.latitude_deg).abs() > FARTHEST_DEG {
            return off("latitude", place.latitude_deg, self.latitude_deg);
        }
        if (self.longitude_deg - place.longitude_deg).abs() > FARTHEST_DEG {
            return off("longitude", place.longitude_deg, self.longitude_deg);
        }
        Ok(())
    }

    /// Number of the record that an instant lies in; `month` and `day` from 1. 29 February takes
    /// the 28th where the file has none.
    pub(super) fn slot(&self, month: u32, day: u32, hour: f64) -> Option<usize> {
        let at = (hour * self.per_hour as f64 + 1e-9).floor() as usize;
        let find = |day: u32| {
            let day = parse_day(&format!("{month:02}-{day:02}"), 2000).ok()? as usize;
            let slot = day * 24 * self.per_hour + at.min(24 * self.per_hour - 1);
            self.direct_w_m2.get(slot).is_some_and(|v| !v.is_nan()).then_some(slot)
        };
        find(day).or_else(|| if (month, day) == (2, 29) { find(28) } else { None })
    }

    /// Mean of a record, W/m2.
    pub(super) fn mean_w_m2(&self, slot: usize) -> f64 {
        f64::from(self.direct_w_m2[slot])
    }

    /// Hour of the day at which a record begins, and its length.
    pub(super) fn span_h(&self, slot: usize) -> (f64, f64) {
        let each = 1.0 / self.per_hour as f64;
        ((slot % (24 * self.per_hour)) as f64 * each, each)
    }
}
