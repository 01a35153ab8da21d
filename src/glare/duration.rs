use super::event::Growing;
use super::label::Labels;
use super::threshold::Run;

const NONE: u32 = u32::MAX;

/// How long each pixel was above the threshold so far, and in which events that are alive.
///
/// A pixel's newest event and its count there lie in arrays. The other events that are alive and
/// have been at the pixel are *visits*: they hang on the pixel in one list and on their event in
/// another. When an event is over, the pixels of its visits are settled: counts of events that
/// merged since add up. Pixels without visits never need that.
#[derive(Debug)]
pub(super) struct Durations {
    /// Timesteps above the threshold.
    pub cumulative: Vec<i32>,
    /// The most timesteps of one event.
    pub sustained: Vec<i32>,
    /// The longest uninterrupted run of timesteps.
    pub longest_run: Vec<i32>,
    /// When the present run of timesteps began.
    since: Vec<u32>,
    /// When the pixel was above the threshold last; before any clock if never.
    last: Vec<u32>,
    /// The newest event there; of use only while it's alive, see [`Self::newest`].
    label: Vec<u32>,
    /// Timesteps of that event.
    count: Vec<u32>,
    /// The pixel's first visit.
    visits: Vec<u32>,
    pool: Vec<Visit>,
    free: Vec<u32>,
    /// The pixels that an event's end has to settle.
    settling: Vec<u32>,
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
pub(super) struct Alive {
    pub growing: Growing,
    /// One of its visits.
    visits: u32,
}

impl Alive {
    pub fn new(timestep: u32) -> Self {
        Self { growing: Growing::new(timestep), visits: NONE }
    }
}

impl Durations {
    /// Bytes for each pixel.
    pub const BYTES_PER_PIXEL: u64 = 32;

    pub fn new(pixels: usize) -> Self {
        Self {
            cumulative: vec![0; pixels],
            sustained: vec![0; pixels],
            longest_run: vec![0; pixels],
            since: vec![0; pixels],
            last: vec![0; pixels],
            label: vec![0; pixels],
            count: vec![0; pixels],
            visits: vec![NONE; pixels],
            pool: Vec::new(),
            free: Vec::new(),
            settling: Vec::new(),
        }
    }

    /// Bytes in memory beyond those of the pixels.
    pub fn bytes(&self) -> usize {
        self.pool.capacity() * size_of::<Visit>()
            + (self.free.capacity() + self.settling.capacity()) * size_of::<u32>()
    }

    /// Two events are one: `kept` takes the visits of `given_up`.
    pub fn join(&mut self, alive: &mut [Alive], kept: u32, given_up: u32) {
        let other = alive[given_up as usize];
        let one = &mut alive[kept as usize];
        one.growing.merge(&other.growing);
        if one.visits == NONE {
            one.visits = other.visits;
        } else if other.visits != NONE {
            let (a, b) = (one.visits, other.visits);
            let (a_after, b_after) = (self.visit(a).after, self.visit(b).after);
            self.link(a, b_after);
            self.link(b, a_after);
        }
    }

    /// The pixels of `run` are above the threshold at `clock`, in the event of `root`.
    pub fn touch(
        &mut self,
        run: &Run,
        columns: usize,
        clock: u32,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) {
        let row = run.row as usize * columns;
        let pixels = row + run.start as usize..row + run.end as usize;
        for cumulative in &mut self.cumulative[pixels.clone()] {
            *cumulative += 1;
        }
        let born = labels.born(root);
        for pixel in pixels {
            let last = self.last[pixel];
            if last + 1 != clock {
                self.since[pixel] = clock;
            }
            let run_length = (clock - self.since[pixel] + 1) as i32;
            self.longest_run[pixel] = self.longest_run[pixel].max(run_length);
            let count = if self.label[pixel] == root && last >= born && self.visits[pixel] == NONE {
                self.count[pixel] + 1
            } else {
                self.count_before(pixel, root, labels, alive) + 1
            };
            self.label[pixel] = root;
            self.count[pixel] = count;
            self.last[pixel] = clock;
            self.sustained[pixel] = self.sustained[pixel].max(count as i32);
        }
    }

    /// The event that the pixel saw last, if it's alive.
    fn newest(&self, pixel: usize, labels: &mut Labels) -> Option<u32> {
        let label = self.label[pixel];
        // A number that was handed out anew since stands for another event.
        let alive = (label as usize) < labels.len() && self.last[pixel] >= labels.born(label);
        alive.then(|| labels.find(label))
    }

    /// How many timesteps the event of `root` has at `pixel` so far. What the pixel knew as its
    /// newest event becomes a visit if it is another one; visits of this event end.
    fn count_before(
        &mut self,
        pixel: usize,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) -> u32 {
        let (mut count, found) = self.take_visits(pixel, root, labels, alive);
        let mut found = found;
        match self.newest(pixel, labels) {
            Some(newest) if newest == root => {
                count += self.count[pixel];
                found += 1;
            }
            Some(other) => self.add_visit(pixel, other, &mut alive[other as usize]),
            None => {}
        }
        let pixels = &mut alive[root as usize].growing.pixels;
        *pixels = *pixels + 1 - found;
        count
    }

    /// Removes the visits of an event from a pixel; their counts, and how many they were.
    fn take_visits(
        &mut self,
        pixel: usize,
        root: u32,
        labels: &mut Labels,
        alive: &mut [Alive],
    ) -> (u32, u64) {
        let (mut count, mut found) = (0, 0);
        let (mut before, mut at) = (NONE, self.visits[pixel]);
        while at != NONE {
            let visit = *self.visit(at);
            if labels.find(visit.label) == root {
                count += visit.count;
                found += 1;
                match before {
                    NONE => self.visits[pixel] = visit.next,
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

    fn add_visit(&mut self, pixel: usize, root: u32, event: &mut Alive) {
        let number = self.free.pop().unwrap_or(self.pool.len() as u32);
        let visit = Visit {
            // Pixels are bounded by MAX_VIEW_PIXELS.
            pixel: pixel as u32,
            label: root,
            count: self.count[pixel],
            next: self.visits[pixel],
            after: number,
            before: number,
        };
        match self.pool.get_mut(number as usize) {
            Some(old) => *old = visit,
            None => self.pool.push(visit),
        }
        self.visits[pixel] = number;
        if event.visits == NONE {
            event.visits = number;
        } else {
            let after = self.visit(event.visits).after;
            self.link(event.visits, number);
            self.link(number, after);
        }
    }

    fn visit(&self, number: u32) -> &Visit {
        &self.pool[number as usize]
    }

    fn link(&mut self, a: u32, b: u32) {
        self.pool[a as usize].after = b;
        self.pool[b as usize].before = a;
    }

    fn unlink(&mut self, number: u32, event: &mut Alive) {
        let Visit { after, before, .. } = *self.visit(number);
        self.link(before, after);
        if event.visits == number {
            event.visits = if after == number { NONE } else { after };
        }
        self.free.push(number);
    }

    /// The event of `root` is over: settles the pixels where it had visits.
    pub fn settle(&mut self, root: u32, labels: &mut Labels, alive: &mut [Alive]) {
        let first = alive[root as usize].visits;
        if first == NONE {
            return;
        }
        let mut pixels = std::mem::take(&mut self.settling);
        let mut at = first;
        loop {
            let visit = self.visit(at);
            pixels.push(visit.pixel);
            at = visit.after;
            if at == first {
                break;
            }
        }
        for pixel in pixels.drain(..).map(|pixel| pixel as usize) {
            let (mut count, mut found) = self.take_visits(pixel, root, labels, alive);
            if found == 0 {
                continue;
            }
            if self.newest(pixel, labels) == Some(root) {
                count += self.count[pixel];
                found += 1;
            }
            self.sustained[pixel] = self.sustained[pixel].max(count as i32);
            alive[root as usize].growing.pixels -= found - 1;
        }
        self.settling = pixels;
    }

    /// Replaces all numbers by those that their events go by.
    pub fn without_aliases(&mut self, labels: &mut Labels) {
        for pixel in 0..self.label.len() {
            // A stale number may be handed out anew, but then it's younger than `last`.
            if let Some(root) = self.newest(pixel, labels) {
                self.label[pixel] = root;
            }
        }
        for (head, pixel) in self.visits.iter().zip(0..) {
            let mut at = *head;
            while at != NONE {
                let visit = &mut self.pool[at as usize];
                debug_assert_eq!(visit.pixel, pixel);
                visit.label = labels.find(visit.label);
                at = visit.next;
            }
        }
    }
}
