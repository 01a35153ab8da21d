//! How long each pixel is in each event, while events may still turn out to be one.
//!
//! The measure of the paper is the most timesteps that a pixel spends in one event. A table of pixels
//! times events would hold it; but nearly every pixel is in one event at a time, so that a pixel notes
//! its newest event and a count, and only what doesn't fit into that costs a list.

use std::io;

use super::event::Growing;
use super::label::Labels;
use super::paged::Paged;
use super::slab::Stay;

/// No event, no visit.
const NONE: u32 = u32::MAX;
/// Stands for the newest event of a pixel some of whose visits were paged out: none. All its
/// events are visits then, so that an event finds them when it ends.
const PAGED: u32 = u32::MAX - 1;

/// How long each pixel was in each of the events that are alive. Events that begin and end in one
/// slab never come here.
///
/// A pixel notes its newest event and the count there. The other events that are alive and have
/// been at the pixel are *visits*: they hang on the pixel in one list and on their event in
/// another. When an event is over, the pixels of its visits are settled: counts of events that
/// merged since add up. Pixels without visits never need that.
#[derive(Debug)]
pub(in crate::glare) struct Durations {
    pixels: Vec<Pixel>,
    visits: Visits,
    /// The pixels that an event's end has to settle.
    settling: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Pixel {
    /// The most timesteps of one event.
    sustained: u32,
    /// The batch in which an event was at the pixel last; 0 if never.
    noted: u32,
    /// The newest event there; of use only while it's alive, see [`Pixel::newest`].
    label: u32,
    /// Timesteps of that event.
    count: u32,
    /// The first visit.
    visits: u32,
}

/// An event, alive, that has been at a pixel, which another event has seen since.
#[derive(Clone, Copy, Debug)]
struct Visit {
    pixel: u32,
    label: u32,
    count: u32,
    /// The pixel's next visit.
    next: u32,
    /// The event's ring of visits.
    after: u32,
    before: u32,
}

/// What is kept of each event that is alive.
#[derive(Clone, Copy, Debug)]
pub(in crate::glare) struct Alive {
    pub growing: Growing,
    /// One of its visits.
    visits: u32,
    /// Its number among those of which something was paged out.
    pub serial: Option<u32>,
}

impl Alive {
    pub fn new(growing: Growing) -> Self {
        Self { growing, visits: NONE, serial: None }
    }
}

impl Pixel {
    const DARK: Self = Self { sustained: 0, noted: 0, label: 0, count: 0, visits: NONE };

    /// The event that the pixel saw last, if it's alive.
    fn newest(&self, labels: &mut Labels) -> Option<u32> {
        // A number that was handed out anew since stands for another event.
        let known = (self.label as usize) < labels.len();
        let alive = known && self.noted >= labels.born(self.label);
        alive.then(|| labels.find(self.label))
    }
}

impl Durations {
    /// Bytes for each pixel.
    pub const BYTES_PER_PIXEL: u64 = 20;

    pub fn new(pixels: usize) -> Self {
        let visits = Visits { pool: Vec::new(), free: Vec::new() };
        Self { pixels: vec![Pixel::DARK; pixels], visits, settling: Vec::new() }
    }

    /// The most timesteps of one event at each pixel.
    pub fn sustained(&self) -> impl Iterator<Item = u32> {
        self.pixels.iter().map(|pixel| pixel.sustained)
    }

    /// Bytes in memory beyond those of the pixels and visits.
    pub fn bytes(&self) -> usize {
        self.settling.capacity() * size_of::<u32>()
    }

    /// Bytes that visits take.
    pub fn visit_bytes(&self) -> usize {
        self.visits.pool.len() * size_of::<Visit>() + self.visits.free.len() * size_of::<u32>()
    }

    /// Two events are one: `kept` takes the visits of `given_up`.
    pub fn join(&mut self, alive: &mut [Alive], kept: u32, given_up: u32, paged: &mut Paged) {
        let other = alive[given_up as usize];
        let one = &mut alive[kept as usize];
        one.growing.merge(&other.growing);
        one.serial = paged.join(one.serial, other.serial);
        if one.visits == NONE {
            one.visits = other.visits;
        } else if other.visits != NONE {
            self.visits.splice(one.visits, other.visits);
        }
    }

    /// A pixel stays in the event of `root` for some timesteps of batch `batch`.
    #[inline]
    pub fn stay(
        &mut self,
        stay: &Stay,
        batch: u32,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) {
        let pixel = &mut self.pixels[stay.pixel as usize];
        let known = pixel.label == root && pixel.visits == NONE;
        if known && pixel.noted >= labels.born(root) {
            pixel.count += stay.count;
        } else {
            pixel.count = stay.count + self.visits.enter(pixel, stay, root, labels, alive);
        }
        pixel.noted = batch;
        pixel.sustained = pixel.sustained.max(pixel.count);
    }

    /// The event of `root` is over: settles the pixels where it had visits.
    pub fn settle(
        &mut self,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
        paged: &mut Paged,
    ) -> io::Result<()> {
        let mut settling = std::mem::take(&mut self.settling);
        self.visits.pixels_of(&alive[root as usize], &mut settling);
        for number in settling.drain(..) {
            let pixel = &mut self.pixels[number as usize];
            let (mut count, mut found) = self.visits.take(pixel, root, labels, alive);
            if found == 0 {
                continue;
            }
            if pixel.newest(labels) == Some(root) {
                count += pixel.count;
                found += 1;
            }
            pixel.sustained = pixel.sustained.max(count);
            alive[root as usize].growing.pixels -= found - 1;
            if let (PAGED, Some(serial)) = (pixel.label, alive[root as usize].serial) {
                paged.add(number, serial, count)?;
            }
        }
        self.settling = settling;
        Ok(())
    }

    /// Hands all visits over to the disk.
    pub fn page_out(
        &mut self,
        labels: &mut Labels,
        alive: &mut [Alive],
        paged: &mut Paged,
    ) -> io::Result<()> {
        for (pixel, number) in self.pixels.iter_mut().zip(0..) {
            if pixel.visits == NONE {
                continue;
            }
            let newest = pixel.newest(labels);
            let mut at = pixel.visits;
            let visits = std::iter::from_fn(|| {
                let visit = *self.visits.pool.get(at as usize)?;
                at = visit.next;
                Some((visit.label, visit.count))
            });
            for (label, count) in visits.chain(newest.map(|label| (label, pixel.count))) {
                let root = labels.find(label) as usize;
                let serial = *alive[root].serial.get_or_insert_with(|| paged.serial());
                alive[root].visits = NONE;
                paged.add(number, serial, count)?;
            }
            (pixel.visits, pixel.label) = (NONE, PAGED);
        }
        self.visits.pool.clear();
        self.visits.free.clear();
        Ok(())
    }

    /// What was paged out counts `count` timesteps of one event at a pixel, which from now on is
    /// like any other: no event is alive.
    pub fn bring_back(&mut self, pixel: u32, count: u32) {
        let pixel = &mut self.pixels[pixel as usize];
        pixel.sustained = pixel.sustained.max(count);
        pixel.label = 0;
    }

    /// Replaces all numbers by those that their events go by.
    pub fn without_aliases(&mut self, labels: &mut Labels) {
        for pixel in &mut self.pixels {
            // A stale number may be handed out anew, but then it's younger than `noted`.
            if let Some(root) = pixel.newest(labels) {
                pixel.label = root;
            }
            let mut at = pixel.visits;
            while at != NONE {
                let visit = &mut self.visits.pool[at as usize];
                visit.label = labels.find(visit.label);
                at = visit.next;
            }
        }
    }
}

#[derive(Debug)]
struct Visits {
    pool: Vec<Visit>,
    free: Vec<u32>,
}

impl Visits {
    /// The event of `root` is at a pixel, for a stay, where it wasn't just before; how many
    /// timesteps it had there so far. What the pixel knew as its newest event becomes a visit if it is
    /// another one; visits of this event end.
    #[inline(never)]
    fn enter(
        &mut self,
        pixel: &mut Pixel,
        stay: &Stay,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) -> u32 {
        let (mut count, mut found) = match pixel.visits {
            NONE => (0, 0),
            _ => self.take(pixel, root, labels, alive),
        };
        match pixel.newest(labels) {
            Some(newest) if newest == root => {
                count += pixel.count;
                found += 1;
            }
            Some(other) => {
                self.add(pixel, stay.pixel, other, pixel.count, &mut alive[other as usize]);
            }
            None => {}
        }
        let pixels = &mut alive[root as usize].growing.pixels;
        *pixels = *pixels + 1 - found;
        if pixel.label == PAGED {
            self.add(pixel, stay.pixel, root, count + stay.count, &mut alive[root as usize]);
        } else {
            pixel.label = root;
        }
        count
    }

    /// Removes the visits of an event from a pixel; their counts, and how many they were.
    fn take(
        &mut self,
        pixel: &mut Pixel,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) -> (u32, u64) {
        let (mut count, mut found) = (0, 0);
        let (mut before, mut at) = (NONE, pixel.visits);
        while at != NONE {
            let visit = self.pool[at as usize];
            if labels.find(visit.label) == root {
                count += visit.count;
                found += 1;
                match before {
                    NONE => pixel.visits = visit.next,
                    before => self.pool[before as usize].next = visit.next,
                }
                self.unlink(at, &mut alive[root as usize]);
            } else {
                before = at;
            }
            at = visit.next;
        }
        (count, found)
    }

    fn add(&mut self, pixel: &mut Pixel, place: u32, root: u32, count: u32, event: &mut Alive) {
        let number = self.free.pop().unwrap_or(self.pool.len() as u32);
        let visit = Visit {
            pixel: place,
            label: root,
            count,
            next: pixel.visits,
            after: number,
            before: number,
        };
        match self.pool.get_mut(number as usize) {
            Some(old) => *old = visit,
            None => self.pool.push(visit),
        }
        pixel.visits = number;
        if event.visits == NONE {
            event.visits = number;
        } else {
            self.splice(event.visits, number);
        }
    }

    /// Makes one ring of two.
    fn splice(&mut self, a: u32, b: u32) {
        let (a_after, b_after) = (self.pool[a as usize].after, self.pool[b as usize].after);
        self.link(a, b_after);
        self.link(b, a_after);
    }

    fn link(&mut self, a: u32, b: u32) {
        self.pool[a as usize].after = b;
        self.pool[b as usize].before = a;
    }

    fn unlink(&mut self, number: u32, event: &mut Alive) {
        let Visit { after, before, .. } = self.pool[number as usize];
        self.link(before, after);
        if event.visits == number {
            event.visits = if after == number { NONE } else { after };
        }
        self.free.push(number);
    }

    /// Appends the pixels of all visits of an event.
    fn pixels_of(&self, event: &Alive, out: &mut Vec<u32>) {
        let mut at = event.visits;
        while at != NONE {
            let visit = self.pool[at as usize];
            out.push(visit.pixel);
            at = if visit.after == event.visits { NONE } else { visit.after };
        }
    }
}
