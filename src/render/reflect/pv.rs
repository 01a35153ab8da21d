//! The PV in cells, and what something sees of them: a point, an eye, a sun.
//!
//! A triangle of PV splits into four of a quarter of its area, and so on ([`Cell`]). At some level,
//! usually half a metre, the corners of the cells are a lattice whose nodes are asked what they see
//! ([`PvTriangle`], [`Lattice`]): neighbours share them, so that there are half as many nodes as cells.
//! A cell whose corners agree sees what they see. Across one whose corners don't agree runs a border,
//! of a shadow or of what hides it: [`Lattice::cut`] follows it along the cell's edges and leaves
//! triangles on either side of a straight line. Asking more and more places instead would need a
//! thousand of them to know a strip to one percent that a few halvings find.
//!
//! Shares are numbers of [`SEEN`]ths, for crowns let some of the light through.

use std::ops::Range;

use glam::DVec3;

/// What stands for a part that is wholly seen.
pub(in crate::render) const SEEN: u16 = 1 << 15;
/// A node that wasn't asked yet.
pub(in crate::render) const NOT_ASKED: u16 = u16::MAX;
/// Levels that a triangle is halved at most before it is asked: a million cells.
const MOST_LEVELS: u32 = 10;
/// Halvings that find a border on an edge of a cell: to a hundredth of it.
const HALVINGS: u32 = 6;

/// Corners of a triangle ask their questions so far inside of it, m.
const INSET_M: f64 = 2e-3;

/// A share of the light in [`SEEN`]ths.
pub(in crate::render) fn seen_share(share: f32) -> u16 {
    (share * f32::from(SEEN)).round() as u16
}

/// A triangle of PV or a part of one: each splits into four of a quarter of the area.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Cell {
    pub corners: [DVec3; 3],
    /// Halvings since the whole triangle.
    pub level: u32,
    /// Number among the cells of its level; its four parts are `4 index ..`.
    pub index: usize,
    /// Corners on the triangle's lattice of `2^asked` steps along each edge; without meaning below
    /// the asked level.
    pub nodes: [[u16; 2]; 3],
}

impl Cell {
    /// A whole triangle whose cells `asked` levels down lie between the nodes of its lattice.
    pub(in crate::render) fn whole(corners: [DVec3; 3], asked: u32) -> Self {
        let n = 1 << asked;
        Self { corners, level: 0, index: 0, nodes: [[0, 0], [n, 0], [0, n]] }
    }

    pub(in crate::render) fn parts(&self) -> [Self; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
        let [i, j, k] = self.nodes;
        let half = |p: [u16; 2], q: [u16; 2]| [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
        let (ij, jk, ki) = (half(i, j), half(j, k), half(k, i));
        let part = |part, corners, nodes| Self {
            corners,
            level: self.level + 1,
            index: 4 * self.index + part,
            nodes,
        };
        [
            part(0, [a, ab, ca], [i, ij, ki]),
            part(1, [ab, b, bc], [ij, j, jk]),
            part(2, [ca, bc, c], [ki, jk, k]),
            part(3, [ab, bc, ca], [ij, jk, ki]),
        ]
    }

    pub(in crate::render) fn middle(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }

    pub(in crate::render) fn area_m2(&self) -> f64 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a).length()
    }

    /// Largest distance of a corner from the middle, m.
    pub(in crate::render) fn radius_m(&self) -> f64 {
        radius_m(&self.corners)
    }

    /// The cells some levels further down, in their order.
    pub(in crate::render) fn below(&self, levels: u32) -> Vec<Self> {
        let mut cells = vec![*self];
        for _ in 0..levels {
            cells = cells.iter().flat_map(Self::parts).collect();
        }
        cells
    }
}

/// Largest distance of a corner from a triangle's middle, m.
pub(in crate::render) fn radius_m(corners: &[DVec3; 3]) -> f64 {
    let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
    corners.iter().fold(0.0, |r: f64, c| r.max(c.distance(middle)))
}

/// Solid angle of a triangle from a place, sr (Van Oosterom and Strackee 1983).
pub(in crate::render) fn solid_angle_sr(corners: &[DVec3; 3], from: DVec3) -> f64 {
    let [a, b, c] = corners.map(|p| p - from);
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let volume = a.dot(b.cross(c)).abs();
    let across = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
    2.0 * libm::atan2(volume, across).abs()
}

/// A triangle of PV with the level of the cells that are asked what they see.
#[derive(Debug)]
pub(in crate::render) struct PvTriangle {
    /// Index of the facet.
    pub facet: usize,
    pub cell: Cell,
    /// Level of the cells that are asked.
    pub asked: u32,
    pub lattice: Lattice,
}

/// How often a triangle is halved until its longest edge is `cell_m` at most.
pub(in crate::render) fn levels(corners: &[DVec3; 3], cell_m: f64) -> u32 {
    let longest = (0..3).map(|i| corners[i].distance(corners[(i + 1) % 3])).fold(0.0, f64::max);
    let mut levels = 0;
    while longest / f64::from(1_u32 << levels) > cell_m && levels < MOST_LEVELS {
        levels += 1;
    }
    levels
}

impl PvTriangle {
    pub(in crate::render) fn new(facet: usize, corners: [DVec3; 3], cell_m: f64) -> Self {
        let asked = levels(&corners, cell_m);
        let (cell, lattice) = (Cell::whole(corners, asked), Lattice::new(corners, asked));
        Self { facet, cell, asked, lattice }
    }

    /// The asked cells that make up a cell, or the one that it lies in.
    #[inline]
    pub(in crate::render) fn asked_cells(&self, cell: &Cell) -> Range<usize> {
        if cell.level <= self.asked {
            let shift = 2 * (self.asked - cell.level);
            cell.index << shift..(cell.index + 1) << shift
        } else {
            let at = cell.index >> (2 * (cell.level - self.asked));
            at..at + 1
        }
    }
}

/// A part of a cell that is seen by the same share all over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Piece {
    pub corners: [DVec3; 3],
    /// In [`SEEN`]ths.
    pub share: u16,
}

/// The lattice over a triangle between whose nodes the asked cells lie.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Lattice {
    corners: [DVec3; 3],
    /// Steps along each edge.
    steps: usize,
    middle: DVec3,
    /// Scale about the middle that moves corners inside.
    inset: f64,
}

impl Lattice {
    pub(in crate::render) fn new(corners: [DVec3; 3], asked: u32) -> Self {
        let [a, b, c] = corners;
        let inset = 1.0 - (INSET_M / radius_m(&corners)).min(0.1);
        Self { corners, steps: 1 << asked, middle: (a + b + c) / 3.0, inset }
    }

    pub(in crate::render) fn len(&self) -> usize {
        (self.steps + 1) * (self.steps + 2) / 2
    }

    /// Number of a node.
    #[inline]
    pub(in crate::render) fn number(&self, [i, j]: [u16; 2]) -> usize {
        let (i, j) = (usize::from(i), usize::from(j));
        // Rows of steps + 1, steps, .. nodes.
        j * (self.steps + 1) - j * j.saturating_sub(1) / 2 + i
    }

    /// All nodes in the order of their numbers.
    pub(in crate::render) fn nodes(&self) -> Vec<[u16; 2]> {
        let steps = self.steps as u16;
        (0..=steps).flat_map(|j| (0..=steps - j).map(move |i| [i, j])).collect()
    }

    /// Where a node's question is asked: a little inside of the triangle, so that what stands at
    /// its very edge doesn't decide by a rounding.
    pub(in crate::render) fn place(&self, [i, j]: [u16; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        let n = self.steps as f64;
        let at = a + (b - a) * (f64::from(i) / n) + (c - a) * (f64::from(j) / n);
        self.inside(at)
    }

    /// A place of the triangle, moved a little inside.
    fn inside(&self, at: DVec3) -> DVec3 {
        self.middle + (at - self.middle) * self.inset
    }

    /// What the corners of a cell see; nodes that were asked before aren't asked again.
    #[inline]
    pub(in crate::render) fn corners_see(
        &self,
        cell: &Cell,
        at_node: &mut [u16],
        sees: &impl Fn(DVec3) -> u16,
    ) -> [u16; 3] {
        cell.nodes.map(|node| {
            let answer = &mut at_node[self.number(node)];
            if *answer == NOT_ASKED {
                *answer = sees(self.place(node));
            }
            *answer
        })
    }

    /// Cuts a triangle whose corners see different shares into pieces that are seen, after it was
    /// split into four some times.
    pub(in crate::render) fn cut(
        &self,
        corners: [DVec3; 3],
        said: [u16; 3],
        splits: u32,
        sees: &impl Fn(DVec3) -> u16,
        each: &mut impl FnMut(Piece),
    ) {
        let mut keep = |corners, share| {
            if share > 0 {
                each(Piece { corners, share });
            }
        };
        let [a, b, c] = corners;
        if said[0] == said[1] && said[1] == said[2] {
            return keep(corners, said[0]);
        }
        let odd = (0..3).find(|&i| said[(i + 1) % 3] == said[(i + 2) % 3]);
        if splits > 0 || odd.is_none() {
            let middles = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            let [ab, bc, ca] = middles;
            let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
            if splits == 0 {
                // Three shares: crowns before crowns.
                for part in parts {
                    keep(part, sees(self.inside((part[0] + part[1] + part[2]) / 3.0)));
                }
                return;
            }
            let [p, q, r] = middles.map(|m| sees(self.inside(m)));
            let own = [[said[0], p, r], [p, said[1], q], [r, q, said[2]], [p, q, r]];
            for (part, said) in parts.into_iter().zip(own) {
                self.cut(part, said, splits - 1, sees, each);
            }
            return;
        }
        let i = odd.unwrap_or(0);
        let [first, second] = [(i + 1) % 3, (i + 2) % 3];
        let border = |to: DVec3| {
            let (mut near, mut far) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let t = 0.5 * (near + far);
                if sees(self.inside(corners[i].lerp(to, t))) == said[i] {
                    near = t;
                } else {
                    far = t;
                }
            }
            self.inside(corners[i].lerp(to, 0.5 * (near + far)))
        };
        let [p, q] = [first, second].map(|k| border(corners[k]));
        keep([corners[i], p, q], said[i]);
        keep([p, corners[first], corners[second]], said[first]);
        keep([p, corners[second], q], said[first]);
    }
}

/// The part of two triangles of one plane that both cover, as triangles; `normal` is the plane's, and
/// both run counter-clockwise around it.
pub(in crate::render) fn common(
    first: &[DVec3; 3],
    second: &[DVec3; 3],
    normal: DVec3,
    each: &mut impl FnMut([DVec3; 3]),
) {
    let mut polygon = [DVec3::ZERO; 9];
    let mut count = 3;
    polygon[..3].copy_from_slice(first);
    // Sutherland and Hodgman (1974): edge by edge, what lies outside is cut off.
    for i in 0..3 {
        let (a, b) = (second[i], second[(i + 1) % 3]);
        let inward = normal.cross(b - a);
        let (source, before) = (polygon, count);
        count = 0;
        for k in 0..before {
            let (p, q) = (source[k], source[(k + 1) % before]);
            let (at_p, at_q) = (inward.dot(p - a), inward.dot(q - a));
            if at_p >= 0.0 {
                polygon[count] = p;
                count += 1;
            }
            if (at_p >= 0.0) != (at_q >= 0.0) {
                polygon[count] = p.lerp(q, at_p / (at_p - at_q));
                count += 1;
            }
        }
        if count == 0 {
            return;
        }
    }
    for k in 1..count.max(1) - 1 {
        each([polygon[0], polygon[k], polygon[k + 1]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_lie_between_the_nodes_of_the_lattice() {
        let corners = [DVec3::ZERO, DVec3::X * 8.0, DVec3::new(1.0, 6.0, 2.0)];
        let asked = 3;
        let lattice = Lattice::new(corners, asked);
        let nodes = lattice.nodes();
        assert_eq!(nodes.len(), lattice.len());
        for (i, node) in nodes.iter().enumerate() {
            assert_eq!(lattice.number(*node), i);
        }
        let cells = Cell::whole(corners, asked).below(asked);
        assert_eq!(cells.len(), 64);
        let mut area_m2 = 0.0;
        for (i, cell) in cells.iter().enumerate() {
            assert_eq!(cell.index, i);
            area_m2 += cell.area_m2();
            for (corner, node) in cell.corners.iter().zip(cell.nodes) {
                assert!(corner.distance(lattice.place(node)) < 0.15);
            }
        }
        assert!((area_m2 - cells[0].area_m2() * 64.0).abs() < 1e-9);
    }
}
