//! The distribution that photons are drawn from: watts over timesteps, emitters and squares.
//!
//! With 260,000 suns and a thousand squares each, the table of all squares doesn't fit into memory.
//! Only the sum of each timestep is kept; its squares are cut again, deterministically, when
//! photons come to it. As photons come in the order of their number, that is once for each timestep
//! and batch.

use glam::DVec3;
use rayon::prelude::*;

use super::aim::{self, SharedSquares, Target};
use super::disc::Disc;
use super::emitter::Emitter;
use super::horizon::Horizon;
use super::yields::Yields;
use crate::base::{Frame, Timeline};
use crate::bsdf::Cone;

/// What light is drawn from.
pub(super) struct Sources<'a> {
    pub emitters: &'a [Emitter<'a>],
    pub horizons: &'a [Option<Horizon>],
    pub shared: &'a [SharedSquares],
    pub disc: Disc,
    pub timeline: &'a Timeline,
    /// See [`aim::budget`].
    pub budget: usize,
}

/// The distribution that photons are drawn from: watts over (timestep, emitter, square). Only the
/// sums over each timestep are kept; the rest is worked out again as photons come to it.
#[derive(Debug)]
pub(super) struct Power {
    /// Watts of all timesteps before each one; one longer than the timeline.
    before_w: Vec<f64>,
    /// The last timestep that has any.
    last: usize,
    /// What falls onto the PV, W, over all timesteps.
    pub falls_w: f64,
    /// What the PV scatters of it, W.
    pub scatters_w: f64,
}

/// What the emitters have of one timestep.
#[derive(Debug)]
pub(super) struct Shares {
    /// The timestep.
    pub step: usize,
    /// Frame whose z points to the sun's centre.
    pub sun: Frame,
    /// Where photons may go.
    aims: Vec<Aim>,
}

/// An emitter's target, with the watts of the timestep up to and with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    pub emitter: usize,
    pub target: Target,
    upto_w: f64,
}

impl Sources<'_> {
    /// The targets of all emitters for one timestep, in order.
    fn aims(&self, step: usize) -> Vec<Aim> {
        let at = &self.timeline.steps[step];
        let irradiance_w_m2 = at.irradiance_w_m2.max(0.0);
        let mut out = Vec::new();
        let mut sum = 0.0;
        if irradiance_w_m2 <= 0.0 {
            return out;
        }
        for (number, emitter) in self.emitters.iter().enumerate() {
            let from = self.cone(emitter, at.sun);
            if from.heights().1 <= 0.0 {
                continue;
            }
            let horizon = self.horizons[number].as_ref();
            let shared = &self.shared[number];
            for target in aim::targets(emitter, shared, horizon, &from, self.budget) {
                let watts = irradiance_w_m2 * emitter.area_m2 * target.weight();
                if watts > 0.0 {
                    sum += watts;
                    out.push(Aim { emitter: number, target, upto_w: sum });
                }
            }
        }
        out
    }

    /// The sun's disc as seen from an emitter.
    fn cone(&self, emitter: &Emitter, sun: DVec3) -> Cone {
        self.disc.cone(emitter.frame.local_from_world(sun))
    }
}

impl Power {
    pub(super) fn of(sources: &Sources, yields: &[Yields]) -> Self {
        let steps: Vec<(f64, [f64; 2])> = (0..sources.timeline.steps.len())
            .into_par_iter()
            .map(|step| {
                let watts = sources.aims(step).last().map_or(0.0, |a| a.upto_w);
                let at = &sources.timeline.steps[step];
                let mut sums = [0.0; 2];
                for (emitter, yields) in sources.emitters.iter().zip(yields) {
                    let watts = at.irradiance_w_m2.max(0.0) * emitter.area_m2;
                    let shares = yields.over(emitter, &sources.disc, at.sun);
                    sums[0] += watts * shares[0];
                    sums[1] += watts * shares[1];
                }
                (watts, sums)
            })
            .collect();
        let mut before_w = Vec::with_capacity(steps.len() + 1);
        let (mut sum, mut falls_w, mut scatters_w) = (0.0, 0.0, 0.0);
        before_w.push(sum);
        for (watts, [falls, scatters]) in &steps {
            sum += watts;
            falls_w += falls;
            scatters_w += scatters;
            before_w.push(sum);
        }
        let last = steps.iter().rposition(|s| s.0 > 0.0).unwrap_or(0);
        Self { before_w, last, falls_w, scatters_w }
    }

    /// Watts of all that photons are drawn from.
    pub(super) fn total_w(&self) -> f64 {
        self.before_w[self.before_w.len() - 1]
    }

    /// The timestep at a position of the distribution, in watts, not before `from`.
    #[inline]
    pub(super) fn step_at(&self, at_w: f64, from: usize) -> usize {
        let mut step = from;
        while step < self.last && at_w >= self.before_w[step + 1] {
            step += 1;
        }
        step
    }

    /// The timestep at a position, searched from nowhere.
    pub(super) fn find(&self, at_w: f64) -> usize {
        self.before_w[1..].partition_point(|&w| w <= at_w).min(self.last)
    }

    /// Watts before a timestep.
    #[inline]
    pub(super) fn before_w(&self, step: usize) -> f64 {
        self.before_w[step]
    }
}

impl Shares {
    pub(super) fn of(sources: &Sources, step: usize) -> Self {
        let sun = Frame::around(sources.timeline.steps[step].sun);
        Self { step, sun, aims: sources.aims(step) }
    }

    #[cfg(test)]
    pub(super) fn aims(&self) -> &[Aim] {
        &self.aims
    }

    /// What lies at a position inside the timestep, in watts; `near` is where the last one was
    /// found, and is moved.
    #[inline]
    pub(super) fn at(&self, within_w: f64, near: &mut usize) -> Option<&Aim> {
        let found = |i: usize| self.aims.get(i).is_none_or(|a| a.upto_w > within_w);
        if !found(*near) {
            *near += 1;
            if !found(*near) {
                *near += self.aims[*near..].partition_point(|a| a.upto_w <= within_w);
            }
        }
        // Past the end by rounding: the last one.
        self.aims.get(*near).or(self.aims.last())
    }
}
