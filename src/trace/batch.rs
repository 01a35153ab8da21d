use std::ops::Range;

use rayon::prelude::*;

use super::emission::Emission;
use super::path::{Batch, Draw, Tracer};
use super::{Error, Plan};
use crate::base::{PhotonSink, Progress, Purpose, Tally};

/// Photons that are sent in one piece. Fixed: the tally's sums depend on it.
pub const BATCH_PHOTONS: u64 = 65_536;

/// Sends all photons of a plan and delivers those that land, batch by batch in order, whatever
/// the number of threads; the sink is called by one thread at a time while the next batches are
/// traced. Runs in the current rayon pool and holds some four batches a thread.
///
/// # Errors
/// What [`Emission::check`] finds, a sink that can't keep its photons, and interruption.
pub fn run(
    emission: &Emission,
    plan: &Plan,
    sink: &mut dyn PhotonSink,
    progress: &dyn Progress,
) -> Result<Tally, Error> {
    let tracer = Tracer::new(emission)?;
    let draw =
        Draw { purpose: Purpose::Photon, seed: emission.settings.seed, emitted: plan.emitted };
    progress.begin("tracing photons", plan.emitted, "photons");
    let result = send_all(&tracer, draw, true, progress, |batch| Ok(sink.accept(&batch.photons)?));
    progress.finish();
    result
}

/// Sends every photon of `draw`; `deliver` gets the batches in order.
pub(super) fn send_all(
    tracer: &Tracer,
    draw: Draw,
    keep: bool,
    progress: &dyn Progress,
    mut deliver: impl FnMut(&Batch) -> Result<(), Error> + Send,
) -> Result<Tally, Error> {
    let batches = draw.emitted.div_ceil(BATCH_PHOTONS);
    let window = 2 * rayon::current_num_threads().max(1) as u64;
    let send = |range: Range<u64>| -> Vec<Batch> {
        range
            .into_par_iter()
            .map(|i| {
                let start = i * BATCH_PHOTONS;
                tracer.send(draw, start..(start + BATCH_PHOTONS).min(draw.emitted), keep)
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
