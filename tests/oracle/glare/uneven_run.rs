//! A project whose days have finer steps for some hours, from the suns to the glare maps: held
//! against SciPy on the series written out minute by minute.

use std::fs;
use std::path::Path;
use std::process::Command;

use glintmap::volume::Volume;
use glintmap_formats::npy;

use crate::support;
use crate::support::program::{project, succeed};

const DAYS: usize = 4;
/// Minutes of the day: every quarter of an hour, every third minute from 6:00 to 7:30.
fn minutes() -> Vec<u32> {
    let fine = 360..=450;
    (330..=570)
        .filter(|m| if fine.contains(m) { m % 3 == 0 } else { (m - 330) % 15 == 0 })
        .collect()
}

/// For each instant of a grid of three minutes the nearest timestep of a day, the earlier of two.
fn grid(minutes: &[u32]) -> Vec<usize> {
    let nearest = |m: u32| (0..minutes.len()).min_by_key(|i| minutes[*i].abs_diff(m)).unwrap_or(0);
    (330..=570).step_by(3).map(nearest).collect()
}

fn run(folder: &Path, more: &[&str]) {
    let text = fs::read_to_string(folder.join("project.toml")).unwrap();
    let finer = "[time]\nfiner = [{ from = 6.0, to = 7.5, step = 0.05 }]\n";
    fs::write(folder.join("project.toml"), text.replacen("[time]\n", finer, 1)).unwrap();
    let folder = folder.to_str().unwrap();
    succeed(&[&["run", folder, "--quiet"], more].concat());
}

#[test]
fn finer_steps_of_some_hours_reach_the_maps() {
    let Some(python) = support::python() else { return };
    let (_keep, folder) = project("tiny");
    run(&folder, &[]);
    let minutes = minutes();
    let volume = Volume::open(&folder.join("run/standard/plan/series.zarr")).unwrap();
    let axis = volume.axis().unwrap();
    let [timesteps, rows, columns] = volume.shape();
    assert_eq!(timesteps, DAYS * minutes.len());
    assert_eq!(volume.segments().len(), DAYS);
    assert!((axis.step_h - 0.05).abs() < 1e-9);
    // Each timestep stands for the time to half the way to its neighbours, on seven days.
    for (t, (hour, weight)) in axis.hour.iter().zip(&axis.weight_h).enumerate() {
        let i = t % minutes.len();
        assert!((hour * 60.0 - f64::from(minutes[i])).abs() < 1e-6, "timestep {t}: {hour} h");
        let before = if i > 0 { minutes[i] - minutes[i - 1] } else { 15 };
        let after = minutes.get(i + 1).map_or(15, |next| next - minutes[i]);
        let expected = f64::from(before + after) / 120.0 * 7.0;
        assert!((weight - expected).abs() < 1e-9, "timestep {t}: {weight} h, not {expected}");
    }
    let sum: f64 = axis.weight_h.iter().sum();
    assert!((sum - 28.0 * 4.25).abs() < 1e-9, "{sum} h");

    let grid = grid(&minutes);
    let shows: Vec<usize> = (0..DAYS)
        .flat_map(|day| grid.iter().map(move |i| (day, i)))
        .map(|(day, i)| day * minutes.len() + i)
        .collect();
    let slice = rows * columns;
    let mut numbers = vec![0.0f32; timesteps * slice];
    volume.read(0..timesteps, &mut numbers).unwrap();
    let regular: Vec<f32> =
        shows.iter().flat_map(|i| &numbers[i * slice..(i + 1) * slice]).copied().collect();
    let path = |name: &str| folder.join(name);
    npy::write(&path("regular.npy"), &[shows.len(), rows, columns], &regular).unwrap();
    let days: Vec<i32> = (0..shows.len()).map(|i| (i / grid.len()) as i32).collect();
    npy::write(&path("days.npy"), &[days.len()], &days).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_reference.py");
    let status = Command::new(python)
        .arg(script)
        .args([path("regular.npy"), path("reference")])
        .args(["--threshold", "10", "--segments"])
        .arg(path("days.npy"))
        .stdout(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success());
    let ours = folder.join("run/standard/plan/glare-10");
    for map in ["cumulative", "sustained", "longest_run"] {
        let read = |side: &Path| {
            npy::Reader::<i32>::open(&side.join(format!("{map}.npy"))).unwrap().read_all().unwrap()
        };
        let found = read(&ours);
        assert!(found.iter().any(|n| *n > 1), "{map}");
        assert!(found == read(&path("reference")), "{map}");
    }
    let events: Vec<serde_json::Value> =
        serde_json::from_str(&fs::read_to_string(path("reference/events.json")).unwrap()).unwrap();
    let table = fs::read_to_string(ours.join("events.csv")).unwrap();
    assert_eq!(table.lines().count(), events.len() + 1);

    // Unfiltered, at each pixel: hours as the timesteps weigh, runs in clock time.
    let read = |map: &str| {
        let file = ours.join(format!("unfiltered/{map}.npy"));
        npy::Reader::<f32>::open(&file).unwrap().read_all().unwrap()
    };
    let (above, longest) = (read("above_h"), read("longest_run_h"));
    for pixel in 0..slice {
        let lit = |t: usize| numbers[t * slice + pixel] > 10.0;
        let hours: f64 = (0..timesteps).filter(|t| lit(*t)).map(|t| axis.weight_h[t]).sum();
        assert!((f64::from(above[pixel]) - hours).abs() < 1e-4, "pixel {pixel}");
        let (mut most, mut now) = (0u32, 0);
        for (i, t) in shows.iter().enumerate() {
            now = if i % grid.len() == 0 { 0 } else { now };
            now = if lit(*t) { now + 1 } else { 0 };
            most = most.max(now);
        }
        assert!((f64::from(longest[pixel]) - f64::from(most) * 0.05).abs() < 1e-5, "pixel {pixel}");
    }
    the_same_without_a_series(&ours);
}

/// Analysed as rendered, the same maps and events.
fn the_same_without_a_series(written: &Path) {
    let (_keep, folder) = project("tiny");
    run(&folder, &["--until", "glare", "--set", "view.plan.fuse=true"]);
    let fused = folder.join("run/standard/plan/glare-10");
    for name in [
        "cumulative.npy",
        "sustained.npy",
        "longest_run.npy",
        "events.csv",
        "unfiltered/longest_day_h.npy",
    ] {
        assert!(
            fs::read(written.join(name)).unwrap() == fs::read(fused.join(name)).unwrap(),
            "{name}"
        );
    }
}
