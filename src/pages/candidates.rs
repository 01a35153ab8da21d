//! Candidates of a search: gathered block by block, selected without a branch that depends on them.
//!
//! A photon is a candidate or not as good as at random, so that a branch on it is mispredicted every
//! other time and costs more than the arithmetic. So everything is written to the next free place and
//! the place is taken or not: `kept += usize::from(condition)`. Distances that aren't negative are
//! ordered as their bits are, so that they are selected as integers. The k-th distance lies most likely
//! where it lay for the query before: only what is farther than that is sorted out.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use super::page::{BLOCK, Page};
use super::query::{Neighbour, Query, SAME_SIDE};

/// Candidates of a search, page by page in the order in which they were met.
#[derive(Default)]
pub(super) struct Candidates {
    pub runs: Vec<Run>,
    /// Squares of distances, as bits: for floats that aren't negative these are in order.
    pub distance: Vec<u32>,
    /// Number in the page.
    pub place: Vec<u32>,
    /// Distances among which the k-th is selected.
    selected: Vec<u32>,
    /// How many of `distance` and `place` are candidates; what lies behind is room.
    pub used: usize,
}

/// A page of the store.
pub(super) struct PageOf {
    pub number: u32,
    /// Store index of its first photon.
    pub first_photon: u64,
    pub page: Arc<Page>,
}

/// The candidates of one page.
pub(super) struct Run {
    of: PageOf,
    start: usize,
}

impl Run {
    /// The photon at a place in the page.
    pub fn photon(&self, place: u32, distance2_m2: f32) -> Neighbour {
        let light = self.of.page.light[place as usize];
        Neighbour {
            index: self.of.first_photon + u64::from(place),
            distance2_m2,
            flux_w: light.flux_w,
            cos: light.cos,
            timestep: light.timestep,
            surface: light.surface,
        }
    }
}

/// A distance, and the highest store index that may still win at exactly that distance.
#[derive(Clone, Copy)]
pub(super) struct Bound {
    pub distance2: f32,
    pub index: u64,
}

/// Which normals of a page lie on the query's side.
enum Side {
    All,
    None,
    /// One bit for each of up to 64 normals.
    Some(u64),
    /// Too many to tell beforehand.
    Each,
}

fn side(page: &Page, normal: Vec3) -> Side {
    if normal == Vec3::ZERO {
        return Side::All;
    }
    if page.normals.len() > 64 {
        return Side::Each;
    }
    let mut bits = 0u64;
    for (i, n) in page.normals.iter().enumerate() {
        bits |= u64::from(n.dot(normal) >= SAME_SIDE) << i;
    }
    match bits.count_ones() as usize {
        0 => Side::None,
        n if n == page.normals.len() => Side::All,
        _ => Side::Some(bits),
    }
}

impl Candidates {
    pub fn clear(&mut self) {
        self.runs.clear();
        self.used = 0;
    }

    /// Adds the photons of a page within `most`, the square of a distance.
    pub fn gather(&mut self, query: &Query, of: PageOf, most: f32) {
        let page = &*of.page;
        let side = side(page, query.normal);
        if matches!(side, Side::None) {
            return;
        }
        let start = self.used;
        for (block, bounds) in page.blocks.iter().enumerate() {
            if bounds.distance_squared(query.point) > most {
                continue;
            }
            let base = block * BLOCK;
            let from = self.used;
            self.block(query.point, page, base, most);
            let accept = |i: u32| {
                let normal = usize::from(page.normal[i as usize]);
                match side {
                    Side::Some(bits) => bits >> normal & 1 == 1,
                    _ => page.normals[normal].dot(query.normal) >= SAME_SIDE,
                }
            };
            if matches!(side, Side::Some(_) | Side::Each) {
                self.retain(from, accept);
            }
        }
        if self.used > start {
            self.runs.push(Run { of, start });
        }
    }

    /// Keeps those of the candidates from `from` on that are accepted by their place.
    fn retain(&mut self, from: usize, accept: impl Fn(u32) -> bool) {
        let mut kept = from;
        for at in from..self.used {
            let i = self.place[at];
            self.place[kept] = i;
            self.distance[kept] = self.distance[at];
            kept += usize::from(accept(i));
        }
        self.used = kept;
    }

    /// Adds the photons of a block within `most`, without a branch that depends on them.
    fn block(&mut self, point: Vec3, page: &Page, base: usize, most: f32) {
        if self.distance.len() < self.used + BLOCK {
            let room = (self.used + BLOCK) * 2;
            self.distance.resize(room, 0);
            self.place.resize(room, 0);
        }
        let end = base + BLOCK;
        let (x, y, z) = (&page.x[base..end], &page.y[base..end], &page.z[base..end]);
        let mut near = [0f32; BLOCK];
        for i in 0..BLOCK {
            let (dx, dy, dz) = (x[i] - point.x, y[i] - point.y, z[i] - point.z);
            near[i] = dx * dx + dy * dy + dz * dz;
        }
        let distance = &mut self.distance[self.used..self.used + BLOCK];
        let place = &mut self.place[self.used..self.used + BLOCK];
        let mut kept = 0;
        for (i, &near) in near.iter().enumerate() {
            distance[kept] = near.to_bits();
            place[kept] = (base + i) as u32;
            // The filling up to whole blocks is NaN and fails here.
            kept += usize::from(near <= most);
        }
        self.used += kept;
    }

    /// Keeps the `count` nearest; what lies beyond the bound it returns can't be among them.
    /// `likely2`: a square distance within which there are most likely less than `count`, so that
    /// only what lies beyond must be sorted out; the result doesn't depend on it.
    pub fn keep(&mut self, count: usize, likely2: f32) -> Bound {
        if self.used <= count {
            return Bound { distance2: f32::INFINITY, index: u64::MAX };
        }
        let mut below = self.select_from(likely2.to_bits());
        if below >= count {
            below = self.select_from(0);
        }
        let (nearer, &mut farthest, farther) = self.selected.select_nth_unstable(count - 1 - below);
        let ties = |some: &[u32]| some.iter().filter(|&&d| d == farthest).count();
        let (winning, losing) = (ties(nearer) + 1, ties(farther));
        let highest = if losing == 0 { u64::MAX } else { self.tie(farthest, winning) };
        let mut kept = 0;
        let mut runs = 0;
        for r in 0..self.runs.len() {
            let (within, first) = (self.within(r), self.runs[r].of.first_photon);
            let new_start = kept;
            for at in within {
                let (d, place) = (self.distance[at], self.place[at]);
                self.distance[kept] = d;
                self.place[kept] = place;
                let wins = d < farthest || d == farthest && first + u64::from(place) <= highest;
                kept += usize::from(wins);
            }
            if kept > new_start {
                self.runs.swap(runs, r);
                self.runs[runs].start = new_start;
                runs += 1;
            }
        }
        // Pages of which nothing is left are let go.
        self.runs.truncate(runs);
        self.used = kept;
        let index = match highest {
            u64::MAX => self.at(farthest).max().unwrap_or(u64::MAX),
            highest => highest,
        };
        Bound { distance2: f32::from_bits(farthest), index }
    }

    /// Takes the distances from `least` on for selection; the number of those before.
    fn select_from(&mut self, least: u32) -> usize {
        self.selected.resize(self.used, 0);
        let mut kept = 0;
        for &d in &self.distance[..self.used] {
            self.selected[kept] = d;
            kept += usize::from(d >= least);
        }
        self.selected.truncate(kept);
        self.used - kept
    }

    /// The `rank`-th lowest store index (from 1) among the candidates at a distance.
    fn tie(&self, distance: u32, rank: usize) -> u64 {
        let mut indices: Vec<u64> = self.at(distance).collect();
        let (_, &mut index, _) = indices.select_nth_unstable(rank - 1);
        index
    }

    fn at(&self, distance: u32) -> impl Iterator<Item = u64> {
        self.runs.iter().enumerate().flat_map(move |(r, run)| {
            let here = self.within(r).filter(move |&at| self.distance[at] == distance);
            here.map(move |at| run.of.first_photon + u64::from(self.place[at]))
        })
    }

    /// The candidates of a run.
    fn within(&self, run: usize) -> Range<usize> {
        self.runs[run].start..self.runs.get(run + 1).map_or(self.used, |next| next.start)
    }

    /// The runs in store order, each with its range of candidates, which are in order already.
    pub fn in_order(&self) -> Vec<(usize, Range<usize>)> {
        let mut ranges: Vec<(usize, Range<usize>)> =
            (0..self.runs.len()).map(|r| (r, self.within(r))).collect();
        ranges.sort_unstable_by_key(|(r, _)| self.runs[*r].of.number);
        ranges
    }
}
