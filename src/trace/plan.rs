use std::ops::Range;

use crate::base::Tally;

/// Photons that are sent in one piece. Fixed: the tally's sums depend on it.
pub const BATCH_PHOTONS: u64 = 16_384;

/// Batches of a unit at least and at most, and how many units a plan is cut into in between: few
/// enough that a unit takes seconds, large enough that many threads find work in it.
const UNIT_BATCHES: (u64, u64) = (2, 256);
const UNITS: u64 = 256;

/// How many photons a run sends: what the pilot found.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Plan {
    /// Photons that the run sends.
    pub emitted: u64,
    /// Photons that the pilot sent, and threw away.
    pub pilot_emitted: u64,
    /// Of these, how many landed where they would have been stored.
    pub pilot_stored: u64,
    /// Flux of each photon of the run, W.
    pub photon_w: f64,
    /// Where the pilot's photons and flux went.
    pub pilot: Tally,
}

impl Plan {
    /// Batches of each unit but the last. Depends on nothing but the plan.
    fn unit_batches(&self) -> u64 {
        let batches = self.emitted.div_ceil(BATCH_PHOTONS);
        batches.div_ceil(UNITS).clamp(UNIT_BATCHES.0, UNIT_BATCHES.1)
    }

    /// Into how many units the plan's photons are cut: contiguous, numbered from 0, the same for
    /// any threads and machines.
    pub fn units(&self) -> u64 {
        self.emitted.div_ceil(BATCH_PHOTONS).div_ceil(self.unit_batches())
    }

    /// Numbers of the photons of a unit.
    pub fn unit(&self, unit: u64) -> Range<u64> {
        let size = self.unit_batches() * BATCH_PHOTONS;
        let start = unit.saturating_mul(size).min(self.emitted);
        start..start.saturating_add(size).min(self.emitted)
    }
}
