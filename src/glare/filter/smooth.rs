use std::ops::Range;

use super::kernel::Kernel;
use crate::glare::error::Error;
use crate::glare::events::threshold::Run;
use crate::glare::settings::Settings;

/// The separable Gaussian along t, then y, then x, each rounded to float32, and the threshold.
///
/// It works through strips of rows and blocks of columns: each row of the window is filtered in
/// time once for several timesteps, kept in a ring for the filter along y, and what that gives is
/// filtered along x and compared while it is still in the cache.
#[derive(Clone, Debug)]
pub(in crate::glare) struct Smoother {
    pub t: Kernel,
    pub y: Kernel,
    pub x: Kernel,
    pub threshold: f32,
}

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
}

/// Consecutive timesteps of one segment whose events are found together.
#[derive(Clone, Debug)]
pub(in crate::glare) struct Part {
    /// The segment.
    pub segment: Range<usize>,
    /// The timesteps.
    pub steps: Range<usize>,
    /// How many segments there are before this one.
    pub segments_before: usize,
}

impl Part {
    /// Counts timesteps; jumps where a segment begins, so that nothing goes on across it. Later
    /// than 1.
    pub fn clock(&self, timestep: usize) -> u32 {
        // Both are bounded by MAX_TIMESTEPS.
        (timestep + self.segments_before) as u32 + 2
    }

    /// The part cut into batches of `step` timesteps.
    pub fn batches(&self, step: usize) -> impl Iterator<Item = Batch> {
        self.steps.clone().step_by(step).map(move |start| {
            let steps = start..(start + step).min(self.steps.end);
            // Rests of half a batch or less have a loop of their own.
            let room = if 2 * steps.len() <= step { step / 2 } else { step };
            Batch { segment: self.segment.clone(), steps, room }
        })
    }
}

/// Consecutive timesteps of one segment that are filtered together.
#[derive(Clone, Debug)]
pub(in crate::glare) struct Batch {
    /// The segment.
    pub segment: Range<usize>,
    /// The timesteps to filter.
    pub steps: Range<usize>,
    /// For how many timesteps there is room: as many or more.
    pub room: usize,
}

impl Batch {
    /// The timesteps that the filter looks at.
    pub fn sees(&self, radius: usize) -> Range<usize> {
        let first = self.steps.start.saturating_sub(radius).max(self.segment.start);
        first..(self.steps.end + radius).min(self.segment.end)
    }
}

/// What lies above the threshold in a strip of rows: for each timestep its runs, sorted by row and
/// column.
pub(in crate::glare) type Strip = Vec<Vec<Run>>;
