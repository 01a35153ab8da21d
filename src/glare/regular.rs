//! Series whose timesteps differ in length, on a regular grid in time.

use std::ops::Range;

use super::error::{Error, ReadFailure};
use super::slices::{Calendar, Slices, checked};
use crate::base::limits::{MAX_TIMESTEPS, TILE_EDGE};
use crate::volume::{TimeAxis, segments_from_numbers};

/// The shortest time step that is believed, h: a second.
const SHORTEST_H: f64 = 1.0 / 3600.0;
/// Hours of a day.
const DAY_H: f64 = 24.0;
/// Differences of clock times that don't count, h.
const SLACK_H: f64 = 1e-6;

/// A time series whose steps differ in length, put onto a regular grid before it is filtered: the
/// filter, runs and events count timesteps, so all must be equally long. The grid's step is the
/// shortest between two timesteps of a segment. Each segment's grid begins with its first timestep
/// and shows at each instant the nearest timestep of the series, the earlier of two.
///
/// Hours are kept: what a timestep stands for is shared out among the instants that show it.
pub struct Regular<'a> {
    source: &'a dyn Slices,
    grid: TimeGrid,
}

impl<'a> Regular<'a> {
    /// The grid of a series whose timesteps `axis` describes; `None` where they lie on one already.
    /// `segments` follow each other without gaps.
    ///
    /// # Errors
    /// Segments or hours that don't fit the series, steps below a second, a grid that is too long.
    pub fn of(
        source: &'a dyn Slices,
        axis: &TimeAxis,
        segments: &[Range<usize>],
    ) -> Result<Option<Self>, Error> {
        let grid = TimeGrid::of(source.shape(), axis, segments)?;
        Ok(grid.map(|grid| Self { source, grid }))
    }

    /// The segments of the grid.
    pub fn segments(&self) -> &[Range<usize>] {
        &self.grid.segments
    }

    /// The timestep of the series that an instant of the grid shows.
    pub fn shown(&self, instant: usize) -> Option<usize> {
        self.grid.shows.get(instant).copied()
    }

    /// What the grid's instants are, given what the series' timesteps are.
    pub fn axis(&self, axis: &TimeAxis) -> TimeAxis {
        let TimeGrid { shows, hour, step_h, .. } = &self.grid;
        // Midnight may lie between an instant and the timestep that it shows.
        let day = |hour: &f64| ((hour + SLACK_H) / DAY_H).floor();
        TimeAxis {
            day: hour.iter().map(|hour| day(hour) as u32).collect(),
            hour: hour.iter().map(|hour| hour - DAY_H * day(hour)).collect(),
            sun: shows.iter().map(|&i| axis.sun[i]).collect(),
            weight_h: self.grid.shared(&axis.weight_h),
            segment: shows.iter().map(|&i| axis.segment[i]).collect(),
            step_h: if step_h.is_finite() { *step_h } else { axis.step_h },
            ..*axis
        }
    }
}

/// How many instants of the finest regular grid show each timestep, and the grid's step, h.
pub(super) fn instants(axis: &TimeAxis) -> Result<(Vec<u32>, f64), Error> {
    let timesteps = axis.day.len();
    let segments = segments_from_numbers(&axis.segment);
    Ok(match TimeGrid::of([timesteps, 1, 1], axis, &segments)? {
        Some(grid) => (grid.times(timesteps), grid.step_h),
        None => (vec![1; timesteps], axis.step_h),
    })
}

/// The instants of a regular grid.
struct TimeGrid {
    /// For each instant the timestep that it shows; never falls.
    shows: Vec<usize>,
    /// When each instant is, h.
    hour: Vec<f64>,
    segments: Vec<Range<usize>>,
    step_h: f64,
}

impl TimeGrid {
    /// See [`Regular::of`]; `shape` is that of the series.
    fn of(
        shape: [usize; 3],
        axis: &TimeAxis,
        segments: &[Range<usize>],
    ) -> Result<Option<Self>, Error> {
        let hour = hours_of_year(axis);
        let even = |segment: &Range<usize>| {
            let hours = hour.get(segment.clone()).unwrap_or_default();
            hours.windows(2).all(|h| is_step(h[1] - h[0], axis.step_h))
        };
        if segments.iter().all(even) {
            return Ok(None);
        }
        Self::new(shape, &hour, segments).map(Some)
    }

    /// The grid of a series whose timestep `i` lies at `hour[i]`, counted from any instant; hours
    /// rise inside each of `segments`.
    fn new(shape: [usize; 3], hour: &[f64], segments: &[Range<usize>]) -> Result<Self, Error> {
        let [timesteps, rows, columns] = checked(shape)?;
        if hour.len() != timesteps {
            return Err(Error::Calendar { found: hour.len(), timesteps });
        }
        let mut expected = 0;
        for (index, segment) in segments.iter().enumerate() {
            let Range { start, end } = *segment;
            if start != expected || end <= start || end > timesteps {
                return Err(Error::Segments { index, start, end, expected, timesteps });
            }
            expected = end;
        }
        if expected != timesteps {
            let (index, start, end) = (segments.len(), expected, expected);
            return Err(Error::Segments { index, start, end, expected, timesteps });
        }
        let gaps = segments.iter().flat_map(|s| hour[s.clone()].windows(2)).map(|h| h[1] - h[0]);
        let step_h = gaps.fold(f64::INFINITY, |least, gap| if gap < least { gap } else { least });
        let named = hour.iter().all(|h| h.is_finite());
        if !named || step_h < SHORTEST_H - SLACK_H {
            return Err(Error::Step(step_h));
        }
        let mut grid = Self { shows: Vec::new(), hour: Vec::new(), segments: Vec::new(), step_h };
        for segment in segments {
            let hours = &hour[segment.clone()];
            let (first, last) = (hours[0], hours[hours.len() - 1]);
            // Of a segment of one timestep the grid has that one, whatever the step.
            let steps = if last > first { ((last - first) / step_h).round() } else { 0.0 };
            if steps >= (MAX_TIMESTEPS - grid.shows.len()) as f64 {
                return Err(Error::Shape(usize::MAX, rows, columns));
            }
            let begins = grid.shows.len();
            let mut nearest = 0;
            for k in 0..=steps as usize {
                let at = if k == 0 { first } else { first + k as f64 * step_h };
                let nearer = |i: usize| (hours[i + 1] - at).abs() + SLACK_H < (hours[i] - at).abs();
                while nearest + 1 < hours.len() && nearer(nearest) {
                    nearest += 1;
                }
                grid.shows.push(segment.start + nearest);
                grid.hour.push(at);
            }
            grid.segments.push(begins..grid.shows.len());
        }
        Ok(grid)
    }

    /// How many instants show each of the series' timesteps.
    fn times(&self, timesteps: usize) -> Vec<u32> {
        let mut times = vec![0; timesteps];
        self.shows.iter().for_each(|&i| times[i] += 1);
        times
    }

    /// The weight of each timestep, shared out among the instants that show it.
    fn shared(&self, weight_h: &[f64]) -> Vec<f64> {
        let times = self.times(weight_h.len());
        self.shows.iter().map(|&i| weight_h[i] / f64::from(times[i])).collect()
    }
}

/// Hours since the year began, h.
fn hours_of_year(axis: &TimeAxis) -> Vec<f64> {
    axis.day.iter().zip(&axis.hour).map(|(day, hour)| DAY_H * f64::from(*day) + hour).collect()
}

/// Whether two timesteps are a step apart. A day needn't be a whole number of steps: over midnight
/// they may lie a hundredth nearer or farther.
fn is_step(gap_h: f64, step_h: f64) -> bool {
    (gap_h - step_h).abs() <= 0.01 * step_h + SLACK_H
}

impl Slices for Regular<'_> {
    fn shape(&self) -> [usize; 3] {
        let [_, rows, columns] = self.source.shape();
        [self.grid.shows.len(), rows, columns]
    }

    fn read_lit(
        &self,
        range: Range<usize>,
        rows: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure> {
        let [_, _, columns] = self.shape();
        let pixels = rows.len() * columns;
        let tiles = rows.len().div_ceil(TILE_EDGE) * columns.div_ceil(TILE_EDGE);
        let shows = &self.grid.shows[range];
        let mut at = 0;
        // Timesteps that follow each other and are shown once are read together.
        while at < shows.len() {
            let once = shows[at..].windows(2).take_while(|pair| pair[1] == pair[0] + 1).count() + 1;
            let steps = at..at + once;
            let into = &mut out[steps.start * pixels..steps.end * pixels];
            let flags = &mut lit[steps.start * tiles..steps.end * tiles];
            self.source.read_lit(shows[at]..shows[at] + once, rows.clone(), into, flags)?;
            at += once;
            let last = shows[at - 1];
            while shows.get(at) == Some(&last) {
                out.copy_within((at - 1) * pixels..at * pixels, at * pixels);
                lit.copy_within((at - 1) * tiles..at * tiles, at * tiles);
                at += 1;
            }
        }
        Ok(())
    }

    fn calendar(&self) -> Option<Calendar> {
        let calendar = self.source.calendar()?;
        Some(Calendar {
            day: self.grid.shows.iter().map(|&i| calendar.day[i]).collect(),
            weight_h: self.grid.shared(&calendar.weight_h),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regular<'a>(
        source: &'a dyn Slices,
        hour: &[f64],
        segments: &[Range<usize>],
    ) -> Result<Regular<'a>, Error> {
        let grid = TimeGrid::new(source.shape(), hour, segments)?;
        Ok(Regular { source, grid })
    }

    /// Timestep `t` shows `t` everywhere, in a picture of one pixel.
    struct Numbers(usize);

    impl Slices for Numbers {
        fn shape(&self) -> [usize; 3] {
            [self.0, 1, 1]
        }

        fn read_lit(
            &self,
            range: Range<usize>,
            _: Range<usize>,
            out: &mut [f32],
            lit: &mut [bool],
        ) -> Result<(), ReadFailure> {
            lit.fill(true);
            for (to, t) in out.iter_mut().zip(range) {
                *to = t as f32;
            }
            Ok(())
        }

        fn calendar(&self) -> Option<Calendar> {
            let weight_h = (0..self.0).map(|t| 1.0 + t as f64).collect();
            Some(Calendar { day: vec![7; self.0], weight_h })
        }
    }

    #[test]
    fn steps_of_any_length_come_to_lie_on_the_finest_grid() {
        // An hour, then quarters, then half an hour; and a day of one timestep.
        let hour = [8.0, 9.0, 9.25, 9.5, 10.0, 12.0];
        let segments = [0..5, 5..6];
        let source = Numbers(6);
        let grid = regular(&source, &hour, &segments).unwrap();
        let expected = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 3.0, 4.0, 5.0];
        assert_eq!(grid.shape(), [10, 1, 1]);
        assert_eq!(grid.segments(), [0..9, 9..10]);
        assert_eq!(grid.grid.hour[..4], [8.0, 8.25, 8.5, 8.75]);
        for step in 1..=10 {
            let mut found = vec![-1.0; 10];
            for start in (0..10).step_by(step) {
                let range = start..(start + step).min(10);
                let mut lit = vec![true; range.len()];
                grid.read_lit(range.clone(), 0..1, &mut found[range], &mut lit).unwrap();
            }
            assert_eq!(found, expected, "{step} at a time");
        }
        let calendar = grid.calendar().unwrap();
        assert_eq!(calendar.weight_h[..3], [1.0 / 3.0; 3]);
        let sum: f64 = calendar.weight_h.iter().sum();
        assert!((sum - 21.0).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn a_regular_series_is_its_own_grid() {
        let hour: Vec<f64> = (0..500).map(|i| 4.0 + f64::from(i % 100) / 60.0 * 7.0).collect();
        let segments: Vec<Range<usize>> = (0..5).map(|d| d * 100..(d + 1) * 100).collect();
        let source = Numbers(500);
        let grid = regular(&source, &hour, &segments).unwrap();
        assert_eq!(grid.grid.shows, (0..500).collect::<Vec<_>>());
        assert_eq!(grid.segments(), segments);
    }

    #[test]
    fn what_has_no_grid_is_refused() {
        let new = |hour: &[f64], segments: &[Range<usize>]| {
            regular(&Numbers(3), hour, segments).map(|_| ()).unwrap_err()
        };
        let all = std::iter::once(0..3).collect::<Vec<_>>();
        assert!(matches!(new(&[1.0, 2.0], &all), Error::Calendar { .. }));
        assert!(matches!(new(&[1.0, 1.0, 2.0], &all), Error::Step(_)));
        assert!(matches!(new(&[3.0, 2.0, 1.0], &all), Error::Step(_)));
        assert!(matches!(new(&[1.0, f64::NAN, 2.0], &all), Error::Step(_)));
        assert!(matches!(new(&[0.0, 1.0 / 3600.0, 1e9], &all), Error::Shape(..)));
        assert!(matches!(
            new(&[1.0, 2.0, 3.0], std::slice::from_ref(&(0..2))),
            Error::Segments { .. }
        ));
        assert!(matches!(new(&[1.0, 2.0, 3.0], &[0..2, 1..3]), Error::Segments { .. }));
    }
}
