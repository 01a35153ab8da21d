//! The table of events: its columns, written and read.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};

use super::event::Event;
use super::list::Events;
use crate::base::table::{Fixed, Shortest, Table};
use crate::volume::TimeAxis;

/// What an analysis knows of an event. Indices count from 0, `last` is inclusive, the peak comes
/// from the filtered volume; rows and columns of peak and centroid are pixels.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EventRow {
    first: u32,
    last: u32,
    voxels: u64,
    pixels: u64,
    peak_w_m2: Shortest,
    peak_timestep: u32,
    peak_row: u32,
    peak_column: u32,
    centroid_row: Fixed<3>,
    centroid_column: Fixed<3>,
    smallest_voxel: u64,
}

impl From<&Event> for EventRow {
    fn from(e: &Event) -> Self {
        Self {
            first: e.first,
            last: e.last,
            voxels: e.voxels,
            pixels: e.pixels,
            peak_w_m2: Shortest(Some(e.peak_w_m2)),
            peak_timestep: e.peak_timestep,
            peak_row: e.peak_row,
            peak_column: e.peak_column,
            centroid_row: e.centroid_row.into(),
            centroid_column: e.centroid_column.into(),
            smallest_voxel: e.smallest_voxel,
        }
    }
}

/// Day of year (0 is 1 January) and hour (local standard time) of an event's first and last
/// timestep, and how long it lasts: first to last timestep, both included.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EventTimes {
    first_day: u32,
    first_hour: Fixed<4>,
    last_day: u32,
    last_hour: Fixed<4>,
    duration_h: Fixed<4>,
}

impl EventTimes {
    /// The times of an event of this axis.
    pub fn of(event: &Event, axis: &TimeAxis) -> Self {
        let (first, last) = (event.first as usize, event.last as usize);
        let hour = |at: usize| axis.hour.get(at).copied().unwrap_or_default().into();
        let day = |at: usize| axis.day.get(at).copied().unwrap_or_default();
        Self {
            first_day: day(first),
            first_hour: hour(first),
            last_day: day(last),
            last_hour: hour(last),
            duration_h: (f64::from(event.last - event.first + 1) * axis.step_h).into(),
        }
    }
}

/// What a reader of a run's table of events needs of one.
#[derive(Clone, Debug, Deserialize)]
pub struct ListedEvent {
    /// First timestep.
    pub first: usize,
    /// Last timestep, inclusive.
    pub last: usize,
    /// How many pixels it touches.
    pub pixels: u64,
    /// Its highest irradiance, W/m2.
    pub peak_w_m2: f64,
    /// How long it lasts, h.
    pub duration_h: f64,
    /// When it begins, by the clock.
    pub first_at: String,
    /// Its last timestep, by the clock.
    pub last_at: String,
}

/// Writes events as CSV, one a row, in their order; with their times where the time axis is known.
///
/// # Errors
/// Whatever `out` says.
pub fn write_events(
    out: &mut impl Write,
    events: &Events,
    axis: Option<&TimeAxis>,
) -> io::Result<()> {
    match axis {
        Some(axis) => {
            let mut table = Table::of::<(EventRow, EventTimes)>(out)?;
            for event in events.iter()? {
                let event = event?;
                table.push((EventRow::from(&event), EventTimes::of(&event, axis)))?;
            }
            table.finish()?;
        }
        None => {
            let mut table = Table::of::<EventRow>(out)?;
            for event in events.iter()? {
                table.push(EventRow::from(&event?))?;
            }
            table.finish()?;
        }
    }
    Ok(())
}
