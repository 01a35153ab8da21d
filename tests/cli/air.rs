//! Receivers in free air: what photons count there against the integral over the PV, against boards
//! put at the same places, and against nobody being there.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glintmap::picture::exr;
use glintmap::volume::Volume;
use serde_json::Value;

use crate::support::program::{hashes, project, succeed};

/// What a set of sensors received.
struct Received {
    annual: Vec<f64>,
    error: Vec<f64>,
    /// For each sensor the irradiance of every timestep.
    series: Vec<Vec<f32>>,
    /// What a photon stands for; empty where there are none.
    photon: Vec<f64>,
}

fn channel(path: &Path, name: &str) -> Vec<f64> {
    let channels = exr::read(path).expect("reads");
    let (_, grid) = channels.list().iter().find(|(n, _)| n == name).expect(name);
    grid.data().iter().map(|v| f64::from(*v)).collect()
}

fn received(run: &Path, view: &str, error: &str) -> Received {
    let folder = run.join("standard").join(view);
    let volume = Volume::open(&folder.join("series.zarr")).expect("opens");
    let annual = channel(&folder.join("annual.exr"), "annual.wh_m2");
    let noise = folder.join("noise.exr");
    Received {
        error: channel(&folder.join("annual.exr"), error),
        series: (0..annual.len()).map(|i| volume.pixel(i, 0).expect("reads")).collect(),
        photon: if noise.exists() { channel(&noise, "photon.w_m2") } else { Vec::new() },
        annual,
    }
}

/// Sensors before the wall: ten that look at the roof from a plane, five anywhere.
fn sensors() -> Vec<([f64; 3], [f64; 3])> {
    let row = |i: u32| {
        // Above the plane of the roof: below, the PV is seen from behind.
        let (y, z) = (-5.4 + 1.2 * f64::from(i), 1.9 + 0.6 * f64::from(i % 5));
        ([-8.0, y, z], [1.0, 0.0, 0.0])
    };
    let mut all: Vec<_> = (0..10).map(row).collect();
    all.extend([
        ([-11.0, 1.0, 2.0], [0.0, 0.0, 1.0]),
        ([-4.0, -1.0, 3.0], [0.6, 0.0, 0.8]),
        ([-12.0, 4.0, 4.5], [0.9, -0.1, 0.1]),
        // Looks away from the PV; stands behind the wall.
        ([-8.0, 0.0, 3.0], [-1.0, 0.0, 0.0]),
        ([-17.0, 0.0, 3.0], [1.0, 0.0, 0.0]),
    ]);
    all
}

/// The tiny project with these sensors, with photons and without.
fn with_sensors(folder: &Path) {
    let mut text = String::new();
    for ([x, y, z], [a, b, c]) in sensors() {
        writeln!(text, "{x} {y} {z} {a} {b} {c}").expect("writes");
    }
    fs::write(folder.join("air.txt"), text).expect("writes");
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    let views = "[[view]]\nname = \"air\"\nsensors = \"air.txt\"\nbandwidth = 400\nmax_radius_m = 0.4\n\n\
                 [[view]]\nname = \"exact\"\nsensors = \"air.txt\"\nestimator = \"direct\"\n";
    // One material is enough.
    let material = before.find("[[material]]\nname = \"tile\"").expect("there");
    let time = before.find("[time]").expect("there");
    let before = format!("{}{}", &before[..material], &before[time..]);
    fs::write(&file, format!("{before}\n{views}")).expect("writes");
}

/// A quadratic mean of deviations in units of their expected size.
fn rms(all: &[f64]) -> f64 {
    (all.iter().map(|z| z * z).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn what_passes_is_what_is_integrated_and_what_a_board_there_receives() {
    let (_keep, folder) = project("tiny");
    with_sensors(&folder);
    let path = folder.to_str().expect("a plain path");
    let run = folder.join("run");
    let photons = "photons.stored=150000";
    succeed(&["run", path, "--quiet", "--set", photons, "--until", "render"]);
    let air = received(&run, "air", "standard_error.wh_m2");
    let exact = received(&run, "exact", "error.wh_m2");
    let lit: Vec<usize> = (0..air.annual.len() - 2).collect();
    for i in [13, 14] {
        assert_eq!((air.annual[i], exact.annual[i]), (0.0, 0.0), "sensor {i} sees nothing");
    }

    // The year.
    let mut off = Vec::new();
    for &i in &lit {
        assert!(exact.annual[i] > 1.0, "{i}: {}", exact.annual[i]);
        assert!(air.error[i] > 0.0 && air.error[i] < 0.08 * air.annual[i], "{i}");
        let z = (air.annual[i] - exact.annual[i]) / air.error[i].hypot(exact.error[i]);
        println!(
            "sensor {i}: {:.2} ± {:.2} Wh/m2, integrated {:.2} ± {:.3}",
            air.annual[i], air.error[i], exact.annual[i], exact.error[i]
        );
        assert!(z.abs() < 4.0, "sensor {i}: {z}");
        off.push(z);
    }
    assert!((0.4..1.7).contains(&rms(&off)), "{off:?}");

    // Every timestep: photons of one, as a count.
    let mut off = Vec::new();
    for &i in &lit {
        for (a, e) in air.series[i].iter().zip(&exact.series[i]) {
            let (a, e) = (f64::from(*a), f64::from(*e));
            // Ten photons and more are nearly normal.
            if e > 10.0 * air.photon[i] {
                let z = (a - e) / (e * air.photon[i]).sqrt();
                assert!(z.abs() < 5.5, "sensor {i}: {a} against {e}, {z}");
                off.push(z);
            }
        }
    }
    assert!(off.len() > 200, "{}", off.len());
    assert!((rms(&off) - 1.0).abs() < 0.12, "{} of {}", rms(&off), off.len());

    // Boards at the first ten, and photons that land.
    let (_keep, boards) = project("tiny");
    with_sensors(&boards);
    let mut scene = fs::read_to_string(boards.join("scene.rad")).expect("reads");
    for ([x, y, z], _) in &sensors()[..10] {
        let at = |b: f64, c: f64| format!("{x} {} {}\n", y + 0.5 * b, z + 0.5 * c);
        let corners = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)].concat();
        writeln!(scene, "\nplaster polygon board\n0\n0\n12\n{corners}").expect("writes");
    }
    fs::write(boards.join("scene.rad"), scene).expect("writes");
    let path = boards.to_str().expect("a plain path");
    let set = "photons.stored=400000";
    succeed(&["run", path, "--quiet", "--set", set, "--until", "render"]);
    let landed = received(&boards.join("run"), "air", "standard_error.wh_m2");
    let mut off = Vec::new();
    for i in 0..10 {
        let z = (air.annual[i] - landed.annual[i]) / air.error[i].hypot(landed.error[i]);
        println!("board {i}: {:.2} ± {:.2} Wh/m2, {z:.2}", landed.annual[i], landed.error[i]);
        assert!(z.abs() < 4.0, "sensor {i}: {z}");
        off.push(z);
    }
    assert!((0.3..1.8).contains(&rms(&off)), "{off:?}");
}

/// What lands doesn't know of the sensors in the air, and what crosses them doesn't depend on the
/// threads or on where a run was stopped.
#[test]
fn who_stands_in_the_air_changes_nothing_that_lands() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    succeed(&["run", path, "--quiet", "--until", "render"]);
    let before = hashes(&folder);
    with_sensors(&folder);
    succeed(&["run", path, "--quiet", "--threads", "1", "--force", "trace"]);
    let after = hashes(&folder);
    for name in ["standard/photons.gmp", "standard/plan/annual.npy", "standard/tally.json"] {
        assert_eq!(before[name], after[name], "{name}");
    }
    let own = "standard/air/air.gmp";
    assert!(after.contains_key(own) && !after.keys().any(|name| name.contains("air-spill")));
    fs::remove_file(folder.join("run").join(own)).expect("removes");
    succeed(&["run", path, "--quiet", "--threads", "2"]);
    assert_eq!(hashes(&folder), after);
    let said = succeed(&["probe", path, "--view", "air", "--pixel", "3,0"]);
    assert!(said.out.contains("roof: 100") && said.out.contains("air at"), "{}", said.out);
    succeed(&["verify", path]);

    // What is integrated has no noise, and no band of it.
    let text = fs::read(folder.join("run/standard/exact/receivers.json")).expect("reads");
    let exact: Value = serde_json::from_slice(&text).expect("JSON");
    let group = &exact["groups"][0];
    assert_eq!((group["points"].as_u64(), group["in_air"].as_u64()), (Some(15), Some(15)));
    let ten = &group["thresholds"][0]["hours"];
    assert!(ten["value"].as_f64() > Some(0.0) && ten["low"] == ten["high"], "{ten}");

    // The observer in the air is told of as all others are.
    let text = fs::read(folder.join("run/standard/receivers/receivers.json")).expect("reads");
    let all: Value = serde_json::from_slice(&text).expect("JSON");
    let air = &all["groups"][0];
    assert_eq!((air["name"].as_str(), air["in_air"].as_u64()), (Some("Wall"), Some(1)));
    let ten = &air["thresholds"][0]["hours"];
    let [low, value, high] = ["low", "value", "high"].map(|k| ten[k].as_f64().expect("h"));
    assert!(0.0 < value && low <= value && value <= high, "{ten}");
    assert_eq!(air["surfaces"]["roof"].as_f64(), Some(1.0), "{air}");
}
