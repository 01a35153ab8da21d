//! The octree: how sorted photons are cut into leaves, and the nodes above the pages.

use std::collections::VecDeque;
use std::ops::Range;

use glintmap_formats::gmp::{Node, PageEntry};

use crate::base::Aabb;
use crate::base::morton::LEVELS;

/// A cell of the octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Depth; 0 is the cube.
    pub level: u32,
    /// Its Morton code, of `3 * level` bits.
    pub code: u64,
}

impl Cell {
    /// The cube.
    pub const ROOT: Self = Self { level: 0, code: 0 };

    /// First Morton code of the deepest level in it.
    pub fn first(self) -> u64 {
        self.code << (3 * (LEVELS - self.level))
    }

    /// Last Morton code of the deepest level in it.
    pub fn last(self) -> u64 {
        ((self.code + 1) << (3 * (LEVELS - self.level))) - 1
    }

    /// The cells that it consists of some levels further down, at most down to the deepest.
    pub fn cut(self, levels: u32) -> impl Iterator<Item = Self> {
        let down = levels.min(LEVELS - self.level);
        let (level, first) = (self.level + down, self.code << (3 * down));
        (first..first + (1 << (3 * down))).map(move |code| Self { level, code })
    }
}

/// Photons of neighbouring cells that share a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    /// First Morton code that it covers.
    pub first: u64,
    /// Last Morton code that it covers.
    pub last: u64,
    /// Number of photons; more than a page holds only where it wasn't cut further.
    pub photons: u64,
}

/// Cuts a cell into leaves of at most `capacity` photons, down to level `deepest`; sparse siblings
/// that lie side by side share one. Depends on nothing but the photons, so that however the work is
/// cut the leaves are the same. `count` tells the photons in a range of codes, ends included.
pub(super) fn cut(
    cell: Cell,
    deepest: u32,
    capacity: u64,
    count: &impl Fn(u64, u64) -> u64,
    leaves: &mut Vec<Leaf>,
) {
    let leaf = |cell: Cell| {
        let (first, last) = (cell.first(), cell.last());
        Leaf { first, last, photons: count(first, last) }
    };
    let whole = leaf(cell);
    if whole.photons <= capacity || cell.level == deepest {
        leaves.extend((whole.photons > 0).then_some(whole));
        return;
    }
    let mut open: Option<Leaf> = None;
    for child in cell.cut(1) {
        let here = leaf(child);
        match &mut open {
            _ if here.photons == 0 => {}
            _ if here.photons > capacity => {
                leaves.extend(open.take());
                cut(child, deepest, capacity, count, leaves);
            }
            Some(leaf) if leaf.photons + here.photons <= capacity => {
                leaf.last = here.last;
                leaf.photons += here.photons;
            }
            _ => {
                leaves.extend(open.take());
                open = Some(here);
            }
        }
    }
    leaves.extend(open);
}

/// The level of the smallest cell that holds both codes.
fn level_around(first: u64, last: u64) -> u32 {
    let differ = 64 - (first ^ last).leading_zeros();
    LEVELS - differ.div_ceil(3).min(LEVELS)
}

/// The nodes above some pages; the root first, children side by side and behind their parent.
pub(super) fn nodes(pages: &[PageEntry]) -> Vec<Node> {
    let mut nodes = Vec::new();
    let mut queue = VecDeque::new();
    if !pages.is_empty() {
        nodes.push(node(pages, 0..pages.len()));
        queue.push_back((0, 0..pages.len()));
    }
    while let Some((parent, range)) = queue.pop_front() {
        let level = nodes[parent].level;
        let groups = children(pages, range, level);
        if groups.len() < 2 {
            continue;
        }
        nodes[parent].first_child = nodes.len() as u32;
        nodes[parent].children = groups.len() as u32;
        for group in groups {
            queue.push_back((nodes.len(), group.clone()));
            nodes.push(node(pages, group));
        }
    }
    nodes
}

fn node(pages: &[PageEntry], range: Range<usize>) -> Node {
    let here = &pages[range.clone()];
    let bounds = here.iter().fold(Aabb::EMPTY, |all, page| all.union(page_box(page)));
    Node {
        min: bounds.min.to_array(),
        max: bounds.max.to_array(),
        level: level_around(here[0].first_cell, here[here.len() - 1].last_cell),
        first_child: 0,
        children: 0,
        first_page: range.start as u32,
        pages: range.len() as u32,
    }
}

/// The pages of a node by octant. A page that covers several octants is a child by itself, a
/// chain of pages in one cell is one child.
fn children(pages: &[PageEntry], range: Range<usize>, level: u32) -> Vec<Range<usize>> {
    if level == LEVELS {
        return Vec::new();
    }
    let octants = |page: &PageEntry| {
        let shift = 3 * (LEVELS - level - 1);
        (page.first_cell >> shift, page.last_cell >> shift)
    };
    let mut out: Vec<Range<usize>> = Vec::new();
    let mut before = None;
    for i in range {
        let now = octants(&pages[i]);
        match out.last_mut() {
            Some(group) if before == Some(now) && now.0 == now.1 => group.end = i + 1,
            _ => out.push(i..i + 1),
        }
        before = Some(now);
    }
    out
}

/// The box of a page.
pub(super) fn page_box(page: &PageEntry) -> Aabb {
    Aabb { min: page.min.into(), max: page.max.into() }
}

/// The box of a node.
pub(super) fn node_box(node: &Node) -> Aabb {
    Aabb { min: node.min.into(), max: node.max.into() }
}
