use std::ops::Range;

use rayon::prelude::*;

use super::error::Error;
use super::kernel::Kernel;
use super::settings::Settings;
use super::strip::{Scratch, Work};
use super::threshold::Run;
use super::window::Window;

/// Rows that one thread filters at a time: enough that the rows above and below, which are
/// filtered in time twice, don't matter.
const STRIP_ROWS: usize = 64;
/// The separable Gaussian along t, then y, then x, each rounded to float32, and the threshold.
///
/// It works through strips of rows and blocks of columns: each row of the window is filtered in
/// time once for several timesteps, kept in a ring for the filter along y, and what that gives is
/// filtered along x and compared while it is still in the cache.
#[derive(Clone, Debug)]
pub(super) struct Smoother {
    pub t: Kernel,
    pub y: Kernel,
    pub x: Kernel,
    pub threshold: f32,
}

/// Consecutive timesteps of one segment.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    /// The segment.
    pub segment: Range<usize>,
    /// The timesteps to filter.
    pub steps: Range<usize>,
    /// How many timesteps all batches but the last of a segment have.
    pub room: usize,
}

impl Batch {
    /// The timesteps that the filter looks at.
    pub fn sees(&self, radius: usize) -> Range<usize> {
        let first = self.steps.start.saturating_sub(radius).max(self.segment.start);
        first..(self.steps.end + radius).min(self.segment.end)
    }
}

/// What lies above the threshold in a strip of rows: for each timestep of the batch its runs,
/// sorted by row and column.
pub(super) type Strip = Vec<Vec<Run>>;

impl Smoother {
    /// The filter and the threshold that are asked for.
    pub fn new(settings: &Settings) -> Result<Self, Error> {
        let [t, y, x] = settings.kernels()?;
        Ok(Self { t, y, x, threshold: settings.threshold_f32()? })
    }

    /// Whether no axis is filtered.
    pub fn is_identity(&self) -> bool {
        [&self.t, &self.y, &self.x].iter().all(|kernel| kernel.is_identity())
    }

    /// Filters a batch. `keep` takes the filtered slices, one after the other.
    pub fn run(&self, window: &Window, batch: &Batch, keep: Option<&mut [f32]>) -> Vec<Strip> {
        let (rows, columns) = (window.rows, window.columns);
        let strips = rows.div_ceil(STRIP_ROWS);
        let mut kept: Vec<Vec<&mut [f32]>> = (0..strips).map(|_| Vec::new()).collect();
        for slice in keep.into_iter().flat_map(|all| all.chunks_mut(rows * columns)) {
            for (strip, part) in kept.iter_mut().zip(slice.chunks_mut(STRIP_ROWS * columns)) {
                strip.push(part);
            }
        }
        kept.into_par_iter()
            .enumerate()
            .map_init(Scratch::default, |scratch, (number, kept)| {
                let first = number * STRIP_ROWS;
                let rows = first..(first + STRIP_ROWS).min(rows);
                Work::new(self, window, batch, rows, kept, scratch).run()
            })
            .collect()
    }
}
