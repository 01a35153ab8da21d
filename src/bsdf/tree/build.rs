//! A file's tree, cut into slices.

use super::{BANDS, LEAF, Root, Slice, Tree};

/// Nodes of slices that a tree may need: 512 MiB of them.
const MOST_SLICES: usize = 1 << 24;

/// The tree as a file holds it: `children` of `2^rank` each, values under [`LEAF`].
#[derive(Clone, Debug, Default)]
pub(in crate::bsdf) struct Raw {
    pub rank: usize,
    pub children: Vec<u32>,
    pub values: Vec<f32>,
    pub root: u32,
}

impl Raw {
    pub(in crate::bsdf) fn leaf(&mut self, value: f32) -> Option<u32> {
        let index = u32::try_from(self.values.len()).ok().filter(|i| *i < LEAF)?;
        self.values.push(value);
        Some(index | LEAF)
    }

    pub(in crate::bsdf) fn branch(&mut self, children: &[u32]) -> Option<u32> {
        let index = u32::try_from(self.children.len() >> self.rank).ok().filter(|i| *i < LEAF)?;
        self.children.extend_from_slice(children);
        Some(index)
    }
}

/// A function of the incident coordinates during building: the same everywhere, or by half
/// (rank 3) or quarter (rank 4).
#[derive(Clone)]
enum Over {
    Same(u32),
    Split(Vec<Over>),
}

impl Over {
    fn part(&self, i: usize) -> &Over {
        match self {
            Self::Same(_) => self,
            Self::Split(parts) => &parts[i],
        }
    }
}

struct Builder<'a> {
    raw: &'a Raw,
    slices: Vec<Slice>,
    means: Vec<f64>,
}

impl Builder<'_> {
    fn mean(&self, node: u32) -> f64 {
        if node & LEAF != 0 {
            f64::from(self.raw.values[(node & !LEAF) as usize])
        } else {
            self.means[node as usize]
        }
    }

    /// The slices below one node of the file's tree. `None`: too many.
    fn over(&mut self, node: u32) -> Option<Over> {
        if node & LEAF != 0 {
            return Some(Over::Same(node));
        }
        let rank = self.raw.rank;
        let parts = 1 << (rank - 2);
        let mut halves = Vec::with_capacity(parts);
        for part in 0..parts {
            let mut quarters = Vec::with_capacity(4);
            for quarter in 0..4 {
                let child = ((node as usize) << rank) + part + quarter * parts;
                quarters.push(self.over(self.raw.children[child])?);
            }
            halves.push(self.join(&[&quarters[0], &quarters[1], &quarters[2], &quarters[3]])?);
        }
        if let Over::Same(first) = halves[0]
            && first & LEAF != 0
            && halves.iter().all(|h| matches!(h, Over::Same(n) if self.equal_leaves(first, *n)))
        {
            return Some(Over::Same(first));
        }
        Some(Over::Split(halves))
    }

    fn equal_leaves(&self, a: u32, b: u32) -> bool {
        a & b & LEAF != 0 && self.mean(a) == self.mean(b)
    }

    /// Four quarters of the outgoing square as one.
    fn join(&mut self, quarters: &[&Over; 4]) -> Option<Over> {
        let mut children = [0; 4];
        for (child, quarter) in children.iter_mut().zip(quarters) {
            match quarter {
                Over::Same(node) => *child = *node,
                Over::Split(_) => {
                    let parts = 1 << (self.raw.rank - 2);
                    let split = (0..parts)
                        .map(|i| self.join(&quarters.map(|q| q.part(i))))
                        .collect::<Option<_>>()?;
                    return Some(Over::Split(split));
                }
            }
        }
        if children.iter().all(|&c| self.equal_leaves(children[0], c)) {
            return Some(Over::Same(children[0]));
        }
        if self.slices.len() >= MOST_SLICES {
            return None;
        }
        let mut sum = 0.0;
        let cumulative = children.map(|c| {
            sum += 0.25 * self.mean(c);
            sum as f32
        });
        let index = u32::try_from(self.slices.len()).ok()?;
        self.slices.push(Slice { children, cumulative });
        self.means.push(sum);
        Some(Over::Same(index))
    }
}

impl Tree {
    /// Cuts a file's tree into slices. `None` where they would need too much memory.
    pub(in crate::bsdf) fn new(raw: Raw, levels: u32) -> Option<Self> {
        let mut builder = Builder { raw: &raw, slices: Vec::new(), means: Vec::new() };
        let over = builder.over(raw.root)?;
        let mut tree = Self {
            rank: raw.rank,
            incident: Vec::new(),
            incident_root: 0,
            roots: Vec::new(),
            slices: Vec::new(),
            values: Vec::new(),
            bands: vec![0.0; BANDS],
            most_in_file: 0.0,
            levels,
        };
        tree.incident_root = tree.flatten(&over, &builder, [0.0, 0.0], 1.0);
        tree.slices = builder.slices;
        tree.values = raw.values;
        Some(tree)
    }

    fn flatten(&mut self, over: &Over, builder: &Builder, corner: [f64; 2], size: f64) -> u32 {
        match over {
            Over::Same(node) => {
                let sum = builder.mean(*node) * std::f64::consts::PI;
                let scale = if sum > 1.0 { 1.0 / sum } else { 1.0 };
                let total = (sum * scale) as f32;
                // The other half of an isotropic axis means nothing.
                if self.rank == 4 || corner[0] < 0.5 {
                    self.most_in_file = self.most_in_file.max(sum);
                }
                self.raise_bands(total, corner, size);
                let index = self.roots.len() as u32;
                self.roots.push(Root { node: *node, total, scale: scale as f32 });
                index | LEAF
            }
            Over::Split(parts) => {
                let index = self.incident.len();
                self.incident.push([LEAF; 4]);
                for (i, part) in parts.iter().enumerate() {
                    let half = size * 0.5;
                    let at = [
                        corner[0] + if i & 1 != 0 { half } else { 0.0 },
                        corner[1] + if i & 2 != 0 { half } else { 0.0 },
                    ];
                    let child = self.flatten(part, builder, at, half);
                    self.incident[index][i] = child;
                }
                index as u32
            }
        }
    }

    /// Notes the total of an incident cell in the bands of the sine that it touches.
    fn raise_bands(&mut self, total: f32, corner: [f64; 2], size: f64) {
        let (low, high) = if self.rank == 3 {
            (1.0 - 2.0 * (corner[0] + size), 1.0 - 2.0 * corner[0])
        } else {
            // The radius in the disc is the larger of the square's distances from its middle.
            let span = |c: f64| {
                let (a, b) = (2.0 * c - 1.0, 2.0 * (c + size) - 1.0);
                let near = if a < 0.0 && b > 0.0 { 0.0 } else { a.abs().min(b.abs()) };
                (near, a.abs().max(b.abs()))
            };
            let (x, y) = (span(corner[0]), span(corner[1]));
            (x.0.max(y.0), x.1.max(y.1))
        };
        if high <= 0.0 {
            return;
        }
        let band = |r: f64| ((r.clamp(0.0, 1.0) * BANDS as f64) as usize).min(BANDS - 1);
        for b in &mut self.bands[band(low - 1e-9)..=band(high + 1e-9)] {
            *b = b.max(total);
        }
    }
}
