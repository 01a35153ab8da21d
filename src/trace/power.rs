use glam::DVec3;
use rayon::prelude::*;

use super::disc::Disc;
use super::emitter::Emitter;
use crate::base::{Frame, Timeline, Timestep};

/// The distribution that photons are drawn from: watts over (timestep, emitter). Only the sums
/// over each timestep are kept; the emitters' shares are worked out again as photons come to it.
#[derive(Debug)]
pub(super) struct Power {
    /// Watts of all timesteps before each one; one longer than the timeline.
    before_w: Vec<f64>,
    /// The last timestep that has any.
    last: usize,
}

/// What the emitters have of one timestep.
#[derive(Debug)]
pub(super) struct Shares {
    /// The timestep.
    pub step: usize,
    /// Frame whose z points to the sun's centre.
    pub sun: Frame,
    /// Emitters with a share: number, bound `g` of cos * reflectance, and the watts up to and
    /// with this one.
    lit: Vec<(usize, f64, f64)>,
}

/// Upper bound over the sun's disc of `cos * bound`, with room for rounding.
fn peak(emitter: &Emitter, disc: &Disc, sun: DVec3) -> f64 {
    let (low, high) = disc.cosines(emitter.frame.z.dot(sun));
    if high <= 0.0 {
        return 0.0;
    }
    high * emitter.bsdf.bound_between(low, high) * (1.0 + 1e-9)
}

fn share_w(emitter: &Emitter, disc: &Disc, step: &Timestep) -> (f64, f64) {
    let peak = peak(emitter, disc, step.sun);
    (peak, step.irradiance_w_m2.max(0.0) * emitter.area_m2 * peak)
}

impl Power {
    pub(super) fn of(emitters: &[Emitter], disc: &Disc, timeline: &Timeline) -> Self {
        let watts: Vec<f64> = timeline
            .steps
            .par_iter()
            .map(|step| emitters.iter().map(|e| share_w(e, disc, step).1).sum())
            .collect();
        let mut before_w = Vec::with_capacity(watts.len() + 1);
        let mut sum = 0.0;
        before_w.push(sum);
        for w in &watts {
            sum += w;
            before_w.push(sum);
        }
        let last = watts.iter().rposition(|&w| w > 0.0).unwrap_or(0);
        Self { before_w, last }
    }

    /// Watts of all.
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
    pub(super) fn of(emitters: &[Emitter], disc: &Disc, timeline: &Timeline, step: usize) -> Self {
        let at = &timeline.steps[step];
        let mut sum = 0.0;
        let lit = emitters
            .iter()
            .enumerate()
            .filter_map(|(i, emitter)| {
                let (peak, watts) = share_w(emitter, disc, at);
                sum += watts;
                (watts > 0.0).then_some((i, peak, sum))
            })
            .collect();
        Self { step, sun: Frame::around(at.sun), lit }
    }

    /// The emitter at a position inside the timestep, in watts, with its bound g.
    #[inline]
    pub(super) fn at(&self, within_w: f64) -> Option<(usize, f64)> {
        let i = if self.lit.len() < 16 {
            self.lit.iter().take_while(|l| l.2 <= within_w).count()
        } else {
            self.lit.partition_point(|l| l.2 <= within_w)
        };
        // Past the end by rounding: the last one.
        self.lit.get(i).or(self.lit.last()).map(|&(emitter, peak, _)| (emitter, peak))
    }
}
