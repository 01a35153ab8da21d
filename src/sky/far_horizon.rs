//! Ridges beyond the scene: when the sun rises above them.

use std::path::Path;

use glam::DVec3;

use super::{Error, altitude_azimuth_deg};
use crate::base::{Timeline, limits};

/// Ridges beyond the scene: what the sun has to rise above, by azimuth. Between the points the
/// altitude runs straight, also across north.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FarHorizon {
    /// Azimuth clockwise from north (0 to below 360, rising) and altitude, degrees.
    points: Vec<[f64; 2]>,
}

/// Points that a horizon may have: one every hundredth of a degree.
const MOST_POINTS: usize = 36_000;

impl FarHorizon {
    /// A horizon from (azimuth, altitude) pairs in degrees, in any order.
    ///
    /// # Errors
    /// [`Error::Horizon`]: no points or too many, numbers outside -360..=360 and -90..=90, the
    /// same azimuth twice.
    pub fn from_points(points: &[[f64; 2]]) -> Result<Self, Error> {
        let wrong = |found: String| Error::Horizon { found };
        if points.is_empty() || points.len() > MOST_POINTS {
            return Err(wrong(format!("{} points", points.len())));
        }
        let mut sorted = Vec::with_capacity(points.len());
        for &[azimuth, altitude] in points {
            if !(-360.0..=360.0).contains(&azimuth) || !(-90.0..=90.0).contains(&altitude) {
                return Err(wrong(format!("azimuth {azimuth}, altitude {altitude}")));
            }
            sorted.push([azimuth.rem_euclid(360.0), altitude]);
        }
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        if let Some(twice) = sorted.windows(2).find(|w| w[0][0] == w[1][0] && w[0][1] != w[1][1]) {
            return Err(wrong(format!("two altitudes at azimuth {}", twice[0][0])));
        }
        sorted.dedup();
        Ok(Self { points: sorted })
    }

    /// Reads a text of pairs, one a line: azimuth and altitude, separated by blanks, commas,
    /// semicolons or tabs. `#` begins a comment; a first line of words (a table's head) is passed
    /// over.
    ///
    /// # Errors
    /// [`Error::HorizonFile`] with the line, [`Error::Horizon`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let wrong =
            |line: usize, found: String| Error::HorizonFile { path: path.to_owned(), line, found };
        let size = std::fs::metadata(path).map_err(|e| wrong(0, e.to_string()))?.len();
        if size > limits::MAX_HEADER_BYTES as u64 {
            return Err(wrong(0, format!("a file of {size} bytes")));
        }
        let text = std::fs::read_to_string(path).map_err(|e| wrong(0, e.to_string()))?;
        let mut points = Vec::new();
        let mut head = true;
        for (i, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() {
                continue;
            }
            let words: Vec<&str> = line
                .split(|c: char| c.is_whitespace() || c == ',' || c == ';')
                .filter(|w| !w.is_empty())
                .collect();
            let numbers: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
            match (numbers.as_slice(), words.len()) {
                (&[azimuth, altitude], 2) => points.push([azimuth, altitude]),
                ([], _) if head => {}
                _ => return Err(wrong(i + 1, format!("`{line}`"))),
            }
            head = false;
        }
        Self::from_points(&points)
    }

    /// Altitude of the ridge at an azimuth, degrees.
    pub fn altitude_deg(&self, azimuth_deg: f64) -> f64 {
        let azimuth = azimuth_deg.rem_euclid(360.0);
        let next = self.points.partition_point(|p| p[0] <= azimuth);
        let count = self.points.len();
        let before = self.points[(next + count - 1) % count];
        let after = self.points[next % count];
        let span = (after[0] - before[0]).rem_euclid(360.0);
        if span == 0.0 {
            return before[1];
        }
        let part = (azimuth - before[0]).rem_euclid(360.0) / span;
        before[1] + (after[1] - before[1]) * part
    }

    /// A timeline without the suns behind the ridge. Like night, it ends a segment.
    ///
    /// # Errors
    /// [`Error::Night`] where no sun is left.
    pub fn cut(&self, mut timeline: Timeline) -> Result<Timeline, Error> {
        let candidates = timeline.steps.len() as u64;
        let mut segment = 0;
        let mut last: Option<(usize, u32)> = None;
        let mut nth = 0;
        timeline.steps.retain_mut(|step| {
            nth += 1;
            if !self.shows(step.sun) {
                return false;
            }
            if let Some((before, old)) = last
                && (before + 1 != nth || old != step.segment)
            {
                segment += 1;
            }
            last = Some((nth, step.segment));
            step.segment = segment;
            true
        });
        if timeline.steps.is_empty() {
            return Err(Error::Night { candidates });
        }
        Ok(timeline)
    }

    /// Whether a sun stands above the ridge.
    pub fn shows(&self, sun: DVec3) -> bool {
        let (altitude, azimuth) = altitude_azimuth_deg(sun);
        altitude > self.altitude_deg(azimuth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_straight_between_points_and_across_north() {
        let h = FarHorizon::from_points(&[[270.0, 4.0], [-10.0, 8.0], [90.0, 2.0]]).expect("valid");
        for (azimuth, altitude) in
            [(90.0, 2.0), (180.0, 3.0), (270.0, 4.0), (310.0, 6.0), (350.0, 8.0), (40.0, 5.0)]
        {
            assert!((h.altitude_deg(azimuth) - altitude).abs() < 1e-12, "{azimuth}");
        }
        let one = FarHorizon::from_points(&[[10.0, 3.0]]).expect("valid");
        assert_eq!(one.altitude_deg(200.0), 3.0);
        assert!(one.shows(DVec3::new(0.0, 1.0, 0.1)) && !one.shows(DVec3::new(0.0, 1.0, 0.05)));
    }

    #[test]
    fn a_ridge_ends_segments_and_keeps_the_order() {
        use crate::sky::{DayRange, HourRange, Place, SunModel, SunStrength, TimeSpec, timeline};
        let place =
            Place { latitude_deg: 47.0, longitude_deg: 8.3, meridian_deg: 15.0, elevation_m: 0.0 };
        let spec = TimeSpec {
            year: 2025,
            days: DayRange { from: 100, to: 101, step: 1 },
            hours: HourRange { from: 0.0, to: 23.0, step: 1.0 },
            sun: SunModel::Gensky,
            irradiance: SunStrength::Gensky,
            finer: Vec::new(),
            half_year: false,
        };
        let whole = timeline(&place, &spec).expect("suns");
        // A tower in the south, from 150 to 210 degrees.
        let tower = [[149.9, 0.0], [150.0, 89.0], [210.0, 89.0], [210.1, 0.0]];
        let cut = FarHorizon::from_points(&tower).expect("valid").cut(whole.clone()).expect("suns");
        assert!(cut.steps.len() < whole.steps.len());
        assert_eq!((whole.segments().len(), cut.segments().len()), (2, 4));
        let flat = FarHorizon::from_points(&[[0.0, 0.0]]).expect("valid").cut(whole.clone());
        assert_eq!(flat, Ok(whole.clone()));
        let walled = FarHorizon::from_points(&[[0.0, 90.0]]).expect("valid").cut(whole);
        assert!(matches!(walled, Err(Error::Night { .. })));
    }

    #[test]
    fn files_are_read_or_refused_with_their_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("ridge.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).expect("writes");
            FarHorizon::read(&path)
        };
        let good =
            read("azimuth,altitude\n# the ridge\n0, 1\n90;3\n180\t5 # noon\n").expect("good");
        assert_eq!(good.altitude_deg(45.0), 2.0);
        for (text, line) in [("0 1\n90\n", ":2"), ("0 1\nx y\n", ":2"), ("", "0 points")] {
            let said = read(text).expect_err("wrong").to_string();
            assert!(said.contains(line), "{said}");
        }
        assert!(read("0 1\n360 2\n").is_err(), "two altitudes at north");
        assert!(read("0 100\n").is_err());
        assert!(read("nan 1\n").is_err());
    }
}
