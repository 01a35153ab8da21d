//! Events followed from slab to slab.
//!
//! Slabs come strip by strip from the top, and on in time. Where open groups of a slab touch what was
//! there before (the lowest row of the strip above, the last timestep of the batch before) they join its
//! events; groups that touch nothing known get a number. An event that isn't in the last timestep of
//! its batch is over when the batch is, since whatever could join it would have to go through there.
//! All of this is sequential; only what crosses the faces of slabs takes part in it.

use std::io;

use super::duration::{Alive, Durations};
use super::label::{Labelled, Labels};
use super::list::Events;
use super::paged::Paged;
use super::slab::{Face, Slab};
use super::threshold::{Span, touching};
use crate::glare::filter::part::Part;
use crate::glare::settings::{Connectivity, Settings};

const NONE: u32 = u32::MAX;

/// Follows glare from slab to slab: events that are alive, how long each pixel is in them, and
/// the events that are over.
///
/// A batch is what is found of one [`Part`] of a segment; it comes strip by strip from the top,
/// and several parts may be on their way at once.
#[derive(Debug)]
pub(in crate::glare) struct Tracker {
    rows: usize,
    columns: usize,
    connectivity: Connectivity,
    /// Batches that were begun.
    batches: u32,
    /// The last timestep of the batch before, where its segment goes on.
    before: Labelled,
    parts: Vec<Ongoing>,
    labels: Labels,
    alive: Vec<Alive>,
    /// For each number the batch in which it was seen last at the end, or ended.
    seen: Vec<u32>,
    pub durations: Durations,
    pub events: Events,
    paged: Paged,
    /// Bytes that visits may take before they are paged out.
    visit_bytes: u64,
    /// Aliases that are tolerated before they are cleared away.
    max_aliases: usize,
}

/// A batch some of whose strips were added.
#[derive(Debug)]
struct Ongoing {
    number: u32,
    /// First timestep.
    first: usize,
    /// Whether the segment began before this batch.
    goes_on: bool,
    /// Whether the segment ends with this batch.
    ends: bool,
    /// For each timestep the lowest row of the strip above, with the numbers of its events.
    above: Vec<Face>,
    /// The last timestep, where the segment goes on.
    newest: Labelled,
    /// Numbers that were handed out.
    created: Vec<u32>,
}

impl Tracker {
    pub fn new(rows: usize, columns: usize, settings: &Settings, spill_bytes: u64) -> Self {
        // One half for visits, a quarter for what is paged out, little for the list of events,
        // which grows with the year and is written in one piece after the other.
        let quarter = spill_bytes / 4;
        Self {
            rows,
            columns,
            connectivity: settings.connectivity,
            batches: 0,
            before: Labelled::default(),
            parts: Vec::new(),
            labels: Labels::default(),
            alive: Vec::new(),
            seen: Vec::new(),
            durations: Durations::new(rows * columns),
            events: Events::new(quarter / 4, settings.spill.clone()),
            paged: Paged::new(quarter, settings.spill.clone()),
            visit_bytes: 2 * quarter,
            // An alias takes as much as an event, and taking them back goes through all pixels.
            max_aliases: (rows * columns / 256).max(1 << 12),
        }
    }

    /// Whether something lies on the disk that waits for the end of its segment.
    pub fn waits_for_the_end(&self) -> bool {
        !self.paged.is_empty()
    }

    /// Which voxels are neighbours.
    pub fn connectivity(&self) -> Connectivity {
        self.connectivity
    }

    /// The first timestep of what is on its way.
    pub fn timestep(&self) -> usize {
        self.parts.first().map_or(0, |part| part.first)
    }

    /// Begins the batches of parts that follow each other.
    pub fn begin(&mut self, parts: &[Part]) {
        for part in parts {
            self.batches += 1;
            self.parts.push(Ongoing {
                number: self.batches,
                first: part.steps.start,
                goes_on: part.steps.start > part.segment.start,
                ends: part.steps.end == part.segment.end,
                above: Vec::new(),
                newest: Labelled::default(),
                created: Vec::new(),
            });
        }
    }

    /// The next strip: a slab for each part.
    ///
    /// # Errors
    /// A disk to which nothing can be spilled.
    pub fn add(&mut self, slabs: Vec<Slab>) -> io::Result<()> {
        for (number, slab) in slabs.into_iter().enumerate() {
            self.add_slab(number, slab)?;
            if self.durations.visit_bytes() as u64 > self.visit_bytes {
                self.durations.page_out(&mut self.labels, &mut self.alive, &mut self.paged)?;
            }
            if self.labels.aliases() > self.max_aliases {
                self.clear_aliases();
            }
        }
        Ok(())
    }

    fn add_slab(&mut self, number: usize, mut slab: Slab) -> io::Result<()> {
        for event in std::mem::take(&mut slab.events) {
            self.events.push(event)?;
        }
        let mut known = vec![NONE; slab.open.len()];
        self.meet_before(number, &slab, &mut known);
        self.meet_above(number, &slab, &mut known);
        let Self { labels, alive, seen, durations, parts, .. } = self;
        let part = &mut parts[number];
        for (label, growing) in known.iter_mut().zip(&slab.open) {
            if *label == NONE {
                *label = labels.create(part.number);
                part.created.push(*label);
                let fresh = Alive::new(*growing);
                match alive.get_mut(*label as usize) {
                    Some(old) => *old = fresh,
                    None => alive.push(fresh),
                }
            } else {
                *label = labels.find(*label);
                alive[*label as usize].growing.merge(growing);
            }
        }
        seen.resize(labels.len(), 0);
        for stay in &slab.stays {
            let root = known[stay.group as usize];
            durations.stay(stay, part.number, root, labels, alive);
        }
        let label = |faces: &mut Face| {
            faces.groups.iter_mut().for_each(|group| *group = known[*group as usize]);
        };
        label(&mut slab.last);
        slab.bottom.iter_mut().for_each(label);
        if !part.ends {
            part.newest.extend(slab.rows, &slab.last.runs, &slab.last.groups);
        }
        part.above = slab.bottom;
        Ok(())
    }

    /// What touches the timestep before the batch.
    fn meet_before(&mut self, number: usize, slab: &Slab, known: &mut [u32]) {
        if !self.parts[number].goes_on {
            return;
        }
        let (_, behind, beside) = self.connectivity.gaps();
        for (row, start, end) in rows_of(&slab.first.runs) {
            let runs = &slab.first.runs[start..end];
            let mut near = vec![(Some(row), behind)];
            if let Some(beside) = beside {
                near.extend([(row.checked_sub(1), beside), (Some(row + 1), beside)]);
            }
            for (row, gap) in near {
                let there = self.before.row(row);
                let Self { before, labels, alive, durations, paged, .. } = self;
                let mut meeting = Meeting { labels, alive, durations, paged };
                touching(runs, &before.runs[there.clone()], gap, |mine, theirs| {
                    let group = slab.first.groups[start + mine] as usize;
                    meeting.meet(&mut known[group], before.labels[there.start + theirs]);
                });
            }
        }
    }

    /// What touches the strip above.
    fn meet_above(&mut self, number: usize, slab: &Slab, known: &mut [u32]) {
        let (above, _, beside) = self.connectivity.gaps();
        let faces = std::mem::take(&mut self.parts[number].above);
        for (step, top) in slab.top.iter().enumerate() {
            let mut near = vec![(Some(step), above)];
            if let Some(beside) = beside {
                near.extend([(step.checked_sub(1), beside), (Some(step + 1), beside)]);
            }
            for (step, gap) in near {
                let Some(face) = step.and_then(|step| faces.get(step)) else { continue };
                let Self { labels, alive, durations, paged, .. } = self;
                let mut meeting = Meeting { labels, alive, durations, paged };
                touching(&top.runs, &face.runs, gap, |mine, theirs| {
                    let group = top.groups[mine] as usize;
                    meeting.meet(&mut known[group], face.groups[theirs]);
                });
            }
        }
    }

    /// All strips of the batches were added: ends the events that aren't in the last timestep of
    /// their batch any more, since whatever joins an event later would have to do so through it.
    ///
    /// # Errors
    /// A disk to which nothing can be spilled.
    pub fn end(&mut self) -> io::Result<()> {
        let mut over = Vec::new();
        let mut ends = false;
        for part in std::mem::take(&mut self.parts) {
            for &label in &part.newest.labels {
                let root = self.labels.find(label);
                self.seen[root as usize] = part.number;
            }
            let before = std::mem::replace(&mut self.before, part.newest);
            let went_on: &[u32] = if part.goes_on { &before.labels } else { &[] };
            for &label in went_on.iter().chain(&part.created) {
                let root = self.labels.find(label);
                if self.seen[root as usize] == part.number {
                    continue;
                }
                self.seen[root as usize] = part.number;
                self.finish(root)?;
                over.push(root);
            }
            ends = part.ends;
        }
        for root in over {
            self.labels.release(root);
        }
        if ends {
            let Self { paged, durations, .. } = self;
            for event in paged.settle(|pixel, count| durations.bring_back(pixel, count))? {
                self.events.push(event.finished(self.rows as u64, self.columns as u64))?;
            }
        }
        Ok(())
    }

    /// An event is over.
    fn finish(&mut self, root: u32) -> io::Result<()> {
        let Self { labels, alive, paged, .. } = self;
        self.durations.settle(root, labels, alive, paged)?;
        let Alive { growing, serial, .. } = &alive[root as usize];
        match serial {
            Some(serial) => paged.end(*serial, *growing),
            None => {
                self.events.push(growing.finished(self.rows as u64, self.columns as u64))?;
            }
        }
        Ok(())
    }

    fn clear_aliases(&mut self) {
        let Self { labels, before, parts, .. } = self;
        let mut replace = |list: &mut [u32]| {
            list.iter_mut().for_each(|label| *label = labels.find(*label));
        };
        replace(&mut before.labels);
        for part in parts {
            replace(&mut part.newest.labels);
            part.above.iter_mut().for_each(|face| replace(&mut face.groups));
            replace(&mut part.created);
            part.created.sort_unstable();
            part.created.dedup();
        }
        self.durations.without_aliases(&mut self.labels);
        self.labels.compact();
    }

    /// Bytes in memory beyond those of the pixels and of what can be spilled.
    pub fn bytes(&self) -> usize {
        let run = size_of::<Span>() + size_of::<u32>();
        let runs = |part: &Ongoing| {
            let above: usize = part.above.iter().map(|face| face.runs.capacity()).sum();
            (above + part.newest.runs.capacity()) * run + part.created.capacity() * 4
        };
        self.durations.bytes()
            + self.labels.bytes()
            + self.before.runs.capacity() * run
            + self.parts.iter().map(runs).sum::<usize>()
            + self.alive.capacity() * size_of::<Alive>()
            + self.seen.capacity() * size_of::<u32>()
            + self.paged.bytes()
    }
}

/// What changes where groups meet.
struct Meeting<'a> {
    labels: &'a mut Labels,
    alive: &'a mut [Alive],
    durations: &'a mut Durations,
    paged: &'a mut Paged,
}

impl Meeting<'_> {
    /// A group, which may have a number already, touches something of the event of `theirs`.
    fn meet(&mut self, mine: &mut u32, theirs: u32) {
        let theirs = self.labels.find(theirs);
        if *mine == NONE {
            *mine = theirs;
            return;
        }
        let own = self.labels.find(*mine);
        *mine = own;
        if own != theirs {
            let (kept, given_up) = self.labels.join(own, theirs);
            self.durations.join(self.alive, kept, given_up, self.paged);
            *mine = kept;
        }
    }
}

/// The rows of sorted runs: row, first run, one past the last.
fn rows_of(runs: &[Span]) -> impl Iterator<Item = (usize, usize, usize)> {
    let mut start = 0;
    runs.chunk_by(|a, b| a.row == b.row).map(move |row| {
        let first = start;
        start += row.len();
        (row[0].row as usize, first, start)
    })
}
