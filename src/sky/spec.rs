//! Which instants a project asks for, by which sun, and how strong it is.

use std::str::FromStr;

use super::{DayRange, Error, HourRange};

/// Hours that are so near are the same, h.
const SLACK_H: f64 = 1e-6;

/// An instant of each day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instant {
    /// Hour of the day, local standard time.
    pub hour: f64,
    /// For how much of the day it stands, h.
    pub length_h: f64,
}

/// Which formulas say where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum SunModel {
    /// Radiance's gensky as of 2018, as the paper used it.
    #[serde(rename = "gensky-2018")]
    Gensky2018,
    /// Today's gensky.
    #[serde(rename = "gensky")]
    Gensky,
    /// NREL's solar position algorithm (Reda and Andreas 2004). The only one that knows the year.
    #[serde(rename = "spa")]
    Spa,
}

impl SunModel {
    /// The name in project files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gensky2018 => "gensky-2018",
            Self::Gensky => "gensky",
            Self::Spa => "spa",
        }
    }

    /// The strength that goes with it where none is asked for.
    pub fn default_irradiance(self) -> SunStrength {
        match self {
            Self::Gensky2018 | Self::Gensky => SunStrength::Gensky,
            Self::Spa => SunStrength::ClearSky,
        }
    }
}

impl FromStr for SunModel {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        [Self::Gensky2018, Self::Gensky, Self::Spa]
            .into_iter()
            .find(|model| model.name() == text)
            .ok_or_else(|| Error::SunModel(text.to_owned()))
    }
}

/// How strong the sun is.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SunStrength {
    /// Radiance's visible watts, for comparison with the paper; a disc of 0.5 degrees.
    Gensky,
    /// Broadband, Ineichen and Perez 2002 with a Linke turbidity of 3.
    ClearSky,
    /// The same with the Linke turbidity of each month, January first.
    Ineichen {
        /// Linke turbidity, 1 to 15; interpolated between the middles of the months.
        linke: [f64; 12],
    },
    /// The same direct normal irradiance for each sun, W/m2, broadband.
    Constant(f64),
    /// Measured or typical weather, broadband. Within a record the strength follows the clear sky
    /// of the instant, scaled so that the record's mean is kept.
    Epw(super::Weather),
}

/// Which instants are computed, by which sun.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TimeSpec {
    /// The year, 1583 to 5999.
    pub year: i32,
    /// Days of the year.
    pub days: DayRange,
    /// Hours of the day, local standard time.
    pub hours: HourRange,
    /// Stretches of the day with finer steps, in order: their instants take the place of those of
    /// `hours` between their ends.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub finer: Vec<HourRange>,
    /// Where the sun stands.
    pub sun: SunModel,
    /// How strong it is.
    pub irradiance: SunStrength,
    /// The paper's Equation (1): half a year stands for the year.
    pub half_year: bool,
}

impl SunStrength {
    /// Checks that the numbers can be a sun's.
    pub(super) fn check(&self) -> Result<(), Error> {
        match self {
            Self::Gensky | Self::ClearSky | Self::Epw(_) => Ok(()),
            Self::Ineichen { linke } => match linke.iter().find(|t| !(1.0..=15.0).contains(*t)) {
                None => Ok(()),
                Some(found) => Err(Error::Irradiance {
                    expected: "Linke turbidities of 1 to 15, one for each month",
                    found: found.to_string(),
                }),
            },
            Self::Constant(w_m2) => {
                if *w_m2 > 0.0 && *w_m2 <= 2000.0 {
                    Ok(())
                } else {
                    Err(Error::Irradiance {
                        expected: "a constant above 0 and up to 2000 W/m2",
                        found: w_m2.to_string(),
                    })
                }
            }
        }
    }
}

impl TimeSpec {
    /// How many instants are looked at, day and night; the ranges were checked.
    pub(super) fn candidates(&self) -> u64 {
        let days = (self.days.to - self.days.from) / self.days.step + 1;
        let finer = self.finer.iter().map(|range| u64::from(range.count()));
        u64::from(days) * (u64::from(self.hours.count()) + finer.sum::<u64>())
    }

    /// The instants of a day, in order.
    pub(super) fn instants(&self) -> Vec<Instant> {
        let of = |range: &HourRange| {
            let range = *range;
            (0..range.count()).map(move |i| (range.hour(i), range.step))
        };
        let replaced = |hour: f64| {
            let within = |f: &HourRange| hour > f.from - SLACK_H && hour < f.to + SLACK_H;
            self.finer.iter().any(within)
        };
        let mut hours: Vec<(f64, f64)> = of(&self.hours).filter(|h| !replaced(h.0)).collect();
        hours.extend(self.finer.iter().flat_map(of));
        hours.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Stretches that meet share an instant.
        hours.dedup_by(|next, last| next.0 - last.0 <= SLACK_H);
        let length = |i: usize| {
            let (hour, step) = hours[i];
            if self.finer.is_empty() {
                return step;
            }
            // Half the way to either neighbour; outwards, half a step.
            let before = i.checked_sub(1).map_or(step, |before| hour - hours[before].0);
            let after = hours.get(i + 1).map_or(step, |after| after.0 - hour);
            (before + after) / 2.0
        };
        (0..hours.len()).map(|i| Instant { hour: hours[i].0, length_h: length(i) }).collect()
    }

    /// Everything that is wrong without asking the sun.
    pub fn mistakes(&self) -> Vec<Error> {
        let mut out = Vec::new();
        let mut add = |checked: Result<(), Error>| out.extend(checked.err());
        match (1583..6000).contains(&self.year) {
            true => add(self.days.check(self.year)),
            false => add(Err(Error::Year(self.year))),
        }
        add(self.hours.check());
        add(self.check_finer());
        add(self.irradiance.check());
        if self.half_year && self.days.to > 182 {
            add(Err(Error::HalfYear { from: self.days.from, to: self.days.to }));
        }
        if self.half_year && matches!(self.irradiance, SunStrength::Epw(_)) {
            add(Err(Error::HalfYearOfWeather));
        }
        out
    }

    fn check_finer(&self) -> Result<(), Error> {
        let mut end = self.hours.from;
        for range in &self.finer {
            let inside = range.from >= end - SLACK_H && range.to <= self.hours.to + SLACK_H;
            if range.check().is_err() || !inside || range.step >= self.hours.step {
                let HourRange { from, to, step } = *range;
                let HourRange { from: first, to: last, step: usual } = self.hours;
                let hours = format!("{first} to {last}, step {usual}");
                return Err(Error::Finer { from, to, step, least: end, hours });
            }
            end = range.to;
        }
        Ok(())
    }

    /// Checks everything that doesn't need the sun.
    pub(super) fn check(&self) -> Result<(), Error> {
        self.mistakes().into_iter().next().map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(finer: &[[f64; 3]]) -> TimeSpec {
        let range = |[from, to, step]: &[f64; 3]| HourRange { from: *from, to: *to, step: *step };
        TimeSpec {
            year: 2025,
            days: DayRange { from: 0, to: 364, step: 7 },
            hours: range(&[4.0, 20.0, 0.25]),
            sun: SunModel::Spa,
            irradiance: SunStrength::ClearSky,
            half_year: false,
            finer: finer.iter().map(range).collect(),
        }
    }

    #[test]
    fn finer_stretches_leave_nothing_of_the_day_out() {
        for finer in [
            &[[6.0, 8.0, 0.05]][..],
            &[[4.0, 5.0, 0.125]],
            &[[6.0, 8.0, 0.05], [8.0, 9.0, 0.1], [18.1, 20.0, 1.0 / 60.0]],
        ] {
            let spec = spec(finer);
            spec.check().unwrap();
            let instants = spec.instants();
            assert!(instants.windows(2).all(|pair| pair[0].hour + 0.01 < pair[1].hour));
            let ends = |i: &Instant| spec.finer.iter().any(|f| (f.from - i.hour).abs() < 1e-9);
            assert_eq!(instants.iter().filter(|i| ends(i)).count(), finer.len());
            // Half a step beyond either end.
            let end = |hour: f64| {
                let here =
                    spec.finer.iter().find(|f| (f.from - SLACK_H..f.to + SLACK_H).contains(&hour));
                here.map_or(0.25, |f| f.step) / 2.0
            };
            let expected = 16.0 + end(4.0) + end(20.0);
            let sum: f64 = instants.iter().map(|i| i.length_h).sum();
            assert!((sum - expected).abs() < 1e-9, "{sum} h, not {expected}");
        }
        let even = spec(&[]).instants();
        assert!(even.len() == 65 && even.iter().all(|i| i.length_h == 0.25));
    }

    #[test]
    fn stretches_that_are_none_are_refused() {
        for finer in [
            &[[3.0, 5.0, 0.05]][..],
            &[[19.0, 21.0, 0.05]],
            &[[6.0, 8.0, 0.25]],
            &[[6.0, 8.0, 0.05], [7.0, 9.0, 0.05]],
            &[[8.0, 9.0, 0.05], [6.0, 7.0, 0.05]],
            &[[8.0, 7.0, 0.05]],
        ] {
            assert!(matches!(spec(finer).check(), Err(Error::Finer { .. })), "{finer:?}");
        }
    }
}
