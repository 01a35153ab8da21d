use glam::DVec3;
use rayon::prelude::*;

use crate::base::{Progress, Timeline};
use crate::render::Error;
use crate::render::facet::Facet;
use crate::site::Site;

/// A triangle of PV or a part of one: each splits into four of a quarter of the area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub corners: [DVec3; 3],
    /// Halvings since the whole triangle.
    pub level: u32,
    /// Number among the cells of its level; its four parts are `4 index ..`.
    pub index: usize,
}

impl Cell {
    pub(super) fn whole(corners: [DVec3; 3]) -> Self {
        Self { corners, level: 0, index: 0 }
    }

    pub(super) fn parts(&self) -> [Self; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
        let triangles = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
        let mut part = 0;
        triangles.map(|corners| {
            let cell = Self { corners, level: self.level + 1, index: 4 * self.index + part };
            part += 1;
            cell
        })
    }

    pub(super) fn middle(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }

    pub(super) fn area_m2(&self) -> f64 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a).length()
    }

    /// Largest distance of a corner from the middle, m.
    pub(super) fn radius_m(&self) -> f64 {
        let middle = self.middle();
        self.corners.iter().fold(0.0, |r: f64, c| r.max(c.distance(middle)))
    }
}

/// A triangle of PV with the level at which it is asked what it sees, and the suns that its cells
/// see.
#[derive(Debug)]
pub(super) struct Rooted {
    /// Index of the facet.
    pub facet: usize,
    pub cell: Cell,
    /// Level of the cells that are asked; cells further down see what these see.
    pub seeing_level: u32,
    /// By level up to that: for each cell and sun whether any of its asked parts sees the sun, and
    /// whether all do.
    any: Vec<Bits>,
    all: Vec<Bits>,
}

/// Rows of bits: one row a cell, one bit a sun.
#[derive(Debug)]
struct Bits {
    words: usize,
    bits: Vec<u64>,
}

impl Bits {
    fn new(rows: usize, columns: usize) -> Self {
        let words = columns.div_ceil(64);
        Self { words, bits: vec![0; rows * words] }
    }

    #[inline]
    fn get(&self, row: usize, column: usize) -> bool {
        self.bits[row * self.words + column / 64] >> (column % 64) & 1 != 0
    }

    fn row(&self, row: usize) -> &[u64] {
        &self.bits[row * self.words..(row + 1) * self.words]
    }
}

/// What a cell sees of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sees {
    None,
    Part,
    All,
}

impl Sees {
    pub(super) fn of(any: bool, all: bool) -> Self {
        match (any, all) {
            (false, _) => Self::None,
            (true, false) => Self::Part,
            (true, true) => Self::All,
        }
    }
}

impl Rooted {
    /// Cells of the asked level.
    pub(super) fn seeing(&self) -> usize {
        1 << (2 * self.seeing_level)
    }

    /// What a cell sees of a sun.
    #[inline]
    pub(super) fn sees_sun(&self, cell: &Cell, sun: usize) -> Sees {
        let level = cell.level.min(self.seeing_level);
        let row = cell.index >> (2 * (cell.level - level));
        let level = level as usize;
        Sees::of(self.any[level].get(row, sun), self.all[level].get(row, sun))
    }

    /// The cells of the asked level, in their order.
    pub(super) fn asked(&self) -> Vec<Cell> {
        let mut cells = vec![self.cell];
        for _ in 0..self.seeing_level {
            cells = cells.iter().flat_map(Cell::parts).collect();
        }
        cells
    }
}

/// Levels that a triangle is halved at most before it is asked: a million cells.
const MOST_LEVELS: u32 = 10;

/// All triangles of the facets, each asked in cells of `cell_m` or a little less which suns it
/// sees: independent of where the light goes. `sun_visibility = false`: all of those in front.
pub(super) fn rooted(
    site: &Site,
    facets: &[Facet],
    timeline: &Timeline,
    cell_m: f64,
    sun_visibility: bool,
    progress: &dyn Progress,
) -> Result<Vec<Rooted>, Error> {
    let mut out = Vec::new();
    for (number, facet) in facets.iter().enumerate() {
        for corners in &facet.triangles {
            let cell = Cell::whole(*corners);
            let longest =
                (0..3).map(|i| corners[i].distance(corners[(i + 1) % 3])).fold(0.0, f64::max);
            let mut seeing_level = 0;
            while longest / f64::from(1_u32 << seeing_level) > cell_m && seeing_level < MOST_LEVELS
            {
                seeing_level += 1;
            }
            out.push(Rooted {
                facet: number,
                cell,
                seeing_level,
                any: Vec::new(),
                all: Vec::new(),
            });
        }
    }
    let cells: u64 = out.iter().map(|r| r.seeing() as u64).sum();
    progress.begin("sun on the PV", cells, "cells");
    for root in &mut out {
        let facet = &facets[root.facet];
        let suns = timeline.steps.len();
        let words = suns.div_ceil(64);
        let mut finest = Bits::new(root.seeing(), suns);
        let asked = root.asked();
        finest.bits.par_chunks_mut(words).zip(&asked).try_for_each(|(row, cell)| {
            progress.check()?;
            let start = facet.lifted(cell.middle()).as_vec3();
            for (i, step) in timeline.steps.iter().enumerate() {
                let free = facet.frame.z.dot(step.sun) > 0.0
                    && (!sun_visibility
                        || !site.bvh.occluded(start, step.sun.as_vec3(), 0.0, f32::INFINITY));
                row[i / 64] |= u64::from(free) << (i % 64);
            }
            progress.advance(1);
            Ok::<(), Error>(())
        })?;
        root.gather(finest, suns);
    }
    progress.finish();
    Ok(out)
}

impl Rooted {
    /// From the asked level up to the whole.
    fn gather(&mut self, finest: Bits, suns: usize) {
        let copy = Bits { words: finest.words, bits: finest.bits.clone() };
        let (mut any, mut all) = (vec![finest], vec![copy]);
        for level in (0..self.seeing_level).rev() {
            let rows = 1 << (2 * level);
            let (mut some, mut every) = (Bits::new(rows, suns), Bits::new(rows, suns));
            let (below_any, below_all) = (&any[any.len() - 1], &all[all.len() - 1]);
            for row in 0..rows {
                for word in 0..some.words {
                    let parts = |bits: &Bits| [0, 1, 2, 3].map(|p| bits.row(4 * row + p)[word]);
                    let at = row * some.words + word;
                    some.bits[at] = parts(below_any).iter().fold(0, |s, w| s | w);
                    every.bits[at] = parts(below_all).iter().fold(u64::MAX, |s, w| s & w);
                }
            }
            any.push(some);
            all.push(every);
        }
        any.reverse();
        all.reverse();
        (self.any, self.all) = (any, all);
    }
}
