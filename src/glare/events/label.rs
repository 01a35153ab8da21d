//! Numbers of events, and the row runs of a timestep with the number of each.
//!
//! A classic union-find, with two additions, because events come and go for years: the numbers of an
//! event hang in a ring, so that all of them are taken back when it is over; and a number remembers
//! when it was handed out, so that a note that somebody made of it earlier is known to be stale.

use super::threshold::Span;

/// Numbers of events, handed out anew once their event is over. Numbers of events that turned out
/// to be the same form a tree (union-find); all of them stay taken until the event is over, or
/// until [`Labels::compact`].
#[derive(Debug, Default)]
pub(in crate::glare) struct Labels {
    nodes: Vec<Node>,
    free: Vec<u32>,
    /// Numbers in use that stand for another one.
    aliases: usize,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    /// Where its event is found; itself for the number that the event goes by.
    parent: u32,
    /// The next in the ring of all numbers of this event.
    next: u32,
    /// When the number was handed out; [`NEVER`] while nobody has it.
    born: u32,
}

const NEVER: u32 = u32::MAX;

impl Labels {
    /// A number for an event, handed out in batch `clock`.
    pub fn create(&mut self, clock: u32) -> u32 {
        let label = self.free.pop().unwrap_or(self.nodes.len() as u32);
        let node = Node { parent: label, next: label, born: clock };
        match self.nodes.get_mut(label as usize) {
            Some(old) => *old = node,
            None => self.nodes.push(node),
        }
        label
    }

    /// When `label` was handed out; later than any clock if nobody has it.
    pub fn born(&self, label: u32) -> u32 {
        self.nodes[label as usize].born
    }

    /// The number that the event of `label` goes by.
    pub fn find(&mut self, mut label: u32) -> u32 {
        loop {
            let parent = self.nodes[label as usize].parent;
            if parent == label {
                return label;
            }
            let above = self.nodes[parent as usize].parent;
            self.nodes[label as usize].parent = above;
            label = above;
        }
    }

    /// Makes one event of two different ones, given by the numbers they go by. Returns the number
    /// that it goes by from now on and the one that is now an alias. The older number is kept: an
    /// event's own number is then never younger than any alias, which is what makes it safe to
    /// put it in an alias's place where "younger than the note" means "handed out anew since".
    pub fn join(&mut self, a: u32, b: u32) -> (u32, u32) {
        let (kept, other) = if self.born(a) <= self.born(b) { (a, b) } else { (b, a) };
        let next = self.nodes[kept as usize].next;
        self.nodes[kept as usize].next = self.nodes[other as usize].next;
        self.nodes[other as usize].next = next;
        self.nodes[other as usize].parent = kept;
        self.aliases += 1;
        (kept, other)
    }

    /// Takes back all numbers of an event, given by the one that it goes by.
    pub fn release(&mut self, root: u32) {
        let mut label = root;
        loop {
            let node = &mut self.nodes[label as usize];
            node.born = NEVER;
            self.free.push(label);
            self.aliases -= usize::from(label != root);
            label = node.next;
            if label == root {
                return;
            }
        }
    }

    /// How many numbers are mere aliases.
    pub fn aliases(&self) -> usize {
        self.aliases
    }

    /// Takes back all aliases. The caller has replaced all of them everywhere.
    pub fn compact(&mut self) {
        for label in 0..self.nodes.len() {
            let node = &mut self.nodes[label];
            if node.born == NEVER {
                continue;
            }
            if node.parent as usize == label {
                node.next = node.parent;
            } else {
                node.born = NEVER;
                self.free.push(label as u32);
            }
        }
        self.aliases = 0;
    }

    /// Numbers that exist, in use or not.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.free.capacity() * size_of::<u32>()
    }
}

/// The runs of one timestep, sorted by row and column, with the numbers of their events.
#[derive(Debug, Default)]
pub(in crate::glare) struct Labelled {
    pub runs: Vec<Span>,
    pub labels: Vec<u32>,
    /// Where each row's runs begin; one more entry than rows.
    rows: Vec<usize>,
}

impl Labelled {
    /// Takes the runs of the next rows, with their numbers.
    pub fn extend(&mut self, rows: std::ops::Range<usize>, runs: &[Span], labels: &[u32]) {
        let mut at = self.runs.len();
        self.runs.extend_from_slice(runs);
        self.labels.extend_from_slice(labels);
        self.rows.truncate(rows.start);
        for row in rows {
            self.rows.push(at);
            while self.runs.get(at).is_some_and(|run| run.row as usize == row) {
                at += 1;
            }
        }
        self.rows.push(at);
    }

    /// The indices of a row's runs; none for rows outside the slice.
    pub fn row(&self, row: Option<usize>) -> std::ops::Range<usize> {
        let bounds = row.and_then(|row| Some((*self.rows.get(row)?, *self.rows.get(row + 1)?)));
        bounds.map_or(0..0, |(start, end)| start..end)
    }
}

/// What a tree of numbers has at its root, given any of its numbers; what is looked up is nearer to
/// the root the next time.
pub(in crate::glare) fn find(parents: &mut [u32], mut at: u32) -> u32 {
    loop {
        let parent = parents[at as usize];
        if parent == at {
            return at;
        }
        let above = parents[parent as usize];
        parents[at as usize] = above;
        at = above;
    }
}
