//! A scattering function as means over the cells of a tensor tree.

use std::f64::consts::PI;

use glam::DVec3;

use super::Bsdf;
use super::disk::{disk_from_square, square_from_disk};

/// How closely cells are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Closeness {
    /// Incident directions per incident coordinate of a cell.
    pub incident: u32,
    /// How often a cell is quartered where the function is uneven: a power of two per edge.
    pub deepest: u32,
}

/// Means of the scattering function over all cells, first coordinate slowest: incident, then
/// outgoing. A rank of 3 has one incident coordinate, `(1 - sin) / 2`, whose upper half is unused.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    pub rank: usize,
    /// Cells per coordinate: 2 to this power.
    pub resolution: u32,
    pub values: Vec<f32>,
    /// Largest correction that made a row scatter what the function scatters, as a share.
    pub corrected: f64,
}

/// Spread of a cell's quarters, relative to their mean, up to which they are believed.
const UNEVEN: f64 = 0.15;
/// Below this, 1/sr, no one looks closer.
const DARK: f64 = 1e-4;

fn upward(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

struct Cell<'a> {
    from: DVec3,
    of: &'a dyn Fn(DVec3, DVec3) -> f64,
    /// Where the mirror direction lies in the square.
    mirror: [f64; 2],
    least_deep: u32,
    deepest: u32,
}

impl Cell<'_> {
    /// Mean over a part of the square, by quarters.
    fn mean(&self, corner: [f64; 2], size: f64, depth: u32) -> f64 {
        let (mut sum, mut low, mut high) = (0.0, f64::INFINITY, 0.0_f64);
        for i in 0..4_u32 {
            let at = |k: usize, bit: u32| corner[k] + size * (0.25 + 0.5 * f64::from(i >> bit & 1));
            let [x, y] = disk_from_square([at(0, 0), at(1, 1)]);
            let value = (self.of)(self.from, upward(x, y));
            sum += 0.25 * value;
            low = low.min(value);
            high = high.max(value);
        }
        // A lobe may hide between the quarters where light is mirrored.
        let near = (0..2).all(|k| (self.mirror[k] - corner[k] - 0.5 * size).abs() < 1.5 * size);
        let even = high - low <= UNEVEN * sum || high < DARK;
        if depth == self.deepest || even && !(near && depth < self.least_deep) {
            return sum;
        }
        (0..4_u32)
            .map(|i| {
                let part = |k: usize, bit: u32| corner[k] + 0.5 * size * f64::from(i >> bit & 1);
                0.25 * self.mean([part(0, 0), part(1, 1)], 0.5 * size, depth + 1)
            })
            .sum()
    }
}

impl Cells {
    /// Takes the means of a model or measured reflection; rows then scatter exactly what it does.
    pub(super) fn of(bsdf: &Bsdf, rank: usize, resolution: u32, closeness: Closeness) -> Self {
        Self::sampled(
            rank,
            resolution,
            closeness,
            &|from, to| bsdf.evaluate(from, to),
            Some(&|from| (bsdf.reflectance(from), bsdf.mirrored(from))),
        )
    }

    /// Takes the means of `value(from, to)`; `shares` are what is scattered in all and into a
    /// delta lobe.
    pub(super) fn sampled(
        rank: usize,
        resolution: u32,
        closeness: Closeness,
        value: &dyn Fn(DVec3, DVec3) -> f64,
        shares: Option<&dyn Fn(DVec3) -> (f64, f64)>,
    ) -> Self {
        let edge = 1_usize << resolution;
        let (row, step) = (edge * edge, 1.0 / edge as f64);
        let projected_sr = PI * step * step;
        let rows = if rank == 3 { edge } else { row };
        let mut values = vec![0.0_f32; rows * row];
        let mut corrected = 0.0_f64;
        let mut sums = vec![0.0_f64; row];
        for (index, cells) in values.chunks_exact_mut(row).enumerate() {
            if rank == 3 && index >= edge / 2 {
                break;
            }
            // Towards grazing incidence reflectances rise steeply.
            let grazing = if rank == 3 && index == 0 { 4 } else { 1 };
            let from = incident_directions(rank, index, edge, grazing * closeness.incident);
            let weight = 1.0 / from.len() as f64;
            sums.fill(0.0);
            let mut scattered = 0.0;
            for &from in &from {
                let (total, delta) = shares.map_or((0.0, 0.0), |s| s(from));
                scattered += weight * total;
                let mirror = square_from_disk([-from.x, -from.y]);
                let least_deep = if delta > 0.0 { 0 } else { 2.min(closeness.deepest) };
                let cell = Cell { from, of: value, mirror, least_deep, deepest: closeness.deepest };
                for (n, sum) in sums.iter_mut().enumerate() {
                    let corner = [(n / edge) as f64 * step, (n % edge) as f64 * step];
                    *sum += weight * cell.mean(corner, step, 0);
                }
                let place = mirror.map(|x| ((x * edge as f64) as usize).min(edge - 1));
                sums[place[0] * edge + place[1]] += weight * delta / projected_sr;
            }
            let mut scale = 1.0;
            if shares.is_some() {
                let sum: f64 = sums.iter().sum::<f64>() * projected_sr;
                if sum > 0.0 {
                    scale = scattered / sum;
                    corrected = corrected.max((scale - 1.0).abs());
                }
            }
            for (cell, sum) in cells.iter_mut().zip(&sums) {
                *cell = (sum * scale) as f32;
            }
        }
        Self { rank, resolution, values, corrected }
    }

    /// Cells of one incident cell.
    pub(super) fn row_of(&self, polar_deg: f64) -> &[f32] {
        let edge = 1_usize << self.resolution;
        let sin = libm::sin(polar_deg.to_radians()).min(1.0);
        let place = |x: f64| ((x * edge as f64) as usize).min(edge - 1);
        let row = if self.rank == 3 {
            place((0.5 - 1e-7 - 0.5 * sin).max(0.0))
        } else {
            let [x, y] = square_from_disk([sin, 0.0]);
            place(x) * edge + place(y)
        };
        &self.values[row * edge * edge..(row + 1) * edge * edge]
    }

    /// Share of the light that a row scatters.
    pub(super) fn scattered(&self, row: &[f32]) -> f64 {
        row.iter().map(|&v| f64::from(v)).sum::<f64>() * PI / row.len() as f64
    }

    /// Polar angles that share the incident cell of one, degrees (rank 3).
    pub(super) fn incident_span_deg(&self, polar_deg: f64) -> (f64, f64) {
        let half = f64::from(1_u32 << self.resolution) / 2.0;
        // Borders belong to the outer ring, as where trees are read.
        let sin = libm::sin(polar_deg.to_radians()) + 2e-7;
        let ring = (sin * half).floor().min(half - 1.0);
        let angle = |r: f64| libm::asin((r / half).min(1.0)).to_degrees();
        (angle(ring), angle(ring + 1.0))
    }
}

/// Directions to the light, even over an incident cell.
fn incident_directions(rank: usize, index: usize, edge: usize, steps: u32) -> Vec<DVec3> {
    let inside =
        |cell: usize, i: u32| (cell as f64 + (f64::from(i) + 0.5) / f64::from(steps)) / edge as f64;
    if rank == 3 {
        return (0..steps).map(|i| upward(-(1.0 - 2.0 * inside(index, i)), 0.0)).collect();
    }
    (0..steps * steps)
        .map(|n| {
            let square = [inside(index / edge, n / steps), inside(index % edge, n % steps)];
            let [x, y] = disk_from_square(square);
            upward(-x, -y)
        })
        .collect()
}
