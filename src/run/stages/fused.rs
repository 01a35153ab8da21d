//! Analysed as rendered: the year in batches of whole segments, no series on disk.

use std::ops::Range;

use serde_json::json;

use super::events::Found;
use super::glare_files;
use crate::base::{Grid, Progress, SeriesEntry, SinkError, TileRect, TileSink, limits};
use crate::glare::{
    self, Analysis, Calendar, HourBounds, HourCounter, Plan, Regular, Session, Slices, TileBatch,
    YearRows, YearTiles, each_slice,
};
use crate::project::PlannedView;
use crate::receivers::clock::Clock;
use crate::render::{Fused, FusedDirect, HitMap, undecided};
use crate::run;
use crate::run::error::Error;
use crate::run::job::{Job, MadeToo};
use crate::run::units::{OfView, Work};
use crate::volume::{Rounded, TimeAxis, segments_from_numbers};

/// Bytes of a batch for each number in it: in the batch, and while its tiles are put in order.
const ENTRY_BYTES: u64 = 16;

/// A view whose series comes in batches of timesteps.
pub(super) trait Batches {
    /// Numbers other than 0 in all pixels, by timestep.
    fn entries(&self) -> &[u64];

    /// The irradiance that one photon stands for at each pixel, W/m2; `None` without photons.
    fn photon_w_m2(&self) -> Option<&Grid<f32>>;

    fn batch(
        &self,
        timesteps: Range<u32>,
        sink: &dyn TileSink,
        progress: &dyn Progress,
    ) -> Result<(), Error>;
}

impl Batches for Fused<'_> {
    fn entries(&self) -> &[u64] {
        &self.entries
    }

    fn photon_w_m2(&self) -> Option<&Grid<f32>> {
        Some(&self.series.photon_w_m2)
    }

    fn batch(
        &self,
        timesteps: Range<u32>,
        sink: &dyn TileSink,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        Ok(Fused::batch(self, timesteps, sink, progress)?)
    }
}

impl Batches for FusedDirect<'_> {
    fn entries(&self) -> &[u64] {
        &self.entries
    }

    fn photon_w_m2(&self) -> Option<&Grid<f32>> {
        None
    }

    fn batch(
        &self,
        timesteps: Range<u32>,
        sink: &dyn TileSink,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        Ok(FusedDirect::batch(self, timesteps, sink, progress)?)
    }
}

/// What a fused view gives.
pub(super) struct Made<'a, B> {
    pub rendered: B,
    pub peak: Grid<f32>,
    pub analyses: Vec<Analysed<'a>>,
    pub batches: usize,
}

/// What it gives at a threshold.
pub(super) struct Analysed<'a> {
    threshold: f64,
    analysis: Analysis,
    bounds: HourBounds,
    /// The maps of the year from the series as it is; none of sensors.
    year: Option<YearTiles<'a>>,
}

/// Hands each tile to several.
struct All<'a, 'b>(&'b [YearTiles<'a>]);

impl TileSink for All<'_, '_> {
    fn has(&self, _: TileRect) -> bool {
        false
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        self.0.iter().try_for_each(|sink| sink.put(tile, entries))
    }
}

/// Renders a view batch by batch and analyses it at `thresholds`. The same integers as an
/// analysis of the written series gives, because filter and events never cross a segment.
/// `prepare` goes through the whole year once; a sink gets each tile's.
pub(super) fn analyse<'a, B: Batches>(
    job: &Job<'_>,
    axis: &'a TimeAxis,
    view: &PlannedView,
    hits: &HitMap,
    thresholds: &[f64],
    prepare: impl FnOnce(Option<&dyn TileSink>) -> Result<B, Error>,
) -> Result<Made<'a, B>, Error> {
    let (progress, timeline) = (job.progress, job.timeline()?);
    let spill = job.folder.root();
    let mut years = Vec::new();
    let clock_h = Clock::new(&job.resolved.project.site, axis.year).hours(axis);
    for &threshold in thresholds.iter().filter(|_| view.picture().is_some()) {
        let size = [hits.rows, hits.columns];
        years.push(YearTiles::new(axis, Some(&clock_h), size, threshold, spill)?);
    }
    let all = All(&years);
    let whole = Rounded::new(&all, view.mantissa_bits);
    let rendered = prepare((!years.is_empty()).then_some(&whole as &dyn TileSink))?;
    let no_noise = Grid::filled(hits.columns, hits.rows, 0.0);
    let photon_w_m2 = rendered.photon_w_m2().unwrap_or(&no_noise);
    let shape = [timeline.steps.len(), hits.rows, hits.columns];
    let memory = job.resolved.glare.memory_bytes / 4;
    let settings = glare::Settings {
        memory_bytes: memory * 2 / thresholds.len().max(1) as u64,
        spill: spill.to_owned(),
        ..job.resolved.glare.clone()
    };
    let segments = timeline.segments();
    // Steps that differ in length come onto the finest regular grid.
    let dark = TileBatch::new(shape, 0..0);
    let grid = Regular::of(&dark, axis, &segments)?;
    let even = grid.as_ref().map(|grid| grid.axis(axis));
    let analysed = grid.as_ref().map_or(shape, Slices::shape);
    let mut sessions = Vec::new();
    for &threshold in thresholds {
        let settings = glare::Settings { threshold, ..settings.clone() };
        let TimeAxis { day, weight_h, .. } = even.as_ref().unwrap_or(axis).clone();
        let plan = Plan::new(analysed, 1, true, false, &settings)?;
        let calendar = Calendar { day, weight_h };
        let session = Session::begin(analysed, Some(calendar), &settings, &plan)?;
        let open_w_m2 = photon_w_m2.map(|photon| undecided(threshold, *photon));
        sessions.push((session, HourCounter::new(threshold, &open_w_m2)));
    }
    let batches = batches(&segments, rendered.entries(), memory / ENTRY_BYTES);
    let mut peak = Grid::filled(hits.columns, hits.rows, 0.0f32);
    for batch in &batches {
        let range = segments[batch.start].start..segments[batch.end - 1].end;
        let tiles = TileBatch::new(shape, range.clone());
        progress.begin("batch of the year", range.len() as u64, "timesteps");
        let rounded = Rounded::new(&tiles, view.mantissa_bits);
        rendered.batch(range.start as u32..range.end as u32, &rounded, progress)?;
        each_slice(&tiles, range, progress, |timestep, slice| {
            for (peak, &value) in peak.data_mut().iter_mut().zip(slice) {
                *peak = peak.max(value);
            }
            for (_, counter) in &mut sessions {
                counter.push(slice, timeline.steps[timestep].weight_h);
            }
        })?;
        let grid = Regular::of(&tiles, axis, &segments)?;
        let (source, pieces): (&dyn Slices, _) = match &grid {
            Some(grid) => (grid, grid.segments()),
            None => (&tiles, &segments[..]),
        };
        for (session, _) in &mut sessions {
            session.push(source, &pieces[batch.clone()], None, progress)?;
        }
        progress.finish();
    }
    let mut analyses = Vec::new();
    let mut years = years.into_iter();
    for (&threshold, (session, counter)) in thresholds.iter().zip(sessions) {
        let (analysis, bounds, year) = (session.finish()?, counter.finish(), years.next());
        analyses.push(Analysed { threshold, analysis, bounds, year });
    }
    Ok(Made { rendered, peak, analyses, batches: batches.len() })
}

/// Cuts the year into runs of segments whose numbers (`entries` of a timestep) are at most `most`;
/// one segment is never cut.
fn batches(segments: &[Range<usize>], entries: &[u64], most: u64) -> Vec<Range<usize>> {
    // A batch counts its timesteps in 22 bits.
    let longest = (1usize << 32) / (limits::TILE_EDGE * limits::TILE_EDGE);
    let mut out: Vec<Range<usize>> = Vec::new();
    let (mut sum, mut first) = (0u64, 0);
    for (i, segment) in segments.iter().enumerate() {
        let here: u64 = entries[segment.clone()].iter().sum();
        match out.last_mut() {
            Some(last) if sum + here <= most && segment.end - first <= longest => {
                last.end = i + 1;
                sum += here;
            }
            _ => {
                out.push(i..i + 1);
                (sum, first) = (here, segment.start);
            }
        }
    }
    out
}

/// Keeps the analyses, each a unit of the stage `glare`.
pub(super) fn keep_all(
    job: &Job<'_>,
    of: OfView<'_>,
    axis: &TimeAxis,
    analyses: Vec<Analysed<'_>>,
) -> Result<Vec<MadeToo>, Error> {
    let dark = TileBatch::new([axis.day.len(), 1, 1], 0..0);
    let grid = Regular::of(&dark, axis, &segments_from_numbers(&axis.segment))?;
    let even = grid.as_ref().map(|grid| grid.axis(axis));
    let counted = even.as_ref().unwrap_or(axis);
    let mut units = Vec::new();
    for Analysed { threshold, analysis, bounds, year } in analyses {
        let name = Work::Glare(of, threshold).name();
        let Some(unit) = job.plan.iter().find(|unit| unit.name == name) else { continue };
        let (axis_of, grid) = (Some(counted), grid.as_ref());
        let found = Found { analysis: &analysis, axis: axis_of, grid, bounds: &bounds };
        let attributes = glare_files::attributes(job, of, threshold, &unit.key)?;
        let mut outputs = glare_files::write(job, of, threshold, &found, &attributes)?;
        if let Some(year) = year {
            let size = [bounds.hours_h.rows(), bounds.hours_h.columns()];
            let make = |rows: YearRows<'_>| year.finish(rows);
            let year = glare_files::UnfilteredYear { axis, size, make };
            outputs.extend(glare_files::write_year(job, of, threshold, year, &attributes)?);
        }
        let facts = json!({ "events": analysis.events.len(), "fused": true });
        let (key, made) = (unit.key.clone(), run::job::Made::new(outputs, facts));
        units.push(MadeToo { name, key, made });
    }
    Ok(units)
}

#[cfg(test)]
mod tests {
    use super::batches;

    #[test]
    fn batches_hold_whole_segments_and_no_more_than_fits() {
        let segments = [0..2, 2..5, 5..6, 6..9];
        let entries = [1, 1, 5, 5, 5, 1, 1, 1, 1];
        assert_eq!(batches(&segments, &entries, 100), std::slice::from_ref(&(0..4)));
        assert_eq!(batches(&segments, &entries, 16), [0..1, 1..3, 3..4]);
        // A segment that is too large by itself is a batch by itself.
        assert_eq!(batches(&segments, &entries, 4), [0..1, 1..2, 2..4]);
        assert!(batches(&[], &[], 4).is_empty());
    }
}
