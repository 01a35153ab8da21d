//! Photons that neighbouring pixels share, and the k nearest among them.
//!
//! All photons that any pixel of a group can need are loaded once. For pixels on one plane they
//! are put into a grid of rows, so that the photons around a pixel are a few runs of memory; the
//! k-th distance is selected among those, and is exact: the same as a search of its own gives.

use glam::Vec3;

use super::Estimator;
use crate::base::Aabb;
use crate::pages::{Neighbour, Neighbours};

/// Rows of the grid within the reach of a pixel's search, one side.
const ROWS: f32 = 6.0;
/// Rows or columns of a grid at most.
const MOST_ROWS: f32 = 512.0;

/// What a sum needs to know about a photon.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Light {
    /// What it gives the surface, and what a plane that faces it: see [`super::fixed`].
    pub surface: i64,
    pub normal: i64,
    /// Its index in the store.
    pub index: u64,
    pub timestep: u32,
}

/// A photon as it was loaded.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loaded {
    pub position: Vec3,
    pub normal: Vec3,
    pub light: Light,
}

/// The photons of one plane, by the cells of a grid, row by row.
#[derive(Debug, Default)]
pub(super) struct Candidates {
    axes: [usize; 2],
    low: [f32; 2],
    per_m: f32,
    size: [usize; 2],
    start: Vec<u32>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    normal: Vec<Vec3>,
    light: Vec<Light>,
    cells: Vec<(u32, u32)>,
    near: Near,
}

/// Whether a photon, by place and normal, may count.
pub(super) type Accept<'a> = dyn Fn(Vec3, Vec3) -> bool + 'a;

/// Photons within the distance looked at.
#[derive(Debug, Default)]
struct Near {
    distance2: Vec<f32>,
    place: Vec<u32>,
    used: usize,
    scratch: Vec<u32>,
    ties: Vec<u64>,
}

/// What bounds a pixel's photons: all that are nearer, and those at exactly this distance whose
/// index is below the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub distance2_m2: f32,
    pub index: u64,
    /// Whether the k-th photon sets it; if not, the largest radius does.
    pub full: bool,
}

impl Candidates {
    /// Takes those of `loaded` that `accept` lets through. Rows are parted for pixels with this
    /// normal; others are found as well.
    pub fn fill(
        &mut self,
        loaded: &[Loaded],
        normal: Vec3,
        (region, reach_m): (Aabb, f32),
        accept: Option<&Accept<'_>>,
    ) {
        let n = normal.abs();
        self.axes = if n.z >= n.x && n.z >= n.y {
            [0, 1]
        } else if n.x >= n.y {
            [1, 2]
        } else {
            [0, 2]
        };
        let [a, b] = self.axes;
        let size = region.size();
        self.low = [region.min[a], region.min[b]];
        self.per_m = (ROWS / reach_m).min(MOST_ROWS / size[a].max(size[b]).max(1e-6));
        let count = |extent: f32| (extent * self.per_m) as usize + 1;
        self.size = [count(size[a]), count(size[b])];
        self.start.clear();
        self.start.resize(self.size[0] * self.size[1] + 1, 0);
        self.cells.clear();
        for (i, photon) in loaded.iter().enumerate() {
            if accept.is_none_or(|accept| accept(photon.position, photon.normal)) {
                let cell =
                    self.row(photon.position[b]) * self.size[0] + self.column(photon.position[a]);
                self.cells.push((cell as u32, i as u32));
                self.start[cell + 1] += 1;
            }
        }
        for cell in 1..self.start.len() {
            self.start[cell] += self.start[cell - 1];
        }
        let total = self.cells.len();
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(total, 0.0);
        }
        self.light.resize(total, Light::default());
        self.normal.resize(total, Vec3::ZERO);
        for &(cell, i) in &self.cells {
            let at = self.start[cell as usize] as usize;
            self.start[cell as usize] += 1;
            let photon = &loaded[i as usize];
            (self.x[at], self.y[at], self.z[at]) = photon.position.into();
            self.light[at] = photon.light;
            self.normal[at] = photon.normal;
        }
        // Every start became the next cell's: back by one.
        self.start.rotate_right(1);
        self.start[0] = 0;
    }

    // Coordinate to cell rises with the coordinate, rounding included; `as` saturates.
    fn column(&self, value: f32) -> usize {
        (((value - self.low[0]) * self.per_m) as usize).min(self.size[0] - 1)
    }

    fn row(&self, value: f32) -> usize {
        (((value - self.low[1]) * self.per_m) as usize).min(self.size[1] - 1)
    }

    /// Lists the photons within `reach_m` of `point` that `accept` lets through.
    fn look(&mut self, point: Vec3, reach_m: f32, accept: Option<&Accept<'_>>) {
        let [a, b] = self.axes;
        let most = reach_m * reach_m;
        // Wider than the reach by more than rounding: the exact distances decide.
        let wide = reach_m * 1.0001 + 1e-5;
        let (p, q) = (point[a], point[b]);
        self.near.used = 0;
        let cell_m = 1.0 / self.per_m;
        for row in self.row(q - wide)..=self.row(q + wide) {
            let low = self.low[1] + row as f32 * cell_m;
            let gap = (low - q).max(q - (low + cell_m)).max(0.0) - 1e-4 * cell_m;
            let gap = gap.max(0.0);
            let half = (wide * wide - gap * gap).max(0.0).sqrt();
            let line = row * self.size[0];
            let from = self.start[line + self.column(p - half)] as usize;
            let to = self.start[line + self.column(p + half) + 1] as usize;
            let (x, y, z) = (&self.x[from..to], &self.y[from..to], &self.z[from..to]);
            self.near.add(point, (x, y, z), from, most);
        }
        let Some(accept) = accept else { return };
        let near = &mut self.near;
        let mut kept = 0;
        for i in 0..near.used {
            let (d, place) = (near.distance2[i], near.place[i]);
            let at = place as usize;
            let position = Vec3::new(self.x[at], self.y[at], self.z[at]);
            (near.distance2[kept], near.place[kept]) = (d, place);
            kept += usize::from(accept(position, self.normal[at]));
        }
        near.used = kept;
    }

    /// Finds what bounds the `count` nearest photons of `point`, looking as far as `guess_m` first
    /// and up to `reach_m`; `None` where there are fewer and `reach_m` isn't the last word.
    pub fn bound(
        &mut self,
        point: Vec3,
        count: usize,
        estimator: Estimator,
        (guess_m, reach_m, last_word): (f32, f32, bool),
        accept: Option<&Accept<'_>>,
    ) -> Option<Bound> {
        let mut guess_m = guess_m.min(reach_m);
        loop {
            self.look(point, guess_m, accept);
            if self.near.used >= count {
                return Some(self.near.nearest(count, estimator, &self.light));
            }
            if guess_m >= reach_m {
                let all = Bound { distance2_m2: reach_m * reach_m, index: u64::MAX, full: false };
                return last_word.then_some(all);
            }
            guess_m = (guess_m * 1.3).max(1e-4).min(reach_m);
        }
    }

    /// Lists what a search of the store's own found, and what bounds it. `light` turns a photon
    /// into what is summed.
    pub fn take(
        &mut self,
        found: &Neighbours,
        estimator: Estimator,
        max_radius_m: f32,
        light: impl Fn(&Neighbour) -> Light,
    ) -> Bound {
        let items = found.items();
        self.light.clear();
        self.light.extend(items.iter().map(light));
        let near = &mut self.near;
        near.distance2.clear();
        near.distance2.extend(items.iter().map(|n| n.distance2_m2));
        near.place.clear();
        near.place.extend(0..items.len() as u32);
        near.used = items.len();
        match found.farthest().filter(|_| found.full()) {
            Some(last) => {
                let Neighbour { distance2_m2, index, .. } = items[last];
                Bound { distance2_m2, index: index + estimator.keeps_last(), full: true }
            }
            None => {
                Bound { distance2_m2: max_radius_m * max_radius_m, index: u64::MAX, full: false }
            }
        }
    }

    /// Lists the photons for a bound that is known.
    pub fn look_again(&mut self, point: Vec3, bound: Bound, accept: Option<&Accept<'_>>) {
        // The square root is rounded; exact squares decide below.
        self.look(point, bound.distance2_m2.sqrt() * 1.000_001, accept);
    }

    /// Calls `each` for the photons within the bound among those listed, with the square of their
    /// distance.
    pub fn within(&self, bound: Bound, mut each: impl FnMut(&Light, f32)) {
        let near = &self.near;
        for (&d, &place) in near.distance2[..near.used].iter().zip(&near.place[..near.used]) {
            let light = &self.light[place as usize];
            if d < bound.distance2_m2 || d == bound.distance2_m2 && light.index < bound.index {
                each(light, d);
            }
        }
    }
}

impl Near {
    /// Adds the photons of a run that lie within `most`, without a branch that depends on them.
    fn add(&mut self, point: Vec3, (x, y, z): (&[f32], &[f32], &[f32]), first: usize, most: f32) {
        const LANES: usize = 32;
        let needed = self.used + x.len() + LANES;
        if self.distance2.len() < needed {
            self.distance2.resize(2 * needed, 0.0);
            self.place.resize(2 * needed, 0);
        }
        let mut used = self.used;
        let mut near = [0f32; LANES];
        let length = x.len();
        let (y, z) = (&y[..length], &z[..length]);
        for from in (0..length).step_by(LANES) {
            let lanes = LANES.min(length - from);
            let (x, y, z) =
                (&x[from..from + lanes], &y[from..from + lanes], &z[from..from + lanes]);
            for i in 0..lanes {
                // As in the store's own search, operation by operation.
                let (dx, dy, dz) = (x[i] - point.x, y[i] - point.y, z[i] - point.z);
                near[i] = dx * dx + dy * dy + dz * dz;
            }
            let distance2 = &mut self.distance2[used..used + LANES];
            let place = &mut self.place[used..used + LANES];
            let mut kept = 0;
            for (i, &d) in near[..lanes].iter().enumerate() {
                distance2[kept] = d;
                place[kept] = (first + from + i) as u32;
                kept += usize::from(d <= most);
            }
            used += kept;
        }
        self.used = used;
    }

    /// The bound of the `count` nearest; of several at the k-th distance those of the lowest index
    /// count, and the highest of these is the k-th.
    fn nearest(&mut self, count: usize, estimator: Estimator, light: &[Light]) -> Bound {
        self.scratch.clear();
        // For floats that aren't negative their bits are in order.
        self.scratch.extend(self.distance2[..self.used].iter().map(|d| d.to_bits()));
        let (before, &mut kth, after) = self.scratch.select_nth_unstable(count - 1);
        let equal = |d: &&u32| **d == kth;
        let ties_before = before.iter().filter(equal).count();
        let alone = ties_before == 0 && !after.contains(&kth);
        let distance2_m2 = f32::from_bits(kth);
        self.ties.clear();
        for (&d, &place) in self.distance2[..self.used].iter().zip(&self.place[..self.used]) {
            if d == distance2_m2 {
                self.ties.push(light[place as usize].index);
                if alone {
                    break;
                }
            }
        }
        self.ties.sort_unstable();
        let last = self.ties[ties_before];
        Bound { distance2_m2, index: last + estimator.keeps_last(), full: true }
    }
}
