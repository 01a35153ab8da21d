//! What the rules say of a view: its largest durations held against each limit, and how much of
//! the view lies above it.

use super::document::Table;
use super::error::Error;
use super::maps::read_map;
use super::sentences::limit_words;
use crate::base::Grid;
use crate::glare::{HourBounds, YearMap};
use crate::project::{Candidate, GlareMap, Map, PlannedView, Results};
use crate::receivers::metrics::conditions;
use crate::rules::{Judged, Limit, Measured, Metrics, Outcome, Profile, Quantity};

/// One duration map in the unit that limits use.
#[derive(Clone)]
struct Duration {
    quantity: Quantity,
    /// None for rules that name no irradiance.
    threshold_w_m2: Option<f64>,
    filtered: bool,
    map: Grid<f32>,
    /// Of hours of the year what noise leaves open.
    band: Option<HourBounds>,
}

/// A row for each material, rule and limit.
pub fn table(results: &Results<'_>, view: &PlannedView) -> Result<Option<Table>, Error> {
    let mut table = Table {
        head: [
            "material",
            "rule",
            "limit",
            "largest here",
            "allowed",
            "verdict",
            "share of the view",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: Vec::new(),
    };
    let profiles = &results.resolved.rules;
    if profiles.is_empty() {
        return Ok(None);
    }
    let hits = results.folder.read_hits(&view.name)?;
    let lowest_w_m2 = results.thresholds_w_m2().iter().copied().fold(f64::INFINITY, f64::min);
    let receivers = hits.hits.iter().filter(|h| h.kind.receives()).count();
    for candidate in &results.resolved.candidates {
        let durations = durations(results, candidate, view)?;
        let metrics = Metrics {
            class: None,
            measured: durations
                .iter()
                .map(|d| {
                    let value = f64::from(d.map.largest());
                    let largest = |map: &Grid<f32>| f64::from(map.largest());
                    let band = d.band.as_ref().map(|band| {
                        // The filter makes noise smaller: the band holds the filtered value, too.
                        [largest(&band.low_h).min(value), largest(&band.high_h).max(value)]
                    });
                    Measured {
                        quantity: d.quantity,
                        threshold_w_m2: d.threshold_w_m2,
                        filtered: d.filtered,
                        value,
                        band,
                    }
                })
                .collect(),
            conditions: conditions(results),
        };
        for profile in profiles {
            rows(candidate, profile, (&metrics, lowest_w_m2), &durations, receivers, &mut table);
        }
    }
    Ok(Some(table))
}

fn durations(
    results: &Results<'_>,
    candidate: &Candidate,
    view: &PlannedView,
) -> Result<Vec<Duration>, Error> {
    let g = &results.resolved.project.glare;
    let filter = g.sigma.iter().any(|s| *s > 0.0);
    let lowest = g.thresholds_w_m2.iter().copied().fold(f64::INFINITY, f64::min);
    let mut out = Vec::new();
    for &threshold in &g.thresholds_w_m2 {
        let read = |map| read_map(results, candidate, view, Map::Glare(threshold, map));
        let bounds = HourBounds {
            low_h: read(GlareMap::AtLeast)?,
            hours_h: read(GlareMap::Hours)?,
            high_h: read(GlareMap::AtMost)?,
        };
        let unfiltered = GlareMap::Unfiltered;
        for (map, filtered, quantity, factor) in [
            (GlareMap::Cumulative, filter, Quantity::AnnualH, 1.0),
            (GlareMap::Sustained, filter, Quantity::SustainedMin, 60.0),
            (GlareMap::LongestRun, filter, Quantity::LongestRunMin, 60.0),
            (unfiltered(YearMap::Above), false, Quantity::AnnualH, 1.0),
            (unfiltered(YearMap::LongestRun), false, Quantity::LongestRunMin, 60.0),
            (unfiltered(YearMap::LongestDay), false, Quantity::DailyTotalMin, 60.0),
        ] {
            let map = read(map)?.map(|h| h * factor);
            let band = (quantity == Quantity::AnnualH).then(|| bounds.clone());
            let threshold_w_m2 = Some(threshold);
            let duration = Duration { quantity, threshold_w_m2, filtered, map, band };
            if threshold == lowest {
                out.push(Duration { threshold_w_m2: None, ..duration.clone() });
            }
            out.push(duration);
        }
    }
    Ok(out)
}

fn rows(
    candidate: &Candidate,
    profile: &Profile,
    (metrics, lowest_w_m2): (&Metrics, f64),
    durations: &[Duration],
    receivers: usize,
    table: &mut Table,
) {
    let verdict = profile.judge(metrics);
    if profile.limits.is_empty() {
        let mut row = vec![candidate.name.clone(), profile.id.clone()];
        row.extend(["none", "–", "–", "no numerical limit", "–"].map(str::to_owned));
        table.rows.push(row);
    }
    let decides = |(limit, _): &(&Limit, _)| !limit.only_informs;
    for (limit, judged) in profile.limits.iter().zip(&verdict.limits).filter(decides) {
        let share = share_above(limit, durations, receivers).filter(|_| judged.value.is_some());
        let unit = limit.quantity.unit();
        let value = judged.value.map(|value| match judged.band.filter(|[low, high]| low < high) {
            Some([low, high]) => format!("{value:.1} {unit} ({low:.1} to {high:.1})"),
            None => format!("{value:.1} {unit}"),
        });
        table.rows.push(vec![
            candidate.name.clone(),
            profile.id.clone(),
            limit_words(limit, Some(lowest_w_m2).filter(|_| limit.quantity.is_time())),
            value.unwrap_or_else(|| "–".into()),
            format!("{} {unit}", limit.value),
            words(judged).to_owned(),
            share.unwrap_or_else(|| "–".into()),
        ]);
    }
}

/// Share of the pixels that can receive light where the limit is exceeded, and of those where
/// noise decides.
fn share_above(limit: &Limit, durations: &[Duration], receivers: usize) -> Option<String> {
    let fits = |d: &&Duration| {
        d.quantity == limit.quantity
            && d.threshold_w_m2 == limit.threshold_w_m2
            && d.filtered == limit.filtered
    };
    let found = durations.iter().find(fits)?;
    let percent = |count: usize| format!("{:.2} %", 100.0 * count as f64 / receivers.max(1) as f64);
    let above = found.map.data().iter().filter(|v| f64::from(**v) > limit.value).count();
    let Some(band) = &found.band else { return Some(percent(above)) };
    let columns = found.map.columns();
    let open = (0..found.map.data().len())
        .filter(|i| band.exceeds((i % columns, i / columns), limit.value as f32).is_none())
        .count();
    Some(format!("{}, not certain on {}", percent(above), percent(open)))
}

fn words(judged: &Judged) -> &'static str {
    let decides = matches!(judged.outcome, Outcome::Exceeded | Outcome::Kept);
    if decides && !judged.certain {
        return "not certain: the limit lies within the noise";
    }
    match judged.outcome {
        Outcome::Exceeded => "exceeded somewhere",
        Outcome::Kept => "kept everywhere",
        Outcome::Excused => "excused by another limit",
        Outcome::NotEvaluated => "not evaluated",
        Outcome::NotApplicable => "not applicable",
    }
}
