use std::io;
use std::ops::Range;

use super::error::Error;
use super::events::list::Events;
use super::plan::Plan;
use super::session::Session;
use super::settings::Settings;
use super::slices::Slices;
use crate::base::{Grid, Progress, limits};

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

/// Analyses a volume: smooths it, segment by segment, and finds what lies above the threshold.
///
/// `segments` follow each other without gaps and cover all timesteps. Nothing in memory grows
/// with the year but what is said of each timestep; what events need beyond their share of the
/// memory limit goes into temporary files.
///
/// # Errors
/// Settings out of range, segments that don't fit, a voxel that isn't finite (unless allowed), a
/// memory limit that is too low, a volume that can't be read, an interruption.
pub fn analyse(
    volume: &dyn Slices,
    segments: &[Range<usize>],
    settings: &Settings,
    filtered: Option<Filtered<'_>>,
    progress: &dyn Progress,
) -> Result<Analysis, Error> {
    let plan = plan(volume, settings, filtered.is_some())?;
    analyse_planned(volume, segments, settings, &plan, filtered, progress)
}

/// The steps in which [`analyse`] would go through a volume, and the memory it would take.
///
/// # Errors
/// Settings out of range, a memory limit that is too low.
pub fn plan(volume: &dyn Slices, settings: &Settings, keep: bool) -> Result<Plan, Error> {
    let calendar = volume.calendar().is_some();
    Plan::new(volume.shape(), volume.chunk_timesteps(), calendar, keep, settings)
}

/// [`analyse`] in steps that the caller chose.
///
/// # Errors
/// As [`analyse`].
pub fn analyse_planned(
    volume: &dyn Slices,
    segments: &[Range<usize>],
    settings: &Settings,
    plan: &Plan,
    filtered: Option<Filtered<'_>>,
    progress: &dyn Progress,
) -> Result<Analysis, Error> {
    let mut session = Session::begin(volume.shape(), volume.calendar(), settings, plan)?;
    progress.begin("glare", volume.shape()[0] as u64, "timesteps");
    session.push(volume, segments, filtered, progress)?;
    progress.finish();
    session.finish()
}

/// A shape that numbers of the analysis can count.
pub(super) fn checked(shape: [usize; 3]) -> Result<[usize; 3], Error> {
    let [timesteps, rows, columns] = shape;
    let pixels = rows.checked_mul(columns);
    let fits = pixels.is_some_and(|p| (1..=limits::MAX_VIEW_PIXELS).contains(&p))
        && (1..=limits::MAX_TIMESTEPS).contains(&timesteps);
    if fits { Ok(shape) } else { Err(Error::Shape(timesteps, rows, columns)) }
}
