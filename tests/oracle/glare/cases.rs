//! Volumes with the way to analyse each, and what an analysis found in memory.

use std::ops::Range;

use glintmap::base::{Grid, Silent};
use glintmap::glare::{self, Analysis, Connectivity, Event, Plan, Settings, Slices};

use super::volumes::{Dice, Memory, adversarial, random, segments};

/// A volume and how to analyse it.
pub struct Case {
    pub name: String,
    pub volume: Memory,
    pub segments: Vec<Range<usize>>,
    pub settings: Settings,
}

pub const ALL: [Connectivity; 3] =
    [Connectivity::Faces, Connectivity::Edges, Connectivity::Corners];

/// The volume as one segment.
pub fn whole(volume: &Memory) -> Vec<Range<usize>> {
    std::iter::once(0..volume.shape()[0]).collect()
}

pub fn plan(batch: usize, block: usize) -> Plan {
    Plan { batch, block, fixed_bytes: 0, events_bytes: u64::MAX, spill_bytes: 1 << 20 }
}

/// All of an analysis in memory.
#[derive(Debug)]
pub struct Found {
    pub cumulative: Grid<i32>,
    pub sustained: Grid<i32>,
    pub longest_run: Grid<i32>,
    pub days: Option<Grid<i32>>,
    pub longest_day: Option<Grid<i32>>,
    pub cumulative_h: Option<Grid<f32>>,
    pub events: Vec<Event>,
    pub nonfinite: u64,
}

impl From<Analysis> for Found {
    fn from(analysis: Analysis) -> Self {
        Self {
            cumulative: analysis.cumulative,
            sustained: analysis.sustained,
            longest_run: analysis.longest_run,
            days: analysis.days,
            longest_day: analysis.longest_day,
            cumulative_h: analysis.cumulative_h,
            events: analysis.events.to_vec().unwrap(),
            nonfinite: analysis.nonfinite,
        }
    }
}

pub fn run(case: &Case, plan: Option<Plan>) -> (Found, Vec<f32>) {
    let mut filtered = Vec::new();
    let mut keep = |timestep: usize, slice: &[f32]| {
        assert_eq!(timestep * slice.len(), filtered.len());
        filtered.extend_from_slice(slice);
        Ok(())
    };
    let Case { name, volume, segments, settings } = case;
    let plan = plan.unwrap_or_else(|| glare::plan(volume, settings, true).unwrap());
    let analysis =
        glare::analyse_planned(volume, segments, settings, &plan, Some(&mut keep), &Silent)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
    (analysis.into(), filtered)
}

/// NaN are equal whatever their payload: the platform decides that.
pub fn same_bits(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

pub fn random_case(number: usize) -> Case {
    let dice = &mut Dice::new(number as u64);
    let shape = match number % 10 {
        0 => [1, 1 + dice.below(20), 1 + dice.below(150)],
        1 => [1 + dice.below(40), 1, 1 + dice.below(300)],
        2 => [1 + dice.below(3), 1 + dice.below(3), 1 + dice.below(3)],
        3 => [1 + dice.below(30), 1 + dice.below(100), 1],
        4 => [1 + dice.below(4), 70 + dice.below(70), 250 + dice.below(40)],
        5 => [100 + dice.below(200), 1 + dice.below(5), 1 + dice.below(5)],
        6 => [17 + dice.below(40), 60 + dice.below(90), 1 + dice.below(8)],
        _ => [1 + dice.below(25), 1 + dice.below(25), 1 + dice.below(80)],
    };
    let mut volume = random(dice, shape);
    let sigma = match number % 4 {
        0 | 1 => [1.0; 3],
        2 => dice.one_of(&[[0.0; 3], [0.7; 3], [2.3; 3]]),
        _ => [(); 3].map(|()| dice.one_of(&[0.0, 0.1, 0.7, 1.0, 2.3])),
    };
    let mean = volume.data.iter().sum::<f32>() / volume.data.len() as f32;
    let threshold = match dice.below(4) {
        0 => 10.0,
        1 => 0.0,
        _ => f64::from(mean) * (0.7 + 0.6 * dice.unit()),
    };
    let allow_nonfinite = number % 7 == 6;
    if allow_nonfinite {
        for _ in 0..1 + dice.below(4) {
            let at = dice.below(volume.data.len());
            volume.data[at] = dice.one_of(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38]);
        }
    }
    let settings = Settings {
        threshold,
        sigma,
        truncate: dice.one_of(&[4.0, 4.0, 4.0, 0.0, 0.5, 2.5, 9.0]),
        connectivity: ALL[number % 3],
        allow_nonfinite,
        ..Settings::default()
    };
    let segments = segments(dice, shape[0]);
    let name = format!("case {number}: {shape:?} {segments:?} {settings:?}");
    Case { name, volume, segments, settings }
}

pub fn shaped_cases() -> Vec<Case> {
    let mut out = Vec::new();
    for (name, volume) in adversarial() {
        for connectivity in ALL {
            for sigma in [0.0, 1.0] {
                let threshold = if sigma == 0.0 { 10.0 } else { 7.0 };
                let settings =
                    Settings { connectivity, threshold, sigma: [sigma; 3], ..Settings::default() };
                let segments = whole(&volume);
                let name = format!("{name}, {connectivity:?}, sigma {sigma}");
                out.push(Case { name, volume: volume.clone(), segments, settings });
            }
        }
    }
    // So many events that merge that numbers have to be taken back while events are alive.
    let dice = &mut Dice::new(77);
    let volume = Memory::from_fn([120, 64, 64], |_, _, _| 20.0 * dice.unit() as f32);
    let settings = Settings { threshold: 12.5, sigma: [0.0; 3], ..Settings::default() };
    out.push(Case { name: "merging noise".into(), segments: whole(&volume), volume, settings });
    out
}

/// Which parts of two analyses differ; the grids themselves would fill the screen.
fn fields(a: &Found, b: &Found) -> Vec<&'static str> {
    let same = [
        ("cumulative", a.cumulative == b.cumulative),
        ("sustained", a.sustained == b.sustained),
        ("longest run", a.longest_run == b.longest_run),
        ("days", a.days == b.days),
        ("longest day", a.longest_day == b.longest_day),
        ("cumulative hours", a.cumulative_h == b.cumulative_h),
        ("events", a.events == b.events),
        ("nonfinite", a.nonfinite == b.nonfinite),
    ];
    same.iter().filter(|(_, same)| !same).map(|(name, _)| *name).collect()
}

pub fn assert_same(found: &(Found, Vec<f32>), expected: &(Found, Vec<f32>), what: &str) {
    let differing = fields(&found.0, &expected.0);
    assert!(differing.is_empty(), "{differing:?} of {what}");
    let unequal = found.1.iter().zip(&expected.1).filter(|(a, b)| !same_bits(**a, **b)).count();
    assert_eq!(unequal, 0, "filtered volume of {what}");
}
