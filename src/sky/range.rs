//! Days and hours as people write them: `A:B:STEP`, the end included.

use super::{Error, calendar};

/// Days of the year, end included: `from + i * step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct DayRange {
    /// First day, 0 is 1 January.
    pub from: u32,
    /// No day lies behind this one.
    pub to: u32,
    /// Days from one to the next.
    pub step: u32,
}

impl DayRange {
    /// Reads `A:B:STEP`; A and B are days of the year or dates `MM-DD`.
    ///
    /// # Errors
    /// Whatever doesn't fit; [`timeline`](super::timeline) checks the values against the year.
    pub fn parse(text: &str, year: i32) -> Result<Self, Error> {
        let wrong = || Error::Range {
            what: "days",
            expected: "A:B:STEP with days of the year or dates, as in 0:181:7 or 01-01:12-31:1",
            found: text.to_owned(),
        };
        let [from, to, step] = thirds(text).ok_or_else(wrong)?;
        let step = step.parse().map_err(|_| wrong())?;
        Ok(Self {
            from: calendar::parse_day(from, year)?,
            to: calendar::parse_day(to, year)?,
            step,
        })
    }

    /// The days, each with the number of days that it stands for: `step`, or what is left of the
    /// year, so that the days of a full year sum to its length.
    pub(super) fn days(self, year: i32) -> impl Iterator<Item = (u32, u32)> {
        let end = calendar::days_in_year(year);
        (self.from..=self.to)
            .step_by(self.step.max(1) as usize)
            .map(move |day| (day, self.step.min(end - day)))
    }

    /// Checks the range against the year.
    pub(super) fn check(self, year: i32) -> Result<(), Error> {
        let last = calendar::days_in_year(year) - 1;
        if self.step == 0 {
            return Err(Error::DayStep);
        }
        if self.from > self.to || self.to > last {
            return Err(Error::DaysOutside { year, last, from: self.from, to: self.to });
        }
        Ok(())
    }
}

/// Hours of the day, end included: `from + i * step`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct HourRange {
    /// First hour, local standard time.
    pub from: f64,
    /// No hour lies behind this one (but for the rounding of a step such as 0.1).
    pub to: f64,
    /// Hours from one to the next.
    pub step: f64,
}

/// Share of a step by which decimal fractions may miss the end of their range.
const SLACK: f64 = 1e-6;

impl HourRange {
    /// Reads `A:B:STEP` in hours.
    ///
    /// # Errors
    /// [`Error::Range`] for what isn't three numbers; [`timeline`](super::timeline) checks them.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let wrong = || Error::Range {
            what: "hours",
            expected: "A:B:STEP in hours, as in 4.5:20.5:0.25",
            found: text.to_owned(),
        };
        let [from, to, step] = thirds(text).ok_or_else(wrong)?;
        let number = |t: &str| t.parse::<f64>().map_err(|_| wrong());
        Ok(Self { from: number(from)?, to: number(to)?, step: number(step)? })
    }

    /// How many hours there are; 0 unless the check of the range passes.
    pub fn count(self) -> u32 {
        // The cast saturates and NaN gives 0.
        if self.check().is_ok() {
            ((self.to - self.from) / self.step + SLACK) as u32 + 1
        } else {
            0
        }
    }

    /// The i-th hour.
    pub fn hour(self, i: u32) -> f64 {
        self.from + f64::from(i) * self.step
    }

    /// Checks the range.
    pub(super) fn check(self) -> Result<(), Error> {
        if !(1.0 / 3601.0..=24.0).contains(&self.step) {
            return Err(Error::HourStep(self.step));
        }
        let inside = self.from >= 0.0 && self.from <= self.to && self.to < 24.0;
        if !inside {
            return Err(Error::HoursOutside { from: self.from, to: self.to });
        }
        Ok(())
    }
}

fn thirds(text: &str) -> Option<[&str; 3]> {
    let mut parts = text.split(':').map(str::trim);
    let out = [parts.next()?, parts.next()?, parts.next()?];
    parts.next().is_none().then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_included_whatever_the_step() {
        let count = |from, to, step| HourRange { from, to, step }.count();
        assert_eq!(count(4.5, 20.5, 0.25), 65);
        assert_eq!(count(0.0, 23.9, 0.1), 240);
        assert_eq!(count(0.1, 0.7, 0.1), 7);
        assert_eq!(count(0.3, 0.9, 0.3), 3);
        assert_eq!(count(5.0, 5.0, 1.0), 1);
        assert_eq!(count(5.0, 5.9, 0.25), 4);
        for steps in 1..=3600_u32 {
            let step = 1.0 / f64::from(steps);
            assert_eq!(count(0.0, 24.0 - step, step), 24 * steps, "{steps} steps an hour");
            assert_eq!(count(7.0, 7.0 + 5.0 * step, step), 6, "{steps} steps an hour");
        }
        assert_eq!(HourRange { from: 4.5, to: 20.5, step: 0.25 }.hour(64), 20.5);
    }

    #[test]
    fn days_of_a_full_year_sum_to_its_length() {
        for (year, length) in [(2023, 365), (2024, 366)] {
            for step in [1, 2, 7, 10, 30, 365, 366, 1000] {
                let range = DayRange { from: 0, to: length - 1, step };
                let sum: u32 = range.days(year).map(|(_, stands_for)| stands_for).sum();
                assert_eq!(sum, length, "{year} step {step}");
            }
        }
        let paper = DayRange { from: 0, to: 181, step: 7 };
        assert_eq!(paper.days(2018).count(), 26);
        assert!(paper.days(2018).all(|(_, stands_for)| stands_for == 7));
    }

    #[test]
    fn words_become_ranges() {
        let days = DayRange { from: 0, to: 181, step: 7 };
        assert_eq!(DayRange::parse("0:181:7", 2018), Ok(days));
        assert_eq!(DayRange::parse("01-01:07-01:7", 2018), Ok(days));
        assert_eq!(
            HourRange::parse("4.5:20.5:0.25"),
            Ok(HourRange { from: 4.5, to: 20.5, step: 0.25 })
        );
        for bad in ["", "0:181", "0:181:7:1", "0:181:x", "0:181:-7", "0:181:1.5"] {
            assert!(matches!(DayRange::parse(bad, 2018), Err(Error::Range { .. })), "{bad}");
        }
        for bad in ["", "1:2", "a:b:c", "1:2:3:4"] {
            assert!(matches!(HourRange::parse(bad), Err(Error::Range { .. })), "{bad}");
        }
    }

    #[test]
    fn impossible_ranges_are_refused() {
        let hours = |from, to, step| HourRange { from, to, step }.check();
        assert!(matches!(hours(0.0, 24.0, 0.25), Err(Error::HoursOutside { .. })));
        assert!(matches!(hours(-1.0, 5.0, 0.25), Err(Error::HoursOutside { .. })));
        assert!(matches!(hours(9.0, 5.0, 0.25), Err(Error::HoursOutside { .. })));
        assert!(matches!(hours(f64::NAN, 5.0, 0.25), Err(Error::HoursOutside { .. })));
        assert!(matches!(hours(0.0, 5.0, f64::NAN), Err(Error::HourStep(_))));
        assert!(matches!(hours(0.0, 5.0, 0.0), Err(Error::HourStep(_))));
        assert!(matches!(hours(0.0, 5.0, 1e-9), Err(Error::HourStep(_))));
        let days = |from, to, step| DayRange { from, to, step }.check(2023);
        assert_eq!(days(0, 364, 1), Ok(()));
        assert!(matches!(days(0, 365, 1), Err(Error::DaysOutside { last: 364, .. })));
        assert!(matches!(days(8, 7, 1), Err(Error::DaysOutside { .. })));
        assert_eq!(days(0, 7, 0), Err(Error::DayStep));
    }
}
