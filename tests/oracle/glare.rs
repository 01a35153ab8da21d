//! The streaming glare analysis, held against SciPy (`tools/oracles/glare_reference.py`) and
//! against a slow twin of our own.

mod large;
mod session;
mod sparse;
mod spill;
mod twin;
mod uneven;
mod volumes;
mod year;

use std::fs;
use std::ops::Range;
use std::path::Path;
use std::process::Command;

use glintmap::base::{Grid, Silent};
use glintmap::glare::{
    self, Analysis, Calendar, Connectivity, Error, Event, Kernel, Plan, Settings, Slices,
};
use glintmap::picture::exr;
use glintmap_formats::npy;
use volumes::{Dice, Memory, adversarial, random, segments};

use crate::support;

/// A volume and how to analyse it.
struct Case {
    name: String,
    volume: Memory,
    segments: Vec<Range<usize>>,
    settings: Settings,
}

const ALL: [Connectivity; 3] = [Connectivity::Faces, Connectivity::Edges, Connectivity::Corners];

/// The volume as one segment.
fn whole(volume: &Memory) -> Vec<Range<usize>> {
    std::iter::once(0..volume.shape()[0]).collect()
}

fn plan(batch: usize, block: usize) -> Plan {
    Plan { batch, block, fixed_bytes: 0, events_bytes: u64::MAX, spill_bytes: 1 << 20 }
}

/// All of an analysis in memory.
#[derive(Debug)]
struct Found {
    cumulative: Grid<i32>,
    sustained: Grid<i32>,
    longest_run: Grid<i32>,
    days: Option<Grid<i32>>,
    longest_day: Option<Grid<i32>>,
    cumulative_h: Option<Grid<f32>>,
    events: Vec<Event>,
    nonfinite: u64,
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

fn run(case: &Case, plan: Option<Plan>) -> (Found, Vec<f32>) {
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
fn same_bits(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

fn random_case(number: usize) -> Case {
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

fn shaped_cases() -> Vec<Case> {
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

fn write_volumes(folder: &Path, cases: &[Case]) {
    let list: Vec<serde_json::Value> = cases
        .iter()
        .enumerate()
        .map(|(number, case)| {
            let numbers: Vec<usize> =
                case.segments.iter().enumerate().flat_map(|(i, s)| vec![i % 2; s.len()]).collect();
            serde_json::json!({
                "number": number,
                "shape": case.volume.shape,
                "threshold": case.settings.threshold,
                "sigma": case.settings.sigma,
                "truncate": case.settings.truncate,
                "connectivity": case.settings.connectivity.neighbours(),
                "segments": numbers,
            })
        })
        .collect();
    fs::write(folder.join("cases.json"), serde_json::to_string(&list).unwrap()).unwrap();
    for (number, case) in cases.iter().enumerate() {
        let bytes: Vec<u8> = case.volume.data.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(folder.join(format!("{number}.f32")), bytes).unwrap();
    }
}

fn words(path: &Path) -> Vec<[u8; 4]> {
    fs::read(path).unwrap().as_chunks().0.to_vec()
}

#[test]
fn volumes_give_the_integers_and_the_bits_of_scipy() {
    let Some(python) = support::python() else { return };
    let mut cases: Vec<Case> = (0..1600).map(random_case).collect();
    cases.extend(shaped_cases());
    let folder = tempfile::tempdir().unwrap();
    write_volumes(folder.path(), &cases);
    let sigmas = "0.3 0.5 0.7 1.0 1.5 2.0 2.3 3.0 5.0 20.0 40.0";
    fs::write(folder.path().join("sigmas.txt"), sigmas).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_cases.py");
    let status = Command::new(python).arg(script).arg(folder.path()).status().unwrap();
    assert!(status.success());

    let (mut skipped, mut events, mut differing) = (0, 0, 0_usize);
    for (number, case) in cases.iter().enumerate() {
        let read = |name: &str| words(&folder.path().join(format!("{number}.{name}")));
        let (analysis, filtered) = run(case, None);
        let reference: Vec<f32> =
            read("filtered.f32").into_iter().map(f32::from_le_bytes).collect();
        assert_eq!(filtered.len(), reference.len(), "{}", case.name);
        let exact = case.settings.sigma.iter().all(|s| [0.0, 0.1, 1.0].contains(s));
        let unequal = filtered.iter().zip(&reference).filter(|(a, b)| !same_bits(**a, **b)).count();
        if exact {
            assert_eq!(unequal, 0, "{}", case.name);
        } else {
            differing += unequal;
            for (a, b) in filtered.iter().zip(&reference) {
                let close = (a - b).abs() <= 2e-7 * b.abs().max(1e-30);
                assert!(same_bits(*a, *b) || close, "{}: {a} {b}", case.name);
            }
            let threshold = case.settings.threshold as f32;
            if unequal > 0 && reference.iter().any(|v| (v - threshold).abs() <= 1e-6 * threshold) {
                skipped += 1;
                continue;
            }
        }
        let maps: Vec<i32> = read("maps.i32").into_iter().map(i32::from_le_bytes).collect();
        let found = [&analysis.cumulative, &analysis.sustained, &analysis.longest_run];
        for (name, (found, expected)) in ["cumulative", "sustained", "longest run"]
            .iter()
            .zip(found.iter().zip(maps.chunks_exact(maps.len() / 3)))
        {
            assert!(found.data() == expected, "{name} of {}", case.name);
        }
        let text = fs::read_to_string(folder.path().join(format!("{number}.events.json")));
        let expected: Vec<serde_json::Value> = serde_json::from_str(&text.unwrap()).unwrap();
        let found: Vec<serde_json::Value> = (analysis.events.iter())
            .map(|e| {
                serde_json::json!({
                    "first": e.first, "last": e.last, "voxels": e.voxels, "pixels": e.pixels
                })
            })
            .collect();
        assert_eq!(found, expected, "events of {}", case.name);
        events += found.len();
        let nonfinite = case.volume.data.iter().filter(|v| !v.is_finite()).count() as u64;
        assert_eq!(analysis.nonfinite, nonfinite);
    }
    eprintln!(
        "{} volumes, {events} events; at other sigmas than 1 {differing} voxels differ in the last bit, {skipped} volumes skipped because of them",
        cases.len()
    );
    assert!(events > 90_000, "the volumes have become too easy: {events} events");
    assert!(skipped < cases.len() / 50, "{skipped} volumes were not compared");
    compare_kernels(folder.path());
}

/// At most one bit between numpy's weights and ours, and none at sigma 1.
fn compare_kernels(folder: &Path) {
    let text = fs::read_to_string(folder.join("kernels.json")).unwrap();
    let kernels: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    for (sigma, expected) in kernels {
        let kernel = Kernel::gaussian('t', sigma.parse().unwrap(), 4.0).unwrap();
        let expected: Vec<u64> = serde_json::from_value(expected).unwrap();
        assert_eq!(kernel.weights().len(), expected.len(), "sigma {sigma}");
        let apart = |(w, e): (&f64, &u64)| w.to_bits().abs_diff(*e);
        let worst = kernel.weights().iter().zip(&expected).map(apart).max().unwrap();
        eprintln!("sigma {sigma}: weights differ from numpy's by at most {worst} ulp");
        assert!(worst <= if sigma == "1.0" { 0 } else { 2 }, "sigma {sigma}");
    }
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

fn assert_same(found: &(Found, Vec<f32>), expected: &(Found, Vec<f32>), what: &str) {
    let differing = fields(&found.0, &expected.0);
    assert!(differing.is_empty(), "{differing:?} of {what}");
    let unequal = found.1.iter().zip(&expected.1).filter(|(a, b)| !same_bits(**a, **b)).count();
    assert_eq!(unequal, 0, "filtered volume of {what}");
}

#[test]
fn volumes_give_what_the_slow_twin_gives() {
    let mut cases: Vec<Case> = (1000..1200).map(random_case).collect();
    cases.extend(shaped_cases());
    for (number, case) in cases.iter_mut().enumerate() {
        if number % 2 == 0 {
            let steps = case.volume.shape[0];
            let mut dice = Dice::new(number as u64);
            case.volume.calendar = Some(Calendar {
                day: (0..steps as u32).map(|t| t / 3).collect(),
                weight_h: (0..steps).map(|_| dice.unit()).collect(),
            });
        }
        let expected = twin::analyse(&case.volume, &case.segments, &case.settings);
        assert_same(&run(case, None), &expected, &case.name);
    }
}

#[test]
fn seams_of_the_window_do_not_show() {
    let mut cases: Vec<Case> = (2000..2040).map(random_case).collect();
    cases.extend(shaped_cases().into_iter().skip(1).step_by(5));
    for case in &cases {
        let all = case.volume.shape[0];
        let expected = run(case, Some(plan(all, all)));
        for batch in [1, 2, 3, 7, 8, all] {
            for block in [1, 2, 3, 7, all] {
                let found = run(case, Some(plan(batch, block)));
                assert_same(&found, &expected, &format!("{}, {batch} by {block}", case.name));
            }
        }
    }
}

#[test]
fn threads_do_not_show() {
    let case = shaped_cases().pop().unwrap();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&case, None))
    };
    let expected = with(1);
    for threads in [2, 5] {
        assert_same(&with(threads), &expected, &format!("{threads} threads"));
    }
}

fn refusal(volume: &Memory, settings: &Settings) -> Error {
    glare::analyse(volume, &whole(volume), settings, None, &Silent)
        .expect_err("it should be refused")
}

#[test]
fn a_voxel_that_is_not_finite_is_named() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut volume = Memory::from_fn([20, 30, 70], |_, _, _| 1.0);
        volume.data[(11 * 30 + 7) * 70 + 64] = bad;
        volume.data[(11 * 30 + 8) * 70 + 3] = bad;
        volume.data[(19 * 30 + 2) * 70 + 3] = bad;
        let error = refusal(&volume, &Settings::default());
        assert!(
            matches!(error, Error::NonFinite { timestep: 11, row: 7, column: 64, .. }),
            "{error}"
        );
        assert_eq!(error.kind().exit_code(), 2);
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let volume = Memory::from_fn([3, 4, 5], |_, _, _| 1.0);
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        let error = refusal(&volume, &settings);
        assert_eq!(error.kind().exit_code(), 2, "{error}");
        error
    };
    for threshold in [-1.0, f64::NAN, f64::INFINITY, 1e39] {
        assert!(matches!(refused(&|s| s.threshold = threshold), Error::Threshold(_)));
    }
    assert!(matches!(refused(&|s| s.sigma[1] = -1.0), Error::Sigma { axis: 'y', .. }));
    assert!(matches!(refused(&|s| s.sigma[2] = 1e12), Error::Radius { axis: 'x', .. }));
    assert!(matches!(refused(&|s| s.truncate = f64::NAN), Error::Truncate(_)));
    assert!(matches!(refused(&|s| s.memory_bytes = 1), Error::Memory { .. }));
    let all = |segments: &[Range<usize>]| {
        let settings = Settings::default();
        glare::analyse(&volume, segments, &settings, None, &Silent).map(|_| ())
    };
    assert!(all(&[0..2, 2..3]).is_ok());
    for wrong in [
        vec![],
        std::iter::once(0..2).collect(),
        vec![0..2, 1..3],
        vec![0..2, 2..4],
        vec![0..0, 0..3],
    ] {
        assert!(matches!(all(&wrong), Err(Error::Segments { .. })), "{wrong:?}");
    }
}

#[test]
fn too_many_events_for_the_memory_are_refused_by_name() {
    let volume = Memory::from_fn([4, 200, 200], |t, y, x| ((t + y + x) % 2 * 20) as f32);
    let settings = Settings { sigma: [0.0; 3], ..Settings::default() };
    let tight = Plan { events_bytes: 1000, ..glare::plan(&volume, &settings, false).unwrap() };
    let found = glare::analyse_planned(&volume, &whole(&volume), &settings, &tight, None, &Silent);
    assert!(matches!(found.map(|_| ()), Err(Error::Events { timestep: 0, .. })));
}

/// Runs the program; what it printed on both channels, and its exit code.
fn program(arguments: &[&str]) -> (String, String, i32) {
    let output = Command::new(env!("CARGO_BIN_EXE_glintmap")).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr), output.status.code().unwrap_or(-1))
}

/// A folder with a volume of 60 timesteps, the numbers of its segments, and what is in it.
fn folder_with_volume() -> (tempfile::TempDir, Memory) {
    let folder = tempfile::tempdir().unwrap();
    let dice = &mut Dice::new(99);
    let volume = Memory::from_fn([60, 40, 50], |_, _, _| {
        if dice.unit() < 0.4 { 40.0 * dice.unit() as f32 } else { 0.0 }
    });
    npy::write(&folder.path().join("volume.npy"), &volume.shape, &volume.data).unwrap();
    let numbers: Vec<i32> = (0..60).map(|t| t / 17).collect();
    npy::write(&folder.path().join("segments.npy"), &[60], &numbers).unwrap();
    (folder, volume)
}

#[test]
fn the_command_writes_what_the_reference_writes() {
    let Some(python) = support::python() else { return };
    let (folder, _) = folder_with_volume();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (volume, segments) = (path("volume.npy"), path("segments.npy"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_reference.py");
    let status = Command::new(python)
        .arg(script)
        .args([&volume, &path("reference"), "--threshold", "8.5", "--keep-filtered"])
        .args(["--segments", &segments, "--connectivity", "18"])
        .stdout(std::process::Stdio::null())
        .status();
    assert!(status.unwrap().success());
    let arguments = ["--threshold", "8.5", "--keep-filtered", "--connectivity", "18"];
    let analyse = |volume: &str, out: &str, more: &[&str]| {
        let start = ["glare", "analyse", volume, "--out", out];
        program(&[&start[..], &arguments[..], more].concat())
    };
    let with_segments = ["--segments", &segments, "--json"];
    let (stdout, stderr, code) = analyse(&volume, &path("ours"), &with_segments);
    assert_eq!(code, 0, "{stderr}");
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();

    for map in ["cumulative", "sustained", "longest_run"] {
        let file = |side: &str| npy::Reader::<i32>::open(&folder.path().join(side)).unwrap();
        let found = file(&format!("ours/{map}.npy"));
        let expected = file(&format!("reference/{map}.npy"));
        assert_eq!(found.shape(), expected.shape());
        assert_eq!(found.read_all().unwrap(), expected.read_all().unwrap(), "{map}");
        let exr = exr::read(&folder.path().join(format!("ours/{map}.exr"))).unwrap();
        let (name, grid) = &exr.list()[0];
        assert_eq!(name, &format!("{map}.timesteps"));
        assert!(grid.data().iter().zip(found.read_all().unwrap()).all(|(a, b)| *a == b as f32));
    }
    let filtered = |side: &str| {
        let path = folder.path().join(side).join("filtered.npy");
        npy::Reader::<f32>::open(&path).unwrap().read_all().unwrap()
    };
    let same = filtered("ours").into_iter().zip(filtered("reference"));
    assert!(same.into_iter().all(|(a, b)| a.to_bits() == b.to_bits()));
    let text = fs::read_to_string(folder.path().join("reference/events.json")).unwrap();
    let expected: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    let sheet = fs::read_to_string(folder.path().join("ours/events.csv")).unwrap();
    let mut lines = sheet.lines();
    assert!(lines.next().unwrap().starts_with("first,last,voxels,pixels,peak_w_m2,"));
    let found: Vec<Vec<u64>> = lines
        .map(|line| line.split(',').take(4).map(|word| word.parse().unwrap()).collect())
        .collect();
    let names = ["first", "last", "voxels", "pixels"];
    let expected: Vec<Vec<u64>> =
        expected.iter().map(|e| names.iter().map(|n| e[n].as_u64().unwrap()).collect()).collect();
    assert!(found == expected, "events.csv");
    assert_eq!(document["events"], expected.len());

    // The same volume as ours on disk, with other threads and memory: the same bytes.
    let zarr = path("volume.zarr");
    let (_, stderr, code) =
        program(&["volume", "import", &volume, "--segments", &segments, "--out", &zarr]);
    assert_eq!(code, 0, "{stderr}");
    for (threads, memory) in [("1", "1GiB"), ("2", "2M")] {
        let more = ["--quiet", "--threads", threads, "--memory", memory];
        let (_, stderr, code) = analyse(&zarr, &path("again"), &more);
        assert_eq!((code, stderr.as_str()), (0, ""));
        for entry in fs::read_dir(folder.path().join("ours")).unwrap() {
            let name = entry.unwrap().file_name();
            let read = |side: &str| fs::read(folder.path().join(side).join(&name)).unwrap();
            assert!(read("ours") == read("again"), "{name:?}, {threads} threads, {memory}");
        }
    }
}

#[test]
fn the_command_refuses_what_it_cannot_do() {
    let (folder, mut volume) = folder_with_volume();
    let path = |name: &str| folder.path().join(name).display().to_string();
    volume.data[(7 * 40 + 8) * 50 + 9] = f32::NAN;
    npy::write(&folder.path().join("nan.npy"), &volume.shape, &volume.data).unwrap();
    let analyse = |volume: &str, more: &[&str]| {
        let (volume, out) = (path(volume), path("out"));
        program(&[&["glare", "analyse", &volume, "--out", &out][..], more].concat())
    };
    let (_, stderr, code) = analyse("nan.npy", &["--threshold", "10", "--keep-filtered"]);
    assert_eq!(code, 2);
    assert!(stderr.contains("timestep 7, row 8, column 9"), "{stderr}");
    let left: Vec<_> = fs::read_dir(folder.path().join("out")).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
    let allowed = ["--threshold", "10", "--allow-nonfinite", "--json"];
    let (stdout, _, code) = analyse("nan.npy", &allowed);
    assert_eq!(code, 0);
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(document["nonfinite"], 1);
    for (volume, more) in [
        ("missing.npy", &["--threshold", "10"][..]),
        ("segments.npy", &["--threshold", "10"]),
        ("volume.npy", &["--threshold", "-1"]),
        ("volume.npy", &["--threshold", "ten"]),
        ("volume.npy", &["--threshold", "10", "--sigma", "1", "1"]),
        ("volume.npy", &["--threshold", "10", "--sigma", "1", "-1", "1"]),
        ("volume.npy", &["--threshold", "10", "--connectivity", "8"]),
        ("volume.npy", &["--threshold", "10", "--segments", "missing.npy"]),
        ("volume.npy", &["--threshold", "10", "--memory", "1K"]),
        ("volume.npy", &["--threshold", "10", "--memory", "much"]),
    ] {
        let (_, stderr, code) = analyse(volume, more);
        assert_eq!(code, 2, "{volume} {more:?}: {stderr}");
        assert!(!stderr.is_empty());
    }
}
