//! What a run will cost, before an hour is spent.
//!
//! Each stage has a function that turns what it works on ([`Load`]) into bytes, memory and time, by
//! the rates and sizes below. They come from the case study on two cores at 2.5 GHz (`glintmap demo`
//! at draft and standard quality; the log of a run, `run/log/run.jsonl`, has photons, pixels, lit
//! timesteps and seconds of each unit, and `du -sb` the bytes) and from the benchmarks that they
//! name. They are round numbers, right within a factor of two or three: the share of photons that
//! land decides most, and that is known only after a pilot. Bounds are counted, not measured.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::disk::{bytes_in_words, free_bytes, used_bytes};
use super::error::Error;
use super::job::Job;
use super::stage::Stage;
use crate::bsdf::{Bsdf, Term};
use crate::project::{Candidate, PlannedView, Resolved, SeriesKept};

/// What two cores do in a second.
mod rate {
    /// Timesteps computed (the draft's 1,280 take some ms).
    pub const SUNS_PER_S: f64 = 500_000.0;
    /// Photons traced until they are stored (unit `trace`; 80,000 to 200,000 with the pilot of a
    /// draft, more with many photons).
    pub const STORED_PER_S: f64 = 300_000.0;
    /// Photons sorted into pages (unit `pages`: 3 to 5 million of a draft, less from the disk).
    pub const SORTED_PER_S: f64 = 2_000_000.0;
    /// Photons gathered for annual maps and for series (`tools/bench/gather.py`: look-ups times k).
    pub const ANNUAL_NEIGHBOURS_PER_S: f64 = 20e6;
    pub const SERIES_NEIGHBOURS_PER_S: f64 = 40e6;
    /// Pixels of hits and of the background (units `hits` and `direct`).
    pub const HIT_PIXELS_PER_S: f64 = 150_000.0;
    pub const BACKGROUND_PIXELS_PER_S: f64 = 60_000.0;
    /// Of direct integration: pixels whose sight of the PV is asked (`tools/bench/direct.py`).
    pub const SIGHTS_PER_S: f64 = 8_000.0;
    /// Lit pixels times suns: of an even surface, and of a lobe of microfacets as wide as it gets;
    /// its time grows with the inverse of its width, up to a limit (the same).
    pub const EVEN_PER_S: f64 = 10e6;
    pub const LOBE_PER_S: f64 = 2e6;
    pub const LOBE_WIDTH: f64 = 0.1;
    pub const NARROWEST_LOBE: f64 = 0.01;
    /// Delta lobes and the values of files (the same).
    pub const DELTA_PER_S: f64 = 5e6;
    pub const MEASURED_PER_S: f64 = 0.5e6;
    /// Voxels filtered, labelled and counted (units `glare`: 40 to 180 million of a draft).
    pub const VOXELS_PER_S: f64 = 100e6;
    /// Pixels drawn (unit `pictures`).
    pub const PICTURE_PIXELS_PER_S: f64 = 2e6;
    /// The document (unit `report`), s.
    pub const REPORT_S: f64 = 0.1;
}

/// Bytes on disk, expected and at most.
mod size {
    /// A line of `suns.csv` (86 in the case study), and with the longest numbers.
    pub const SUN: f64 = 110.0;
    pub const SUN_BOUND: f64 = 130.0;
    /// A photon while it waits to be sorted, and by how much the stored number may exceed its target
    /// (`photons.stored` is met within 2 %).
    pub const SPILLED: f64 = 15.0;
    pub const STORED_SPREAD: f64 = 1.02;
    /// A photon in the store (9 in the case study; the bound is Radiance's record, uncompressed).
    pub const STORED: f64 = 12.0;
    pub const STORED_BOUND: f64 = 24.0;
    /// Of a series value that isn't zero, compressed; of what it takes, a third doesn't depend on
    /// the bits of mantissa that are kept, 16 of which count.
    pub const SERIES: f64 = 3.0;
    pub const MANTISSA_BITS: u32 = 16;
    pub const OTHER_BITS: f64 = 8.0;
    /// Of a series value at most: a 32-bit float.
    pub const SERIES_BOUND: f64 = 4.0;
    /// Of a pixel: hits and background; the year's maps of a material, and those of a threshold.
    pub const SEEN_PIXEL: f64 = 40.0;
    pub const ANNUAL_PIXEL: f64 = 12.0;
    pub const YEAR_PIXEL: f64 = 24.0;
    /// Of a pixel: what an analysis leaves at a threshold.
    pub const GLARE_PIXEL: f64 = 16.0;
    pub const GLARE_PIXEL_BOUND: f64 = 40.0;
    /// Of a pixel: all pictures of a material.
    pub const PICTURE_PIXEL: f64 = 3.0;
    pub const PICTURE_PIXEL_BOUND: f64 = 12.0;
    /// The document (80 kB in the case study).
    pub const REPORT: f64 = 1e5;
    pub const REPORT_BOUND: f64 = 1e6;
}

/// Anonymous memory, bytes.
mod memory {
    /// Of a timestep.
    pub const SUN: f64 = 100.0;
    /// Scene, ray tracer and emission; buffers of the spill for each stored photon, up to this
    /// part of the budget.
    pub const TRACE: f64 = 200e6;
    pub const SPILL_PHOTON: f64 = 30.0;
    pub const SPILL_PART: f64 = 1.0 / 16.0;
    /// Of a photon while it is sorted, up to this part of the budget (`pages::build`).
    pub const SORTED_PHOTON: f64 = 96.0;
    pub const SORTED_PART: f64 = 0.75;
    /// Scene and page cache, and of a pixel of the largest view: maps and tiles.
    pub const RENDER: f64 = 300e6;
    pub const RENDER_PIXEL: f64 = 120.0;
    /// Of a pixel: slices in the filter's window, 32-bit floats.
    pub const GLARE_PIXEL: f64 = 4.0 * 40.0;
    /// Of a pixel that is drawn.
    pub const PICTURE_PIXEL: f64 = 80.0;
    pub const REPORT: f64 = 10e6;
}

/// Shares of what could be lit, as in the case study (`lit_pixels` and `lit_timesteps` in its log).
mod lit {
    /// Of a view's pixels, that photons reach.
    pub const PIXELS: f64 = 0.6;
    /// Of the timesteps, at such a pixel.
    pub const TIMESTEPS: f64 = 0.4;
    /// Of a view's pixels, that see PV which is lit at some time.
    pub const DIRECT: f64 = 0.3;
}

/// Pictures of a view and material, and those that each threshold adds.
const PICTURES: f64 = 3.0;
const PICTURES_OF_THRESHOLD: f64 = 3.0;
/// Crossings of a disc in free air that are aimed at, at least.
const CROSSINGS: f64 = 10_000.0;

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

/// What the stages work on.
struct Load {
    steps: f64,
    candidates: f64,
    thresholds: f64,
    /// Photons of one material.
    stored: f64,
    /// Of all views and sets of points, and of the largest.
    pixels: f64,
    largest: f64,
    pictures: f64,
    views: Vec<ViewLoad>,
    /// Of memory, bytes.
    budget: f64,
}

/// Of a view, for one material.
#[derive(Default)]
struct ViewLoad {
    name: String,
    /// Photons gathered for the annual map and for the series.
    annual_neighbours: f64,
    series_neighbours: f64,
    /// Photons that cross receivers in free air, if all of them stand there.
    crossings: f64,
    /// Pixels that are integrated.
    direct_pixels: f64,
    /// Of its series on disk.
    series_bytes: f64,
}

impl ViewLoad {
    fn of(view: &PlannedView, pixels: f64, steps: usize, stored: f64) -> Self {
        let kept = match view.series {
            SeriesKept::None => 0.0,
            SeriesKept::One => 1.0,
            SeriesKept::Both => 2.0,
        };
        let bits = f64::from(view.mantissa_bits.min(size::MANTISSA_BITS));
        let all_bits = size::OTHER_BITS + f64::from(size::MANTISSA_BITS);
        let number = kept * size::SERIES * (size::OTHER_BITS + bits) / all_bits;
        let lit_steps = steps as f64 * lit::TIMESTEPS;
        let load = Self { name: view.name.clone(), ..Self::default() };
        let Some(gather) = view.photons() else {
            let series_bytes = number * pixels * lit::DIRECT * lit_steps;
            return Self { direct_pixels: pixels, series_bytes, ..load };
        };
        let k = gather.series_bandwidth(steps) as f64;
        let lit_pixels = pixels * lit::PIXELS;
        let in_air = view.points().map(|_| (pixels * k.max(CROSSINGS)).min(stored));
        Self {
            annual_neighbours: lit_pixels * gather.annual.bandwidth as f64,
            series_neighbours: lit_pixels * k,
            crossings: in_air.unwrap_or_default(),
            // A pixel has no more lit timesteps than photons.
            series_bytes: number * lit_pixels * lit_steps.min(k),
            ..load
        }
    }
}

impl Load {
    fn of(resolved: &Resolved, steps: usize, memory_bytes: u64) -> Self {
        let stored = if resolved.needs_photons() { resolved.trace.stored as f64 } else { 0.0 };
        let pixels: Vec<f64> = resolved.with_sensors().map(|v| resolved.pixels(v) as f64).collect();
        let views = resolved.with_sensors().zip(&pixels);
        Self {
            steps: steps as f64,
            candidates: resolved.candidates.len() as f64,
            thresholds: resolved.glare_thresholds() as f64,
            stored,
            views: views.map(|(v, &p)| ViewLoad::of(v, p, steps, stored)).collect(),
            pixels: pixels.iter().sum(),
            largest: pixels.iter().copied().fold(0.0, f64::max),
            pictures: resolved.views.len() as f64,
            budget: memory_bytes as f64,
        }
    }

    fn sum(&self, of: impl Fn(&ViewLoad) -> f64) -> f64 {
        self.views.iter().map(of).sum()
    }

    fn stage(&self, stage: Stage, work: String, cost: &Cost) -> StageEstimate {
        StageEstimate {
            stage,
            work,
            photons: cost.photons as u64,
            disk_bytes: cost.disk as u64,
            disk_bound_bytes: cost.disk_bound as u64,
            memory_bytes: cost.memory.min(self.budget) as u64,
            time_s: cost.time_s,
        }
    }

    fn photons(&self) -> String {
        let Self { stored, candidates, .. } = self;
        format!("{} photons for each of {candidates} materials", *stored as u64)
    }

    fn suns(&self) -> StageEstimate {
        let cost = Cost {
            disk: self.steps * size::SUN,
            disk_bound: self.steps * size::SUN_BOUND,
            memory: self.steps * memory::SUN,
            time_s: self.steps / rate::SUNS_PER_S,
            ..Cost::default()
        };
        self.stage(Stage::Suns, format!("{} timesteps", self.steps), &cost)
    }

    /// One material's photons wait at a time.
    fn trace(&self) -> StageEstimate {
        let all = self.stored * self.candidates;
        let spill = (self.stored * memory::SPILL_PHOTON).min(self.budget * memory::SPILL_PART);
        let cost = Cost {
            photons: all,
            disk: self.stored * size::SPILLED,
            disk_bound: self.stored * size::SPILLED * size::STORED_SPREAD,
            memory: memory::TRACE + spill,
            time_s: all / rate::STORED_PER_S,
        };
        self.stage(Stage::Trace, self.photons(), &cost)
    }

    fn pages(&self) -> StageEstimate {
        let all = self.stored * self.candidates;
        let sorted = self.stored * memory::SORTED_PHOTON;
        let cost = Cost {
            photons: all,
            disk: all * size::STORED,
            disk_bound: all * size::STORED_BOUND,
            memory: sorted.min(self.budget * memory::SORTED_PART),
            time_s: all / rate::SORTED_PER_S,
        };
        self.stage(Stage::Pages, self.photons(), &cost)
    }

    fn render(&self, materials: &[Candidate]) -> StageEstimate {
        let Self { steps, candidates, pixels, .. } = *self;
        let of_material = size::ANNUAL_PIXEL + size::YEAR_PIXEL * self.thresholds;
        let maps = pixels * candidates * of_material + pixels * size::SEEN_PIXEL;
        let air = self.sum(|v| v.crossings) * (size::SPILLED + size::STORED_BOUND);
        let series = pixels * steps * size::SERIES_BOUND;
        let seen_s = pixels / rate::HIT_PIXELS_PER_S + pixels / rate::BACKGROUND_PIXELS_PER_S;
        let gathered_s = self.sum(|v| v.annual_neighbours) / rate::ANNUAL_NEIGHBOURS_PER_S
            + self.sum(|v| v.series_neighbours) / rate::SERIES_NEIGHBOURS_PER_S;
        let direct_pixels = self.sum(|v| v.direct_pixels);
        let direct_s: f64 = materials.iter().map(|c| direct_pixels * direct_s(c, steps)).sum();
        let cost = Cost {
            photons: self.stored * candidates,
            disk: self.sum(|v| v.series_bytes) * candidates + maps,
            disk_bound: (series + air) * candidates + maps,
            memory: memory::RENDER + self.largest * memory::RENDER_PIXEL,
            time_s: seen_s + direct_s + candidates * gathered_s,
        };
        let work = format!("{pixels} pixels, {steps} timesteps, {candidates} materials");
        self.stage(Stage::Render, work, &cost)
    }

    fn glare(&self) -> StageEstimate {
        let maps = self.pixels * self.candidates * self.thresholds;
        let voxels = self.pixels * self.steps * self.candidates;
        let cost = Cost {
            disk: maps * size::GLARE_PIXEL,
            disk_bound: maps * size::GLARE_PIXEL_BOUND,
            memory: self.largest * memory::GLARE_PIXEL,
            time_s: voxels * self.thresholds / rate::VOXELS_PER_S,
            ..Cost::default()
        };
        let work = format!("{} voxels at {} thresholds", voxels as u64, self.thresholds);
        self.stage(Stage::Glare, work, &cost)
    }

    fn pictures(&self) -> StageEstimate {
        let pixels = self.pixels * self.candidates;
        let of_view = PICTURES + PICTURES_OF_THRESHOLD * self.thresholds;
        let cost = Cost {
            disk: pixels * size::PICTURE_PIXEL,
            disk_bound: pixels * size::PICTURE_PIXEL_BOUND,
            memory: self.largest * memory::PICTURE_PIXEL,
            time_s: pixels * of_view / rate::PICTURE_PIXELS_PER_S,
            ..Cost::default()
        };
        let count = (self.candidates * self.pictures * of_view) as u64;
        self.stage(Stage::Pictures, format!("{count} pictures"), &cost)
    }

    fn report(&self) -> StageEstimate {
        let cost = Cost {
            disk: size::REPORT,
            disk_bound: size::REPORT_BOUND,
            memory: memory::REPORT,
            time_s: rate::REPORT_S,
            ..Cost::default()
        };
        self.stage(Stage::Report, "one document".into(), &cost)
    }
}

/// What a stage costs: bytes and seconds.
#[derive(Default)]
struct Cost {
    photons: f64,
    disk: f64,
    disk_bound: f64,
    memory: f64,
    time_s: f64,
}

/// Estimates a run; writes nothing.
///
/// # Errors
/// When the timesteps can't be computed or the disk can't be asked.
pub fn estimate(resolved: &Resolved, memory_bytes: u64) -> Result<Estimate, Error> {
    let timesteps = resolved.timeline()?.steps.len();
    let load = Load::of(resolved, timesteps, memory_bytes);
    let stages = vec![
        load.suns(),
        load.trace(),
        load.pages(),
        load.render(&resolved.candidates),
        load.glare(),
        load.pictures(),
        load.report(),
    ];
    let series = load.views.iter().filter(|v| v.series_bytes > 0.0).map(|v| SeriesEstimate {
        view: v.name.clone(),
        disk_bytes: (v.series_bytes * load.candidates) as u64,
    });
    Ok(Estimate {
        timesteps,
        candidates: resolved.candidates.len(),
        disk_bytes: stages.iter().map(|s| s.disk_bytes).sum(),
        stages,
        free_bytes: free_bytes(&resolved.folder)?,
        series: series.collect(),
        folder: resolved.run_folder(),
    })
}

/// Time for a pixel that is integrated directly, lit or not, s.
fn direct_s(candidate: &Candidate, steps: f64) -> f64 {
    let of_term = |term: Term<'_>| match term {
        Term::Even(_) => 1.0 / rate::EVEN_PER_S,
        Term::Measured(_) => 1.0 / rate::MEASURED_PER_S,
        Term::Lobe(lobe) => lobe.alpha().map_or(1.0 / rate::EVEN_PER_S, |alpha| {
            (1.0 + rate::LOBE_WIDTH / alpha.max(rate::NARROWEST_LOBE)) / rate::LOBE_PER_S
        }),
    };
    let of = |bsdf: &Bsdf| {
        let delta = if bsdf.has_delta() { 1.0 / rate::DELTA_PER_S } else { 0.0 };
        bsdf.terms().into_iter().map(|(_, term)| of_term(term)).sum::<f64>() + delta
    };
    let slowest = candidate.bsdfs.iter().map(of).fold(0.0, f64::max);
    1.0 / rate::SIGHTS_PER_S + lit::DIRECT * steps * slowest
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
