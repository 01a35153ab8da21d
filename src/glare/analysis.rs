use std::io;

use super::events::counts::Counts;
use super::events::duration::Durations;
use super::events::list::Events;
use crate::base::Grid;

/// Takes the filtered volume, slice by slice: timestep and `[row, column]` in W/m2.
pub type Filtered<'a> = &'a mut dyn FnMut(usize, &[f32]) -> io::Result<()>;

/// What the analysis found. Grids are `[row, column]`, row 0 at the top.
#[derive(Debug)]
pub struct Analysis {
    /// Timesteps above the threshold.
    pub cumulative: Grid<i32>,
    /// The most timesteps that one event has at the pixel: the paper's measure.
    pub sustained: Grid<i32>,
    /// The longest uninterrupted run of timesteps inside one segment.
    pub longest_run: Grid<i32>,
    /// Days with glare, where the volume has a calendar.
    pub days: Option<Grid<i32>>,
    /// The most timesteps above the threshold on one day, where the volume has a calendar.
    pub longest_day: Option<Grid<i32>>,
    /// Hours of the year above the threshold (the sum of the timesteps' weights), where the
    /// volume has a calendar.
    pub cumulative_h: Option<Grid<f32>>,
    /// All events, sorted.
    pub events: Events,
    /// How many voxels of the volume are NaN or infinite.
    pub nonfinite: u64,
}

impl Analysis {
    /// The maps of a picture of `[row, column]` pixels.
    pub(super) fn new(
        [rows, columns]: [usize; 2],
        counts: &Counts,
        durations: Durations,
        events: Events,
        nonfinite: u64,
    ) -> Self {
        let pixels = counts.pixels();
        // All are bounded by MAX_TIMESTEPS.
        let grid = |of: &mut dyn Iterator<Item = u32>| {
            Grid::from_vec(columns, rows, of.map(|n| n as i32).collect())
        };
        let followed = durations.sustained().zip(pixels);
        let sustained = grid(&mut followed.map(|(most, pixel)| most.max(pixel.sustained)));
        // The other maps need its room.
        drop(durations);
        let yearly = counts.yearly();
        Self {
            sustained,
            cumulative: grid(&mut pixels.iter().map(|pixel| pixel.cumulative)),
            longest_run: grid(&mut pixels.iter().map(|pixel| pixel.longest_run)),
            days: yearly.map(|all| grid(&mut all.iter().map(|pixel| pixel.days))),
            longest_day: yearly.map(|all| grid(&mut all.iter().map(|pixel| pixel.longest_day))),
            cumulative_h: yearly.map(|all| {
                let hours = all.iter().map(|pixel| pixel.hours as f32);
                Grid::from_vec(columns, rows, hours.collect())
            }),
            events,
            nonfinite,
        }
    }
}
