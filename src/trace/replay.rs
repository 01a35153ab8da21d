use serde::Serialize;

use super::Error;
use super::path::{Draw, Tracer};
use super::plan::Plan;
use super::power::Shares;
use crate::base::{Fate, Purpose, Stream};
use crate::bsdf::Chart;

/// One photon's path, retold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Retold {
    /// The photon, from 0.
    pub photon: u64,
    /// Photons that the run sends.
    pub emitted: u64,
    /// Index of the timestep.
    pub timestep: usize,
    /// Unit vector to the point of the sun's disc that it came from.
    pub to_sun: [f64; 3],
    /// Number of the PV surface.
    pub surface: u16,
    /// Front (false) or back of a two-sided surface.
    pub back: bool,
    /// Angle between the way to the sun and the PV's normal, degrees.
    pub incidence_deg: f64,
    /// Part of the scattering that it was drawn from.
    pub lobe: &'static str,
    /// Share of that lobe that was drawn from: the rest reaches nothing or was drawn by others.
    pub lobe_share: f64,
    /// Share of the emitter's area that it could start from.
    pub area_share: f64,
    /// Flux of the photon against the run's usual one; 1 but for numerical accidents.
    pub weight: f64,
    /// Where it started, m from the local origin; none if it didn't.
    pub start: Option<[f64; 3]>,
    /// Where it flew, a unit vector; none if it died in the PV.
    pub direction: Option<[f64; 3]>,
    /// Whether the sun was seen from the start; none if nobody looked.
    pub sun_visible: Option<bool>,
    /// How it ended.
    pub fate: &'static str,
    /// How far it flew, m.
    pub distance_m: Option<f32>,
    /// Triangle that it hit.
    pub triangle: Option<u32>,
    /// Where it landed, m from the local origin.
    pub landed: Option<[f32; 3]>,
    /// Flux that it carried away from the PV, W.
    pub flux_w: f64,
}

fn word(fate: Fate) -> &'static str {
    match fate {
        Fate::Blocked => "blocked",
        Fate::Absorbed => "absorbed",
        Fate::OnPv => "on-pv",
        Fate::Stored => "stored",
        Fate::Escaped => "escaped",
        Fate::TooFar => "too-far",
        Fate::NotSampled => "not-sampled",
    }
}

fn lobe(chart: Chart) -> &'static str {
    match chart {
        Chart::Whole => "whole",
        Chart::Mirrored => "mirrored",
        Chart::Hemisphere => "hemisphere",
        Chart::Cells => "cells",
        Chart::Facets => "facets",
    }
}

impl Tracer<'_> {
    /// Sends one photon of a plan again and tells what happens to it.
    ///
    /// # Errors
    /// [`Error::Setting`] where the plan has no such photon.
    pub fn replay(&self, plan: &Plan, photon: u64) -> Result<Retold, Error> {
        if photon >= plan.emitted {
            return Err(Error::Setting {
                name: "the photon's number",
                expected: "below the number of photons sent (tally.json: plan, emitted)",
                found: format!("{photon} of {}", plan.emitted),
            });
        }
        let seed = self.emission.settings.seed;
        let draw = Draw { purpose: Purpose::Photon, seed, emitted: plan.emitted };
        self.retell(draw, photon)
            .ok_or(Error::NoFlux { timesteps: self.emission.timeline.steps.len() })
    }

    /// `None` only where nothing can be sent at all.
    fn retell(&self, draw: Draw, number: u64) -> Option<Retold> {
        let each_w = self.power.total_w() / draw.emitted as f64;
        let mut random = Stream::new(draw.seed, draw.purpose, number);
        let at_w = (number as f64 + random.uniform()) * each_w;
        let shares = Shares::of(&self.sources(), self.power.find(at_w));
        let aim = *shares.at(at_w - self.power.before_w(shares.step), &mut 0)?;
        let path = self.follow(&shares, &aim, each_w, &mut random);
        let emitter = &self.emitters[aim.emitter];
        let pv = &self.emission.site.pv[usize::from(emitter.surface)];
        let start = path.flight.and_then(|f| f.start);
        let hit = path.flight.and_then(|f| f.hit);
        let looked = start.is_some() && self.emission.settings.sun_visibility;
        let target = aim.target;
        Some(Retold {
            photon: number,
            emitted: draw.emitted,
            timestep: shares.step,
            to_sun: path.to_sun.to_array(),
            surface: emitter.surface,
            back: emitter.frame.z.dot(pv.normal) < 0.0,
            incidence_deg: libm::acos(emitter.frame.z.dot(path.to_sun).clamp(-1.0, 1.0))
                .to_degrees(),
            lobe: lobe(target.square.chart),
            lobe_share: target.square.area(),
            area_share: target.share,
            weight: path.weight,
            start: start.map(|p| p.to_array()),
            direction: path.flight.map(|f| f.direction.to_array()),
            sun_visible: looked.then_some(path.fate != Fate::Blocked),
            fate: word(path.fate),
            distance_m: hit.map(|h| h.0),
            triangle: hit.map(|h| h.1),
            landed: self.photon(&shares, &aim, &path).map(|p| p.position.to_array()),
            flux_w: path.left_w,
        })
    }
}
