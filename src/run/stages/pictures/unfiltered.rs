//! Maps of the series as it is: worst days, unbroken glare, days, months, clock times, margins.

use super::atlas::{Atlas, Drawing};
use crate::glare::YearMap;
use crate::project::{GlareMap, Map};
use crate::receivers::clock::Clock;
use crate::run::error::Error;

impl Atlas<'_> {
    /// What was read off the series as it is: the measure that rules judge.
    pub(super) fn unfiltered(&mut self) -> Result<(), Error> {
        for (map, meaning) in [
            (YearMap::LongestDay, "The most time above the threshold on any one day."),
            (
                YearMap::LongestRun,
                "The longest time above the threshold without a break on any day.",
            ),
        ] {
            self.above_each_threshold(GlareMap::Unfiltered(map), "above", |what| {
                format!(
                    "{meaning} Irradiance {what}, unfiltered; noise makes single pixels too high."
                )
            })?;
        }
        // The margins don't depend on a threshold: one picture for all. Days, months and clock times
        // are drawn for the lowest: those of others lie within.
        let lowest = self.thresholds().iter().copied().min_by(f64::total_cmp);
        let Some(lowest) = lowest else { return Ok(()) };
        self.months(lowest)?;
        self.days(lowest)?;
        self.clock_times(lowest)?;
        self.margins(lowest)
    }

    /// Hours of glare in each month that has any, on one scale.
    fn months(&mut self, threshold: f64) -> Result<(), Error> {
        let map = |month| Map::Glare(threshold, GlareMap::Unfiltered(YearMap::Month(month)));
        let (mut grids, mut lit) = (Vec::new(), Vec::new());
        for month in 1..=12 {
            let maps = self.all(map(month))?;
            lit.extend((!maps.is_empty()).then_some(month));
            grids.extend(maps);
        }
        for month in lit {
            let caption = format!(
                "Days that were not computed count as the computed one before them. Irradiance {}, unfiltered; noise makes single pixels too high.",
                self.what()
            );
            let legend = format!("above {threshold} {}", self.watts());
            let scale = self.linear(map(month), &grids);
            self.drawings.push(Drawing {
                bare: "no colour: never above the threshold in this month".into(),
                ..self.drawing(map(month), legend, caption, scale)
            });
        }
        Ok(())
    }

    fn days(&mut self, threshold: f64) -> Result<(), Error> {
        let map = Map::Glare(threshold, GlareMap::Unfiltered(YearMap::Days));
        let caption = format!("Days with any glare. Irradiance {}, unfiltered.", self.what());
        let scale = self.linear(map, &self.all(map)?);
        self.drawings.push(self.drawing(map, "days with glare".into(), caption, scale));
        Ok(())
    }

    /// The earliest and latest clock times of glare, on whole hours.
    fn clock_times(&mut self, threshold: f64) -> Result<(), Error> {
        let year = self.job.timeline()?.year;
        let zone = Clock::new(&self.job.resolved.project.site, year).zone();
        for map in [YearMap::FirstHour, YearMap::LastHour] {
            let map = Map::Glare(threshold, GlareMap::Unfiltered(map));
            let grids = self.all(map)?;
            let mut scale = self.linear(map, &grids);
            let lit = || grids.iter().flat_map(|g| g.data()).copied().filter(|h| *h > 0.0);
            if let Some(latest) = lit().max_by(f32::total_cmp) {
                let earliest = lit().fold(24.0f32, f32::min);
                scale.min = f64::from(earliest).floor();
                scale.max = libm::ceil(f64::from(latest)).max(scale.min + 1.0);
            }
            let caption = format!("Clock time, {zone}. Irradiance {}, unfiltered.", self.what());
            self.drawings.push(self.drawing(map, "clock time".into(), caption, scale));
        }
        Ok(())
    }

    /// The irradiances that are exceeded for as long as rules allow.
    fn margins(&mut self, threshold: f64) -> Result<(), Error> {
        for (map, legend) in [
            (YearMap::ExceededOnWorstDay, "irradiance exceeded for 30 min"),
            (YearMap::ExceededInYear, "irradiance exceeded for 50 h"),
        ] {
            let map = Map::Glare(threshold, GlareMap::Unfiltered(map));
            let caption = format!(
                "The margin to any threshold: one below this value is exceeded for that long here. Irradiance {}, unfiltered.",
                self.what()
            );
            let scale = self.decades(map, &self.all(map)?);
            self.drawings.push(Drawing {
                bare: "no colour: less, or not for so long".into(),
                ..self.drawing(map, legend.into(), caption, scale)
            });
        }
        Ok(())
    }
}
