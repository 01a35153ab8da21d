//! Time that work took, for the log.

use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// Measures wall time and the process's processor time.
#[derive(Debug)]
pub struct Watch {
    wall: Instant,
    cpu_s: f64,
}

/// What a [`Watch`] reads.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Took {
    /// Wall time, s.
    wall_s: f64,
    /// Processor time over all threads, s.
    cpu_s: f64,
}

impl Watch {
    /// Begins to measure.
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu_s: cpu_s() }
    }

    /// What went by since.
    pub fn read(&self) -> Took {
        Took { wall_s: self.wall.elapsed().as_secs_f64(), cpu_s: cpu_s() - self.cpu_s }
    }
}

fn cpu_s() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}
