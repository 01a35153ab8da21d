//! The maps of the year against sorted lists of each pixel.

use std::collections::BTreeMap;

use glintmap::base::Silent;
use glintmap::glare::{self, YearMap};
use glintmap::volume::{TimeAxis, Volume};

use crate::support::series::{Dense, timeline};

/// The slow way: all timesteps of a pixel in memory.
fn expected(
    series: &[f32],
    (axis, clock_h): (&TimeAxis, &[f64]),
    threshold: f32,
    map: YearMap,
) -> f32 {
    let above = |t: &usize| series[*t] > threshold;
    let all = || (0..series.len()).filter(above);
    let weight = |t: usize| axis.weight_h[t];
    let mut days: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
    for (t, value) in series.iter().enumerate() {
        days.entry(axis.day[t]).or_default().push(*value);
    }
    let per_day = days.values().map(|day| day.iter().filter(|v| **v > threshold).count());
    let sorted = |values: &mut Vec<(f32, f64)>| values.sort_by(|a, b| b.0.total_cmp(&a.0));
    let reached = |values: &[(f32, f64)], hours: f64| {
        let mut sum = 0.0;
        let found = values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= hours - 1e-5
        });
        found.map_or(0.0, |(value, _)| *value)
    };
    let runs = || {
        let (mut best, mut run) = (0, 0);
        for t in 0..series.len() {
            let new = t == 0 || axis.segment[t] != axis.segment[t - 1];
            run = if !above(&t) { 0 } else { 1 + if new { 0 } else { run } };
            best = best.max(run);
        }
        best
    };
    match map {
        YearMap::Above => all().map(weight).sum::<f64>() as f32,
        YearMap::Days => per_day.filter(|n| *n > 0).count() as f32,
        YearMap::LongestRun => (f64::from(runs()) * axis.step_h) as f32,
        YearMap::LongestDay => (per_day.max().unwrap() as f64 * axis.step_h) as f32,
        YearMap::FirstHour => all().map(|t| clock_h[t]).reduce(f64::min).unwrap_or(0.0) as f32,
        YearMap::LastHour => all().map(|t| clock_h[t]).reduce(f64::max).unwrap_or(0.0) as f32,
        YearMap::ExceededOnWorstDay => days.values().fold(0.0, |worst, day| {
            let mut values = day.iter().map(|v| (*v, axis.step_h)).collect();
            sorted(&mut values);
            worst.max(reached(&values, 0.5))
        }),
        YearMap::ExceededInYear => {
            let mut values = series.iter().zip(&axis.weight_h).map(|(v, w)| (*v, *w)).collect();
            sorted(&mut values);
            reached(&values, 50.0)
        }
        YearMap::Month(month) => {
            // The test's year, 2026 or another without a leap day before March's end.
            let first = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334, 365];
            let within = first[usize::from(month) - 1]..first[usize::from(month)];
            all().filter(|t| within.contains(&axis.day[*t])).map(weight).sum::<f64>() as f32
        }
    }
}

#[test]
fn maps_of_the_year_are_those_of_sorted_lists() {
    let folder = tempfile::tempdir().unwrap();
    for (number, (shape, lit, half_year)) in
        [([410, 40, 70], 0.5, false), ([37, 1, 1], 1.0, true), ([300, 33, 5], 0.05, false)]
            .into_iter()
            .enumerate()
    {
        let dense = Dense::random(shape, lit, 3);
        let mut timeline = timeline(shape[0]);
        timeline.half_year = half_year;
        timeline.year = 2026;
        for (i, step) in timeline.steps.iter_mut().enumerate() {
            step.weight_h = [0.25, 1.0 / 3.0, 1.75][i % 3];
        }
        let path = folder.path().join(number.to_string());
        let [_, rows, columns] = shape;
        dense.write_at(&path, &timeline);
        let volume = Volume::open(&path).unwrap();
        let axis = volume.axis().unwrap();
        let largest = dense.numbers.iter().copied().fold(0.0, f32::max);
        let threshold = largest / 3.0;
        let mut found: BTreeMap<String, Vec<f32>> = BTreeMap::new();
        let mut take = |map: YearMap, band: &[f32]| {
            found.entry(map.name()).or_default().extend_from_slice(band);
            Ok(())
        };
        // Summer time from the 30th day to the 60th; the third volume keeps standard time.
        let summer = |day: u32| if (30..60).contains(&day) { 1.0 } else { 0.0 };
        let civil = axis.day.iter().zip(&axis.hour).map(|(day, hour)| hour + summer(*day));
        let clock_h = if number == 2 { axis.hour.clone() } else { civil.collect() };
        let given = (number < 2).then_some(&clock_h[..]);
        assert!(glare::year(&volume, f64::from(threshold), given, &mut take, &Silent).unwrap());
        let maps = YearMap::all(axis);
        assert_eq!(maps.len(), if half_year { 8 } else { 20 });
        assert_eq!(found.len(), maps.len());
        let mut seen = 0;
        for map in maps {
            let found = &found[&map.name()];
            assert_eq!(found.len(), rows * columns);
            for (pixel, value) in found.iter().enumerate() {
                let (row, column) = (pixel / columns, pixel % columns);
                let series: Vec<f32> = (0..shape[0]).map(|t| dense.at(t, row, column)).collect();
                let expected = expected(&series, (axis, &clock_h), threshold, map);
                let close = (value - expected).abs() <= 1e-6 * expected.abs();
                assert!(close, "{map:?} at {row}, {column}: {value}, expected {expected}");
                seen += usize::from(*value > 0.0);
            }
        }
        assert!(seen > 0);
    }
}
