//! A page: photons to columns of integers when it is written, and back, ready for searching.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::OnceLock;

use glam::Vec3;
use glintmap_formats::gmp::{Columns, Flux};

use super::packed::Packed;
use super::quantise::{flux, flux_code, unit};
use super::store_header::Sums;
use crate::base::morton::{deinterleave, interleave};
use crate::base::{Aabb, Photon};

/// Photons whose box is kept: the unit in which a search looks at a page.
pub(super) const BLOCK: usize = 128;

/// Steps of the integers that positions are rounded to along a page's longest edge: 16 bits.
const STEPS: f32 = 65535.0;

/// Quantises the photons of a page, given in their order in the octree.
pub(super) fn columns(photons: &[Packed]) -> Columns {
    let bounds = Aabb::around(photons.iter().map(|p| p.position));
    let step = bounds.size().max_element() / STEPS;
    let integer = |v: f32| {
        let q = f64::from(v) / f64::from(step);
        // `as` saturates and takes the NaN of 0 / 0 to 0.
        q.round().min(f64::from(STEPS)) as u64
    };
    // 48 bits of code, 13 bits of number in the page: ties stay in the octree's order.
    let mut order: Vec<u64> = photons
        .iter()
        .zip(0u64..)
        .map(|(p, i)| {
            let v = p.position - bounds.min;
            interleave(integer(v.x), integer(v.y), integer(v.z)) << 13 | i
        })
        .collect();
    order.sort_unstable();
    let sorted = || order.iter().map(|key| &photons[(key & 0x1FFF) as usize]);

    let mut table = Table::default();
    let normal = sorted().map(|p| table.index(p.normal)).collect();
    let first = photons.first().map_or(0.0, |p| p.flux_w);
    let flux = if photons.iter().all(|p| p.flux_w == first) {
        Flux::Equal(first.abs().to_bits())
    } else {
        Flux::Codes(sorted().map(|p| flux_code(p.flux_w.abs())).collect())
    };
    Columns {
        origin: bounds.min.to_array(),
        step,
        position: order.iter().map(|key| key >> 13).collect(),
        normal_table: table.normals,
        normal,
        direction: sorted().map(|p| p.direction).collect(),
        flux,
        timestep: sorted().map(|p| p.timestep).collect(),
        surface: sorted().map(|p| p.surface).collect(),
    }
}

/// The different normals of a page, in order of appearance.
#[derive(Default)]
struct Table {
    normals: Vec<[i16; 2]>,
    index: HashMap<[i16; 2], u16>,
    last: u16,
}

impl Table {
    fn index(&mut self, normal: [i16; 2]) -> u16 {
        if self.normals.get(usize::from(self.last)) != Some(&normal) {
            let next = self.normals.len() as u16;
            self.last = *self.index.entry(normal).or_insert(next);
            if self.last == next {
                self.normals.push(normal);
            }
        }
        self.last
    }
}

/// Positions as the store gives them back.
fn positions(columns: &Columns) -> impl Iterator<Item = Vec3> {
    let origin = Vec3::from_array(columns.origin);
    let step = columns.step;
    columns.position.iter().map(move |&code| {
        let q = deinterleave(code);
        origin + Vec3::new(q[0] as f32, q[1] as f32, q[2] as f32) * step
    })
}

/// What a page adds to the sums of the store. Flux is what photons had before they were
/// quantised.
pub(super) fn sums(columns: &Columns, photons: &[Packed]) -> Sums {
    let mut sums = Sums::NONE;
    for photon in photons {
        let flux_w = f64::from(photon.flux_w);
        sums.photons += 1;
        sums.flux_w += flux_w;
        sums.flux2_w2 += flux_w * flux_w;
        sums.flux_min_w = sums.flux_min_w.min(photon.flux_w);
        sums.flux_max_w = sums.flux_max_w.max(photon.flux_w);
    }
    sums.bounds = Aabb::around(positions(columns));
    let mut edges = sums.bounds.size().as_dvec3().to_array();
    edges.sort_by(f64::total_cmp);
    let edge_m = f64::from(columns.step) * 65536.0;
    sums.area_m2 = lit_area(&columns.position, 0, edge_m).min(edges[1] * edges[2]);
    sums
}

/// Photons in a cell that isn't divided further when the lit area is measured: few enough to
/// follow its outline, enough that chance leaves no cell inside of it empty.
const LIT_CELL_PHOTONS: usize = 16;

/// Area of the cells with photons in them, m2: a page's cube is divided until a cell holds at most
/// [`LIT_CELL_PHOTONS`]. `codes` are those of one cell of `edge_m` at `depth`.
fn lit_area(codes: &[u64], depth: u32, edge_m: f64) -> f64 {
    if codes.len() <= LIT_CELL_PHOTONS || depth == 16 {
        return if codes.is_empty() { 0.0 } else { edge_m * edge_m };
    }
    let shift = 3 * (15 - depth);
    codes
        .chunk_by(|a, b| a >> shift == b >> shift)
        .map(|child| lit_area(child, depth + 1, edge_m / 2.0))
        .sum()
}

/// What a search hands on about a photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Flux, W.
    pub flux_w: f32,
    /// Cosine of incidence: its normal times its direction.
    pub cos: f32,
    /// Index of its timestep.
    pub timestep: u32,
    /// The PV surface that sent it.
    pub surface: u16,
}

/// A page in memory.
#[derive(Debug)]
pub(super) struct Page {
    /// Number of photons; the coordinates are filled up to whole blocks with NaN, which is near
    /// nothing.
    pub photons: usize,
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    pub normals: Vec<Vec3>,
    pub normal: Vec<u16>,
    pub light: Vec<Light>,
    direction: Vec<[i16; 2]>,
    /// Boxes around each [`BLOCK`] photons.
    pub blocks: Vec<Aabb>,
    /// First and last timestep of its photons.
    timesteps: (u32, u32),
    /// Numbers of the photons by timestep, from when somebody asks for few timesteps.
    by_timestep: OnceLock<Vec<u16>>,
}

impl Page {
    pub fn new(columns: &Columns) -> Self {
        let photons = columns.position.len();
        let filled = photons.next_multiple_of(BLOCK);
        let mut axes: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(filled));
        for p in positions(columns) {
            axes[0].push(p.x);
            axes[1].push(p.y);
            axes[2].push(p.z);
        }
        let [mut x, mut y, mut z] = axes;
        let blocks = (0..photons)
            .step_by(BLOCK)
            .map(|first| {
                let block = first..photons.min(first + BLOCK);
                Aabb::around(block.map(|i| Vec3::new(x[i], y[i], z[i])))
            })
            .collect();
        for axis in [&mut x, &mut y, &mut z] {
            axis.resize(filled, f32::NAN);
        }
        let normals: Vec<Vec3> = columns.normal_table.iter().map(|&n| unit(n)).collect();
        let light = (0..photons)
            .map(|i| Light {
                flux_w: match &columns.flux {
                    Flux::Equal(bits) => f32::from_bits(*bits),
                    Flux::Codes(codes) => flux(codes[i]),
                },
                cos: normals[usize::from(columns.normal[i])].dot(unit(columns.direction[i])),
                timestep: columns.timestep[i],
                surface: columns.surface[i],
            })
            .collect();
        Self {
            photons,
            x,
            y,
            z,
            normals,
            normal: columns.normal.clone(),
            light,
            direction: columns.direction.clone(),
            blocks,
            timesteps: first_and_last(&columns.timestep),
            by_timestep: OnceLock::new(),
        }
    }

    /// Lists the numbers of the photons of some timesteps, ascending.
    pub fn of_timesteps(&self, timesteps: &Range<u32>, out: &mut Vec<u16>) {
        let timestep = |i: u16| self.light[usize::from(i)].timestep;
        let order = self.by_timestep.get_or_init(|| {
            let mut order: Vec<u16> = (0..self.photons as u16).collect();
            order.sort_unstable_by_key(|&i| (timestep(i), i));
            order
        });
        let before = |end: u32| order.partition_point(|&i| timestep(i) < end);
        out.clear();
        out.extend_from_slice(&order[before(timesteps.start)..before(timesteps.end)]);
        out.sort_unstable();
    }

    /// First and last timestep of its photons.
    pub fn timesteps(&self) -> (u32, u32) {
        self.timesteps
    }

    /// Tight box around its photons.
    pub fn bounds(&self) -> Aabb {
        self.blocks.iter().fold(Aabb::EMPTY, |all, block| all.union(*block))
    }

    /// The photons of a block.
    pub fn block(&self, number: usize) -> Range<usize> {
        number * BLOCK..self.photons.min((number + 1) * BLOCK)
    }

    /// Where a photon lies, metres.
    pub fn position(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    pub fn photon(&self, i: usize) -> Photon {
        let light = self.light[i];
        Photon {
            position: self.position(i),
            normal: self.normals[usize::from(self.normal[i])],
            direction: unit(self.direction[i]),
            flux_w: light.flux_w,
            timestep: light.timestep,
            surface: light.surface,
        }
    }

    /// What it weighs in the cache, with the numbers by timestep, whether or not it has them.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + 12 * self.x.capacity()
            + size_of::<u16>() * self.photons
            + size_of::<Vec3>() * self.normals.capacity()
            + 6 * self.normal.capacity()
            + size_of::<Light>() * self.light.capacity()
            + size_of::<Aabb>() * self.blocks.capacity()
    }
}

fn first_and_last(timesteps: &[u32]) -> (u32, u32) {
    timesteps.iter().fold((u32::MAX, 0), |all, &step| (all.0.min(step), all.1.max(step)))
}
