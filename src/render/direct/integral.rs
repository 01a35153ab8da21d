use glam::DVec3;

use super::cells::{Cell, Rooted, Sees};
use super::disc::Disc;
use super::kernel::{Batch, Kernel};
use super::scene::{Lights, Spot};
use crate::base::Frame;
use crate::render::MIN_COS;
use crate::render::facet::Facet;

/// What arrives at one spot, by timestep. Only timesteps in `lit` are not 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DirectYear {
    /// Irradiance of the surface, W/m2, by timestep.
    pub surface_w_m2: Vec<f64>,
    /// Irradiance of planes that face the beams (E_n), W/m2, by timestep.
    pub normal_w_m2: Vec<f64>,
    /// Bound of the quadrature's error in `surface_w_m2`, by timestep.
    pub error_w_m2: Vec<f64>,
    /// Timesteps that are lit, in the order in which they were met.
    pub lit: Vec<u32>,
}

impl DirectYear {
    pub(super) fn clear(&mut self, timesteps: usize) {
        for list in [&mut self.surface_w_m2, &mut self.normal_w_m2, &mut self.error_w_m2] {
            list.clear();
            list.resize(timesteps, 0.0);
        }
        self.lit.clear();
    }

    #[inline]
    pub(super) fn add(&mut self, step: u32, surface: f64, normal: f64, error: f64) {
        if normal > 0.0 {
            let i = step as usize;
            if self.normal_w_m2[i] == 0.0 {
                self.lit.push(step);
            }
            self.surface_w_m2[i] += surface;
            self.normal_w_m2[i] += normal;
            self.error_w_m2[i] += error;
        }
    }
}

/// Radon's rule on a triangle, 7 points of degree 5 (1948); the first is the middle, which alone
/// is a rule of degree 1: the two together tell how the integrand bends.
const RADON: [([f64; 3], f64); 7] = {
    const A: f64 = 0.470_142_064_105_115_1;
    const B: f64 = 0.101_286_507_323_456_34;
    const A1: f64 = 1.0 - 2.0 * A;
    const B1: f64 = 1.0 - 2.0 * B;
    const WA: f64 = 0.132_394_152_788_506_18;
    const WB: f64 = 0.125_939_180_544_827_15;
    const T: f64 = 1.0 / 3.0;
    [
        ([T, T, T], 0.225),
        ([A1, A, A], WA),
        ([A, A1, A], WA),
        ([A, A, A1], WA),
        ([B1, B, B], WB),
        ([B, B1, B], WB),
        ([B, B, B1], WB),
    ]
};

/// How the rule's bend may be at most, as a share of the value: the error is below its square.
const BEND: f64 = 0.03;
/// What a cell may be wrong by however small its light is, W/m2 on a plane that faces it.
const NEGLIGIBLE_W_M2: f64 = 1e-5;
/// A cell is looked at through its rule once its half vectors spread less than this share of the
/// lobe's width: before, the lobe could fall between the points.
const SPREAD: f64 = 0.7;
/// Lobe widths within which the sun is a disc; outside a point at its middle does (the difference
/// falls with the square of the distance).
const NEAR_WIDTHS: f64 = 10.0;
/// Levels below the asked one.
const DEEPER: u32 = 8;

/// Scratch of one thread, kept from spot to spot.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pool: Vec<Batch>,
    values: Vec<f64>,
    sums: [Vec<f64>; 3],
    discs: Batch,
}

/// The integral over one facet of what it scatters to one spot.
pub(super) struct Integral<'a> {
    pub facet: &'a Facet,
    pub root: &'a Rooted,
    pub kernel: Kernel<'a>,
    pub disc: &'a Disc,
    /// Points of the disc.
    pub points: &'a [(f64, f64)],
    pub spot: &'a Spot,
    pub max_path_m: f64,
    /// Which of the root's asked cells the spot sees; the number of those before each.
    pub seen_before: &'a [u32],
    pub scratch: &'a mut Scratch,
    pub year: &'a mut DirectYear,
}

impl Integral<'_> {
    pub(super) fn add(&mut self, lights: &Lights) {
        let whole = self.root.cell;
        self.descend(&whole, &lights.batch);
    }

    /// What the spot sees of a cell.
    fn sees(&self, cell: &Cell) -> Sees {
        let asked = self.root.seeing_level;
        let (first, last) = if cell.level <= asked {
            let shift = 2 * (asked - cell.level);
            (cell.index << shift, (cell.index + 1) << shift)
        } else {
            let at = cell.index >> (2 * (cell.level - asked));
            (at, at + 1)
        };
        let count = (self.seen_before[last] - self.seen_before[first]) as usize;
        Sees::of(count > 0, count == last - first)
    }

    fn descend(&mut self, cell: &Cell, suns: &Batch) {
        let seen = self.sees(cell);
        if seen == Sees::None || suns.len() == 0 {
            return;
        }
        let mut pool = || self.scratch.pool.pop().unwrap_or_default();
        let (mut far, mut near, mut finer) = (pool(), pool(), pool());
        for batch in [&mut far, &mut near, &mut finer] {
            batch.clear();
        }
        self.sort(cell, suns, seen, &mut far, &mut near, &mut finer);
        let deepest = cell.level >= self.root.seeing_level + DEEPER;
        for (batch, as_disc) in [(&far, false), (&near, true)] {
            self.look(cell, batch, as_disc, deepest, &mut finer);
        }
        self.scratch.pool.extend([far, near]);
        for part in cell.parts() {
            if finer.len() > 0 {
                self.descend(&part, &finer);
            }
        }
        self.scratch.pool.push(finer);
    }

    /// Which suns can be looked at through this cell's rule, as points or discs, and which need
    /// its parts.
    fn sort(
        &self,
        cell: &Cell,
        suns: &Batch,
        seen: Sees,
        far: &mut Batch,
        near: &mut Batch,
        finer: &mut Batch,
    ) {
        let middle = cell.middle();
        let way = self.spot.position - middle;
        let away_m = way.length();
        let out = self.facet.frame.local_from_world(way / away_m);
        // Angle that the cell spans at the spot.
        let angle = cell.radius_m() / away_m;
        let width = self.kernel.width();
        let deepest = cell.level >= self.root.seeing_level + DEEPER;
        for i in 0..suns.len() {
            let sees = self.root.sees_sun(cell, suns.step[i] as usize);
            if sees == Sees::None {
                continue;
            }
            if seen == Sees::Part || sees == Sees::Part {
                finer.push_from(suns, i);
                continue;
            }
            let (hx, hy, hz) = (suns.x[i] + out.x, suns.y[i] + out.y, suns.z[i] + out.z);
            let across2 = hx * hx + hy * hy;
            let length2 = across2 + hz * hz;
            // Half vectors turn by half of what directions turn, and faster across the plane of
            // incidence where light grazes.
            let cos = (0.25 * length2).sqrt().max(0.1);
            let spread = 0.5 * angle / cos;
            let tilt = ((across2 / length2).sqrt() - spread).max(0.0);
            let reach = (width * width + tilt * tilt).sqrt();
            // Even light bends by distance alone.
            if spread.min(angle) > SPREAD * reach.min(1.0) && !deepest {
                finer.push_from(suns, i);
            } else if tilt < NEAR_WIDTHS * width && width.is_finite() {
                near.push_from(suns, i);
            } else {
                far.push_from(suns, i);
            }
        }
    }

    /// Applies the rule; suns for which it bends too much go to `finer`.
    fn look(&mut self, cell: &Cell, suns: &Batch, as_disc: bool, deepest: bool, finer: &mut Batch) {
        let count = suns.len();
        if count == 0 {
            return;
        }
        let Scratch { values, sums, discs, .. } = &mut *self.scratch;
        let fold = if as_disc { self.points.len() } else { 1 };
        if as_disc {
            discs.clear();
            for i in 0..count {
                let sun = Frame::around(suns.sun(i));
                for &point in self.points {
                    let at = self.disc.direction(&sun, point);
                    discs.push(suns.step[i], at, suns.strength[i], &self.kernel);
                }
            }
        }
        let lit = if as_disc { &*discs } else { suns };
        values.resize(count * fold, 0.0);
        for sum in sums.iter_mut() {
            sum.clear();
            sum.resize(count, 0.0);
        }
        let (area, [a, b, c]) = (cell.area_m2(), cell.corners);
        for (nth, ([u, v, w], share)) in RADON.into_iter().enumerate() {
            let way = self.spot.position - (a * u + b * v + c * w);
            let away2 = way.length_squared();
            let away_m = away2.sqrt();
            let towards = way / away_m;
            let out = self.facet.frame.local_from_world(towards);
            let cos = -self.spot.normal.dot(towards);
            if out.z <= 0.0 || cos <= 0.0 || away_m > self.max_path_m {
                continue;
            }
            self.kernel.radiance(lit, out, values);
            let solid = area * out.z / away2;
            let facing = cos / cos.max(f64::from(MIN_COS));
            for i in 0..count {
                let mut value = values[i * fold];
                if fold > 1 {
                    value = values[i * fold..(i + 1) * fold].iter().sum::<f64>() / fold as f64;
                }
                let value = value * solid;
                sums[0][i] += share * cos * value;
                sums[1][i] += share * facing * value;
                if nth == 0 {
                    sums[2][i] = cos * value;
                }
            }
        }
        for i in 0..count {
            let (surface, normal, one) = (sums[0][i], sums[1][i], sums[2][i]);
            let bend = (surface - one).abs();
            if bend > BEND * surface + NEGLIGIBLE_W_M2 && !deepest {
                finer.push_from(suns, i);
            } else {
                let error = if surface > 0.0 { bend * (bend / surface).min(1.0) } else { 0.0 };
                self.year.add(suns.step[i], surface, normal, error);
            }
        }
    }
}
