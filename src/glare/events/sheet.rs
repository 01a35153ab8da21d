use std::io::{self, Write};

use super::list::Events;
use crate::volume::TimeAxis;

/// Writes events as CSV, one a row, in their order. Indices count from 0, `last` is
/// inclusive, the peak comes from the filtered volume; rows and columns of peak and centroid are
/// pixels. Where the time axis is known, day of year (0 is 1 January) and hour (local standard
/// time) of the first and last timestep follow, and how long the event lasts: first to last
/// timestep, both included.
///
/// # Errors
/// Whatever `out` says.
pub fn write_events(
    out: &mut impl Write,
    events: &Events,
    axis: Option<&TimeAxis>,
) -> io::Result<()> {
    write!(
        out,
        "first,last,voxels,pixels,peak_w_m2,peak_timestep,peak_row,peak_column,\
         centroid_row,centroid_column,smallest_voxel"
    )?;
    let times =
        if axis.is_some() { ",first_day,first_hour,last_day,last_hour,duration_h" } else { "" };
    writeln!(out, "{times}")?;
    for e in events.iter()? {
        let e = e?;
        write!(
            out,
            "{},{},{},{},{},{},{},{},{:.3},{:.3},{}",
            e.first,
            e.last,
            e.voxels,
            e.pixels,
            e.peak_w_m2,
            e.peak_timestep,
            e.peak_row,
            e.peak_column,
            e.centroid_row,
            e.centroid_column,
            e.smallest_voxel
        )?;
        if let Some(axis) = axis {
            let steps = e.last - e.first + 1;
            let at = |values: &[f64], index: u32| values.get(index as usize).copied();
            let day = |index: u32| axis.day.get(index as usize).copied();
            if let (Some(first_day), Some(first_hour), Some(last_day), Some(last_hour)) =
                (day(e.first), at(&axis.hour, e.first), day(e.last), at(&axis.hour, e.last))
            {
                let hours = f64::from(steps) * axis.step_h;
                write!(out, ",{first_day},{first_hour:.4},{last_day},{last_hour:.4},{hours:.4}")?;
            }
        }
        writeln!(out)?;
    }
    Ok(())
}
