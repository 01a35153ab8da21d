//! How many photons to send so that as many land as were asked for: a pilot finds out.
//!
//! Users ask for stored photons, since these decide about noise. The share that lands isn't known
//! beforehand, so a pilot sends photons of its own, in growing rounds over the whole year, until
//! enough have landed to know it to 0.5 %. They are thrown away: keeping them would make the store
//! depend on how the rounds went.

use super::Error;
use super::batch::send_all;
use super::emission::Emission;
use super::path::{Draw, Tracer};
use super::plan::{BATCH_PHOTONS, Plan};
use crate::base::{Progress, Purpose, Tally};

/// Landed photons that a pilot counts: the share that lands is then known to 0.5 % or better.
const PILOT_STORED: u64 = 40_000;
/// Photons that a pilot sends at most.
const PILOT_EMITTED: u64 = 1 << 29;
/// Photons of the first round.
const FIRST_ROUND: u64 = 32_768;
/// Landed photons without which a pilot says nothing, and how many it sends before it gives up.
const PILOT_LEAST: u64 = 64;
const PILOT_PATIENCE: u64 = 1 << 24;
/// Photons that may always be sent through virtual sensors.
const LEAST_SENT: u64 = 1 << 24;
/// Photons that a run may send.
const MOST_EMITTED: f64 = (1_u64 << 48) as f64;

impl Tracer<'_> {
    /// Finds how many photons to send so that `settings.stored` land. Deterministic: sends photons
    /// of their own in growing rounds, each spread over the whole year, until about 40,000 have
    /// landed (fewer for targets below 100,000).
    ///
    /// # Errors [`Error::NothingLands`] with the shares that say why, and interruption.
    pub fn plan(&self, progress: &dyn Progress) -> Result<Plan, Error> {
        let (tracer, emission) = (self, self.emission);
        let target = emission.settings.stored;
        let wanted = (target / 5 * 2).clamp(1000, PILOT_STORED);
        progress.begin("pilot", wanted, "landed photons");
        if let Some(sensors) = &tracer.sensors {
            let plan = self.sensor_plan(sensors.most(), wanted, progress);
            progress.finish();
            return plan;
        }
        if tracer.total_w() <= 0.0 {
            // Nothing can be reached: there is no need to try.
            return Err(Error::nothing_lands(&tracer.dark(), emission.settings.max_path_m));
        }
        let limits = Limits { wanted, most: PILOT_EMITTED, patient: false };
        let result = rounds(tracer, emission, Purpose::Pilot, limits, progress);
        progress.finish();
        let tally = result?;
        let (sent, stored) = (tally.sent.photons, tally.stored.photons);
        let emitted = (target as f64 * sent as f64 / stored as f64).ceil();
        if emitted > MOST_EMITTED {
            return Err(Error::TooMany { stored: target, emitted });
        }
        let emitted = (emitted as u64).max(1);
        Ok(Plan {
            emitted,
            pilot_emitted: sent,
            pilot_stored: stored,
            photon_w: tracer.total_w() / emitted as f64,
            pilot: tally,
        })
    }

    /// Through virtual sensors as many are sent as cross them often enough, but `most` at most: a
    /// virtual sensor in the shade of everything is no mistake, nor one that little light reaches.
    fn sensor_plan(&self, most: u64, wanted: u64, progress: &dyn Progress) -> Result<Plan, Error> {
        let most = most.max(LEAST_SENT);
        let mut tally = Tally::default();
        let mut emitted = 1;
        if self.total_w() > 0.0 {
            let limits = Limits { wanted, most: most / 4, patient: true };
            tally = rounds(self, self.emission, Purpose::SensorPilot, limits, progress)?;
            let each = tally.sent.photons as f64 / tally.stored.photons.max(1) as f64;
            let needed = (self.emission.settings.stored as f64 * each).ceil();
            emitted = (needed.min(most as f64) as u64).max(1);
        }
        Ok(Plan {
            emitted,
            pilot_emitted: tally.sent.photons,
            pilot_stored: tally.stored.photons,
            photon_w: self.total_w() / emitted as f64,
            pilot: tally,
        })
    }
}

/// How long a pilot goes on.
#[derive(Clone, Copy)]
struct Limits {
    /// Landed photons that are enough.
    wanted: u64,
    /// Photons to send at most.
    most: u64,
    /// Whether it goes on to the end though hardly anything lands.
    patient: bool,
}

fn rounds(
    tracer: &Tracer,
    emission: &Emission,
    purpose: Purpose,
    limits: Limits,
    progress: &dyn Progress,
) -> Result<Tally, Error> {
    let wanted = limits.wanted;
    let mut tally = Tally::default();
    let mut round = 0_u64;
    let mut size = FIRST_ROUND;
    loop {
        // Photons of different rounds must not share numbers: the round is part of the seed.
        let seed = emission.settings.seed.wrapping_add(round.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let draw = Draw { purpose, seed, emitted: size };
        let found = send_all(tracer, draw, 0..size, false, &Quiet(progress), |_| Ok(()))?;
        tally.add(&found);
        progress.advance(found.stored.photons);
        let (sent, stored) = (tally.sent.photons, tally.stored.photons);
        if stored >= wanted {
            return Ok(tally);
        }
        if !limits.patient && sent >= PILOT_PATIENCE && stored < PILOT_LEAST {
            return Err(Error::nothing_lands(&tally, emission.settings.max_path_m));
        }
        if sent >= limits.most {
            return Ok(tally);
        }
        // What is missing, by what was seen so far and a little more; without anything seen, four
        // times as much as before.
        let missing = if stored == 0 {
            4 * size
        } else {
            let each = sent as f64 / stored as f64;
            (1.05 * each * (wanted - stored) as f64) as u64
        };
        size = missing.clamp(BATCH_PHOTONS, 8 * size).min(limits.most);
        round += 1;
    }
}

/// Progress of a round inside the pilot: the pilot counts what landed, not what was sent.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _what: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _units: u64) {}
    fn finish(&self) {}
    fn say(&self, message: &str) {
        self.0.say(message);
    }
    fn check(&self) -> Result<(), crate::base::Interrupted> {
        self.0.check()
    }
}
