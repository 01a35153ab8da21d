//! A year of an eye in fine steps, of which only those are looked at where a limit may be exceeded.

use rayon::prelude::*;

use super::instant::EyeInstant;
use super::patches::{EyePv, LitPv, Seen};
use super::{EyeMaterial, Glint, SunAt};
use crate::base::{Progress, Timeline};
use crate::bsdf::Cone;
use crate::render::view::error::Error;

/// What must be exceeded for an instant to count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SweepLimits {
    /// Irradiances, W/m2.
    pub irradiances_w_m2: Vec<f64>,
    /// Of planes that face the beams, or of that across the line of sight.
    pub normal: bool,
    /// Radiances of the brightest patch, W/m2/sr.
    pub radiances_w_m2_sr: Vec<f64>,
}

/// What a sweep of the year found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sweep {
    /// By timestep: a bit for each irradiance, then for each radiance, that is exceeded.
    pub exceeded: Vec<u32>,
    /// Timesteps at which the eye looked.
    pub looked: usize,
    /// Timesteps at which shadows were asked for as well.
    pub asked: usize,
}

/// Room for all else that changes between two timesteps.
const ROOM: f64 = 1.2;

/// An eye, a year of suns in fine steps, and a material.
#[derive(Clone, Copy, Debug)]
pub struct Sweeper<'a> {
    /// The PV.
    pub pv: &'a EyePv<'a>,
    /// What the eye has in sight, once or by month.
    pub seen: &'a [Seen],
    /// The fine timesteps.
    pub timeline: &'a Timeline,
    /// By PV surface.
    pub materials: &'a [EyeMaterial<'a>],
    /// What is asked.
    pub limits: &'a SweepLimits,
}

impl SweepLimits {
    fn pairs(&self, instant: &EyeInstant) -> impl Iterator<Item = (f64, f64)> {
        let irradiance = if self.normal { instant.normal_w_m2 } else { instant.surface_w_m2 };
        let radiance = instant.peak.radiance_w_m2_sr;
        let first = self.irradiances_w_m2.iter().map(move |l| (irradiance, *l));
        first.chain(self.radiances_w_m2_sr.iter().map(move |l| (radiance, *l)))
    }

    fn exceeded(&self, instant: &EyeInstant) -> u32 {
        let bits = self.pairs(instant).enumerate();
        bits.fold(0, |all, (i, (value, limit))| all | u32::from(value > limit) << i)
    }

    fn within(&self, instant: &EyeInstant) -> bool {
        self.pairs(instant).all(|(value, limit)| value <= limit)
    }
}

/// A timestep that was looked at without shadows, per W/m2 of the sun.
#[derive(Clone, Copy)]
struct Looked {
    at: usize,
    instant: EyeInstant,
    /// See [`EyePv::least_tilt`].
    least_tilt: f64,
    least_cos: f64,
}

impl Sweeper<'_> {
    /// Finds out which timesteps exceed a limit: first every `coarse`-th, then, between two of them,
    /// the middle, until nothing between can exceed any limit or no timestep lies between. What can
    /// be exceeded is bounded by what the PV would send without shadows, by how far the sun moves
    /// meanwhile, and by how narrow the lobe is; of measured surfaces by the largest value of all cells
    /// that the sun and the eye's directions may touch meanwhile. So the result is that of looking at each timestep.
    /// `coarse` 1 looks at all.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn run(&self, coarse: usize, progress: &dyn Progress) -> Result<Sweep, Error> {
        let segments = self.timeline.segments();
        let parts: Vec<Sweep> = segments
            .par_iter()
            .map(|segment| {
                progress.check()?;
                let mut part = Part {
                    sweeper: self,
                    first: segment.start,
                    sweep: Sweep { exceeded: vec![0; segment.len()], ..Sweep::default() },
                    glints: Vec::new(),
                };
                part.segment(segment.end, coarse.max(1));
                Ok::<_, Error>(part.sweep)
            })
            .collect::<Result<_, _>>()?;
        let mut out = Sweep::default();
        for part in parts {
            out.exceeded.extend(part.exceeded);
            out.looked += part.looked;
            out.asked += part.asked;
        }
        Ok(out)
    }

    fn seen(&self, at: usize) -> (&Seen, usize) {
        let day = self.timeline.steps[at].day;
        let month = crate::sky::date_of_day(self.timeline.year, day).0.saturating_sub(1) as usize;
        (&self.seen[month % self.seen.len()], month)
    }

    fn sun(&self, at: usize) -> SunAt {
        let step = &self.timeline.steps[at];
        SunAt {
            direction: step.sun,
            irradiance_w_m2: step.irradiance_w_m2,
            diameter_deg: self.timeline.sun_diameter_deg,
        }
    }

    /// Whether nothing between two timesteps can exceed a limit.
    fn nothing_between(&self, a: &Looked, b: &Looked) -> bool {
        let suns = [a, b].map(|l| self.timeline.steps[l.at].sun);
        let steps = &self.timeline.steps[a.at..=b.at];
        let strongest = steps.iter().fold(0.0, |most: f64, s| most.max(s.irradiance_w_m2));
        if strongest <= 0.0 {
            return true;
        }
        // The sun's way between them is nearly an arc: no place on it is farther from both ends.
        // Where the sun rises or sets for a part of the PV, one end says nothing about the other.
        let (seen, _) = self.seen(a.at);
        let part = if self.pv.passes_a_plane(seen, suns) { 1.05 } else { 0.55 };
        let angle = libm::acos(suns[0].dot(suns[1]).clamp(-1.0, 1.0));
        let moved = part * angle;
        let cos = a.least_cos.min(b.least_cos).max(0.05);
        let turned = 0.5 * moved / cos;
        let radius = self.sun(a.at).radius_rad();
        let disc = 0.5 * radius / cos;
        let mirrors = self.materials.iter().any(|m| m.width() == 0.0);
        if mirrors && a.least_tilt.min(b.least_tilt) <= turned + disc {
            return false;
        }
        let modelled = self.materials.iter().any(EyeMaterial::is_modelled);
        let arc = Cone::new((suns[0] + suns[1]).normalize(), part * angle + radius);
        let measured = self.pv.most_measured(seen, &arc, self.materials);
        [a, b].into_iter().all(|end| {
            let tilt = end.least_tilt - disc;
            let growth = self.materials.iter().map(|m| m.growth(tilt, turned));
            let most = if modelled { ROOM * growth.fold(1.0, f64::max) } else { 0.0 };
            self.limits.within(&end.instant.scaled(strongest * most, &measured, strongest))
        })
    }
}

/// One segment of a sweep.
struct Part<'a> {
    sweeper: &'a Sweeper<'a>,
    first: usize,
    sweep: Sweep,
    glints: Vec<Glint>,
}

impl Part<'_> {
    fn segment(&mut self, end: usize, coarse: usize) {
        let mut before: Option<Looked> = None;
        let mut at = self.first;
        while at < end {
            let here = self.look(at);
            if let Some(before) = before {
                self.between(&before, &here);
            }
            before = Some(here);
            // The last timestep is always looked at.
            at = if at + coarse >= end && at + 1 < end { end - 1 } else { at + coarse };
        }
    }

    fn between(&mut self, a: &Looked, b: &Looked) {
        if b.at - a.at < 2 || self.sweeper.nothing_between(a, b) {
            return;
        }
        let middle = self.look(a.at + (b.at - a.at) / 2);
        self.between(a, &middle);
        self.between(&middle, b);
    }

    /// Looks at a timestep: without shadows, and where that exceeds a limit, with them.
    fn look(&mut self, at: usize) -> Looked {
        let Sweeper { pv, materials, limits, .. } = *self.sweeper;
        let (seen, month) = self.sweeper.seen(at);
        let sun = self.sweeper.sun(at);
        let unit = SunAt { irradiance_w_m2: 1.0, ..sun };
        let open = LitPv::open();
        self.sweep.looked += 1;
        pv.look(seen, &open, &unit, materials, &mut self.glints);
        let instant = EyeInstant::bright(&seen.eye, &self.glints);
        let here = instant.scaled(sun.irradiance_w_m2, &EyeInstant::default(), 0.0);
        let (least_tilt, least_cos) = pv.least_tilt(seen, sun.direction);
        if !limits.within(&here) {
            self.sweep.asked += 1;
            let lit = pv.lit(sun.direction, seen, month);
            pv.look(seen, &lit, &sun, materials, &mut self.glints);
            let shaded = EyeInstant::bright(&seen.eye, &self.glints);
            self.sweep.exceeded[at - self.first] = limits.exceeded(&shaded);
        }
        Looked { at, instant, least_tilt, least_cos }
    }
}
