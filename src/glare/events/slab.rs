//! Slabs: what is found in a strip of rows at some timesteps, reduced to what its surroundings need.
//!
//! The problem: joining row runs to events and counting how long each pixel is in each event is
//! sequential at heart, since whoever comes later may join what was two events so far; and its tables
//! cover the picture, so that each run misses the cache.
//!
//! The idea: cut the volume into boxes of one strip and one part, label each box by itself, a thread
//! each, while its runs are in the nearest cache, and forget whatever can't be seen from outside. A
//! group of connected runs that touches no face of the box is an event, finished. What touches a face
//! is *open*: the box keeps the runs at its faces, what is known of each open group, and how long each
//! pixel is in it. `track` joins the boxes, whose faces are all it looks at; what happens inside of a
//! box reaches it finished.
//!
//! Inside of a box the runs are joined by union-find in the order of timesteps and rows
//! (two-pass labelling by runs: He, Chao & Suzuki 2008, "A run-based two-scan labeling algorithm"),
//! the lowest number standing for the group, so that numbers follow the order of the volume.
//! Then pixels are counted row by row: all timesteps of a row before the next row, so that what is
//! known of the row stays in the nearest cache.

use std::ops::Range;

use super::counts::StripCounts;
use super::event::{Event, Growing};
use super::label::find;
use super::threshold::{RowRun, Span, touching};
use crate::glare::filter::part::Part;
use crate::glare::settings::Connectivity;

/// No number: of a group that reaches no face, of a column in no group.
const NONE: u32 = u32::MAX;

/// What lies above the threshold in a strip of rows at the consecutive timesteps of one [`Part`],
/// as far as it matters to what lies around it: runs at the faces of this box, and the groups of
/// connected voxels that reach a face. Groups that don't are glare events already.
#[derive(Debug)]
pub(in crate::glare) struct Slab {
    /// The rows.
    pub rows: Range<usize>,
    /// Runs of the first timestep, where the segment began before.
    pub first: Face,
    /// Runs of the last timestep, where the segment goes on.
    pub last: Face,
    /// Runs of the topmost row at each timestep, where there are rows above.
    pub top: Vec<Face>,
    /// Runs of the lowest row at each timestep, where there are rows below.
    pub bottom: Vec<Face>,
    /// The groups that reach a face; their pixels aren't counted.
    pub open: Vec<Growing>,
    /// How long pixels are in those groups; no pair of pixel and group comes twice.
    pub stays: Vec<Stay>,
    /// Events that begin and end in this box.
    pub events: Vec<Event>,
}

/// Runs, sorted by row and column, and the group of each.
#[derive(Clone, Debug, Default)]
pub(in crate::glare) struct Face {
    pub runs: Vec<Span>,
    pub groups: Vec<u32>,
}

/// A pixel is in a group for so many timesteps.
#[derive(Clone, Copy, Debug)]
pub(in crate::glare) struct Stay {
    pub pixel: u32,
    pub group: u32,
    pub count: u32,
}

/// Buffers of one thread.
#[derive(Debug, Default)]
pub(in crate::glare) struct Scratch {
    /// For each timestep and row where its runs begin.
    starts: Vec<u32>,
    runs: Vec<RowRun>,
    /// For each run one of the same group with a lower number, or itself; then its group.
    parents: Vec<u32>,
    groups: Vec<Group>,
    /// For each column of the row that is counted, its stay in the group it was in last.
    latest: Vec<ColumnStay>,
    /// Stays of columns in other groups, before.
    earlier: Vec<ColumnStay>,
    /// How long pixels are in groups that reach a face.
    stays: Vec<Stay>,
}

#[derive(Debug)]
struct Group {
    growing: Growing,
    /// Its number among those that reach a face.
    open: Option<u32>,
}

/// A column is in a group for so many timesteps.
#[derive(Clone, Copy, Debug)]
struct ColumnStay {
    group: u32,
    count: u32,
    /// The column's stay in another group: a number among the earlier ones.
    before: u32,
}

impl ColumnStay {
    const NOWHERE: Self = Self { group: NONE, count: 0, before: NONE };
}

/// Where a slab lies in the volume.
#[derive(Debug)]
pub(in crate::glare) struct Place<'a> {
    pub part: &'a Part,
    pub rows: Range<usize>,
    /// Rows and columns of the picture.
    pub picture: [usize; 2],
    pub connectivity: Connectivity,
}

impl Slab {
    /// Joins the runs of a strip (`found`, for each timestep), and counts how long each pixel is
    /// above the threshold.
    pub fn new(
        found: Vec<Vec<RowRun>>,
        place: &Place<'_>,
        counts: &mut StripCounts<'_>,
        scratch: &mut Scratch,
    ) -> Self {
        let steps = found.len();
        scratch.gather(found, &place.rows);
        scratch.join(steps, place.rows.len(), place.connectivity);
        let reaches = Reaches::new(place);
        scratch.number(place, &reaches);
        scratch.count(place, counts);
        let height = place.rows.len();
        let of_step = |step: usize| scratch.face(step * height..(step + 1) * height);
        let of_row = |row: usize| move |step: usize| step * height + row..step * height + row + 1;
        let of_rows = |reaches: bool, row: usize| -> Vec<Face> {
            let steps = if reaches { 0..steps } else { 0..0 };
            steps.map(of_row(row)).map(|lines| scratch.face(lines)).collect()
        };
        let first = if reaches.before { of_step(0) } else { Face::default() };
        let last = if reaches.after { of_step(steps - 1) } else { Face::default() };
        let (top, bottom) = (of_rows(reaches.above, 0), of_rows(reaches.below, height - 1));
        let [rows, columns] = place.picture.map(|n| n as u64);
        let opened = scratch.groups.iter().filter(|group| group.open.is_some()).count();
        let mut open = Vec::with_capacity(opened);
        let mut events = Vec::with_capacity(scratch.groups.len() - opened);
        for group in &scratch.groups {
            match group.open {
                Some(_) => open.push(group.growing),
                None => events.push(group.growing.finished(rows, columns)),
            }
        }
        let next = Vec::with_capacity(scratch.stays.len());
        let stays = std::mem::replace(&mut scratch.stays, next);
        Self { rows: place.rows.clone(), first, last, top, bottom, open, stays, events }
    }
}

/// Through which faces something may go on.
struct Reaches {
    before: bool,
    after: bool,
    above: bool,
    below: bool,
}

impl Reaches {
    fn new(place: &Place<'_>) -> Self {
        let Part { steps, segment, .. } = place.part;
        Self {
            before: steps.start > segment.start,
            after: steps.end < segment.end,
            above: place.rows.start > 0,
            below: place.rows.end < place.picture[0],
        }
    }
}

impl Scratch {
    /// Takes what was found; what is copied goes at once, so that it isn't there twice.
    fn gather(&mut self, found: Vec<Vec<RowRun>>, rows: &Range<usize>) {
        self.runs.clear();
        self.starts.clear();
        for strip in found {
            let (base, mut at) = (self.runs.len(), 0);
            for row in rows.clone() {
                // A slab has fewer than 2^32 voxels.
                self.starts.push((base + at) as u32);
                while strip.get(at).is_some_and(|run| run.row as usize == row) {
                    at += 1;
                }
            }
            self.runs.extend_from_slice(&strip);
        }
        self.starts.push(self.runs.len() as u32);
    }

    /// The runs of a row at a timestep of `height` rows.
    fn line(&self, line: usize) -> Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }

    fn join(&mut self, steps: usize, height: usize, connectivity: Connectivity) {
        let (above, behind, beside) = connectivity.gaps();
        self.parents.clear();
        self.parents.extend(0..self.runs.len() as u32);
        for line in 0..steps * height {
            let here = self.line(line);
            if here.is_empty() {
                continue;
            }
            let (step, row) = (line / height, line % height);
            if row > 0 {
                self.link(&here, line - 1, above);
            }
            if step == 0 {
                continue;
            }
            self.link(&here, line - height, behind);
            let Some(beside) = beside else { continue };
            if row > 0 {
                self.link(&here, line - height - 1, beside);
            }
            if row + 1 < height {
                self.link(&here, line - height + 1, beside);
            }
        }
    }

    fn link(&mut self, here: &Range<usize>, line: usize, gap: u32) {
        let there = self.line(line);
        let Self { runs, parents, .. } = self;
        touching(&runs[here.clone()], &runs[there.clone()], gap, |a, b| {
            let a = find(parents, (here.start + a) as u32);
            let b = find(parents, (there.start + b) as u32);
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            parents[high as usize] = low;
        });
    }

    /// Numbers the groups, sums up what is known of them, and tells which reach a face.
    fn number(&mut self, place: &Place<'_>, reaches: &Reaches) {
        let Self { starts, runs, parents, groups, .. } = self;
        groups.clear();
        let [rows, columns] = place.picture.map(|n| n as u64);
        let height = place.rows.len();
        let steps = place.part.steps.clone();
        for (step, timestep) in steps.clone().enumerate() {
            let end = (reaches.before && step == 0) || (reaches.after && step + 1 == steps.len());
            let slice = timestep as u64 * rows * columns;
            let lines = starts[step * height] as usize..starts[(step + 1) * height] as usize;
            for at in lines {
                let run = &runs[at];
                // Parents have lower numbers: they know their groups already.
                let group = match parents[at] as usize {
                    own if own == at => {
                        let growing = Growing::new(timestep as u32);
                        groups.push(Group { growing, open: None });
                        groups.len() as u32 - 1
                    }
                    parent => parents[parent],
                };
                parents[at] = group;
                let row = run.row as usize;
                let edge = (reaches.above && row == place.rows.start)
                    || (reaches.below && row + 1 == place.rows.end);
                let group = &mut groups[group as usize];
                group.growing.add(run, timestep as u32, slice, columns);
                if end || edge {
                    group.open = Some(NONE);
                }
            }
        }
        for (number, open) in (0..).zip(groups.iter_mut().filter_map(|g| g.open.as_mut())) {
            *open = number;
        }
    }

    /// Counts, row by row, so that all that is known of a row stays in the nearest cache.
    fn count(&mut self, place: &Place<'_>, counts: &mut StripCounts<'_>) {
        self.latest.resize(place.picture[1], ColumnStay::NOWHERE);
        for row in 0..place.rows.len() {
            let touched = self.count_row(row, place, counts);
            if !touched.is_empty() {
                self.settle_row(row, touched, place, counts);
            }
        }
    }

    /// Goes through all timesteps of a row: at each pixel, its counts, and how long it is in which
    /// group. The columns between the first and the last that were touched.
    fn count_row(
        &mut self,
        row: usize,
        place: &Place<'_>,
        counts: &mut StripCounts<'_>,
    ) -> Range<usize> {
        let (height, columns) = (place.rows.len(), place.picture[1]);
        let base = row * columns;
        let mut touched = columns..0;
        for (step, timestep) in place.part.steps.clone().enumerate() {
            let clock = place.part.clock(timestep);
            for at in self.line(step * height + row) {
                let (run, group) = (&self.runs[at], self.parents[at]);
                let (start, end) = (run.start as usize, run.end as usize);
                touched = touched.start.min(start)..touched.end.max(end);
                let pixels = &mut counts.pixels[base + start..base + end];
                for (latest, pixel) in self.latest[start..end].iter_mut().zip(pixels) {
                    pixel.touch(clock);
                    if latest.group == group {
                        latest.count += 1;
                    } else {
                        enter(latest, group, &mut self.earlier);
                    }
                }
                counts.touch_yearly(timestep, base + start..base + end);
            }
        }
        touched
    }

    /// The stays of a row's columns are complete: those in open groups are kept, of the others the
    /// longest counts.
    fn settle_row(
        &mut self,
        row: usize,
        touched: Range<usize>,
        place: &Place<'_>,
        counts: &mut StripCounts<'_>,
    ) {
        let Self { groups, latest, earlier, stays, .. } = self;
        let base = row * place.picture[1];
        for column in touched {
            let mut stay = std::mem::replace(&mut latest[column], ColumnStay::NOWHERE);
            while stay.group != NONE {
                let group = &mut groups[stay.group as usize];
                if let Some(group) = group.open {
                    // Pixels are bounded by MAX_VIEW_PIXELS.
                    let pixel = (place.rows.start * place.picture[1] + base + column) as u32;
                    stays.push(Stay { pixel, group, count: stay.count });
                } else {
                    group.growing.pixels += 1;
                    let pixel = &mut counts.pixels[base + column];
                    pixel.sustained = pixel.sustained.max(stay.count);
                }
                let before = earlier.get(stay.before as usize);
                stay = before.copied().unwrap_or(ColumnStay::NOWHERE);
            }
        }
        earlier.clear();
    }

    /// The runs of some lines, with the numbers of their groups among those that reach a face.
    fn face(&self, lines: Range<usize>) -> Face {
        let runs = self.starts[lines.start] as usize..self.starts[lines.end] as usize;
        let open = |group: &u32| self.groups[*group as usize].open.unwrap_or(NONE);
        Face {
            groups: self.parents[runs.clone()].iter().map(open).collect(),
            runs: self.runs[runs].iter().map(RowRun::span).collect(),
        }
    }
}

/// A column leaves the group that it was in for another one, where it may have been before.
#[inline(never)]
fn enter(latest: &mut ColumnStay, group: u32, earlier: &mut Vec<ColumnStay>) {
    if latest.group != NONE {
        let mut at = latest.before;
        while let Some(stay) = earlier.get_mut(at as usize) {
            if stay.group == group {
                std::mem::swap(&mut stay.group, &mut latest.group);
                std::mem::swap(&mut stay.count, &mut latest.count);
                latest.count += 1;
                return;
            }
            at = stay.before;
        }
        let number = earlier.len() as u32;
        earlier.push(*latest);
        latest.before = number;
    }
    (latest.group, latest.count) = (group, 1);
}
