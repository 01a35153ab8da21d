use std::ops::Range;

use super::analysis::{Analysis, Filtered};
use super::error::Error;
use super::plan::Plan;
use super::session::Session;
use super::settings::Settings;
use super::slices::Slices;
use crate::base::Progress;

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
