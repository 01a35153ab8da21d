//! The streaming analysis of a year.
//!
//! The problem: the time series of a year has hundreds of gigabytes, and an event is a connected
//! component of it in time, row and column, after a Gaussian along all three. With the volume in
//! memory that is two calls of SciPy. Here memory may hold the window of the filter and what is alive.
//!
//! The idea: the picture moves through three stages, and each wave of rows is in one of them:
//!
//! ```text
//!             read ───────────► filtered ───────────► followed
//!      rows of tiles of      strips become slabs,    events go on
//!        the next wave         a thread each         from slab to slab
//! ```
//!
//! A [`Step`] of the [`Schedule`] is one wave. While its rows are filtered, the slabs of the step before
//! are followed, and what the step after needs is read: three kinds of work that share nothing, so
//! that they run at once ([`Session::work`]) and the result depends on no order. Following is
//! sequential, since it hands out numbers; it costs little, as a slab keeps what is inside of it for itself.
//! At the bottom of the picture a pass ends, its filtered slices are complete, and the next pass begins
//! at the top with later timesteps.
//!
//! Since nothing crosses the border of a segment, a year may come in pieces, from several sources.
//!
//! What lost: sliding along time alone, as the analysis did at first, with all rows of the timesteps
//! that are read at once in memory (twice of it), and stages that wait for each other. Not tried:
//! labels of the whole volume on disk and a second pass that joins them, which reads everything twice
//! and keeps a table that grows with the year.

use std::ops::Range;

use rayon::prelude::*;

use super::analysis::{Analysis, Filtered};
use super::error::Error;
use super::events::counts::Counts;
use super::events::slab::Slab;
use super::events::track::Tracker;
use super::filter::kernel::Gaussian;
use super::filter::window::{Block, Window};
use super::plan::Plan;
use super::schedule::{Passes, Schedule, Step};
use super::settings::Settings;
use super::slices::{Calendar, Slices, checked};
use super::wave::{Scratch, Wave};
use crate::base::Progress;

/// An analysis that is fed piece by piece: whole segments in chronological order, from one source
/// or from several that follow each other. The pieces don't show in the result, since nothing
/// crosses the border of a segment.
pub struct Session {
    shape: [usize; 3],
    gaussian: Gaussian,
    threshold: f32,
    plan: Plan,
    allow_nonfinite: bool,
    counts: Counts,
    tracker: Tracker,
    window: Window,
    /// For each strip of a wave.
    scratch: Vec<Scratch>,
    /// Filtered slices of a pass, where somebody wants them.
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
        if let Some(calendar) = &calendar {
            let found = calendar.day.len().min(calendar.weight_h.len());
            if found != timesteps {
                return Err(Error::Calendar { found, timesteps });
            }
        }
        let gaussian = settings.gaussian()?;
        let depth = (2 * gaussian.t.radius()).min(timesteps);
        Ok(Self {
            shape,
            gaussian,
            threshold: settings.threshold_f32()?,
            plan,
            allow_nonfinite: settings.allow_nonfinite,
            counts: Counts::new(rows, columns, calendar),
            tracker: Tracker::new(rows, columns, settings, plan.spill_bytes),
            window: Window::new(rows, columns, depth),
            scratch: Vec::new(),
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
        let reader = Reader { source, allow_nonfinite: self.allow_nonfinite };
        let mut schedule = self.schedule(segments)?;
        let mut next = schedule.next(self.tracker.waits_for_the_end());
        if let Some(first) = &next {
            self.window.begin(first.pass.reads.start);
        }
        let rooms = self.rooms(next.as_ref());
        let mut read = reader.read(next.as_ref(), rooms);
        let (keeps, mut followable) = (filtered.is_some(), None);
        while let Some(step) = next {
            progress.check()?;
            self.take_in(&step, read?);
            next = schedule.next(self.tracker.waits_for_the_end());
            let work = self.work(&step, followable.take(), &reader, next.as_ref(), keeps)?;
            progress.advance(work.timesteps);
            read = work.read;
            if let (true, Some(filtered)) = (step.ends, &mut filtered) {
                self.hand_on(&step, filtered)?;
            }
            if let Some(next) = next.as_ref().filter(|next| next.begins()) {
                self.window.begin(next.pass.reads.start);
            }
            followable = Some(Followable { step, slabs: work.slabs });
        }
        if let Some(last) = followable {
            progress.advance(last.follow(&mut self.tracker, self.plan.events_bytes)?);
        }
        Ok(())
    }

    /// The steps in which segments are gone through, once they are known to follow what was
    /// pushed so far.
    fn schedule<'a>(&mut self, segments: &'a [Range<usize>]) -> Result<Schedule<'a>, Error> {
        let radius = self.gaussian.t.radius();
        let passes = Passes::new(segments, self.segments, self.plan.block, radius);
        for segment in segments {
            let (start, end) = (segment.start, segment.end);
            if start != self.next || end <= start || end > self.shape[0] {
                return Err(self.misplaced(start, end));
            }
            self.segments += 1;
            self.next = end;
        }
        // Two at least, so that filtering and following go on at once.
        let strips = rayon::current_num_threads().max(2);
        self.scratch.resize_with(strips.max(self.scratch.len()), Scratch::default);
        Ok(Schedule::new(passes, self.shape[1], strips, self.gaussian.y.radius()))
    }

    /// Room for what a step needs to have read.
    fn rooms(&mut self, step: Option<&Step>) -> Vec<(Range<usize>, Block)> {
        step.map_or_else(Vec::new, |step| self.window.rooms(step.reads.clone()))
    }

    /// What was read for a step comes into the window; rows that no filter sees any more leave it.
    fn take_in(&mut self, step: &Step, blocks: Vec<Block>) {
        for block in blocks {
            self.nonfinite += block.nonfinite;
            self.window.push(block);
        }
        self.window.retire(step.rows.start.saturating_sub(self.gaussian.y.radius()));
    }

    /// Filters the rows of a step; meanwhile follows events through the step before and reads what
    /// the step after needs.
    fn work(
        &mut self,
        step: &Step,
        before: Option<Followable>,
        reader: &Reader<'_>,
        after: Option<&Step>,
        keeps: bool,
    ) -> Result<Worked, Error> {
        let rooms = self.rooms(after);
        let [_, rows, columns] = self.shape;
        let Self { gaussian, threshold, plan, counts, tracker, window, scratch, keep, .. } = self;
        let kept = keeps.then(|| {
            keep.resize(step.pass.steps() * rows * columns, 0.0);
            &mut keep[..]
        });
        let wave = Wave {
            gaussian,
            threshold: *threshold,
            connectivity: tracker.connectivity(),
            window,
            parts: &step.pass.parts,
            rows: step.rows.clone(),
            batch: plan.batch,
        };
        let (followed, (slabs, read)) = rayon::join(
            || before.map_or(Ok(0), |before| before.follow(tracker, plan.events_bytes)),
            || rayon::join(|| wave.run(counts, kept, scratch), || reader.read(after, rooms)),
        );
        Ok(Worked { timesteps: followed?, slabs, read })
    }

    /// Hands on the filtered slices of a pass, of which this was the last step.
    fn hand_on(&self, step: &Step, filtered: &mut Filtered<'_>) -> Result<(), Error> {
        let [_, rows, columns] = self.shape;
        let steps = step.pass.parts.iter().flat_map(|part| part.steps.clone());
        for (timestep, slice) in steps.zip(self.keep.chunks_exact(rows * columns)) {
            filtered(timestep, slice).map_err(Error::Filtered)?;
        }
        Ok(())
    }

    fn misplaced(&self, start: usize, end: usize) -> Error {
        let (index, expected, timesteps) = (self.segments, self.next, self.shape[0]);
        Error::Segments { index, start, end, expected, timesteps }
    }

    /// What was found, once all timesteps were pushed.
    ///
    /// # Errors
    /// Timesteps that are missing.
    pub fn finish(self) -> Result<Analysis, Error> {
        let [timesteps, rows, columns] = self.shape;
        if self.next != timesteps {
            return Err(self.misplaced(self.next, self.next));
        }
        // The maps need room while the pixels are still there.
        drop((self.window, self.scratch));
        let Tracker { durations, mut events, .. } = self.tracker;
        events.sort();
        Ok(Analysis::new([rows, columns], &self.counts, durations, events, self.nonfinite))
    }
}

/// What came of the work on a step.
struct Worked {
    /// How many timesteps are done.
    timesteps: u64,
    slabs: Vec<Vec<Slab>>,
    /// What was read for the step after, or why it wasn't.
    read: Result<Vec<Block>, Error>,
}

/// Reads rows of tiles.
struct Reader<'a> {
    source: &'a dyn Slices,
    allow_nonfinite: bool,
}

impl Reader<'_> {
    /// Reads rows of tiles at the timesteps of a step, into room for each of them.
    fn read(
        &self,
        step: Option<&Step>,
        rooms: Vec<(Range<usize>, Block)>,
    ) -> Result<Vec<Block>, Error> {
        let Some(step) = step else { return Ok(Vec::new()) };
        let read = |(rows, block): (Range<usize>, Block)| {
            block.read(self.source, step.pass.reads.clone(), rows, self.allow_nonfinite)
        };
        // Of several errors the topmost is returned, whatever the threads.
        let all: Vec<_> = rooms.into_par_iter().with_max_len(1).map(read).collect();
        all.into_iter().collect()
    }
}

/// A step that was filtered.
struct Followable {
    step: Step,
    /// For each strip a slab for each part.
    slabs: Vec<Vec<Slab>>,
}

impl Followable {
    /// Follows events through the step; how many timesteps are done by that.
    fn follow(self, tracker: &mut Tracker, events_bytes: u64) -> Result<u64, Error> {
        let Self { step, slabs } = self;
        if step.begins() {
            tracker.begin(&step.pass.parts);
        }
        for slabs in slabs {
            tracker.add(slabs).map_err(Error::Spill)?;
            let found = tracker.bytes() as u64;
            if found > events_bytes {
                return Err(Error::Events {
                    timestep: tracker.timestep(),
                    found_mib: found >> 20,
                    allowed_mib: events_bytes >> 20,
                });
            }
        }
        if !step.ends {
            return Ok(0);
        }
        tracker.end().map_err(Error::Spill)?;
        Ok(step.pass.steps() as u64)
    }
}
