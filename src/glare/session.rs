use std::ops::Range;

use rayon::prelude::*;

use super::error::Error;
use super::events::slab::Slab;
use super::events::track::Tracker;
use super::filter::passes::{Pass, Passes};
use super::filter::smooth::{Part, Smoother};
use super::filter::wave::{STRIP_ROWS, Scratch, Wave};
use super::filter::window::{Block, Window};
use super::plan::Plan;
use super::settings::Settings;
use super::slices::{Calendar, Slices};
use super::stream::{Analysis, Filtered, checked};
use super::year::counts::Counts;
use crate::base::limits::TILE_EDGE;
use crate::base::{Grid, Progress};

/// An analysis that is fed piece by piece: whole segments in chronological order, from one source
/// or from several that follow each other. The pieces don't show in the result, since nothing
/// crosses the border of a segment.
pub struct Session {
    shape: [usize; 3],
    smoother: Smoother,
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
        let smoother = Smoother::new(settings)?;
        let depth = (2 * smoother.t.radius()).min(timesteps);
        Ok(Self {
            shape,
            smoother,
            plan,
            allow_nonfinite: settings.allow_nonfinite,
            counts: Counts::new(rows, columns, calendar),
            tracker: Tracker::new(rows, columns, settings, &plan),
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
        let before = self.segments;
        self.follow(segments)?;
        let [_, rows, columns] = self.shape;
        let pixels = rows * columns;
        let strips = rayon::current_num_threads().max(2);
        let wave_rows = STRIP_ROWS * strips;
        self.scratch.resize_with(strips.max(self.scratch.len()), Scratch::default);
        let reach = self.smoother.y.radius();
        let mut passes = Passes::new(segments, before, self.plan.block, self.smoother.t.radius());
        let reader = Reader { source, allow_nonfinite: self.allow_nonfinite };
        // Rows of tiles that a wave needs, its last row given.
        let needed = |end: usize| (end + reach).next_multiple_of(TILE_EDGE).min(rows);
        let Self { smoother, plan, counts, tracker, window, scratch, keep, nonfinite, .. } = self;
        let connectivity = tracker.connectivity();
        let Some(mut pass) = passes.next(tracker.waits_for_the_end()) else { return Ok(()) };
        let mut first = 0;
        let mut waiting: Option<Found> = None;
        window.begin(pass.reads.start);
        let spare = window.rooms(0..needed(wave_rows.min(rows)));
        let mut read = reader.read(&pass, spare);
        loop {
            progress.check()?;
            for block in read? {
                *nonfinite += block.nonfinite;
                window.push(block);
            }
            let here = first..(first + wave_rows).min(rows);
            window.retire(here.start.saturating_sub(reach));
            // While these rows are filtered, what was found in those before is followed and what
            // comes next is read: three kinds of work that don't depend on each other.
            let (ends, mut ahead) = (here.end == rows, None);
            if ends {
                ahead = passes.next(tracker.waits_for_the_end());
            }
            let next_rows = match (ends, &ahead) {
                (false, _) if pass.reads.is_empty() => 0..0,
                (false, _) => window.end()..needed((here.end + wave_rows).min(rows)),
                (true, Some(ahead)) if !ahead.reads.is_empty() => 0..needed(wave_rows.min(rows)),
                (true, _) => 0..0,
            };
            let spare = window.rooms(next_rows);
            let found = waiting.take();
            let mut kept = None;
            if filtered.is_some() {
                keep.resize(pass.steps() * pixels, 0.0);
                kept = Some(&mut keep[..]);
            }
            let (followed, (slabs, next)) = rayon::join(
                || found.map_or(Ok(0), |found| found.follow(tracker, plan)),
                || {
                    rayon::join(
                        || {
                            let (parts, batch) = (&pass.parts, plan.batch);
                            let rows = here.clone();
                            Wave { smoother, window, parts, rows, batch, connectivity }
                                .run(counts, kept, scratch)
                        },
                        || reader.read(ahead.as_ref().unwrap_or(&pass), spare),
                    )
                },
            );
            progress.advance(followed?);
            read = next;
            let begins = (first == 0).then(|| pass.parts.clone());
            waiting = Some(Found { slabs, begins, ends: ends.then(|| pass.steps()) });
            first = here.end;
            if !ends {
                continue;
            }
            if let Some(filtered) = &mut filtered {
                let steps = pass.parts.iter().flat_map(|part| part.steps.clone());
                for (timestep, slice) in steps.zip(keep.chunks_exact(pixels)) {
                    filtered(timestep, slice).map_err(Error::Filtered)?;
                }
            }
            let Some(ahead) = ahead else { break };
            (pass, first) = (ahead, 0);
            window.begin(pass.reads.start);
        }
        let found = waiting.map_or(Ok(0), |found| found.follow(tracker, plan));
        progress.advance(found?);
        Ok(())
    }

    /// Checks that segments follow what was pushed so far.
    fn follow(&mut self, segments: &[Range<usize>]) -> Result<(), Error> {
        for segment in segments {
            let (start, end) = (segment.start, segment.end);
            if start != self.next || end <= start || end > self.shape[0] {
                return Err(self.misplaced(start, end));
            }
            self.segments += 1;
            self.next = end;
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
        let pixels = self.counts.pixels();
        // All are bounded by MAX_TIMESTEPS.
        let counts = |of: &mut dyn Iterator<Item = u32>| {
            Grid::from_vec(columns, rows, of.map(|n| n as i32).collect())
        };
        let sustained = durations.sustained().zip(pixels).map(|(a, pixel)| a.max(pixel.sustained));
        let sustained = counts(&mut sustained.into_iter());
        drop(durations);
        let cumulative = counts(&mut pixels.iter().map(|pixel| pixel.cumulative));
        let longest_run = counts(&mut pixels.iter().map(|pixel| pixel.longest_run));
        let (mut days, mut longest_day, mut cumulative_h) = (None, None, None);
        if let Some(yearly) = self.counts.yearly() {
            let grid = |data| Grid::from_vec(columns, rows, data);
            days = Some(grid(yearly.iter().map(|pixel| pixel.days).collect()));
            longest_day = Some(grid(yearly.iter().map(|pixel| pixel.longest_day).collect()));
            let hours = yearly.iter().map(|pixel| pixel.hours as f32).collect();
            cumulative_h = Some(Grid::from_vec(columns, rows, hours));
        }
        Ok(Analysis {
            cumulative,
            sustained,
            longest_run,
            days,
            longest_day,
            cumulative_h,
            events,
            nonfinite: self.nonfinite,
        })
    }
}

/// Reads rows of tiles.
struct Reader<'a> {
    source: &'a dyn Slices,
    allow_nonfinite: bool,
}

impl Reader<'_> {
    /// Reads rows of tiles at the timesteps of a pass, into room for each of them.
    fn read(&self, pass: &Pass, rooms: Vec<(Range<usize>, Block)>) -> Result<Vec<Block>, Error> {
        if pass.reads.is_empty() {
            return Ok(Vec::new());
        }
        let read = |(rows, block): (Range<usize>, Block)| {
            block.read(self.source, pass.reads.clone(), rows, self.allow_nonfinite)
        };
        // Of several errors the topmost is told, whatever the threads.
        let all: Vec<_> = rooms.into_par_iter().with_max_len(1).map(read).collect();
        all.into_iter().collect()
    }
}

/// What was found in a wave.
struct Found {
    slabs: Vec<Vec<Slab>>,
    /// The parts of its pass, if it is the first wave.
    begins: Option<Vec<Part>>,
    /// How many timesteps the pass had, if it is the last wave.
    ends: Option<usize>,
}

impl Found {
    /// Follows events through the wave; how many timesteps are done by that.
    fn follow(self, tracker: &mut Tracker, plan: &Plan) -> Result<u64, Error> {
        if let Some(parts) = &self.begins {
            tracker.begin(parts);
        }
        for slabs in self.slabs {
            tracker.add(slabs).map_err(Error::Spill)?;
            let found = tracker.bytes() as u64;
            if found > plan.events_bytes {
                return Err(Error::Events {
                    timestep: tracker.timestep(),
                    found_mib: found >> 20,
                    allowed_mib: plan.events_bytes >> 20,
                });
            }
        }
        if self.ends.is_some() {
            tracker.end().map_err(Error::Spill)?;
        }
        Ok(self.ends.unwrap_or(0) as u64)
    }
}
