//! Timesteps that differ in length come onto the finest regular grid: the command gives what the
//! reference gives for the series written out on that grid by hand.

use std::fs;
use std::path::Path;
use std::process::Command;

use glintmap_formats::npy;

use super::program;
use super::volumes::Dice;
use crate::support;
use crate::support::series::{Dense, timeline};

/// Minutes between the timesteps of each day.
const DAYS: [&[u32]; 5] = [
    &[15, 15, 60, 30, 15, 15, 45, 15, 15],
    &[],
    &[60, 60, 60],
    &[15; 20],
    &[30, 15, 15, 120, 15, 30],
];
const SHAPE: [usize; 2] = [40, 70];
const THRESHOLD: f32 = 10.0;

struct Step {
    day: usize,
    minute: u32,
}

/// The series' timesteps, and for each instant of the grid of 15 minutes its day and the timestep
/// nearest to it, the earlier of two.
fn times() -> (Vec<Step>, Vec<(usize, usize)>) {
    let (mut steps, mut grid) = (Vec::new(), Vec::new());
    for (day, gaps) in DAYS.iter().enumerate() {
        let first = steps.len();
        steps.push(Step { day, minute: 600 });
        for gap in *gaps {
            let minute = steps.last().map_or(0, |s: &Step| s.minute) + gap;
            steps.push(Step { day, minute });
        }
        let last = steps[steps.len() - 1].minute;
        for minute in (600..=last).step_by(15) {
            let nearest = (first..steps.len()).min_by_key(|i| steps[*i].minute.abs_diff(minute));
            grid.push((day, nearest.unwrap()));
        }
    }
    (steps, grid)
}

#[test]
fn uneven_timesteps_give_what_the_reference_gives_on_the_finest_grid() {
    let Some(python) = support::python() else { return };
    let (steps, grid) = times();
    assert!(grid.len() > steps.len() + 10);
    let [rows, columns] = SHAPE;
    let dice = &mut Dice::new(55);
    let mut dense = Dense::random([steps.len(), rows, columns], 0.9, 8);
    for value in &mut dense.numbers {
        *value = if *value > 0.0 { 25.0 * dice.unit() as f32 } else { 0.0 };
    }
    let mut line = timeline(steps.len());
    for (step, at) in line.steps.iter_mut().zip(&steps) {
        (step.day, step.hour) = (at.day as u32, f64::from(at.minute) / 60.0);
        step.segment = at.day as u32;
        step.weight_h = 0.5 + dice.unit();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    dense.write_at(Path::new(&path("volume.zarr")), &line);
    let start = ["glare", "analyse"];
    let (volume, ours) = (path("volume.zarr"), path("ours"));
    let arguments = [&volume, "--threshold", "10", "--out", &ours, "--json"];
    let (stdout, stderr, code) = program(&[&start[..], &arguments[..]].concat());
    assert_eq!(code, 0, "{stderr}");
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(document["instants"], grid.len());

    let slice = rows * columns;
    let regular: Vec<f32> = grid
        .iter()
        .flat_map(|(_, i)| dense.numbers[i * slice..(i + 1) * slice].iter().copied())
        .collect();
    npy::write(&folder.path().join("regular.npy"), &[grid.len(), rows, columns], &regular).unwrap();
    let days: Vec<i32> = grid.iter().map(|(day, _)| *day as i32).collect();
    npy::write(&folder.path().join("days.npy"), &[grid.len()], &days).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_reference.py");
    let status = Command::new(python)
        .arg(script)
        .args([path("regular.npy"), path("reference")])
        .args(["--threshold", "10", "--segments", &path("days.npy")])
        .stdout(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success());
    for map in ["cumulative", "sustained", "longest_run"] {
        let read = |side: &str| {
            let file = folder.path().join(side).join(format!("{map}.npy"));
            npy::Reader::<i32>::open(&file).unwrap().read_all().unwrap()
        };
        let found = read("ours");
        assert!(found.iter().any(|n| *n > 0));
        assert!(found == read("reference"), "{map}");
    }
    let events: Vec<serde_json::Value> =
        serde_json::from_str(&fs::read_to_string(path("reference/events.json")).unwrap()).unwrap();
    assert_eq!(document["events"], events.len());

    // What is unfiltered: hours are weighed as the series says, clock time as the grid has it.
    let read = |map: &str| {
        let file = folder.path().join(format!("ours/unfiltered/{map}.npy"));
        npy::Reader::<f32>::open(&file).unwrap().read_all().unwrap()
    };
    let (above, run, day) = (read("above_h"), read("longest_run_h"), read("longest_day_h"));
    let margin = read("exceeded_30min_w_m2");
    for pixel in 0..slice {
        let lit = |i: usize| dense.numbers[i * slice + pixel] > THRESHOLD;
        let hours: f64 = (0..steps.len()).filter(|i| lit(*i)).map(|i| line.steps[i].weight_h).sum();
        assert!((f64::from(above[pixel]) - hours).abs() < 1e-5, "pixel {pixel}: {hours} h");
        let (mut longest, mut now, mut most, mut pair) = (0, 0, 0, 0.0f32);
        for number in 0..DAYS.len() {
            let instants = grid.iter().filter(|(day, _)| *day == number).map(|(_, i)| *i);
            now = 0;
            most = most.max(instants.clone().filter(|i| lit(*i)).count());
            let mut values: Vec<f32> =
                instants.clone().map(|i| dense.numbers[i * slice + pixel]).collect();
            values.sort_by(|a, b| b.total_cmp(a));
            pair = pair.max(values.get(1).copied().unwrap_or(0.0));
            for i in instants {
                now = if lit(i) { now + 1 } else { 0 };
                longest = longest.max(now);
            }
        }
        assert_eq!(run[pixel], longest as f32 * 0.25, "longest run of pixel {pixel}, {now}");
        assert_eq!(day[pixel], most as f32 * 0.25, "worst day of pixel {pixel}");
        assert_eq!(margin[pixel], pair, "half an hour of pixel {pixel}");
    }
}
