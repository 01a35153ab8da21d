use std::ops::Range;

use super::error::Error;
use super::plan::Plan;
use super::settings::Settings;
use super::slices::{Calendar, Slices};
use super::smooth::{Batch, Smoother, Strip};
use super::stream::{Analysis, Filtered, checked};
use super::track::{Tracker, Yearly};
use super::window::{Block, Window};
use crate::base::{Grid, Progress};

/// An analysis that is fed piece by piece: whole segments in chronological order, from one source
/// or from several that follow each other. The pieces don't show in the result, since nothing
/// crosses the border of a segment.
pub struct Session {
    shape: [usize; 3],
    smoother: Smoother,
    plan: Plan,
    allow_nonfinite: bool,
    tracker: Tracker,
    window: Window,
    /// Filtered slices of a batch, where somebody wants them.
    keep: Vec<f32>,
    nonfinite: u64,
    /// Segments that were pushed.
    segments: usize,
    /// First timestep that wasn't pushed.
    next: usize,
}

impl Session {
    /// An analysis of a year of `shape`, `[timestep, row, column]`, with its calendar where one is
    /// known.
    ///
    /// # Errors
    /// Settings out of range, a shape beyond the limits, a calendar that doesn't fit it.
    pub fn begin(
        shape: [usize; 3],
        calendar: Option<Calendar>,
        settings: &Settings,
        plan: &Plan,
    ) -> Result<Self, Error> {
        let [timesteps, rows, columns] = checked(shape)?;
        let plan = Plan { batch: plan.batch.max(1), block: plan.block.max(1), ..*plan };
        let mut tracker = Tracker::new(rows, columns, settings, &plan);
        if let Some(calendar) = calendar {
            let found = calendar.day.len().min(calendar.weight_h.len());
            if found != timesteps {
                return Err(Error::Calendar { found, timesteps });
            }
            tracker.yearly = Some(Yearly::new(calendar, rows * columns));
        }
        Ok(Self {
            shape,
            smoother: Smoother::new(settings)?,
            plan,
            allow_nonfinite: settings.allow_nonfinite,
            tracker,
            window: Window::new(rows, columns, plan.block),
            keep: Vec::new(),
            nonfinite: 0,
            segments: 0,
            next: 0,
        })
    }

    /// Analyses the next segments, which follow each other and what was pushed before without
    /// gaps. `source` has the shape of the whole year and holds at least their timesteps.
    ///
    /// # Errors
    /// A source of another shape, segments that don't follow, a voxel that isn't finite (unless
    /// allowed), a source that can't be read, an interruption. After an error the session is of no
    /// use.
    pub fn push(
        &mut self,
        source: &dyn Slices,
        segments: &[Range<usize>],
        mut filtered: Option<Filtered<'_>>,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        if source.shape() != self.shape {
            return Err(Error::Source { expected: self.shape, found: source.shape() });
        }
        let range = self.follow(segments)?;
        let [_, rows, columns] = self.shape;
        let (pixels, step) = (rows * columns, self.plan.batch);
        if filtered.is_some() {
            self.keep.resize(pixels * step, 0.0);
        }
        let batches = batches(segments, step);
        let mut reader = Reader {
            source,
            step: self.plan.block,
            next: range.start,
            end: range.end,
            allow_nonfinite: self.allow_nonfinite,
        };
        let radius = self.smoother.t.radius();
        let Self { smoother, plan, tracker, window, keep, nonfinite, .. } = self;
        let mut waiting: Option<(Batch, Vec<Strip>)> = None;
        // While a batch is filtered, the one before is labelled and what the next one needs is
        // read: three kinds of work that don't depend on each other.
        let ahead = batches.first().map_or(0, |b| b.sees(radius).end);
        let spare = reader.spare(window, ahead);
        let mut read = reader.read(spare, ahead);
        for number in 0..=batches.len() {
            progress.check()?;
            for block in read? {
                *nonfinite += block.nonfinite;
                window.push(block);
            }
            let batch = batches.get(number);
            if let Some(batch) = batch {
                window.forget_before(batch.sees(radius).start);
            }
            let ahead = batches.get(number + 1).map_or(0, |next| next.sees(radius).end);
            let spare = reader.spare(window, ahead);
            let done = waiting.take();
            let kept = filtered.is_some().then_some(&mut *keep);
            let (labelled, (strips, next)) = rayon::join(
                || done.map_or(Ok(0), |(batch, strips)| label(tracker, &batch, &strips, plan)),
                || {
                    rayon::join(
                        || {
                            batch.map(|batch| {
                                let kept = kept.map(|all| &mut all[..batch.steps.len() * pixels]);
                                (batch.clone(), smoother.run(window, batch, kept))
                            })
                        },
                        || reader.read(spare, ahead),
                    )
                },
            );
            progress.advance(labelled?);
            if let (Some(filtered), Some(batch)) = (&mut filtered, batch) {
                for (timestep, slice) in batch.steps.clone().zip(keep.chunks_exact(pixels)) {
                    filtered(timestep, slice).map_err(Error::Filtered)?;
                }
            }
            (waiting, read) = (strips, next);
        }
        self.window.forget_before(usize::MAX);
        Ok(())
    }

    /// The timesteps of segments, if they follow what was pushed so far.
    fn follow(&mut self, segments: &[Range<usize>]) -> Result<Range<usize>, Error> {
        let first = self.next;
        for segment in segments {
            let (start, end) = (segment.start, segment.end);
            if start != self.next || end <= start || end > self.shape[0] {
                return Err(self.misplaced(start, end));
            }
            self.segments += 1;
            self.next = end;
        }
        Ok(first..self.next)
    }

    fn misplaced(&self, start: usize, end: usize) -> Error {
        let (index, expected, timesteps) = (self.segments, self.next, self.shape[0]);
        Error::Segments { index, start, end, expected, timesteps }
    }

    /// What was found, once all timesteps were pushed.
    ///
    /// # Errors
    /// Timesteps that are missing.
    pub fn finish(mut self) -> Result<Analysis, Error> {
        let [timesteps, rows, columns] = self.shape;
        if self.next != timesteps {
            return Err(self.misplaced(self.next, self.next));
        }
        // The maps need room while the pixels are still there.
        self.window = Window::new(rows, columns, 1);
        let grid = |data| Grid::from_vec(columns, rows, data);
        let Tracker { durations, yearly, mut events, .. } = self.tracker;
        events.sort();
        let [cumulative, sustained, longest_run] = durations.maps();
        let (mut days, mut longest_day, mut cumulative_h) = (None, None, None);
        if let Some(yearly) = yearly {
            days = Some(grid(yearly.days));
            longest_day = Some(grid(yearly.longest_day));
            let hours = yearly.hours.iter().map(|h| *h as f32).collect();
            cumulative_h = Some(Grid::from_vec(columns, rows, hours));
        }
        Ok(Analysis {
            cumulative: grid(cumulative),
            sustained: grid(sustained),
            longest_run: grid(longest_run),
            days,
            longest_day,
            cumulative_h,
            events,
            nonfinite: self.nonfinite,
        })
    }
}

/// Reads blocks in order.
struct Reader<'a> {
    source: &'a dyn Slices,
    step: usize,
    /// First timestep that wasn't read.
    next: usize,
    /// Behind the last timestep.
    end: usize,
    allow_nonfinite: bool,
}

impl Reader<'_> {
    /// Blocks to read into until `end`.
    fn spare(&self, window: &mut Window, end: usize) -> Vec<Block> {
        let start = self.next / self.step * self.step;
        let blocks = if end > self.next { (end - start).div_ceil(self.step) } else { 0 };
        (0..blocks).map(|_| window.spare()).collect()
    }

    /// Reads all blocks that begin before `end`.
    fn read(&mut self, spare: Vec<Block>, end: usize) -> Result<Vec<Block>, Error> {
        let mut spare = spare.into_iter();
        let mut out = Vec::new();
        while self.next < end {
            // Blocks begin at multiples of their length, where chunks begin; only the first may not.
            let last = (self.next / self.step + 1) * self.step;
            let range = self.next..last.min(self.end);
            let block = spare.next().unwrap_or_default();
            self.next = range.end;
            out.push(block.read(self.source, range, self.allow_nonfinite)?);
        }
        Ok(out)
    }
}

/// Tracks the slices of a batch; how many there were.
fn label(
    tracker: &mut Tracker,
    batch: &Batch,
    strips: &[Strip],
    plan: &Plan,
) -> Result<u64, Error> {
    for (step, timestep) in batch.steps.clone().enumerate() {
        tracker.slice(timestep, strips.iter().map(|strip| &strip[step])).map_err(Error::Spill)?;
        let found = tracker.bytes() as u64;
        if found > plan.events_bytes {
            return Err(Error::Events {
                timestep,
                found_mib: found >> 20,
                allowed_mib: plan.events_bytes >> 20,
            });
        }
    }
    if batch.steps.end == batch.segment.end {
        tracker.end_segment().map_err(Error::Spill)?;
    }
    Ok(batch.steps.len() as u64)
}

fn batches(segments: &[Range<usize>], step: usize) -> Vec<Batch> {
    let cut = |segment: &Range<usize>| {
        let (segment, end) = (segment.clone(), segment.end);
        segment.clone().step_by(step).map(move |start| Batch {
            segment: segment.clone(),
            steps: start..(start + step).min(end),
            room: step,
        })
    };
    segments.iter().flat_map(cut).collect()
}
