use serde::Serialize;

use super::path::{Draw, Tracer};
use super::{Error, Plan};
use crate::base::{Fate, Purpose};
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

pub(super) fn word(fate: Fate) -> &'static str {
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

pub(super) fn lobe(chart: Chart) -> &'static str {
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
}
