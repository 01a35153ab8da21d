//! Tensor trees: scattering over cells that are small only where the function changes.
//!
//! Ward, Kurt and Bonneel 2012 ("A practical framework for sharing and rendering real-world
//! bidirectional scattering distribution functions") cut the square of outgoing directions (Shirley
//! and Chiu's map of the disc) together with the incident one into a tree of 16 or 8 children. To
//! draw from it one needs, for a given incident direction, a distribution over outgoing cells;
//! walking the whole tree for each photon is too slow, and one quadtree for each incident cell too
//! large.
//!
//! So the tree is cut into slices when it is read: a quadtree over the outgoing square for each
//! incident cell that can be told apart, where all slices share the parts that they have in common.
//! A node keeps the sums over its children, and one number is enough to walk down to a cell.
//! Evaluating and bounding walk the same slices.

mod build;

use glam::DVec3;

use super::Cone;
use super::disk::{disk_from_square, polar_range, square_from_disk, square_span};
use crate::base::Stream;

pub(super) use build::Raw;

/// Set in a number that is a value's, not a node's.
const LEAF: u32 = 1 << 31;
/// Bands of the incident direction's sine for which bounds are kept.
const BANDS: usize = 256;
/// Levels of a tree: a cell of 2^-12 is a minute of arc.
pub(super) const MOST_LEVELS: u32 = 12;

/// Scattering over a tensor tree (Ward, Kurt and Bonneel 2012): piecewise constant over cells of
/// the square of outgoing directions, for cells of the incident square (rank 4) or of the sine of
/// the incident angle (rank 3, isotropic).
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    rank: usize,
    /// Nodes over the incident coordinates; two or four children each.
    incident: Vec<[u32; 4]>,
    /// Slice of the first incident node, or [`LEAF`] and a slice, see [`Self::slice_of`].
    incident_root: u32,
    /// Slices by number: a root of a quadtree each.
    roots: Vec<Root>,
    slices: Vec<Slice>,
    values: Vec<f32>,
    /// Largest total over the incident cells of each band of the sine.
    bands: Vec<f32>,
    /// Largest share of light scattered from any incident cell, as the file has it.
    most_in_file: f64,
    /// Levels of the finest incident and outgoing cells.
    levels: u32,
}

/// A box of the square, wider by more than the rounding of all that leads to it.
fn widened((low, high): ([f64; 2], [f64; 2])) -> ([f64; 2], [f64; 2]) {
    (low.map(|x| x - 1e-9), high.map(|x| x + 1e-9))
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Root {
    node: u32,
    /// Share of the light that is scattered.
    total: f32,
    /// What values are multiplied with: 1, or less where the file holds more light than came in.
    scale: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Slice {
    children: [u32; 4],
    /// Mean value over the first, the first two, three and all four children, 1/sr.
    cumulative: [f32; 4],
}

impl Tree {
    /// 3 (isotropic) or 4.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Levels of the finest cells: `2^levels` along each edge of the square.
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Number of values in the file.
    pub fn values(&self) -> usize {
        self.values.len()
    }

    pub(super) fn most_in_file(&self) -> f64 {
        self.most_in_file
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.slices.len() * size_of::<Slice>()
            + self.values.len() * 4
            + self.incident.len() * 16
            + self.roots.len() * size_of::<Root>()
    }

    #[inline]
    fn root(&self, from: DVec3) -> &Root {
        &self.roots[self.root_number(from) as usize]
    }

    /// Number of the slice of light from a direction.
    #[inline]
    pub(super) fn root_number(&self, from: DVec3) -> u32 {
        let mut at = if self.rank == 3 {
            let radius = (from.x * from.x + from.y * from.y).sqrt().min(1.0);
            // Half of the axis is used: files keep 1 - sin in cells of twice the width.
            [(0.5 - 1e-7 - 0.5 * radius).max(0.0), 0.0]
        } else {
            square_from_disk([-from.x, -from.y])
        };
        let mut node = self.incident_root;
        while node & LEAF == 0 {
            let mut part = 0;
            for (i, x) in at.iter_mut().enumerate() {
                *x *= 2.0;
                if *x >= 1.0 {
                    *x -= 1.0;
                    part |= 1 << i;
                }
            }
            node = self.incident[node as usize][part];
        }
        node & !LEAF
    }

    /// Share of the light from a direction that is scattered.
    #[inline]
    pub(super) fn total(&self, from: DVec3) -> f64 {
        f64::from(self.root(from).total)
    }

    /// Turns the disc so that light from `from` travels along +x (isotropic trees).
    #[inline]
    pub(super) fn turn(&self, from: DVec3) -> (f64, f64) {
        if self.rank != 3 {
            return (1.0, 0.0);
        }
        let radius = (from.x * from.x + from.y * from.y).sqrt();
        if radius > 0.0 { (-from.x / radius, -from.y / radius) } else { (1.0, 0.0) }
    }

    pub(super) fn evaluate(&self, from: DVec3, to: DVec3) -> f64 {
        let (cos, sin) = self.turn(from);
        self.value(self.root_number(from), [cos, sin], to)
    }

    /// The value of a slice, 1/sr, with outgoing directions turned back by an angle.
    #[inline]
    pub(super) fn value(&self, root: u32, [cos, sin]: [f64; 2], to: DVec3) -> f64 {
        let mut at = square_from_disk([to.x * cos + to.y * sin, to.y * cos - to.x * sin]);
        let root = &self.roots[root as usize];
        let mut node = root.node;
        while node & LEAF == 0 {
            let mut quarter = 0;
            for (i, x) in at.iter_mut().enumerate() {
                *x *= 2.0;
                if *x >= 1.0 {
                    *x -= 1.0;
                    quarter |= 1 << i;
                }
            }
            node = self.slices[node as usize].children[quarter];
        }
        f64::from(self.values[(node & !LEAF) as usize]) * f64::from(root.scale)
    }

    /// The cell that light from a direction is scattered into: corner and size in the square.
    #[inline]
    fn cell(&self, mut node: u32, mut u: f64) -> ([f64; 2], f64) {
        let mut corner = [0.0, 0.0];
        let mut size = 1.0;
        while node & LEAF == 0 {
            let slice = &self.slices[node as usize];
            let sums = slice.cumulative.map(f64::from);
            let at = u * sums[3];
            let quarter = sums.iter().take_while(|&&s| s <= at).count().min(3);
            let before = if quarter == 0 { 0.0 } else { sums[quarter - 1] };
            // What is left of the number decides further below.
            u = ((at - before) / (sums[quarter] - before)).clamp(0.0, 1.0 - f64::EPSILON);
            size *= 0.5;
            corner[0] += if quarter & 1 != 0 { size } else { 0.0 };
            corner[1] += if quarter & 2 != 0 { size } else { 0.0 };
            node = slice.children[quarter];
        }
        (corner, size)
    }

    #[inline]
    pub(super) fn sample(&self, from: DVec3, random: &mut Stream) -> DVec3 {
        let (corner, size) = self.cell(self.root(from).node, random.uniform_fine());
        let (u, v) = (random.uniform(), random.uniform());
        let [x, y] = disk_from_square([corner[0] + u * size, corner[1] + v * size]);
        let (cos, sin) = self.turn(from);
        DVec3::new(x * cos - y * sin, x * sin + y * cos, (1.0 - x * x - y * y).max(0.0).sqrt())
    }

    /// What `quarter`s of a square, from the whole on, lead to: a node that may be a larger leaf.
    #[inline]
    fn below(&self, mut node: u32, (level, x, y): (u8, u16, u16)) -> u32 {
        for bit in (0..level).rev() {
            if node & LEAF != 0 {
                break;
            }
            let quarter = (x >> bit & 1) | (y >> bit & 1) << 1;
            node = self.slices[node as usize].children[usize::from(quarter)];
        }
        node
    }

    /// Mean value below a node.
    #[inline]
    fn mean(&self, node: u32) -> f32 {
        if node & LEAF != 0 {
            self.values[(node & !LEAF) as usize]
        } else {
            self.slices[node as usize].cumulative[3]
        }
    }

    /// For light from a direction, a direction in a part of the outgoing square (level, column,
    /// row) and the part's mean value: two even numbers make directions in proportion to the
    /// values, cell by cell, first the row, then the column.
    #[inline]
    pub(super) fn within(
        &self,
        from: DVec3,
        part: (u8, u16, u16),
        mut u: f64,
        mut v: f64,
    ) -> (DVec3, f64) {
        let root = self.root(from);
        let mut node = self.below(root.node, part);
        let value = f64::from(self.mean(node)) * f64::from(root.scale);
        let mut size = 1.0 / f64::from(1_u32 << part.0);
        let mut corner = [f64::from(part.1) * size, f64::from(part.2) * size];
        while node & LEAF == 0 {
            let slice = &self.slices[node as usize];
            let [a, ab, abc, abcd] = slice.cumulative.map(f64::from);
            if abcd <= 0.0 {
                break;
            }
            // One of two parts, and what is left of the number.
            let choose = |at: f64, low: f64, both: f64| {
                let at = at * both;
                let (upper, part) =
                    if at < low { (0, at / low) } else { (1, (at - low) / (both - low)) };
                (upper, part.clamp(0.0, 1.0 - f64::EPSILON))
            };
            let (row, left) = choose(v, ab, abcd);
            v = left;
            let (column, left) =
                if row == 0 { choose(u, a, ab) } else { choose(u, abc - ab, abcd - ab) };
            u = left;
            size *= 0.5;
            corner[0] += f64::from(column) * size;
            corner[1] += f64::from(row) * size;
            node = slice.children[(column + 2 * row) as usize];
        }
        let [x, y] = disk_from_square([corner[0] + u * size, corner[1] + v * size]);
        let (cos, sin) = self.turn(from);
        let height = (1.0 - x * x - y * y).max(0.0).sqrt();
        (DVec3::new(x * cos - y * sin, x * sin + y * cos, height), value)
    }

    /// A cone that holds the directions of a part of the outgoing square, for light from a cone.
    pub(super) fn reach(&self, low: [f64; 2], high: [f64; 2], from: &Cone) -> Cone {
        let (radii, turns) = polar_range(low, high);
        if self.rank != 3 {
            return Cone::of_patch(radii, turns);
        }
        let (centre, spread) = from.about(-from.axis).turns();
        Cone::of_patch(radii, [turns[0] + centre - spread, turns[1] + centre + spread])
    }

    /// Largest mean value, 1/sr, of a part of the outgoing square (level, column, row) for light
    /// from a cone.
    pub(super) fn most_within(&self, part: (u8, u16, u16), from: &Cone) -> f64 {
        let mut most = 0.0_f64;
        self.each_incident(from, &mut |root| {
            let root = &self.roots[root as usize];
            let mean = self.mean(self.below(root.node, part));
            most = most.max(f64::from(mean) * f64::from(root.scale));
        });
        most
    }

    /// The numbers of all slices that light of a cone may have.
    fn each_incident(&self, from: &Cone, each: &mut impl FnMut(u32)) {
        let span = if self.rank == 3 {
            let (near, far) = from.radii();
            let at = |radius: f64| (0.5 - 1e-7 - 0.5 * radius).max(0.0);
            ([at(far) - 1e-9, 0.0], [at(near) + 1e-9, 0.0])
        } else {
            // The square's coordinates change by less than 0.81 of the way in the disc.
            let at = square_from_disk([-from.axis.x, -from.axis.y]);
            (at.map(|c| c - 0.85 * from.angle_rad), at.map(|c| c + 0.85 * from.angle_rad))
        };
        self.each_root(self.incident_root, [0.0; 2], 1.0, span, each);
    }

    /// Widens a span by the values of a slice in all cells that directions of a cone may lie in.
    pub(super) fn values_within(&self, root: u32, out: &Cone, span: &mut [f64; 2]) {
        let (near, far) = out.radii();
        let (centre, spread) = out.turns();
        let within = widened(square_span([near, far], [centre - spread, centre + spread]));
        let root = &self.roots[root as usize];
        let mut own = [f64::INFINITY, 0.0_f64];
        self.span(root.node, ([0.0; 2], 1.0), within, &mut own);
        let scale = f64::from(root.scale);
        *span = [span[0].min(own[0] * scale), span[1].max(own[1] * scale)];
    }

    fn span(
        &self,
        node: u32,
        (corner, size): ([f64; 2], f64),
        within: ([f64; 2], [f64; 2]),
        span: &mut [f64; 2],
    ) {
        if node & LEAF != 0 {
            let value = f64::from(self.values[(node & !LEAF) as usize]);
            *span = [span[0].min(value), span[1].max(value)];
            return;
        }
        let half = 0.5 * size;
        for quarter in 0..4 {
            let at = [
                corner[0] + if quarter & 1 != 0 { half } else { 0.0 },
                corner[1] + if quarter & 2 != 0 { half } else { 0.0 },
            ];
            if (0..2).all(|i| at[i] <= within.1[i] && at[i] + half >= within.0[i]) {
                let child = self.slices[node as usize].children[quarter];
                self.span(child, (at, half), within, span);
            }
        }
    }

    /// Largest value, 1/sr, for light from a cone to directions of another one.
    pub(super) fn most_between(&self, from: &Cone, out: &Cone) -> f64 {
        let (near, far) = out.radii();
        let (centre, spread) = out.turns();
        let mut turns = [centre - spread, centre + spread];
        if self.rank == 3 {
            // Azimuths count from that of the light.
            let (centre, spread) = from.about(-from.axis).turns();
            turns = [turns[0] - centre - spread, turns[1] - centre + spread];
        }
        let within = widened(square_span([near, far], turns));
        let mut most = 0.0_f64;
        self.each_incident(from, &mut |root| {
            let root = &self.roots[root as usize];
            let mut span = [0.0, 0.0];
            self.span(root.node, ([0.0; 2], 1.0), within, &mut span);
            most = most.max(span[1] * f64::from(root.scale));
        });
        most
    }

    /// The slices of all incident cells that touch a box.
    fn each_root(
        &self,
        node: u32,
        corner: [f64; 2],
        size: f64,
        span: ([f64; 2], [f64; 2]),
        each: &mut impl FnMut(u32),
    ) {
        if node & LEAF != 0 {
            return each(node & !LEAF);
        }
        let half = 0.5 * size;
        for part in 0..1 << (self.rank - 2) {
            let at = [
                corner[0] + if part & 1 != 0 { half } else { 0.0 },
                corner[1] + if part & 2 != 0 { half } else { 0.0 },
            ];
            let touches =
                (0..self.rank - 2).all(|i| at[i] <= span.1[i] && at[i] + half >= span.0[i]);
            if touches {
                self.each_root(self.incident[node as usize][part], at, half, span, each);
            }
        }
    }

    /// Share of the light from a direction in its brightest cell among the finest ones: where a
    /// file has larger cells, its makers saw nothing narrow.
    pub(super) fn peak_share(&self, from: DVec3) -> f64 {
        let root = self.root(from);
        // Cells by their size; children count for a quarter each.
        let finest = 1.0 / 4.0_f64.powi(self.levels as i32);
        let mut stack = vec![(root.node, 1.0)];
        let (mut most, mut sum) = (0.0_f64, 0.0);
        while let Some((node, area)) = stack.pop() {
            if node & LEAF != 0 {
                let part = area * f64::from(self.values[(node & !LEAF) as usize]);
                if area < 1.5 * finest {
                    most = most.max(part);
                }
                sum += part;
            } else {
                stack.extend(self.slices[node as usize].children.map(|c| (c, 0.25 * area)));
            }
        }
        if sum > 0.0 { most / sum } else { 0.0 }
    }

    /// Largest share scattered from any incident cell that reaches into a range of cosines.
    pub(super) fn most(&self, cos_low: f64, cos_high: f64) -> f64 {
        let sine = |cos: f64| (1.0 - cos * cos).max(0.0).sqrt();
        let band = |r: f64| ((r.clamp(0.0, 1.0) * BANDS as f64) as usize).min(BANDS - 1);
        let (from, to) = (band(sine(cos_high) - 1e-6), band(sine(cos_low) + 1e-6));
        self.bands[from..=to.max(from)].iter().fold(0.0, |m, &b| m.max(f64::from(b)))
    }
}
