//! Aiming: which squares of a BSDF's lobes photons are drawn from, for one sun and one PV surface.
//!
//! Most of what a flat roof reflects flies into the sky. A photon that is drawn, sent and lost
//! costs as much as one that lands, so the lobe is cut into squares ([`crate::bsdf::Square`]), and
//! only those are kept whose cone of directions doesn't clear the horizon of what can be hit.
//! Cutting goes where it pays: the square with the largest waste (what its bound promises less what
//! it is seen to give) is cut next, from a heap, until waste falls below 2 % or the budget is
//! spent. The budget grows with the photons that are wanted for each sun, so that a run of few
//! photons doesn't cut more than it sends.
//!
//! Lobes whose bound is a product of incident and outgoing part (a diffuse base) are cut once for
//! all suns ([`SharedSquares`]). A uniform grid would not do: a lobe of half a degree wants 14
//! halvings in one place and none elsewhere.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::emitter::{Emitter, Pieces};
use super::horizon::Horizon;
use crate::bsdf::{Chart, Cone, Square};

/// Squares that an emitter's lobes are cut into for one sun, at most.
const MOST_SQUARES: usize = 1024;
/// With fewer it isn't worth the trouble: the lobe is drawn as a whole.
const LEAST_SQUARES: usize = 12;
/// Photons that a square should be good for: cutting one out takes about as long as sending a few.
const PHOTONS_A_SQUARE: f64 = 12.0;
/// What is cut once for all suns may be finer by this factor, up to so many squares.
const SHARED_FINER: usize = 8;
const MOST_SHARED: usize = 2048;
/// How much finer lobes are cut for virtual sensors, and how finely at least.
const FINER: usize = 8;
const LEAST_FINE: usize = 64;
/// Share of draws that end early from which on cutting further isn't worth it.
const WASTE: f64 = 0.02;

/// Where an emitter's light may be drawn from: a square of a lobe that may reach something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    pub square: Square,
    /// Upper bound of density * cos(incident) in it, over the sun's disc.
    pub most: f64,
    /// The pieces of the emitter from which it may reach something.
    pub pieces: Pieces,
    /// Their share of the emitter's area.
    pub share: f64,
}

impl Target {
    /// What falls to it of a sun's light per area of PV; the measure that photons are shared by.
    pub(super) fn weight(&self) -> f64 {
        self.most * self.square.area() * self.share
    }
}

/// How finely to cut: squares for each sun and emitter, when `photons` are wanted of `pairs`.
/// It depends on nothing that differs between pilot, run, threads or machines.
pub(super) fn budget(photons: u64, pairs: usize) -> usize {
    let wanted = photons as f64 / pairs.max(1) as f64 / PHOTONS_A_SQUARE;
    if wanted < LEAST_SQUARES as f64 { 0 } else { (wanted as usize).min(MOST_SQUARES) }
}

/// The same where little of what is drawn may reach anything: cutting spares more than it costs.
pub(super) fn fine_budget(photons: u64, pairs: usize) -> usize {
    (FINER * budget(photons, pairs)).clamp(LEAST_FINE, MOST_SQUARES)
}

/// A square that may still be cut.
#[derive(Debug)]
struct Open {
    target: Target,
    /// Estimate of what draws in it would come to nothing.
    waste: f64,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        let order = |o: &Self| o.target.square.order();
        let level = |o: &Self| o.target.square.level;
        self.waste
            .total_cmp(&other.waste)
            .then_with(|| order(self).cmp(&order(other)))
            .then_with(|| level(self).cmp(&level(other)))
    }
}

/// What of an emitter's light is cut once for all suns.
#[derive(Debug, Default)]
pub(super) struct SharedSquares {
    targets: Vec<Target>,
    lobes: Vec<Chart>,
}

/// Light along the normal: that which [`SharedSquares`] is cut for.
fn upright() -> Cone {
    Cone::new(DVec3::Z, 0.0)
}

impl SharedSquares {
    /// Cuts the lobes whose bounds are products, see [`Bsdf::scale`].
    ///
    /// [`Bsdf::scale`]: crate::bsdf::Bsdf::scale
    pub(super) fn of(emitter: &Emitter, horizon: Option<&Horizon>, budget: usize) -> Self {
        let Some(horizon) = horizon.filter(|_| budget > 0) else { return Self::default() };
        let from = upright();
        let all = emitter.bsdf.charts().iter().copied();
        let lobes: Vec<_> = all.filter(|&l| emitter.bsdf.scale(l, &from).is_some()).collect();
        let budget = (SHARED_FINER * budget).min(MOST_SHARED);
        Self { targets: cut(emitter, horizon, &from, &lobes, budget), lobes }
    }
}

/// Cuts an emitter's lobes into squares for light from `from` (local directions), and keeps those
/// that may reach something: a square is left out only if a cone that holds all its directions,
/// for all of the sun's disc, clears the horizon of all pieces of the emitter, or lies below its
/// plane; and it is kept for those pieces alone whose horizon the cone doesn't clear.
pub(super) fn targets(
    emitter: &Emitter,
    shared: &SharedSquares,
    horizon: Option<&Horizon>,
    from: &Cone,
    budget: usize,
) -> Vec<Target> {
    let square = Square::whole(Chart::Whole);
    let most = emitter.bsdf.most(square, from);
    let whole = Target { square, most, pieces: emitter.all(), share: 1.0 };
    if most <= 0.0 {
        return Vec::new();
    }
    let Some(horizon) = horizon.filter(|_| budget > 0) else { return vec![whole] };
    let lobes = emitter.bsdf.charts().iter().copied();
    let lobes: Vec<_> = lobes.filter(|l| !shared.lobes.contains(l)).collect();
    let mut out = cut(emitter, horizon, from, &lobes, budget);
    for &lobe in &shared.lobes {
        let scale = |from: &Cone| emitter.bsdf.scale(lobe, from).unwrap_or(0.0);
        let factor = scale(from) / scale(&upright());
        let of_lobe = shared.targets.iter().filter(|t| t.square.chart == lobe);
        out.extend(of_lobe.map(|t| Target { most: t.most * factor, ..*t }));
    }
    // A rugged lobe has squares that promise more than it has in all.
    if out.iter().map(Target::weight).sum::<f64>() < whole.weight() { out } else { vec![whole] }
}

/// Cuts the square with the largest waste, again and again. The squares come in an order that
/// keeps neighbours together, so that consecutive photons fly similar ways.
fn cut(
    emitter: &Emitter,
    horizon: &Horizon,
    from: &Cone,
    lobes: &[Chart],
    budget: usize,
) -> Vec<Target> {
    let look = |square: Square| look(emitter, horizon, from, square);
    let mut open: BinaryHeap<Open> =
        lobes.iter().filter_map(|&lobe| look(Square::whole(lobe))).collect();
    let mut done = Vec::new();
    let sums = |sum: (f64, f64), o: &Open| (sum.0 + o.target.weight(), sum.1 + o.waste);
    let (mut all, mut waste) = open.iter().fold((0.0, 0.0), sums);
    while open.len() + done.len() < budget && waste > WASTE * all {
        let Some(largest) = open.pop() else { break };
        let Some(quarters) = largest.target.square.quarters() else {
            done.push(largest.target);
            continue;
        };
        all -= largest.target.weight();
        waste -= largest.waste;
        for part in quarters.into_iter().filter_map(look) {
            (all, waste) = sums((all, waste), &part);
            open.push(part);
        }
    }
    done.extend(open.into_iter().map(|o| o.target));
    done.sort_by_cached_key(|t| t.square.order());
    done
}

/// Whether a square may reach anything, its bound, and what would be wasted in it.
fn look(emitter: &Emitter, horizon: &Horizon, from: &Cone, square: Square) -> Option<Open> {
    let most = emitter.bsdf.most(square, from);
    if most <= 0.0 {
        return None;
    }
    let frame = &emitter.frame;
    let reach = emitter.bsdf.reach(square, from);
    if reach.heights().1 <= 0.0 {
        return None;
    }
    let pieces = horizon.reaching_cone(&reach.about(frame.world_from_local(reach.axis)));
    if pieces == 0 {
        return None;
    }
    let target = Target { square, most, pieces, share: emitter.share(pieces) };
    if square.quarters().is_none() {
        return Some(Open { target, waste: 0.0 });
    }
    let mut useful = 0.0;
    if from.axis.z > 0.0 {
        let each = 0.25 * from.axis.z / emitter.pieces.len() as f64;
        for (u, v) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            if let Some((out, density)) = emitter.bsdf.density(square, from.axis, u, v) {
                let reaching = horizon.reaching(frame.world_from_local(out));
                useful += each * density * f64::from(reaching.count_ones());
            }
        }
    }
    let waste = (target.weight() - useful * square.area()).max(0.0);
    Some(Open { target, waste })
}
