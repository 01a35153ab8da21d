use std::ops::Range;

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
