//! Sending photons in batches, in order, on any number of threads.
//!
//! A batch is a fixed range of photon numbers: its content depends on nothing else, as random
//! numbers are counter-based. Batches are traced in parallel, window by window, and delivered one
//! after the other while the next window is traced. Units are ranges of batches that are sealed and
//! resumed as a whole, cut by the plan alone, so that shards and machines agree on them.

use std::ops::Range;

use rayon::prelude::*;

use super::Error;
use super::path::{Batch, Draw, Tracer};
use super::plan::{BATCH_PHOTONS, Plan};
use crate::base::{PhotonSink, Progress, Purpose, SinkError, Tally};

/// Takes photons, and is told when a unit is complete.
pub trait UnitSink: PhotonSink {
    /// All photons of `unit` were taken; `tally` says where they went.
    ///
    /// # Errors
    /// When it can't be noted (a full disk).
    fn complete(&mut self, unit: u64, tally: &Tally) -> Result<(), SinkError>;
}

impl Tracer<'_> {
    /// Sends the photons of some units of a plan and delivers those that land, batch by batch in
    /// order, whatever the number of threads; the sink is called by one thread at a time while the
    /// next batches are traced. Runs in the current rayon pool and holds some four batches a
    /// thread. The tally of the whole is the sum of the units' in ascending order, to the last bit.
    ///
    /// # Errors A sink that can't keep its photons, and interruption.
    pub fn run_units(
        &self,
        plan: &Plan,
        units: &[u64],
        sink: &mut dyn UnitSink,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let seed = self.emission.settings.seed;
        let purpose = if self.sensors.is_some() { Purpose::Sensor } else { Purpose::Photon };
        let draw = Draw { purpose, seed, emitted: plan.emitted };
        let count = |&unit: &u64| {
            let numbers = plan.unit(unit);
            numbers.end - numbers.start
        };
        progress.begin("tracing photons", units.iter().map(count).sum(), "photons");
        let result = units.iter().try_for_each(|&unit| {
            let numbers = plan.unit(unit);
            let deliver = |batch: &Batch| Ok(sink.accept(&batch.photons)?);
            let tally = send_all(self, draw, numbers, true, progress, deliver)?;
            Ok(sink.complete(unit, &tally)?)
        });
        progress.finish();
        result
    }
}

/// Sends photons `numbers` of `draw`; `deliver` gets the batches in order.
pub(super) fn send_all(
    tracer: &Tracer,
    draw: Draw,
    numbers: Range<u64>,
    keep: bool,
    progress: &dyn Progress,
    mut deliver: impl FnMut(&Batch) -> Result<(), Error> + Send,
) -> Result<Tally, Error> {
    let batches = (numbers.end - numbers.start).div_ceil(BATCH_PHOTONS);
    let window = 2 * rayon::current_num_threads().max(1) as u64;
    let send = |range: Range<u64>| -> Vec<Batch> {
        range
            .into_par_iter()
            .map(|i| {
                let start = numbers.start + i * BATCH_PHOTONS;
                tracer.send(draw, start..(start + BATCH_PHOTONS).min(numbers.end), keep)
            })
            .collect()
    };
    let mut tally = Tally::default();
    let mut ready: Vec<Batch> = Vec::new();
    let mut next = 0;
    while next < batches || !ready.is_empty() {
        progress.check()?;
        let end = (next + window).min(batches);
        let (sent, delivered) = rayon::join(
            || send(next..end),
            || {
                ready.iter().try_for_each(|batch| {
                    tally.add(&batch.tally);
                    deliver(batch)
                })
            },
        );
        delivered?;
        progress.advance(sent.iter().map(|batch| batch.tally.sent.photons).sum());
        ready = sent;
        next = end;
    }
    Ok(tally)
}
