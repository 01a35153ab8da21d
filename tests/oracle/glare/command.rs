//! `glintmap glare analyse` as its users start it.

use std::fs;
use std::path::Path;
use std::process::Command;

use glintmap::picture::exr;
use glintmap_formats::npy;

use super::volumes::{Dice, Memory};
use crate::support;

/// Runs the program; what it printed on both channels, and its exit code.
pub fn program(arguments: &[&str]) -> (String, String, i32) {
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
