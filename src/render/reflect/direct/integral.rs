//! What one triangle of PV scatters to one receiver point, for all suns at once.
//!
//! **The problem.** `E(sun) = integral over the triangle of f(sun, out) cos_i DNI cos_o cos_r / r2 dA`, for
//! some thousand suns and a million receivers. The integrand is smooth almost everywhere, but a
//! lobe of facets may be narrower than the sun's disc, borders of shadows and of what hides the PV run
//! across the triangle, and measured BSDFs jump. For a given receiver each sun has its peak elsewhere
//! on the PV.
//!
//! **The idea.** Visibility is known beforehand, cell by cell, on both sides: [`Rooted::lit`] for the
//! suns, [`VisibleCells`] for the receiver. So the integral descends the triangle's cells with a list of
//! suns. At each cell every sun is either done, through the coarsest rule whose error is known to
//! be small ([`Quadrature`]: 1, 3 or 7 points of the cell, times what stands for the sun's disc), or handed
//! on to the cell's four parts. What is small is a ratio: the cell's size beside the length over which
//! the integrand changes. That length is the least of the distance to the receiver and of the lobe's
//! width where the half vector lies, `sqrt(d^2 + alpha^2 h_z^2)`, d being the half vector's shadow in the
//! plane of the PV ([`Integral::sort_by_lobe`]). So most suns, whose lobe is far off, need few points on large
//! cells, and small cells see only the suns whose lobe they lie in. Suns with one rule are computed
//! together, in single precision, eight at a time. Tails are summed, not cut.
//!
//! Of a measured BSDF nothing is known beforehand but its cells. There each sun is looked at through
//! seven points, and the smallest and largest values of all cells of the file that the PV's cell may touch
//! say how wrong that may be: where it is too much, the parts are looked at ([`Integral::add_measured`]).
//!
//! **Borders.** Where the receiver sees a part of a cell only, the middles of what it sees of the
//! cell's four parts stand for it once the integrand hardly changes over the cell; where a sun lights a
//! part only, the part counts as spread over all of it under a stricter ratio. Below the asked cells a
//! share is all that is known, and the bound says so.
//!
//! **The bound.** Every value has one: what rules and discs miss (found by trial, the constants say
//! how), the fit of the lobe's reflectance, jumps of files, and what is in doubt at borders.
//!
//! **What lost.** Points drawn at random, one ray each (the photons are that); splitting until two
//! rules agree, as adaptive quadrature usually does, which computes everything twice and is fooled by lobes
//! that lie between the points; the lobe's integral over a polygon by linearly transformed
//! cosines (Heitz, Dupuy, Hill and Neubelt 2016), which fits a lobe to some percent only.

use std::ops::Range;

use glam::DVec3;

use super::kernel::{Kernel, Point, Spans, Sums};
use super::lobe::{POINTS, Ways};
use super::quadrature::{DiscPoints, DiscRatio, Group, Groups, Quadrature, SunOfCell};
use super::receiver::ReceiverPoint;
use super::rule::{FINEST, GOOD, Look, rule_error};
use super::sight::{LitPart, Rooted};
use super::suns::Suns;
use super::visible::VisibleCells;
use crate::render::reflect::disc::Disc;
use crate::render::reflect::facet::Facet;
use crate::render::reflect::pv::Cell;

/// Levels below the asked one, at most: two millimetres.
const DEEPER: u32 = 8;
/// Ratio of a cell's radius to the length over which the integrand changes up to which the cell is
/// looked at though a border of what the receiver sees crosses it: through the middles of what is seen
/// of its parts, each of half the size. One point of those misses 2.4e-3 ([`rule_error`]).
const PARTLY_SEEN: f32 = 0.08;
/// The same for a shadow's border: what is lit of it counts as spread over all of it, so that the
/// integrand's slope over the cell counts in full.
const PARTLY_LIT: f32 = 0.04;
/// How much of a measured cell's irradiance jumps may leave in doubt before its parts are looked at, and
/// how far the cell may reach in directions however much it is (a fifth of a Klems patch).
const JUMP: f32 = 0.05;
const JUMP_REACH: f32 = 0.02;
/// A straight border between two values, through a triangle of which seven points are looked at, is
/// missed by less than that part of their difference (by trial).
const JUMP_MISSES: f32 = 0.24;
/// What the part of an asked cell that is seen, or lit, may be wrong by where a border crosses it:
/// 4 and 16 places of it are asked. Along many cells the errors make up for each other; against rays at
/// 2,400 places of each triangle all but 2 % of instants stay within (`tests/physics/direct_borders.rs`).
const SEEN_ERROR: f32 = 0.2;
const LIT_ERROR: f32 = 0.1;
/// Where a cell is lit in part, light is taken from a wrong place of it: on average by some tenths of
/// its radius, over which `(d^2 + a^2)^-2` changes by up to four times the ratio to
/// `sqrt(d^2 + a^2)`. Three times the ratio holds it (same test).
const LIT_SLOPE: f32 = 3.0;
/// A border crosses about that many times as many asked cells as lie along an edge.
const CELLS_ON_A_BORDER: f32 = 2.0;

/// Scratch of one thread, kept from receiver to receiver.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Lists of suns, by depth.
    pool: Vec<Vec<u32>>,
    groups: Groups,
    points: Vec<Point>,
    sums: Sums,
    spans: Spans,
    /// What a facet sends to the receiver, by sun.
    pub arrived: Arrived,
}

/// Irradiances and their bound by sun, W/m2.
#[derive(Debug, Default)]
pub(super) struct Arrived {
    /// On the surface.
    pub surface: Vec<f32>,
    /// Facing the beam.
    pub normal: Vec<f32>,
    /// Bound of the error in the first.
    pub error: Vec<f32>,
}

impl Arrived {
    /// Sets some of `count` suns to 0.
    pub(super) fn clear(&mut self, count: usize, suns: Range<usize>) {
        for list in [&mut self.surface, &mut self.normal, &mut self.error] {
            list.resize(count.max(list.len()), 0.0);
            list[suns.clone()].fill(0.0);
        }
    }
}

/// The integral over one triangle of PV of what it scatters to one receiver.
pub(super) struct Integral<'a> {
    pub facet: &'a Facet,
    pub root: &'a Rooted,
    pub suns: &'a Suns,
    pub kernel: &'a Kernel<'a>,
    pub disc: &'a Disc,
    pub disc_points: &'a DiscPoints,
    pub receiver: &'a ReceiverPoint,
    /// The receiver's normal, turned over, in the facet's frame.
    pub toward: [f32; 3],
    /// What the receiver sees of the root's asked cells.
    pub visible: &'a VisibleCells,
    pub scratch: &'a mut Scratch,
}

/// A cell, and what the receiver sees of it.
struct Visited {
    cell: Cell,
    look: Look,
    /// Part of it that is seen.
    share: f32,
    /// Whether that is spread over its parts: looked at through their middles.
    by_parts: bool,
    /// Bound of the relative error of the share.
    error: f32,
    /// Whether it isn't split any further.
    deepest: bool,
}

impl Visited {
    /// Up to which ratio the cell may be looked at.
    fn good(&self) -> f32 {
        if self.by_parts { PARTLY_SEEN } else { GOOD[FINEST] }
    }
}

impl Integral<'_> {
    /// Adds what arrives from the triangle for all `suns` (numbers among the facet's).
    pub(super) fn add(&mut self, suns: &[u32]) {
        let whole = self.root.triangle.cell;
        self.descend(&whole, suns);
    }

    fn descend(&mut self, cell: &Cell, suns: &[u32]) {
        let Some(visited) = self.visit(cell).filter(|_| !suns.is_empty()) else { return };
        let mut finer = self.scratch.pool.pop().unwrap_or_default();
        finer.clear();
        if visited.look.near > visited.good() && !visited.deepest {
            let lit = self.root.lit(cell);
            finer.extend(suns.iter().filter(|&&sun| !lit[sun as usize].is_dark()));
        } else {
            let mut groups = std::mem::take(&mut self.scratch.groups);
            groups.clear();
            match self.kernel.alpha() {
                Some(alpha) => {
                    let alpha2 = (alpha * alpha) as f32;
                    self.sort_by_lobe(&visited, suns, alpha2, &mut groups, &mut finer);
                }
                None => self.sort_alike(&visited, suns, &mut groups, &mut finer),
            }
            let ways = if groups.any_fine() { self.ways_of(&visited) } else { Ways::default() };
            for (how, group) in groups.each() {
                if self.kernel.jumps() {
                    self.add_measured(&visited, group, &mut finer);
                } else {
                    self.add_modelled(&visited, &ways, how, group);
                }
            }
            self.scratch.groups = groups;
        }
        if !finer.is_empty() {
            for part in cell.parts() {
                self.descend(&part, &finer);
            }
        }
        self.scratch.pool.push(finer);
    }

    /// A cell of which the receiver sees something.
    fn visit(&self, cell: &Cell) -> Option<Visited> {
        let asked_cells = self.root.triangle.asked_cells(cell);
        let share = self.visible.share(&asked_cells);
        if share == 0.0 {
            return None;
        }
        let asked = self.root.triangle.asked;
        let is_block = cell.level < asked;
        let uneven = self.visible.uneven(&asked_cells);
        Some(Visited {
            look: Look::at(cell, self.facet, self.receiver),
            share,
            by_parts: share < 1.0 && is_block && !self.visible.is_even(&asked_cells),
            error: if share < 1.0 { SEEN_ERROR * uneven / share } else { 0.0 },
            deepest: cell.level >= asked + DEEPER,
            cell: *cell,
        })
    }

    /// What part of a cell a sun lights, with the bound of the error in that as far as the
    /// integrand changes by `ratio2` (squared) over the cell; `None`: its parts must be asked.
    #[inline]
    fn lit(&self, visited: &Visited, lit: LitPart, ratio2: f32) -> Option<(f32, f32)> {
        let part = lit.part();
        if lit.is_even() {
            return Some((part, 0.0));
        }
        let asked = self.root.triangle.asked;
        if visited.cell.level >= asked {
            return Some((part, LIT_ERROR / part));
        }
        (!visited.by_parts && ratio2 <= PARTLY_LIT * PARTLY_LIT).then(|| {
            let along = (1_u32 << (asked - visited.cell.level)) as f32;
            let place = LIT_SLOPE * (1.0 - part) * ratio2.sqrt();
            (part, place + LIT_ERROR * CELLS_ON_A_BORDER / (along * part))
        })
    }

    /// Sorts suns for what has no lobe: all are looked at through the same rule, or need the
    /// cell's parts.
    fn sort_alike(
        &self,
        visited: &Visited,
        suns: &[u32],
        groups: &mut Groups,
        finer: &mut Vec<u32>,
    ) {
        let lit = self.root.lit(&visited.cell);
        let near = visited.look.near;
        let how = Quadrature::of_point(near);
        let error = visited.error + rule_error(how.cell_rule(), near);
        for &sun in suns {
            let part = lit[sun as usize];
            if part.is_dark() {
                continue;
            }
            match self.lit(visited, part, near * near) {
                Some((lit, doubt)) => {
                    groups.push(how, SunOfCell { sun, lit, error: error + doubt });
                }
                None => finer.push(sun),
            }
        }
    }

    /// Sorts suns by where their lobe lies: through which rule each is looked at, as a point or as a
    /// disc, or whether it needs the cell's parts.
    fn sort_by_lobe(
        &self,
        visited: &Visited,
        suns: &[u32],
        alpha2: f32,
        groups: &mut Groups,
        finer: &mut Vec<u32>,
    ) {
        let lit = self.root.lit(&visited.cell);
        let look = &visited.look;
        let radius = self.disc.radius_rad as f32;
        let (across2, near2, along2) =
            (look.across * look.across, look.near * look.near, look.along * look.along);
        let good = visited.good();
        for &sun in suns {
            let i = sun as usize;
            if lit[i].is_dark() {
                continue;
            }
            // The half vector, not of length 1, and how near its shadow comes to the lobe's middle.
            let (dx, dy) = (self.suns.x[i] + look.out.x, self.suns.y[i] + look.out.y);
            let hz = self.suns.z[i] + look.out.z;
            let off = ((dx * dx + dy * dy).sqrt() - look.across - radius).max(0.0);
            // Length over which the lobe changes, as a way of the outgoing direction.
            let width2 = off * off + alpha2 * hz * hz;
            let disc = DiscRatio::new(radius, width2, self.suns.z[i]);
            let mut lobe2 = across2 / width2;
            if lobe2 > good * good && disc.needs_a_line() {
                lobe2 = self.stretched2(look, i, width2);
            }
            let ratio2 = lobe2.max(near2).max(along2 / (hz * hz));
            if ratio2 > good * good && !visited.deepest {
                finer.push(sun);
                continue;
            }
            let Some((lit, doubt)) = self.lit(visited, lit[i], ratio2) else {
                finer.push(sun);
                continue;
            };
            let ratio = ratio2.sqrt();
            let (how, disc_misses) = Quadrature::of(ratio, &disc);
            let misses = if visited.by_parts {
                // One point each, of parts that are a half as large.
                rule_error(0, 0.5 * ratio)
            } else {
                rule_error(how.cell_rule(), ratio)
            };
            let error = visited.error + doubt + disc_misses + misses;
            groups.push(how, SunOfCell { sun, lit, error });
        }
    }

    /// Square of a cell's radius beside the width of a low sun's lobe, which its disc makes wider
    /// to the side: there a third of its radius counts as well.
    #[inline]
    fn stretched2(&self, look: &Look, sun: usize, width2: f32) -> f32 {
        let (suns, radius) = (self.suns, self.disc.radius_rad as f32);
        let (x, y, steep) = (suns.x[sun], suns.y[sun], suns.steep[sun]);
        let wide2 = width2 + radius * radius * (1.0 / 9.0);
        let of = |[u, v]: [f32; 2]| {
            let (up, side) = (u * x + v * y, v * x - u * y);
            steep * (up * up / width2 + side * side / wide2)
        };
        let [a, b, c] = look.offs.map(of);
        a.max(b).max(c)
    }

    /// Adds the suns of a group.
    fn add_modelled(&mut self, visited: &Visited, ways: &Ways, how: Quadrature, group: &Group) {
        let mut fit = 0.0;
        match (self.kernel, how) {
            (Kernel::Lobe(lobe), Quadrature::Seven(rule)) => {
                let points = self.disc_points.get(rule);
                let (suns, sums) = (self.suns, &mut self.scratch.sums);
                lobe.add_points((ways, self.toward), suns, &group.suns, points, sums);
                fit = lobe.shape.fit as f32;
            }
            _ => {
                self.points_of(visited, how);
                let Scratch { points, sums, .. } = &mut *self.scratch;
                self.kernel.add_all(points, self.suns, &group.suns, sums);
            }
        }
        let Scratch { sums, arrived, .. } = &mut *self.scratch;
        for (k, &sun) in group.suns.iter().enumerate() {
            let (i, lit) = (sun as usize, group.lit[k]);
            let error = (group.error[k] + fit) * sums.surface[k];
            arrived.surface[i] += sums.surface[k] * lit;
            arrived.normal[i] += sums.normal[k] * lit;
            arrived.error[i] += error * lit;
        }
    }

    /// Adds the suns of a group where a file's values are known well enough; the others go to
    /// `finer`.
    fn add_measured(&mut self, visited: &Visited, group: &Group, finer: &mut Vec<u32>) {
        self.points_of(visited, Quadrature::of_point(f32::INFINITY));
        let coarse = visited.look.across > JUMP_REACH && !visited.deepest;
        let Scratch { points, sums, spans, arrived, .. } = &mut *self.scratch;
        self.kernel.add_all(points, self.suns, &group.suns, sums);
        self.kernel.spans(&visited.look.outs(), self.suns, &group.suns, spans);
        let worth: f64 = points.iter().map(|p| p.surface).sum();
        for (k, &sun) in group.suns.iter().enumerate() {
            let (i, lit) = (sun as usize, group.lit[k]);
            let jump = JUMP_MISSES * spans.width(k) * worth as f32;
            if coarse && jump > JUMP * sums.surface[k] {
                finer.push(sun);
                continue;
            }
            let error = group.error[k] * sums.surface[k] + jump;
            arrived.surface[i] += sums.surface[k] * lit;
            arrived.normal[i] += sums.normal[k] * lit;
            arrived.error[i] += error * lit;
        }
    }

    /// The middles of what the receiver sees of a cell's parts, and their areas, m2.
    fn middles(&self, cell: &Cell) -> impl Iterator<Item = (DVec3, f64)> {
        cell.parts().into_iter().filter_map(|part| {
            let asked = self.root.triangle.asked_cells(&part);
            let share = self.visible.share(&asked);
            let (mut middle, mut sum) = (part.middle(), 1.0);
            if share < 1.0 {
                (middle, sum) = (DVec3::ZERO, 0.0);
                for i in asked {
                    let weight = self.visible.of(i) as f64;
                    middle += self.root.middles[i] * weight;
                    sum += weight;
                }
            }
            (share > 0.0).then(|| (middle / sum, part.area_m2() * f64::from(share)))
        })
    }

    /// The points through which a cell is looked at: a rule's, or the middles of its seen parts.
    fn points_of(&mut self, visited: &Visited, how: Quadrature) {
        let mut points = std::mem::take(&mut self.scratch.points);
        points.clear();
        if visited.by_parts {
            let of = |(at, area_m2)| Look::point(at, area_m2, self.facet, self.receiver);
            points.extend(self.middles(&visited.cell).filter_map(of));
        } else {
            let area_m2 = visited.cell.area_m2() * f64::from(visited.share);
            let rule = how.cell_rule();
            Look::points(&visited.cell, self.facet, self.receiver, rule, area_m2, &mut points);
        }
        self.scratch.points = points;
    }

    /// The same for the finest rule.
    fn ways_of(&self, visited: &Visited) -> Ways {
        if !visited.by_parts {
            return visited.look.places(visited.cell.area_m2() * f64::from(visited.share));
        }
        let mut ways = Ways::default();
        for (k, (at, area_m2)) in self.middles(&visited.cell).enumerate().take(POINTS) {
            let way = self.facet.frame.local_from_world(self.receiver.position - at).as_vec3();
            (ways.way[0][k], ways.way[1][k], ways.way[2][k]) = (way.x, way.y, way.z);
            ways.area[k] = area_m2 as f32;
        }
        ways
    }
}
