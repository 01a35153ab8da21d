//! What a run will cost, before an hour is spent.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::Error;
use super::job::{Job, Stage};
use crate::bsdf::{Bsdf, Term};
use crate::project::{Candidate, Resolved};

/// Rates on two cores at 2.5 GHz, from which times are expected. They are rough: the share of
/// photons that land decides most, and it is known only after a pilot.
mod rate {
    pub const STORED_PER_S: f64 = 300_000.0;
    pub const SORTED_PER_S: f64 = 2_000_000.0;
    pub const ANNUAL_NEIGHBOURS_PER_S: f64 = 20e6;
    pub const SERIES_NEIGHBOURS_PER_S: f64 = 40e6;
    pub const HIT_PIXELS_PER_S: f64 = 150_000.0;
    pub const BACKGROUND_PIXELS_PER_S: f64 = 60_000.0;
    /// Of direct integration: pixels whose sight of the PV is asked, a second.
    pub const SIGHTS_PER_S: f64 = 8_000.0;
    /// Lit pixels times suns: of an even surface, and of a lobe of facets as wide as it gets; its
    /// time grows with the inverse of its width, up to a limit.
    pub const EVEN_PER_S: f64 = 10e6;
    pub const LOBE_PER_S: f64 = 2e6;
    pub const LOBE_WIDTH: f64 = 0.1;
    /// Delta lobes and the values of files.
    pub const DELTA_PER_S: f64 = 5e6;
    pub const MEASURED_PER_S: f64 = 0.5e6;
    pub const VOXELS_PER_S: f64 = 100e6;
    pub const PICTURE_PIXELS_PER_S: f64 = 2e6;
}

/// Bytes of a photon while it waits on disk to be sorted, and in the store.
mod size {
    pub const SPILLED: f64 = 15.0;
    /// In memory while it is sorted.
    pub const SORTED: f64 = 96.0;
    pub const STORED: f64 = 12.0;
    pub const STORED_BOUND: f64 = 24.0;
    /// Of a series value that isn't zero, compressed.
    pub const SERIES: f64 = 3.0;
    /// Share of a view's pixels and of the timesteps that photons reach, as in the case study.
    pub const LIT_PIXELS: f64 = 0.6;
    pub const LIT_TIMESTEPS: f64 = 0.4;
    /// Share of a view's pixels that see PV which is lit at some time.
    pub const LIT_DIRECT: f64 = 0.3;
}

/// One stage of an [`Estimate`].
#[derive(Clone, Debug, Serialize)]
pub struct StageEstimate {
    /// The stage.
    pub stage: Stage,
    /// What it works on, in words.
    pub work: String,
    /// Photons that it handles.
    pub photons: u64,
    /// Bytes that it leaves on disk, expected.
    pub disk_bytes: u64,
    /// Bytes that it leaves on disk, at most.
    pub disk_bound_bytes: u64,
    /// Anonymous memory at its peak, bytes.
    pub memory_bytes: u64,
    /// Time on two cores, s.
    pub time_s: f64,
}

/// What a whole run will cost.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    /// Timesteps with the sun above the horizon.
    pub timesteps: usize,
    /// Materials and cases.
    pub candidates: usize,
    /// Stage by stage.
    pub stages: Vec<StageEstimate>,
    /// Free bytes where the run folder lies.
    pub free_bytes: u64,
    /// Bytes expected on disk at the fullest moment.
    pub disk_bytes: u64,
    /// The time series of each view that keeps one, for all materials together.
    pub series: Vec<SeriesEstimate>,
    /// Where the run folder lies.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// What a view's time series will take.
#[derive(Clone, Debug, Serialize)]
pub struct SeriesEstimate {
    /// The view.
    pub view: String,
    /// Bytes on disk, expected.
    pub disk_bytes: u64,
}

impl Estimate {
    /// Refuses a run that is expected to fill the disk, whatever of it is there already.
    ///
    /// # Errors
    /// [`Error::Disk`].
    pub fn refuse_full_disk(&self) -> Result<(), Error> {
        let there = used_bytes(&self.folder)?;
        self.refuse(self.disk_bytes.saturating_sub(there))
    }

    fn refuse(&self, needed: u64) -> Result<(), Error> {
        if needed <= self.free_bytes {
            return Ok(());
        }
        Err(Error::Disk {
            path: self.folder.clone(),
            needed: bytes_in_words(needed),
            free: bytes_in_words(self.free_bytes),
            remedy: self.remedy(needed),
        })
    }

    /// What would make room.
    fn remedy(&self, needed: u64) -> String {
        let all: u64 = self.series.iter().map(|s| s.disk_bytes).sum();
        let largest = self.series.iter().max_by_key(|s| s.disk_bytes);
        match largest.filter(|_| all > needed / 4) {
            Some(largest) => format!(
                "the time series take {} of it, most of that view \"{}\": analyse it without \
                 writing it (`fuse = true`), keep fewer bits (`series_mantissa_bits = 8`), make \
                 the view smaller, or put the project elsewhere",
                bytes_in_words(all),
                largest.view
            ),
            None => "free some, lower photons.stored or the views' sizes, or put the project \
                     elsewhere"
                .to_owned(),
        }
    }
}

/// Estimates a run; writes nothing.
///
/// # Errors
/// When the timesteps can't be computed or the disk can't be asked.
pub fn estimate(resolved: &Resolved, memory_bytes: u64) -> Result<Estimate, Error> {
    let timeline = resolved.timeline()?;
    let steps = timeline.steps.len() as f64;
    let candidates = resolved.candidates.len() as f64;
    let stored = if resolved.needs_photons() { resolved.trace.stored as f64 } else { 0.0 };
    let pixels: f64 = resolved.with_sensors().map(|v| resolved.pixels(v) as f64).sum();
    let thresholds = resolved.glare_thresholds() as f64;
    let largest = resolved.with_sensors().map(|v| resolved.pixels(v) as f64).fold(0.0, f64::max);
    let all = stored * candidates;
    let mut neighbours = (0.0, 0.0);
    let mut series = 0.0;
    let mut direct = 0.0;
    // Photons that cross receivers in free air, if all of them stand there.
    let mut air = 0.0;
    let mut of_views = Vec::new();
    for v in resolved.with_sensors() {
        let p = resolved.pixels(v) as f64;
        // A fused view keeps no series.
        let kept = f64::from(v.series as u8);
        // A number has 24 bits of mantissa and sign; those that were dropped cost nothing.
        let number = size::SERIES * (8.0 + f64::from(v.mantissa_bits.min(16))) / 24.0;
        let Some(gather) = v.photons() else {
            direct += p;
            let bytes = kept * p * size::LIT_DIRECT * steps * size::LIT_TIMESTEPS * number;
            series += bytes;
            of_views.push((v.name.clone(), bytes));
            continue;
        };
        let k = gather.series_bandwidth(timeline.steps.len()) as f64;
        if v.points().is_some() {
            air += (p * k.max(10_000.0)).min(stored);
        }
        neighbours.0 += p * size::LIT_PIXELS * gather.annual.bandwidth as f64;
        neighbours.1 += p * size::LIT_PIXELS * k;
        let lit = p * size::LIT_PIXELS * (steps * size::LIT_TIMESTEPS).min(k);
        let bytes = kept * lit * number;
        series += bytes;
        of_views.push((v.name.clone(), bytes));
    }
    let budget = memory_bytes as f64;
    let maps = pixels * candidates * (12.0 + 24.0 * thresholds) + pixels * 40.0;
    let photons = |n: f64| format!("{} photons for each of {candidates} materials", n as u64);
    let stage = |stage, work: String, photons: f64, disk: (f64, f64), memory: f64, time_s: f64| {
        StageEstimate {
            stage,
            work,
            photons: photons as u64,
            disk_bytes: disk.0 as u64,
            disk_bound_bytes: disk.1 as u64,
            memory_bytes: memory.min(budget) as u64,
            time_s,
        }
    };
    let stages = vec![
        stage(
            Stage::Suns,
            format!("{steps} timesteps"),
            0.0,
            (steps * 110.0, steps * 130.0),
            steps * 100.0,
            steps * 2e-6,
        ),
        stage(
            Stage::Trace,
            photons(stored),
            all,
            (stored * size::SPILLED, stored * size::SPILLED * 1.02),
            200e6 + (stored * 30.0).min(budget / 16.0),
            all / rate::STORED_PER_S,
        ),
        stage(
            Stage::Pages,
            photons(stored),
            all,
            (all * size::STORED, all * size::STORED_BOUND),
            (stored * size::SORTED).min(budget * 0.75),
            all / rate::SORTED_PER_S,
        ),
        stage(
            Stage::Render,
            format!("{pixels} pixels, {} timesteps, {candidates} materials", steps),
            all,
            (
                series * candidates + maps,
                pixels * steps * 4.0 * candidates
                    + maps
                    + air * candidates * (size::SPILLED + size::STORED_BOUND),
            ),
            300e6 + largest * 120.0,
            pixels / rate::HIT_PIXELS_PER_S
                + pixels / rate::BACKGROUND_PIXELS_PER_S
                + resolved.candidates.iter().map(|c| direct * direct_s(c, steps)).sum::<f64>()
                + candidates
                    * (neighbours.0 / rate::ANNUAL_NEIGHBOURS_PER_S
                        + neighbours.1 / rate::SERIES_NEIGHBOURS_PER_S),
        ),
        stage(
            Stage::Glare,
            format!("{} voxels at {thresholds} thresholds", (pixels * steps * candidates) as u64),
            0.0,
            (pixels * candidates * thresholds * 16.0, pixels * candidates * thresholds * 40.0),
            largest * 4.0 * 40.0,
            pixels * steps * candidates * thresholds / rate::VOXELS_PER_S,
        ),
        stage(
            Stage::Pictures,
            format!(
                "{} pictures",
                (candidates * resolved.views.len() as f64 * (3.0 + 3.0 * thresholds)) as u64
            ),
            0.0,
            (pixels * candidates * 3.0, pixels * candidates * 12.0),
            largest * 80.0,
            pixels * candidates * (3.0 + 3.0 * thresholds) / rate::PICTURE_PIXELS_PER_S,
        ),
        stage(Stage::Report, "one document".into(), 0.0, (1e5, 1e6), 10e6, 0.1),
    ];
    let disk_bytes = stages.iter().map(|s| s.disk_bytes).sum();
    Ok(Estimate {
        timesteps: timeline.steps.len(),
        candidates: resolved.candidates.len(),
        stages,
        free_bytes: free_bytes(&resolved.folder)?,
        disk_bytes,
        series: of_views
            .into_iter()
            .filter(|(_, bytes)| *bytes > 0.0)
            .map(|(view, bytes)| SeriesEstimate { view, disk_bytes: (bytes * candidates) as u64 })
            .collect(),
        folder: resolved.folder.join("run"),
    })
}

/// Time for a pixel that is integrated directly, lit or not, s.
fn direct_s(candidate: &Candidate, steps: f64) -> f64 {
    let of_term = |term: Term<'_>| match term {
        Term::Even(_) => 1.0 / rate::EVEN_PER_S,
        Term::Measured(_) => 1.0 / rate::MEASURED_PER_S,
        Term::Lobe(lobe) => lobe.alpha().map_or(1.0 / rate::EVEN_PER_S, |alpha| {
            (1.0 + rate::LOBE_WIDTH / alpha.max(0.01)) / rate::LOBE_PER_S
        }),
    };
    let of = |bsdf: &Bsdf| {
        let delta = if bsdf.has_delta() { 1.0 / rate::DELTA_PER_S } else { 0.0 };
        bsdf.terms().into_iter().map(|(_, term)| of_term(term)).sum::<f64>() + delta
    };
    let slowest = candidate.bsdfs.iter().map(of).fold(0.0, f64::max);
    1.0 / rate::SIGHTS_PER_S + size::LIT_DIRECT * steps * slowest
}

/// Free bytes for us on the disk where `path`, or the nearest folder above it, lies.
fn free_bytes(path: &Path) -> Result<u64, Error> {
    let mut at = std::path::absolute(path)?;
    while !at.exists() && at.pop() {}
    let stat = rustix::fs::statvfs(&at).map_err(std::io::Error::from)?;
    Ok(stat.f_bavail.saturating_mul(stat.f_frsize))
}

/// Refuses a run that is expected to fill the disk. What is current already costs nothing more,
/// and what lies there unfinished or out of date makes room or is gone on with.
///
/// # Errors
/// [`Error::Disk`].
pub(super) fn refuse_full_disk(job: &Job<'_>) -> Result<(), Error> {
    let expected = estimate(job.resolved, job.options.memory_bytes)?;
    let mut there = used_bytes(job.folder.root())?;
    for unit in job.planned().filter(|unit| job.is_current(unit)) {
        let made = job.manifest.units.get(&unit.name);
        for output in made.iter().flat_map(|unit| unit.outputs.keys()) {
            let path = job.folder.at(Path::new(output));
            let bytes = if path.is_dir() { used_bytes(&path)? } else { path.metadata()?.len() };
            there = there.saturating_sub(bytes);
        }
    }
    let stages: Vec<(u64, usize, usize)> = expected
        .stages
        .iter()
        .map(|s| {
            let of_stage = || job.planned().filter(|unit| unit.stage == s.stage);
            let stale = of_stage().filter(|unit| !job.is_current(unit)).count();
            (s.disk_bytes, stale, of_stage().count())
        })
        .collect();
    expected.refuse(still_needed(&stages, there))
}

/// Bytes that a run still has to find. `stages`: bytes of a whole stage, its units that have to be
/// made, all its units. `there`: bytes that make room or count as done.
fn still_needed(stages: &[(u64, usize, usize)], there: u64) -> u64 {
    let share = |&(bytes, stale, all): &(u64, usize, usize)| {
        (bytes as f64 * stale as f64 / all.max(1) as f64) as u64
    };
    let sum = stages.iter().map(share).fold(0, u64::saturating_add);
    sum.saturating_sub(there)
}

/// Bytes of all files below a folder; 0 if there is none.
pub(super) fn used_bytes(path: &Path) -> Result<u64, Error> {
    if !path.is_dir() {
        return Ok(0);
    }
    let mut sum = 0;
    for entry in std::fs::read_dir(path)? {
        let entry = entry?;
        let meta = entry.metadata()?;
        sum += if meta.is_dir() { used_bytes(&entry.path())? } else { meta.len() };
    }
    Ok(sum)
}

/// `1.5 GB`
pub fn bytes_in_words(bytes: u64) -> String {
    let value = bytes as f64;
    for (unit, size) in [("TB", 1e12), ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)] {
        if value >= size {
            return format!("{:.1} {unit}", value / size);
        }
    }
    format!("{bytes} B")
}

#[cfg(test)]
mod tests {
    use super::still_needed;

    #[test]
    fn only_what_has_to_be_made_needs_room() {
        let gb = 1_000_000_000;
        // Everything is to be made.
        assert_eq!(still_needed(&[(12 * gb, 4, 4), (8 * gb, 8, 8)], 0), 20 * gb);
        // The stores are there; a quarter of the series isn't, and 1 GB of that is begun.
        assert_eq!(still_needed(&[(12 * gb, 0, 4), (8 * gb, 2, 8)], gb), gb);
        // Nothing is to be made: a full disk doesn't matter.
        assert_eq!(still_needed(&[(12 * gb, 0, 4), (8 * gb, 0, 8)], 0), 0);
        // Absurd claims don't wrap around.
        assert_eq!(still_needed(&[(u64::MAX, 1, 1), (u64::MAX, 1, 1)], 0), u64::MAX);
        assert_eq!(still_needed(&[(5, 0, 0)], 9), 0);
    }
}
