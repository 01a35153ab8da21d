use std::io;
use std::ops::Range;

use super::error::Error;
use super::event::Event;
use super::plan::{Demand, Plan};
use super::settings::Settings;
use super::slices::Slices;
use super::smooth::{Batch, Smoother, Strip};
use super::track::{Tracker, Yearly};
use super::window::{Block, Window};
use crate::base::{Grid, Progress, limits};

/// Takes the filtered volume, slice by slice: timestep and `[row, column]` in W/m2.
pub type Filtered<'a> = &'a mut dyn FnMut(usize, &[f32]) -> io::Result<()>;

/// What the analysis found. Grids are `[row, column]`, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
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
    /// All events, sorted by first and last timestep, voxels, pixels and smallest voxel.
    pub events: Vec<Event>,
    /// How many voxels of the volume are NaN or infinite.
    pub nonfinite: u64,
}

/// Analyses a volume: smooths it, segment by segment, and finds what lies above the threshold.
///
/// `segments` follow each other without gaps and cover all timesteps. The list of events is the
/// only thing in memory that grows with the year; it counts against the memory limit.
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
    let shape = checked_shape(volume)?;
    let smoother = smoother(settings)?;
    let chunk = volume.chunk_timesteps();
    Demand::new(shape, &smoother, chunk, volume.calendar().is_some(), keep).plan(settings)
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
    mut filtered: Option<Filtered<'_>>,
    progress: &dyn Progress,
) -> Result<Analysis, Error> {
    let [timesteps, rows, columns] = checked_shape(volume)?;
    check_segments(segments, timesteps)?;
    let smoother = smoother(settings)?;
    let pixels = rows * columns;
    let (step, block) = (plan.batch.max(1), plan.block.max(1));
    let batches = batches(segments, step);

    let mut tracker = Tracker::new(rows, columns, settings.connectivity);
    if let Some(calendar) = volume.calendar() {
        let found = calendar.day.len().min(calendar.weight_h.len());
        if found != timesteps {
            return Err(Error::Calendar { found, timesteps });
        }
        tracker.yearly = Some(Yearly::new(calendar, pixels));
    }
    let mut reader = Reader {
        volume,
        step: block,
        timesteps,
        next: 0,
        allow_nonfinite: settings.allow_nonfinite,
    };
    let mut window = Window::new(rows, columns, block);
    let mut keep = vec![0.0; if filtered.is_some() { pixels * step } else { 0 }];
    let mut nonfinite = 0;
    let mut waiting: Option<(Batch, Vec<Strip>)> = None;
    let radius = smoother.t.radius();

    progress.begin("glare", timesteps as u64, "timesteps");
    // While a batch is filtered, the one before is labelled and what the next one needs is read:
    // three kinds of work that don't depend on each other.
    let mut read = reader.read(Vec::new(), batches.first().map_or(0, |b| b.sees(radius).end));
    for number in 0..=batches.len() {
        progress.check()?;
        for block in read? {
            nonfinite += block.nonfinite;
            window.push(block);
        }
        let batch = batches.get(number);
        if let Some(batch) = batch {
            window.forget_before(batch.sees(radius).start);
        }
        let ahead = batches.get(number + 1).map_or(0, |next| next.sees(radius).end);
        let spare = reader.spare(&mut window, ahead);
        let done = waiting.take();
        let kept = filtered.is_some().then_some(&mut keep);
        let (labelled, (strips, next)) = rayon::join(
            || done.map_or(Ok(0), |(batch, strips)| label(&mut tracker, &batch, &strips, plan)),
            || {
                rayon::join(
                    || {
                        batch.map(|batch| {
                            let kept = kept.map(|all| &mut all[..batch.steps.len() * pixels]);
                            (batch.clone(), smoother.run(&window, batch, kept))
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
    progress.finish();
    Ok(finished(tracker, rows, columns, nonfinite))
}

/// Reads blocks in order.
struct Reader<'a> {
    volume: &'a dyn Slices,
    step: usize,
    timesteps: usize,
    /// First timestep that wasn't read.
    next: usize,
    allow_nonfinite: bool,
}

impl Reader<'_> {
    /// Blocks to read into until `end`.
    fn spare(&self, window: &mut Window, end: usize) -> Vec<Block> {
        let blocks = end.saturating_sub(self.next).div_ceil(self.step);
        (0..blocks).map(|_| window.spare()).collect()
    }

    /// Reads all blocks that begin before `end`.
    fn read(&mut self, spare: Vec<Block>, end: usize) -> Result<Vec<Block>, Error> {
        let mut spare = spare.into_iter();
        let mut out = Vec::new();
        while self.next < end {
            let range = self.next..(self.next + self.step).min(self.timesteps);
            let block = spare.next().unwrap_or_default();
            self.next = range.end;
            out.push(block.read(self.volume, range, self.allow_nonfinite)?);
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
        tracker.slice(timestep, strips.iter().map(|strip| &strip[step]));
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
        tracker.end_segment();
    }
    Ok(batch.steps.len() as u64)
}

fn finished(tracker: Tracker, rows: usize, columns: usize, nonfinite: u64) -> Analysis {
    let grid = |data| Grid::from_vec(columns, rows, data);
    let Tracker { durations, yearly, mut events, .. } = tracker;
    Event::sort(&mut events);
    let (mut days, mut longest_day, mut cumulative_h) = (None, None, None);
    if let Some(yearly) = yearly {
        days = Some(grid(yearly.days));
        longest_day = Some(grid(yearly.longest_day));
        let hours = yearly.hours.iter().map(|h| *h as f32).collect();
        cumulative_h = Some(Grid::from_vec(columns, rows, hours));
    }
    Analysis {
        cumulative: grid(durations.cumulative),
        sustained: grid(durations.sustained),
        longest_run: grid(durations.longest_run),
        days,
        longest_day,
        cumulative_h,
        events,
        nonfinite,
    }
}

fn batches(segments: &[Range<usize>], step: usize) -> Vec<Batch> {
    let cut = |segment: &Range<usize>| {
        let (segment, end) = (segment.clone(), segment.end);
        segment.clone().step_by(step).map(move |start| Batch {
            segment: segment.clone(),
            steps: start..(start + step).min(end),
        })
    };
    segments.iter().flat_map(cut).collect()
}

fn smoother(settings: &Settings) -> Result<Smoother, Error> {
    let [t, y, x] = settings.kernels()?;
    Ok(Smoother { t, y, x, threshold: settings.threshold_f32()? })
}

fn checked_shape(volume: &dyn Slices) -> Result<[usize; 3], Error> {
    let shape @ [timesteps, rows, columns] = volume.shape();
    let pixels = rows.checked_mul(columns);
    let fits = pixels.is_some_and(|p| (1..=limits::MAX_VIEW_PIXELS).contains(&p))
        && (1..=limits::MAX_TIMESTEPS).contains(&timesteps);
    if fits { Ok(shape) } else { Err(Error::Shape(timesteps, rows, columns)) }
}

fn check_segments(segments: &[Range<usize>], timesteps: usize) -> Result<(), Error> {
    let mut expected = 0;
    for (index, segment) in segments.iter().enumerate() {
        let (start, end) = (segment.start, segment.end);
        if start != expected || end <= start || end > timesteps {
            return Err(Error::Segments { index, start, end, expected, timesteps });
        }
        expected = end;
    }
    if expected == timesteps {
        return Ok(());
    }
    let index = segments.len();
    Err(Error::Segments { index, start: expected, end: expected, expected, timesteps })
}
