use std::ops::Range;

use glam::DVec3;

use super::cells::Cell;
use super::disc::Disc;
use super::kernel::{Kernel, Point, Sums};
use super::lobe::{POINTS, Place, Ways};
use super::rule::{GOOD, Look, rule_error};
use super::scene::Spot;
use super::sight::{LitPart, Rooted};
use super::suns::Suns;
use crate::render::reflect::facet::Facet;

/// Parts that a cell on a border of what the spot sees is asked in.
const SEEN_PARTS: usize = 4;
/// What stands for a part that is wholly seen.
pub(super) const SEEN: u16 = 1 << 15;

/// What a spot sees of a triangle's asked cells.
#[derive(Debug, Default)]
pub(super) struct SeenCells {
    /// Sums up to each cell of what is seen of its parts, in [`SEEN`]ths.
    before: Vec<u64>,
    /// Cells up to each whose parts aren't seen alike.
    uneven_before: Vec<u32>,
}

impl SeenCells {
    pub(super) fn clear(&mut self) {
        self.before.clear();
        self.before.push(0);
        self.uneven_before.clear();
        self.uneven_before.push(0);
    }

    /// Some cells more, of which all parts are seen by this much.
    pub(super) fn push_even(&mut self, cells: usize, seen: u16) {
        for _ in 0..cells {
            self.push_parts([seen; SEEN_PARTS]);
        }
    }

    /// One cell more.
    pub(super) fn push_parts(&mut self, parts: [u16; SEEN_PARTS]) {
        let last = |sum: Option<&u64>| sum.copied().unwrap_or(0);
        let sum: u64 = parts.iter().map(|p| u64::from(*p)).sum();
        self.before.push(last(self.before.last()) + sum);
        let uneven = parts.iter().any(|p| *p != parts[0]);
        let count = self.uneven_before.last().copied().unwrap_or(0);
        self.uneven_before.push(count + u32::from(uneven));
    }

    pub(super) fn any(&self) -> bool {
        self.before.last().is_some_and(|sum| *sum > 0)
    }

    /// What is seen of a cell, in [`SEEN`]ths of a part.
    fn of(&self, i: usize) -> u64 {
        self.before[i + 1] - self.before[i]
    }

    /// Share of some cells that is seen.
    fn share(&self, cells: &Range<usize>) -> f32 {
        let seen = self.before[cells.end] - self.before[cells.start];
        seen as f32 / (usize::from(SEEN) * SEEN_PARTS * cells.len()) as f32
    }

    /// Share of some cells whose parts aren't seen alike.
    fn uneven(&self, cells: &Range<usize>) -> f32 {
        let count = self.uneven_before[cells.end] - self.uneven_before[cells.start];
        count as f32 / cells.len() as f32
    }

    /// Whether some cells are seen by the same share all over.
    fn is_even(&self, cells: &Range<usize>) -> bool {
        self.uneven_before[cells.end] == self.uneven_before[cells.start]
            && cells.clone().all(|i| self.of(i) == self.of(cells.start))
    }
}
/// Levels below the asked one.
const DEEPER: u32 = 8;
/// The sun's radius beside a lobe's width, squared: up to here a point does.
const POINT: f32 = 1e-4;
/// Up to here a disc is as good as the second order of its mean.
const SECOND_ORDER: f32 = 0.02;
/// Up to here 16 places all over the disc do, then 5 or 9 chords of it, beyond it 17.
const CHORDS: [f32; 3] = [0.4, 1.2, 6.0];
/// How far those miss the mean of a lobe once it is integrated over cells, too.
const CHORDS_ERROR: [f32; 4] = [4e-4, 1e-3, 1e-3, 2e-2];
/// Up to here 3, 5 or 9 points in a line do, beyond it 17, if the disc's height is as good as its second order.
const LINES: [f32; 3] = [0.3, 1.2, 6.0];
/// Ratio of a cell's radius to the length over which the integrand changes up to which the cell is
/// looked at though a border of what the spot sees crosses it: through the middles of what is seen
/// of its parts.
const PARTLY_SEEN: f32 = 0.08;
/// The same for a shadow's border: what is lit of it counts as spread over all of it.
const PARTLY_LIT: f32 = 0.04;
/// How far a file's values may be apart on a cell that is looked at, as a share of their mean, and
/// how far a cell may reach in directions however far they are.
const JUMP: f32 = 0.05;
const JUMP_REACH: f32 = 0.02;
/// What the part of an asked cell that is seen, or lit, may be wrong by where a border crosses it:
/// 4 and 16 places of it are asked.
const SEEN_ERROR: f32 = 0.2;
const LIT_ERROR: f32 = 0.1;

/// Ways in which suns are looked at through a cell: as points through rules of one and three
/// points, then through seven as discs: their second order, lines of 3 to 17 places, 16 places
/// all over, 5 to 17 chords.
const WAYS: usize = SEVEN + DISCS;
const SEVEN: usize = 2;
pub(super) const DISCS: usize = 9;

/// What stands for the disc in those ways.
pub(super) fn disc_places(disc: &Disc) -> [Vec<Place>; DISCS] {
    [
        vec![disc.middle()],
        disc.line(3),
        disc.line(5),
        disc.line(9),
        disc.line(17),
        disc.rings(),
        disc.chords(5),
        disc.chords(9),
        disc.chords(17),
    ]
}

/// Suns to be looked at in one way.
#[derive(Debug, Default)]
struct Class {
    suns: Vec<u32>,
    /// Part of the cell that they light.
    lit: Vec<f32>,
    /// Bound of the relative error.
    error: Vec<f32>,
}

impl Class {
    fn clear(&mut self) {
        self.suns.clear();
        self.lit.clear();
        self.error.clear();
    }

    #[inline]
    fn push(&mut self, sun: u32, lit: f32, error: f32) {
        self.suns.push(sun);
        self.lit.push(lit);
        self.error.push(error);
    }
}

/// Scratch of one thread, kept from spot to spot.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pool: Vec<Vec<u32>>,
    classes: [Class; WAYS],
    points: Vec<Point>,
    sums: Sums,
    middle: Sums,
    /// What a facet sends to the spot, by sun: on the surface, facing the beam, and the error.
    pub arrived: [Vec<f32>; 3],
}

/// The integral over one triangle of PV of what it scatters to one spot.
pub(super) struct Integral<'a> {
    pub facet: &'a Facet,
    pub root: &'a Rooted,
    pub suns: &'a Suns,
    pub kernel: &'a Kernel<'a>,
    pub disc: &'a Disc,
    pub places: &'a [Vec<Place>; DISCS],
    pub spot: &'a Spot,
    /// The spot's normal, turned over, in the facet's frame.
    pub toward: [f32; 3],
    /// What the spot sees of the root's asked cells.
    pub seen: &'a SeenCells,
    pub scratch: &'a mut Scratch,
}

/// A cell, and what the spot sees of it.
struct Seen {
    cell: Cell,
    look: Look,
    /// Part of it that is seen.
    share: f32,
    /// Whether that is spread over its parts: not asked any further.
    by_parts: bool,
    /// Bound of the relative error of the share.
    error: f32,
    deepest: bool,
}

impl Integral<'_> {
    /// Adds what arrives from the triangle for all `suns` (numbers among the facet's).
    pub(super) fn add(&mut self, suns: &[u32]) {
        let whole = self.root.cell;
        self.descend(&whole, suns);
    }

    /// Range of the asked cells of a cell.
    fn asked(&self, cell: &Cell) -> Range<usize> {
        let asked = self.root.asked;
        if cell.level <= asked {
            let shift = 2 * (asked - cell.level);
            cell.index << shift..(cell.index + 1) << shift
        } else {
            let at = cell.index >> (2 * (cell.level - asked));
            at..at + 1
        }
    }

    fn descend(&mut self, cell: &Cell, suns: &[u32]) {
        let asked = self.asked(cell);
        let share = self.seen.share(&asked);
        if share == 0.0 || suns.is_empty() {
            return;
        }
        let look = Look::at(cell, self.facet, self.spot);
        let whole = cell.level < self.root.asked;
        let seen = Seen {
            look,
            share,
            by_parts: share < 1.0 && whole && !self.seen.is_even(&asked),
            error: if share < 1.0 { SEEN_ERROR * self.seen.uneven(&asked) / share } else { 0.0 },
            deepest: cell.level >= self.root.asked + DEEPER,
            cell: *cell,
        };
        let good = if seen.by_parts { PARTLY_SEEN } else { GOOD[2] };
        let mut finer = self.scratch.pool.pop().unwrap_or_default();
        finer.clear();
        if look.near > good && !seen.deepest {
            let lit = self.root.lit(cell);
            finer.extend(suns.iter().filter(|&&sun| !lit[sun as usize].is_dark()));
        } else {
            let mut classes = std::mem::take(&mut self.scratch.classes);
            match self.kernel.alpha() {
                Some(alpha) => {
                    let alpha2 = (alpha * alpha) as f32;
                    self.sort(&seen, suns, alpha2, &mut classes, &mut finer);
                }
                None => self.sort_smooth(&seen, suns, &mut classes, &mut finer),
            }
            let fine = classes[SEVEN..].iter().any(|class| !class.suns.is_empty());
            let ways = if fine { self.ways_of(&seen) } else { Ways::default() };
            for (way, class) in classes.iter().enumerate().filter(|(_, c)| !c.suns.is_empty()) {
                self.look(&seen, &ways, (way, class), &mut finer);
            }
            self.scratch.classes = classes;
        }
        if !finer.is_empty() {
            for part in cell.parts() {
                self.descend(&part, &finer);
            }
        }
        self.scratch.pool.push(finer);
    }

    /// What part of a cell a sun lights, with the bound of the error in that as far as the
    /// integrand changes by `ratio` over the cell; `None`: its parts must be asked.
    #[inline]
    fn lit(&self, seen: &Seen, lit: LitPart, ratio2: f32) -> Option<(f32, f32)> {
        let part = lit.part();
        if lit.is_even() {
            return Some((part, 0.0));
        }
        if seen.cell.level >= self.root.asked {
            return Some((part, LIT_ERROR / part));
        }
        (!seen.by_parts && ratio2 <= PARTLY_LIT * PARTLY_LIT).then(|| {
            // A border crosses about twice as many asked cells as lie along an edge.
            let along = (1_u32 << (self.root.asked - seen.cell.level)) as f32;
            (part, 3.0 * (1.0 - part) * ratio2.sqrt() + LIT_ERROR * 2.0 / (along * part))
        })
    }

    /// Every sun is looked at through the same rule, or needs the cell's parts.
    fn sort_smooth(
        &self,
        seen: &Seen,
        suns: &[u32],
        classes: &mut [Class; WAYS],
        finer: &mut Vec<u32>,
    ) {
        classes.iter_mut().for_each(Class::clear);
        let lit = self.root.lit(&seen.cell);
        let near = seen.look.near;
        let rule = rule_of(near);
        let error = seen.error + rule_error(rule, near);
        for &sun in suns {
            let part = lit[sun as usize];
            if part.is_dark() {
                continue;
            }
            match self.lit(seen, part, near * near) {
                Some((part, doubt)) => classes[rule].push(sun, part, error + doubt),
                None => finer.push(sun),
            }
        }
    }

    /// Through which rule each sun is looked at, as a point or as a disc, or whether it needs the
    /// cell's parts.
    fn sort(
        &self,
        seen: &Seen,
        suns: &[u32],
        alpha2: f32,
        classes: &mut [Class; WAYS],
        finer: &mut Vec<u32>,
    ) {
        classes.iter_mut().for_each(Class::clear);
        let lit = self.root.lit(&seen.cell);
        let look = &seen.look;
        let radius = self.disc.radius_rad as f32;
        let (across2, near2, along2) =
            (look.across * look.across, look.near * look.near, look.along * look.along);
        let good = if seen.by_parts { PARTLY_SEEN } else { GOOD[2] };
        for &sun in suns {
            let i = sun as usize;
            if lit[i].is_dark() {
                continue;
            }
            let (dx, dy) = (self.suns.x[i] + look.out.x, self.suns.y[i] + look.out.y);
            let hz = self.suns.z[i] + look.out.z;
            let off = ((dx * dx + dy * dy).sqrt() - look.across - radius).max(0.0);
            // Length over which the lobe changes, as a way of the outgoing direction.
            let width2 = off * off + alpha2 * hz * hz;
            let beside2 = radius * radius / width2;
            let low = beside2 * self.suns.z[i] * self.suns.z[i] < SECOND_ORDER;
            let mut lobe2 = across2 / width2;
            if lobe2 > good * good && low && beside2 > SECOND_ORDER {
                lobe2 = self.stretched2(look, i, width2);
            }
            let ratio2 = lobe2.max(near2).max(along2 / (hz * hz));
            if ratio2 > good * good && !seen.deepest {
                finer.push(sun);
                continue;
            }
            let Some((part, doubt)) = self.lit(seen, lit[i], ratio2) else {
                finer.push(sun);
                continue;
            };
            let ratio = ratio2.sqrt();
            let (way, disc_error) = if beside2 < POINT {
                (rule_of(ratio), 2.0 * beside2)
            } else if beside2 < SECOND_ORDER {
                (SEVEN, beside2 * beside2)
            } else if low {
                let line = LINES.iter().filter(|&&most| beside2 > most).count();
                (SEVEN + 1 + line, if line < LINES.len() { 1e-3 } else { 2e-2 })
            } else {
                let way = CHORDS.iter().filter(|&&most| beside2 > most).count();
                (SEVEN + 5 + way, CHORDS_ERROR[way])
            };
            let rule = if seen.by_parts { 0 } else { way.min(SEVEN) };
            // Parts are a half as large.
            let own = if seen.by_parts { 0.5 * ratio } else { ratio };
            let error = seen.error + doubt + disc_error + rule_error(rule, own);
            classes[way].push(sun, part, error);
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

    /// Looks at the suns of a class; those of files' jumping values may go to `finer`.
    fn look(
        &mut self,
        seen: &Seen,
        ways: &Ways,
        (way, class): (usize, &Class),
        finer: &mut Vec<u32>,
    ) {
        let jumps = self.kernel.jumps();
        let (suns, list) = (self.suns, &*class.suns);
        let mut fit = 0.0;
        if let (Kernel::Lobe(lobe), true) = (self.kernel, way >= SEVEN) {
            let places = &self.places[way - SEVEN];
            lobe.add_points((ways, self.toward), suns, list, places, &mut self.scratch.sums);
            fit = lobe.shape.fit as f32;
        } else {
            self.points_of(seen, if jumps { SEVEN } else { way });
            let Scratch { points, sums, middle, .. } = &mut *self.scratch;
            // No point of the cell faces the spot: nothing arrives.
            let Some(first) = points.first() else { return };
            self.kernel.add_all(points, suns, list, sums);
            if jumps {
                // The middle alone tells how far values jump.
                let worth = |of: fn(&Point) -> f64| points.iter().map(of).sum::<f64>();
                let [surface, normal] = [worth(|p| p.surface), worth(|p| p.normal)];
                let all = Point { out: first.out, surface, normal };
                self.kernel.add_all(&[all], suns, list, middle);
            }
        }
        let coarse = seen.look.across > JUMP_REACH && !seen.deepest;
        let Scratch { sums, middle, arrived: [to_surface, to_normal, to_error], .. } =
            &mut *self.scratch;
        for (k, &sun) in list.iter().enumerate() {
            let (i, lit) = (sun as usize, class.lit[k]);
            let mut error = (class.error[k] + fit) * sums.surface[k];
            if jumps {
                let jump = (sums.surface[k] - middle.surface[k]).abs();
                if coarse && jump > JUMP * sums.surface[k] {
                    finer.push(sun);
                    continue;
                }
                error += jump;
            }
            to_surface[i] += sums.surface[k] * lit;
            to_normal[i] += sums.normal[k] * lit;
            to_error[i] += error * lit;
        }
    }

    /// The middles of what the spot sees of a cell's parts, and their areas, m2.
    fn middles(&self, cell: &Cell) -> impl Iterator<Item = (DVec3, f64)> {
        cell.parts().into_iter().filter_map(|part| {
            let asked = self.asked(&part);
            let share = self.seen.share(&asked);
            let (mut middle, mut sum) = (part.middle(), 1.0);
            if share < 1.0 {
                (middle, sum) = (DVec3::ZERO, 0.0);
                for i in asked {
                    let weight = self.seen.of(i) as f64;
                    middle += self.root.middles[i] * weight;
                    sum += weight;
                }
            }
            (share > 0.0).then(|| (middle / sum, part.area_m2() * f64::from(share)))
        })
    }

    /// The points through which a cell is looked at: a rule's, or the middles of its seen parts.
    fn points_of(&mut self, seen: &Seen, rule: usize) {
        let mut points = std::mem::take(&mut self.scratch.points);
        points.clear();
        if seen.by_parts {
            let of = |(at, area_m2)| Look::point(at, area_m2, self.facet, self.spot);
            points.extend(self.middles(&seen.cell).filter_map(of));
        } else {
            let share = f64::from(seen.share);
            Look::points(&seen.cell, self.facet, self.spot, rule, share, &mut points);
        }
        self.scratch.points = points;
    }

    /// The same for the finest rule.
    fn ways_of(&self, seen: &Seen) -> Ways {
        if !seen.by_parts {
            return seen.look.places(seen.cell.area_m2() * f64::from(seen.share));
        }
        let mut ways = Ways::default();
        for (k, (at, area_m2)) in self.middles(&seen.cell).enumerate().take(POINTS) {
            let way = self.facet.frame.local_from_world(self.spot.position - at).as_vec3();
            (ways.way[0][k], ways.way[1][k], ways.way[2][k]) = (way.x, way.y, way.z);
            ways.area[k] = area_m2 as f32;
        }
        ways
    }
}

/// The coarsest rule that is good for a ratio.
#[inline]
fn rule_of(ratio: f32) -> usize {
    if ratio <= GOOD[0] {
        0
    } else if ratio <= GOOD[1] {
        1
    } else {
        2
    }
}
