//! Analysed as rendered: the year in batches of whole segments, no series on disk.

use std::ops::Range;
use std::time::Instant;

use serde_json::json;

use super::band::{Band, Counter, each_slice};
use super::glare::keep;
use crate::base::{Grid, limits};
use crate::glare::{self, Analysis, Calendar, Plan, Session, TileBatch};
use crate::pages::Store;
use crate::render::{Fused, Gather, HitMap, Series, Surfaces};
use crate::run::Error;
use crate::run::job::Job;
use crate::run::resolve::{Candidate, PlannedView};

/// Bytes of a batch for each number in it: in the batch, and while its tiles are put in order.
const ENTRY_BYTES: u64 = 16;

/// What a fused view gives.
pub(super) struct Made {
    pub series: Series,
    pub peak: Grid<f32>,
    pub analyses: Vec<(f64, Analysis, Band)>,
    pub batches: usize,
}

/// Renders a view batch by batch and analyses it at `thresholds`. The same integers as an
/// analysis of the written series gives, because filter and events never cross a segment.
pub(super) fn analyse(
    job: &Job<'_>,
    (store, surfaces, hits): (&Store, Option<&Surfaces<'_>>, &HitMap),
    gather: &Gather,
    thresholds: &[f64],
) -> Result<Made, Error> {
    let (progress, timeline) = (job.progress, job.timeline()?);
    let fused = Fused::prepare(store, surfaces, hits, gather, job.resolved.quantity, progress)?;
    let shape = [timeline.steps.len(), hits.rows, hits.columns];
    let memory = job.resolved.glare.memory_bytes / 4;
    let settings = glare::Settings {
        memory_bytes: memory * 2 / thresholds.len().max(1) as u64,
        ..job.resolved.glare.clone()
    };
    let mut sessions = Vec::new();
    for &threshold in thresholds {
        let settings = glare::Settings { threshold, ..settings.clone() };
        let calendar = Calendar {
            day: timeline.steps.iter().map(|s| s.day).collect(),
            weight_h: timeline.steps.iter().map(|s| s.weight_h).collect(),
        };
        let plan = Plan::new(shape, 1, true, false, &settings)?;
        let session = Session::begin(shape, Some(calendar), &settings, &plan)?;
        sessions.push((session, Counter::new(threshold, &fused.series.photon_w_m2)));
    }
    let segments = timeline.segments();
    let batches = batches(&segments, &fused.photons, memory / ENTRY_BYTES);
    let mut peak = Grid::filled(hits.columns, hits.rows, 0.0f32);
    for batch in &batches {
        let range = segments[batch.start].start..segments[batch.end - 1].end;
        let tiles = TileBatch::new(shape, range.clone());
        progress.begin("batch of the year", range.len() as u64, "timesteps");
        fused.batch(range.start as u32..range.end as u32, &tiles, progress)?;
        each_slice(&tiles, range, progress, |timestep, slice| {
            for (peak, &value) in peak.data_mut().iter_mut().zip(slice) {
                *peak = peak.max(value);
            }
            for (_, counter) in &mut sessions {
                counter.push(slice, timeline.steps[timestep].weight_h);
            }
        })?;
        for (session, _) in &mut sessions {
            session.push(&tiles, &segments[batch.clone()], None, progress)?;
        }
        progress.finish();
    }
    let mut analyses = Vec::new();
    for (&threshold, (session, counter)) in thresholds.iter().zip(sessions) {
        analyses.push((threshold, session.finish()?, counter.finish()));
    }
    Ok(Made { series: fused.series, peak, analyses, batches: batches.len() })
}

/// Cuts the year into runs of segments whose photons, and so whose numbers, are at most `most`;
/// one segment is never cut.
fn batches(segments: &[Range<usize>], photons: &[u64], most: u64) -> Vec<Range<usize>> {
    // A batch counts its timesteps in 22 bits.
    let longest = (1usize << 32) / (limits::TILE_EDGE * limits::TILE_EDGE);
    let mut out: Vec<Range<usize>> = Vec::new();
    let (mut sum, mut first) = (0u64, 0);
    for (i, segment) in segments.iter().enumerate() {
        let here: u64 = photons[segment.clone()].iter().sum();
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
pub(super) fn record(
    job: &mut Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    analyses: &[(f64, Analysis, Band)],
    began: Instant,
) -> Result<(), Error> {
    let render_key = job.resolved.render_key(candidate, view)?;
    for (threshold, analysis, band) in analyses {
        let key = job.resolved.glare_key(&render_key, *threshold)?;
        let unit = format!("glare {} {} {threshold}", candidate.name, view.name);
        let axis = crate::volume::TimeAxis::from(job.timeline()?);
        let outputs =
            keep(job, candidate, view, (*threshold, &key), (analysis, Some(&axis), band))?;
        let facts = json!({ "events": analysis.events.len(), "fused": true });
        job.done(&unit, &key, &outputs, began, facts)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::batches;

    #[test]
    fn batches_hold_whole_segments_and_no_more_than_fits() {
        let segments = [0..2, 2..5, 5..6, 6..9];
        let photons = [1, 1, 5, 5, 5, 1, 1, 1, 1];
        assert_eq!(batches(&segments, &photons, 100), std::slice::from_ref(&(0..4)));
        assert_eq!(batches(&segments, &photons, 16), [0..1, 1..3, 3..4]);
        // A segment that is too large by itself is a batch by itself.
        assert_eq!(batches(&segments, &photons, 4), [0..1, 1..2, 2..4]);
        assert!(batches(&[], &[], 4).is_empty());
    }
}
