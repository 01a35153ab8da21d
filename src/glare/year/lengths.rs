use std::ops::RangeInclusive;

use crate::glare::error::Error;
use crate::glare::regular::instants;
use crate::volume::TimeAxis;

/// Sums of weights such as 1/12 h may miss a round number of hours by that much, h.
pub(in crate::glare) const SLACK_H: f64 = 1e-6;
/// Instants in half an hour at most: more would be a step below a second.
const MAX_HALF_HOUR: f64 = 1800.0;

/// How long each timestep of a series lasts, as a number of instants of the finest regular grid
/// (see [`Regular`](crate::glare::regular::Regular)): 1 where all steps are alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Lengths {
    instants: Vec<u32>,
    step_h: f64,
}

impl Lengths {
    /// Those of an axis in local standard time.
    ///
    /// # Errors
    /// Hours that don't rise inside a segment, steps below a second, a grid that is too long.
    pub fn of(axis: &TimeAxis) -> Result<Self, Error> {
        let (instants, step_h) = instants(axis)?;
        Ok(Self { instants, step_h })
    }

    /// Of an axis all of whose steps are alike.
    pub fn even(axis: &TimeAxis) -> Self {
        Self { instants: vec![1; axis.day.len()], step_h: axis.step_h }
    }

    /// From one instant of the grid to the next, h.
    pub fn step_h(&self) -> f64 {
        self.step_h
    }

    /// Instants that fill half an hour.
    ///
    /// # Errors
    /// A step of 0, or below a second.
    pub(in crate::glare) fn half_hour(&self) -> Result<usize, Error> {
        let count = (0.5 / self.step_h - SLACK_H).ceil().max(1.0);
        if !(self.step_h > 0.0 && count <= MAX_HALF_HOUR) {
            return Err(Error::Step(self.step_h));
        }
        Ok(count as usize)
    }

    /// Instants of a timestep.
    pub fn instants(&self, timestep: usize) -> u32 {
        self.instants[timestep]
    }

    /// How long timesteps last together, both ends included, h.
    pub fn hours(&self, timesteps: RangeInclusive<usize>) -> f64 {
        let sum: u64 = self.instants[timesteps].iter().map(|n| u64::from(*n)).sum();
        // Bounded by MAX_TIMESTEPS.
        sum as f64 * self.step_h
    }

    /// The timestep that each instant shows, and an axis of the instants: each has the time of its
    /// timestep and its share of the weight. `None` where all steps are alike.
    pub fn spread(&self, axis: &TimeAxis) -> Option<(Vec<usize>, TimeAxis)> {
        if self.instants.iter().all(|n| *n == 1) {
            return None;
        }
        let repeat = |(t, n): (usize, &u32)| std::iter::repeat_n(t, *n as usize);
        let shows: Vec<usize> = self.instants.iter().enumerate().flat_map(repeat).collect();
        let weight = |t: &usize| axis.weight_h[*t] / f64::from(self.instants[*t]);
        let wide = TimeAxis {
            day: shows.iter().map(|t| axis.day[*t]).collect(),
            hour: shows.iter().map(|t| axis.hour[*t]).collect(),
            sun: shows.iter().map(|t| axis.sun[*t]).collect(),
            weight_h: shows.iter().map(weight).collect(),
            segment: shows.iter().map(|t| axis.segment[*t]).collect(),
            step_h: self.step_h,
            ..axis.clone()
        };
        Some((shows, wide))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, SpectralBasis, Stream};
    use crate::glare::year::receiver::{margins, spot};

    /// What is counted by lengths, against the same written out instant by instant.
    #[test]
    fn uneven_timesteps_count_as_the_instants_that_show_them() {
        let mut random = Stream::new(3, Purpose::Survey, 0);
        let (mut day, mut hour, mut weight_h) = (Vec::new(), Vec::new(), Vec::new());
        for d in 0..40 {
            let mut quarters = 24.0;
            for _ in 0..12 {
                day.push(d * 3);
                hour.push(quarters / 4.0);
                weight_h.push(0.3 + random.uniform());
                quarters += 1.0 + (random.uniform() * 4.0).floor();
            }
        }
        let axis = TimeAxis {
            sun: vec![glam::DVec3::Z; day.len()],
            segment: day.clone(),
            day,
            hour,
            weight_h,
            step_h: 0.25,
            half_year: false,
            year: 2025,
            sun_diameter_deg: 0.5,
            basis: SpectralBasis::Broadband,
        };
        let lengths = Lengths::of(&axis).unwrap();
        let (shows, wide) = lengths.spread(&axis).unwrap();
        assert!(shows.len() > 700 && lengths.step_h() == 0.25);
        for share in [0.1, 0.5, 0.9] {
            let series: Vec<f32> =
                (0..480).map(|_| (random.uniform() * 10.0 / (1.0 - share)) as f32).collect();
            let spread: Vec<f32> = shows.iter().map(|t| series[*t]).collect();
            let found = spot(&axis, &lengths, |t| series[t] > 10.0);
            let mut slow = spot(&wide, &Lengths::even(&wide), |i| spread[i] > 10.0);
            slow.longest_run_at = shows[slow.longest_run_at as usize] as u32;
            assert!((found.hours - slow.hours).abs() < 1e-6 && found.hours > 0.0);
            (slow.hours, slow.months_h) = (found.hours, found.months_h);
            assert_eq!(found, slow);
            let [worst, _] = margins(&axis, &lengths, &series).unwrap();
            assert_eq!(worst, margins(&wide, &Lengths::even(&wide), &spread).unwrap()[0]);
        }
    }
}
