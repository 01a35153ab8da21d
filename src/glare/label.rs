use super::settings::Connectivity;
use super::threshold::Run;

/// Numbers of events, handed out anew once their event is over. Numbers of events that turned out
/// to be the same form a tree (union-find); all of them stay taken until the event is over, or
/// until [`Labels::compact`].
#[derive(Debug, Default)]
pub(super) struct Labels {
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
    /// A number for an event that begins at `clock`.
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

/// The runs of one slice, sorted by row and column, with the numbers of their events.
#[derive(Debug, Default)]
pub(super) struct Labelled {
    pub runs: Vec<Run>,
    pub labels: Vec<u32>,
    /// Where each row's runs begin; one more entry than rows.
    rows: Vec<usize>,
}

impl Labelled {
    /// Takes the runs of another slice; their labels are still to be found.
    pub fn set(&mut self, rows: usize, strips: impl Iterator<Item = impl AsRef<[Run]>>) {
        self.clear();
        for strip in strips {
            self.runs.extend_from_slice(strip.as_ref());
        }
        self.rows.reserve(rows + 1);
        self.rows.push(0);
        let mut at = 0;
        for row in 0..rows {
            while self.runs.get(at).is_some_and(|run| run.row as usize == row) {
                at += 1;
            }
            self.rows.push(at);
        }
    }

    /// A slice without runs.
    pub fn clear(&mut self) {
        self.runs.clear();
        self.labels.clear();
        self.rows.clear();
    }

    /// The indices of a row's runs; none for rows outside the slice.
    fn row(&self, row: Option<usize>) -> std::ops::Range<usize> {
        let bounds = row.and_then(|row| Some((*self.rows.get(row)?, *self.rows.get(row + 1)?)));
        bounds.map_or(0..0, |(start, end)| start..end)
    }
}

/// Gives the runs of `newest` their labels: those of the runs they touch in the slice before and
/// in their own, or new ones. `on` hears of each change. Labels may be aliases in the end.
pub(super) fn connect(
    before: &Labelled,
    newest: &mut Labelled,
    connectivity: Connectivity,
    labels: &mut Labels,
    clock: u32,
    mut on: impl FnMut(Change),
) {
    // How far runs may lie apart and still touch: in the row above of the same slice, the same
    // row of the slice before, and the rows beside it.
    let (above, behind, beside) = match connectivity {
        Connectivity::Faces => (0, 0, None),
        Connectivity::Edges => (1, 1, Some(0)),
        Connectivity::Corners => (1, 1, Some(1)),
    };
    let Labelled { runs, labels: found, rows } = newest;
    for row in 0..rows.len().saturating_sub(1) {
        let here = rows[row]..rows[row + 1];
        if here.is_empty() {
            continue;
        }
        let up = row.checked_sub(1);
        let neighbours = [
            (Some(before.row(Some(row))), behind),
            (beside.map(|_| before.row(up)), beside.unwrap_or(0)),
            (beside.map(|_| before.row(Some(row + 1))), beside.unwrap_or(0)),
        ];
        let start = here.start;
        found.extend(here.clone().map(|_| NONE));
        let mut meet = |mine: &mut u32, theirs: u32| {
            let theirs = labels.find(theirs);
            if *mine == NONE {
                *mine = theirs;
                return;
            }
            let own = labels.find(*mine);
            *mine = own;
            if own != theirs {
                let (kept, given_up) = labels.join(own, theirs);
                on(Change::Joined { kept, given_up });
                *mine = kept;
            }
        };
        for (range, gap) in neighbours {
            let Some(range) = range else { continue };
            touching(&runs[here.clone()], &before.runs[range.clone()], gap, |mine, theirs| {
                meet(&mut found[start + mine], before.labels[range.start + theirs]);
            });
        }
        if let Some(up) = up {
            let range = rows[up]..rows[row];
            touching(&runs[here.clone()], &runs[range.clone()], above, |mine, theirs| {
                let label = found[range.start + theirs];
                meet(&mut found[start + mine], label);
            });
        }
        for label in &mut found[here] {
            if *label == NONE {
                *label = labels.create(clock);
                on(Change::Created(*label));
            }
        }
    }
}

/// What happens to events while a slice is labelled.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// A new event has this number.
    Created(u32),
    /// Two events are one.
    Joined {
        /// The number that it goes by.
        kept: u32,
        /// The number that the other one went by.
        given_up: u32,
    },
}

const NONE: u32 = u32::MAX;

/// Calls `each` with the indices of runs of two rows that lie at most `gap` columns apart
/// diagonally (0: they share a column).
fn touching(a: &[Run], b: &[Run], gap: u32, mut each: impl FnMut(usize, usize)) {
    let (mut i, mut j) = (0, 0);
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        if x.start < y.end + gap && y.start < x.end + gap {
            each(i, j);
        }
        // Runs of one row are at least a column apart, so the one that ends first touches no other.
        if x.end < y.end {
            i += 1;
        } else {
            j += 1;
        }
    }
}
