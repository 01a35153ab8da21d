//! Photons of a scene, sent and counted as a run does it.

use glintmap::base::{Photon, PhotonSink, Progress, SinkError, Tally};
use glintmap::trace::{Emission, Error, Plan, Tracer, UnitSink};

/// How many photons to send.
pub fn plan(emission: &Emission, progress: &dyn Progress) -> Result<Plan, Error> {
    Tracer::new(emission)?.plan(progress)
}

/// Sends all photons of a plan.
pub fn run(
    emission: &Emission,
    plan: &Plan,
    sink: &mut dyn PhotonSink,
    progress: &dyn Progress,
) -> Result<Tally, Error> {
    let units: Vec<u64> = (0..plan.units()).collect();
    let mut sink = Summing { sink, tally: Tally::default() };
    Tracer::new(emission)?.run_units(plan, &units, &mut sink, progress)?;
    Ok(sink.tally)
}

/// Adds up the tallies of the units.
struct Summing<'a> {
    sink: &'a mut dyn PhotonSink,
    tally: Tally,
}

impl PhotonSink for Summing<'_> {
    fn accept(&mut self, photons: &[Photon]) -> Result<(), SinkError> {
        self.sink.accept(photons)
    }
}

impl UnitSink for Summing<'_> {
    fn complete(&mut self, _unit: u64, tally: &Tally) -> Result<(), SinkError> {
        self.tally.add(tally);
        Ok(())
    }
}
