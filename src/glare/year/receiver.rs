use super::lengths::{Lengths, SLACK_H};
use super::maps::{BILLIONTHS, YEAR_H, month};
use crate::glare::error::Error;
use crate::volume::TimeAxis;

/// The glare of one place over the year: of a point, or of anything that is dazzled or not at each
/// timestep. No filter.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SpotGlare {
    /// Hours of the year: the sum of the weights, h.
    pub hours: f64,
    /// Days of the timeline with glare.
    pub days: u32,
    /// The longest uninterrupted run inside a segment, h.
    pub longest_run_h: f64,
    /// Its first timestep.
    pub longest_run_at: u32,
    /// The most glare of one day, h.
    pub longest_day_h: f64,
    /// That day, 0 is 1 January; the first of several.
    pub longest_day: u32,
    /// The earliest and the latest clock time with glare, h, as the axis has hours.
    pub between_h: Option<[f64; 2]>,
    /// Hours of each month, h.
    pub months_h: [f64; 12],
}

impl SpotGlare {
    /// How many months have glare.
    pub fn months(&self) -> usize {
        self.months_h.iter().filter(|h| **h > 0.0).count()
    }
}

/// An uninterrupted run of timesteps, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// First timestep.
    pub first: usize,
    /// Last timestep.
    pub last: usize,
}

/// The uninterrupted runs inside the segments of all timesteps at which `dazzles`.
pub fn runs(axis: &TimeAxis, dazzles: impl Fn(usize) -> bool) -> Vec<Run> {
    let mut out: Vec<Run> = Vec::new();
    for t in (0..axis.day.len()).filter(|t| dazzles(*t)) {
        match out.last_mut() {
            Some(run) if run.last + 1 == t && axis.segment[run.last] == axis.segment[t] => {
                run.last = t;
            }
            _ => out.push(Run { first: t, last: t }),
        }
    }
    out
}

/// The glare of a place that is dazzled at the timesteps for which `dazzles` says so. The axis may
/// have the hours of any clock, `lengths` are those in standard time.
pub fn spot(axis: &TimeAxis, lengths: &Lengths, dazzles: impl Fn(usize) -> bool) -> SpotGlare {
    let runs = runs(axis, dazzles);
    let mut out = SpotGlare::default();
    let mut longest = 0;
    for run in &runs {
        let count: u32 = (run.first..=run.last).map(|t| lengths.instants(t)).sum();
        if count > longest {
            longest = count;
            // Timesteps are bounded by MAX_TIMESTEPS.
            out.longest_run_at = run.first as u32;
        }
    }
    out.longest_run_h = f64::from(longest) * lengths.step_h();
    let (mut sum, mut months) = (0u64, [0u64; 12]);
    let (mut today, mut most, mut day) = (0u32, 0u32, None);
    for t in runs.iter().flat_map(|run| run.first..=run.last) {
        let weight = (axis.weight_h[t] * BILLIONTHS).round() as u64;
        sum += weight;
        months[usize::from(month(axis.year, axis.day[t]))] += weight;
        if day != Some(axis.day[t]) {
            (day, today) = (Some(axis.day[t]), 0);
            out.days += 1;
        }
        today += lengths.instants(t);
        if today > most {
            (most, out.longest_day) = (today, axis.day[t]);
        }
        let hour = axis.hour[t];
        let [first, last] = out.between_h.unwrap_or([hour, hour]);
        out.between_h = Some([first.min(hour), last.max(hour)]);
    }
    out.longest_day_h = f64::from(most) * lengths.step_h();
    out.hours = sum as f64 / BILLIONTHS;
    out.months_h = months.map(|m| m as f64 / BILLIONTHS);
    out
}

/// The irradiance, W/m2, that is reached or exceeded for half an hour of some day, and that for 50
/// hours of the year; 0 where there is none. `series` has a value for each timestep, W/m2.
///
/// # Errors
/// A series that doesn't fit the axis, a time step out of range.
pub fn margins(axis: &TimeAxis, lengths: &Lengths, series: &[f32]) -> Result<[f32; 2], Error> {
    if series.len() != axis.day.len() {
        return Err(Error::Calendar { found: axis.day.len(), timesteps: series.len() });
    }
    let half_hour = lengths.half_hour()?;
    let mut worst_day = 0.0f32;
    let mut start = 0;
    while start < series.len() {
        let day = axis.day[start];
        let end = (start..series.len()).find(|t| axis.day[*t] != day).unwrap_or(series.len());
        let count = |t: usize| (series[t], lengths.instants(t) as usize);
        let mut values: Vec<(f32, usize)> = (start..end).map(count).collect();
        values.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut sum = 0;
        let full = values.iter().find(|(_, instants)| {
            sum += instants;
            sum >= half_hour
        });
        worst_day = worst_day.max(full.map_or(0.0, |v| v.0));
        start = end;
    }
    let lit = (0..series.len()).filter(|t| series[*t] > 0.0);
    let mut all: Vec<(f32, f64)> = lit.map(|t| (series[t], axis.weight_h[t])).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut sum = 0.0;
    let year = all.iter().find(|(_, weight)| {
        sum += weight;
        sum >= YEAR_H - SLACK_H
    });
    Ok([worst_day, year.map_or(0.0, |v| v.0)])
}
