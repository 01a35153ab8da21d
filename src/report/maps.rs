//! Maps of a run, for numbers in the report.

use super::error::Error;
use crate::base::Grid;
use crate::picture::exr;
use crate::project::{Candidate, Map, PlannedView, Results};

/// Reads a map.
///
/// # Errors
/// When its file is missing or damaged.
pub fn read_map(
    results: &Results<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    map: Map,
) -> Result<Grid<f32>, Error> {
    let path = results.folder.at(&results.folder.exr(&candidate.name, &view.name, map));
    Ok(exr::read_channel(&path, &map.channel())?)
}
