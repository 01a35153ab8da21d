//! Through which points of a cell and of the sun's disc a sun's light is summed up.
//!
//! Two things make the integrand of one cell and one sun change: the place on the cell, over the
//! length in which the lobe or the distance changes, and the sun's disc, over the lobe's width. Far
//! from the lobe one point of the cell and one of the sun do; near it the cell is looked at through
//! seven points and the disc through what [`DiscRule`] has. Which is enough follows from two ratios
//! before anything is computed, so that all suns with one rule are computed together.

use super::rule::GOOD;
use crate::render::reflect::disc::{Disc, DiscPoint};

/// How a cell is looked at for a sun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quadrature {
    /// The cell's middle, and the sun's.
    Middle,
    /// Three points of the cell, the sun's middle.
    Three,
    /// Seven points of the cell, the sun as a disc.
    Seven(DiscRule),
}

/// What stands for the sun's disc.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DiscRule {
    /// Its middle with the lobe's second derivatives.
    SecondOrder,
    /// So many points from side to side, with what lies above and below each by second order.
    Line3,
    Line5,
    Line9,
    Line17,
    /// Sixteen points all over it.
    Rings,
    /// So many chords, along which the lobe's mean is exact.
    Chords5,
    Chords9,
    Chords17,
}

impl DiscRule {
    pub(super) const ALL: [Self; 9] = [
        Self::SecondOrder,
        Self::Line3,
        Self::Line5,
        Self::Line9,
        Self::Line17,
        Self::Rings,
        Self::Chords5,
        Self::Chords9,
        Self::Chords17,
    ];

    /// The points of a disc.
    pub(super) fn points(self, disc: &Disc) -> Vec<DiscPoint> {
        match self {
            Self::SecondOrder => vec![disc.middle()],
            Self::Line3 => disc.line(3),
            Self::Line5 => disc.line(5),
            Self::Line9 => disc.line(9),
            Self::Line17 => disc.line(17),
            Self::Rings => disc.rings(),
            Self::Chords5 => disc.chords(5),
            Self::Chords9 => disc.chords(9),
            Self::Chords17 => disc.chords(17),
        }
    }
}

/// The points of each disc rule.
#[derive(Debug)]
pub(super) struct DiscPoints([Vec<DiscPoint>; DiscRule::ALL.len()]);

impl DiscPoints {
    pub(super) fn of(disc: &Disc) -> Self {
        Self(DiscRule::ALL.map(|rule| rule.points(disc)))
    }

    pub(super) fn get(&self, rule: DiscRule) -> &[DiscPoint] {
        &self.0[rule as usize]
    }
}

/// Radius of the disc beside the length over which the lobe changes, squared: up to here the middle
/// stands for the disc. What that misses is [`POINT_MISSES`] times the ratio: the second order of the
/// mean of `(d^2 + a^2)^-2` over a disc is `r^2 / 8` times its Laplacian, at most 16 at the peak.
const POINT: f32 = 1e-4;
const POINT_MISSES: f32 = 2.0;
/// Up to here the second order does; it misses about the ratio's square, the next order.
const SECOND_ORDER: f32 = 0.02;
/// A disc that stands high: up to the ratios 16 points all over it do, then 5 or 9 chords, beyond them
/// 17; and what each misses of the mean of a lobe once that is integrated over cells, too. Found by
/// trial against 288 points of the disc (`the_suns_disc_is_integrated` in the tests).
const CHORDS: [(f32, DiscRule, f32); 4] = [
    (0.4, DiscRule::Rings, 4e-4),
    (1.2, DiscRule::Chords5, 1e-3),
    (6.0, DiscRule::Chords9, 1e-3),
    (f32::INFINITY, DiscRule::Chords17, 2e-2),
];
/// The same for a disc that stands so low over the PV that the lobe, as wide as long in the plane of
/// the PV, sees it as a line: its height is as good as its second order.
const LINES: [(f32, DiscRule, f32); 4] = [
    (0.3, DiscRule::Line3, 1e-3),
    (1.2, DiscRule::Line5, 1e-3),
    (6.0, DiscRule::Line9, 1e-3),
    (f32::INFINITY, DiscRule::Line17, 2e-2),
];

/// A sun's disc beside a lobe.
#[derive(Clone, Copy, Debug)]
pub(super) struct DiscRatio {
    /// Radius beside the length over which the lobe changes, squared.
    pub squared: f32,
    /// Whether the disc's height is as good as its second order.
    pub is_line: bool,
}

impl DiscRatio {
    /// `radius`: of the disc, rad; `width2`: the lobe's length, squared; `sun_z`: the sun's cosine, by
    /// which the disc is shorter along its own shadow.
    #[inline]
    pub(super) fn new(radius: f32, width2: f32, sun_z: f32) -> Self {
        let squared = radius * radius / width2;
        Self { squared, is_line: squared * sun_z * sun_z < SECOND_ORDER }
    }

    /// Whether more than the second order is needed, but only from side to side.
    #[inline]
    pub(super) fn needs_a_line(&self) -> bool {
        self.is_line && self.squared > SECOND_ORDER
    }
}

impl Quadrature {
    pub(super) const COUNT: usize = 2 + DiscRule::ALL.len();

    /// The coarsest that is good for a cell's ratio and a disc's, with the bound of what the disc's
    /// rule misses.
    #[inline]
    pub(super) fn of(ratio: f32, disc: &DiscRatio) -> (Self, f32) {
        if disc.squared < POINT {
            return (Self::of_point(ratio), POINT_MISSES * disc.squared);
        }
        if disc.squared < SECOND_ORDER {
            return (Self::Seven(DiscRule::SecondOrder), disc.squared * disc.squared);
        }
        let rules = if disc.is_line { &LINES } else { &CHORDS };
        let last = rules.len() - 1;
        let count = rules[..last].iter().filter(|(most, ..)| disc.squared > *most).count();
        let (_, rule, misses) = rules[count];
        (Self::Seven(rule), misses)
    }

    /// The coarsest that is good for a cell's ratio where the sun may be taken for a point.
    #[inline]
    pub(super) fn of_point(ratio: f32) -> Self {
        if ratio <= GOOD[0] {
            Self::Middle
        } else if ratio <= GOOD[1] {
            Self::Three
        } else {
            Self::Seven(DiscRule::SecondOrder)
        }
    }

    /// Number of the cell's rule among [`super::rule::RULES`].
    #[inline]
    pub(super) fn cell_rule(self) -> usize {
        match self {
            Self::Middle => 0,
            Self::Three => 1,
            Self::Seven(_) => 2,
        }
    }

    /// Its number, from coarse to fine.
    #[inline]
    pub(super) fn number(self) -> usize {
        match self {
            Self::Middle => 0,
            Self::Three => 1,
            Self::Seven(rule) => 2 + rule as usize,
        }
    }

    /// All of them in the order of their numbers.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let discs = DiscRule::ALL.into_iter().map(Self::Seven);
        [Self::Middle, Self::Three].into_iter().chain(discs)
    }
}

/// Suns to be looked at in one way.
#[derive(Debug, Default)]
pub(super) struct Group {
    pub suns: Vec<u32>,
    /// Part of the cell that they light.
    pub lit: Vec<f32>,
    /// Bound of the relative error.
    pub error: Vec<f32>,
}

/// A sun with what of a cell it lights and how well that is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct SunOfCell {
    pub sun: u32,
    pub lit: f32,
    /// Bound of the relative error.
    pub error: f32,
}

/// Suns by how they are looked at.
#[derive(Debug, Default)]
pub(super) struct Groups([Group; Quadrature::COUNT]);

impl Groups {
    pub(super) fn clear(&mut self) {
        for group in &mut self.0 {
            group.suns.clear();
            group.lit.clear();
            group.error.clear();
        }
    }

    #[inline]
    pub(super) fn push(&mut self, how: Quadrature, of: SunOfCell) {
        let group = &mut self.0[how.number()];
        group.suns.push(of.sun);
        group.lit.push(of.lit);
        group.error.push(of.error);
    }

    /// Those that have suns, from coarse to fine.
    pub(super) fn each(&self) -> impl Iterator<Item = (Quadrature, &Group)> {
        Quadrature::all().zip(&self.0).filter(|(_, group)| !group.suns.is_empty())
    }

    /// Whether some suns are looked at through seven points.
    pub(super) fn any_fine(&self) -> bool {
        self.each().any(|(how, _)| matches!(how, Quadrature::Seven(_)))
    }
}
