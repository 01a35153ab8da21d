use super::duration::{Alive, Durations};
use std::io;

use super::events::Events;
use super::label::{Change, Labelled, Labels, connect};
use super::paged::Paged;
use super::plan::Plan;
use super::settings::{Connectivity, Settings};
use super::slices::Calendar;
use super::threshold::Run;

/// Follows glare from slice to slice: events that are alive, how long each pixel is in them, and
/// the events that are over.
#[derive(Debug)]
pub(super) struct Tracker {
    rows: usize,
    columns: usize,
    connectivity: Connectivity,
    /// Counts timesteps; jumps where a segment begins, so that nothing goes on across it.
    clock: u32,
    before: Labelled,
    newest: Labelled,
    labels: Labels,
    alive: Vec<Alive>,
    /// Events that end with this slice.
    over: Vec<u32>,
    /// For each number when it was last seen in a slice.
    seen: Vec<u32>,
    pub durations: Durations,
    pub yearly: Option<Yearly>,
    pub events: Events,
    paged: Paged,
    /// Bytes that visits may take before they are paged out.
    visit_bytes: u64,
    /// Aliases that are tolerated before they are cleared away.
    max_aliases: usize,
}

impl Tracker {
    pub fn new(rows: usize, columns: usize, settings: &Settings, plan: &Plan) -> Self {
        // One half for visits, a quarter each for the list of events and what is paged out.
        let quarter = plan.spill_bytes / 4;
        Self {
            rows,
            columns,
            connectivity: settings.connectivity,
            // Later than 1: pixels that were never above the threshold have 0 as their last time.
            clock: 1,
            before: Labelled::default(),
            newest: Labelled::default(),
            labels: Labels::default(),
            alive: Vec::new(),
            over: Vec::new(),
            seen: Vec::new(),
            durations: Durations::new(rows * columns),
            yearly: None,
            events: Events::new(quarter, settings.spill.clone()),
            paged: Paged::new(quarter, settings.spill.clone()),
            visit_bytes: 2 * quarter,
            max_aliases: (rows * columns / 8).max(1 << 12),
        }
    }

    /// The next slice: all its runs above the threshold, strip by strip.
    ///
    /// # Errors
    /// A disk to which nothing can be spilled.
    pub fn slice<'a>(
        &mut self,
        timestep: usize,
        strips: impl Iterator<Item = &'a Vec<Run>>,
    ) -> io::Result<()> {
        self.clock += 1;
        let clock = self.clock;
        // Bounded by MAX_TIMESTEPS.
        let timestep_u32 = timestep as u32;
        std::mem::swap(&mut self.before, &mut self.newest);
        self.newest.set(self.rows, strips);
        let Self { labels, alive, seen, durations, before, newest, paged, .. } = self;
        connect(before, newest, self.connectivity, labels, clock, |change| match change {
            Change::Created(label) => {
                let fresh = Alive::new(timestep_u32);
                match alive.get_mut(label as usize) {
                    Some(old) => *old = fresh,
                    None => alive.push(fresh),
                }
            }
            Change::Joined { kept, given_up } => {
                durations.join(alive, kept, given_up, paged);
            }
        });
        seen.resize(labels.len(), 0);
        let columns = self.columns as u64;
        let slice = timestep as u64 * self.rows as u64 * columns;
        for (run, label) in newest.runs.iter().zip(&mut newest.labels) {
            *label = labels.find(*label);
            seen[*label as usize] = clock;
            let growing = &mut alive[*label as usize].growing;
            growing.add(run, timestep_u32, slice, columns);
            durations.touch(run, self.columns, clock, *label, labels, alive);
        }
        if let Some(yearly) = &mut self.yearly {
            for run in &newest.runs {
                let row = run.row as usize * self.columns;
                yearly.touch(timestep, row + run.start as usize..row + run.end as usize);
            }
        }
        self.end_events_not_in_newest()?;
        if self.durations.visit_bytes() as u64 > self.visit_bytes {
            self.durations.page_out(&mut self.labels, &mut self.alive, &mut self.paged)?;
        }
        if self.labels.aliases() > self.max_aliases {
            self.clear_aliases();
        }
        Ok(())
    }

    /// Nothing crosses the border of a segment.
    ///
    /// # Errors
    /// A disk to which nothing can be spilled.
    pub fn end_segment(&mut self) -> io::Result<()> {
        self.clock += 1;
        std::mem::swap(&mut self.before, &mut self.newest);
        self.newest.clear();
        self.end_events_not_in_newest()?;
        for event in self.paged.settle(&mut self.durations)? {
            self.events.push(event.finished(self.rows as u64, self.columns as u64))?;
        }
        Ok(())
    }

    /// Ends the events that the slice before had and the newest doesn't: whatever joins an event
    /// later would have to do so through the newest slice.
    fn end_events_not_in_newest(&mut self) -> io::Result<()> {
        for &label in &self.before.labels {
            let root = self.labels.find(label);
            if self.seen[root as usize] == self.clock {
                continue;
            }
            let Self { labels, alive, paged, .. } = self;
            self.durations.settle(root, labels, alive, paged)?;
            let Alive { growing, serial, .. } = &alive[root as usize];
            match serial {
                Some(serial) => paged.end(*serial, *growing),
                None => {
                    self.events.push(growing.finished(self.rows as u64, self.columns as u64))?;
                }
            }
            self.seen[root as usize] = self.clock;
            self.over.push(root);
        }
        for root in self.over.drain(..) {
            self.labels.release(root);
        }
        Ok(())
    }

    fn clear_aliases(&mut self) {
        for label in &mut self.newest.labels {
            *label = self.labels.find(*label);
        }
        self.durations.without_aliases(&mut self.labels);
        self.labels.compact();
    }

    /// Bytes in memory beyond those of the pixels and of what can be spilled.
    pub fn bytes(&self) -> usize {
        let run = size_of::<Run>() + size_of::<u32>();
        self.durations.bytes()
            + self.labels.bytes()
            + (self.before.runs.capacity() + self.newest.runs.capacity()) * run
            + self.alive.capacity() * size_of::<Alive>()
            + self.seen.capacity() * size_of::<u32>()
            + self.paged.bytes()
    }
}

/// What pixels collect where the volume has a calendar.
#[derive(Debug)]
pub(super) struct Yearly {
    calendar: Calendar,
    /// Days with glare.
    pub days: Vec<i32>,
    /// The most timesteps above the threshold on one day.
    pub longest_day: Vec<i32>,
    /// Hours of the year above the threshold.
    pub hours: Vec<f64>,
    today: Vec<i32>,
    /// The day after the one that `today` counts; 0 before the first.
    day_after: Vec<u32>,
}

impl Yearly {
    /// Bytes for each pixel.
    pub const BYTES_PER_PIXEL: u64 = 24;

    pub fn new(calendar: Calendar, pixels: usize) -> Self {
        Self {
            calendar,
            days: vec![0; pixels],
            longest_day: vec![0; pixels],
            hours: vec![0.0; pixels],
            today: vec![0; pixels],
            day_after: vec![0; pixels],
        }
    }

    fn touch(&mut self, timestep: usize, pixels: std::ops::Range<usize>) {
        let day_after = self.calendar.day[timestep].saturating_add(1);
        let weight_h = self.calendar.weight_h[timestep];
        for pixel in pixels {
            if self.day_after[pixel] != day_after {
                self.day_after[pixel] = day_after;
                self.today[pixel] = 0;
                self.days[pixel] += 1;
            }
            self.today[pixel] += 1;
            self.longest_day[pixel] = self.longest_day[pixel].max(self.today[pixel]);
            self.hours[pixel] += weight_h;
        }
    }
}
