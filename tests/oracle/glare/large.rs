//! A volume that is larger than the memory that the system grants, and a year in steps of a minute.

#![cfg(target_os = "linux")]

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use glintmap::base::{Purpose, Silent, Stream, limits::TILE_EDGE};
use glintmap::glare::{self, Settings};
use glintmap_formats::npy;
use glintmap_formats::zarr::chunk::{Encoder, Pipeline};
use glintmap_formats::zarr::metadata::{self, Array, DataType};
use glintmap_formats::zarr::shard;
use serde_json::Map;

use super::volumes::Memory;
use super::{Case, assert_same, run, twin};
use crate::support;

/// 4.3 GB of float32.
const SHAPE: [usize; 3] = [512, 1440, 1472];
const CHUNK: usize = 16;
/// Every so many tiles a row and a column of them is dark: cells that no event leaves.
const CELL_TILES: usize = 8;
/// Different chunks; which one lies where follows from its place.
const PATTERNS: usize = 61;

/// The volume as another program would write it: noise of whole numbers in seven tiles out of
/// eight along each axis.
fn write_volume(path: &Path) {
    let mut encoder = Encoder::new().unwrap();
    let patterns: Vec<Vec<u8>> = (0..PATTERNS as u64)
        .map(|number| {
            let mut random = Stream::new(4, Purpose::Survey, number);
            let values = (0..CHUNK * TILE_EDGE * TILE_EDGE)
                .flat_map(|_| ((random.uniform() * 21.0).floor() as f32).to_le_bytes());
            encoder.encode(&values.collect::<Vec<u8>>()).unwrap().to_vec()
        })
        .collect();
    let chunks = SHAPE[0] / CHUNK;
    let folder = path.join("irradiance");
    for row in 0..SHAPE[1] / TILE_EDGE {
        let shards = folder.join("c").join("0").join(row.to_string());
        fs::create_dir_all(&shards).unwrap();
        for column in 0..SHAPE[2] / TILE_EDGE {
            if row % CELL_TILES == 0 || column % CELL_TILES == 0 {
                continue;
            }
            let file =
                std::io::BufWriter::new(File::create(shards.join(column.to_string())).unwrap());
            let mut shard = shard::Writer::new(file);
            for chunk in 0..chunks {
                shard
                    .push(&patterns[(row * 7919 + column * 104_729 + chunk * 31) % PATTERNS])
                    .unwrap();
            }
            shard.finish().unwrap();
        }
    }
    let array = Array {
        shape: SHAPE.to_vec(),
        data_type: DataType::Float32,
        file_shape: vec![SHAPE[0], TILE_EDGE, TILE_EDGE],
        chunk_shape: Some(vec![CHUNK, TILE_EDGE, TILE_EDGE]),
        pipeline: Pipeline::OURS,
        dimension_names: ["timestep", "row", "column"].map(String::from).to_vec(),
        attributes: Map::new(),
    };
    fs::write(folder.join("zarr.json"), array.to_json().to_string()).unwrap();
    let group = metadata::group(&Map::new(), &[("irradiance", &array)]);
    fs::write(path.join("zarr.json"), group.to_string()).unwrap();
}

/// The command, under a limit of the data segment (`RLIMIT_DATA`) in KiB; whether it succeeded,
/// and its highest `RssAnon` in bytes.
fn analyse_limited(folder: &Path, kib: u64) -> (bool, u64) {
    let mut child = Command::new("sh")
        .current_dir(folder)
        .args(["-c", &format!("ulimit -d {kib}; exec \"$0\" \"$@\"")])
        .arg(env!("CARGO_BIN_EXE_glintmap"))
        .args(["glare", "analyse", "volume.zarr", "--segments", "days.npy", "--out", "out"])
        .args(["--threshold", "10.8", "--memory", "700MiB", "--threads", "2", "--quiet"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut most = 0;
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return (status.success(), most);
        }
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:"));
        let kib = line.and_then(|l| l.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
        most = most.max(kib.unwrap_or(0) << 10);
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_volume_of_4_gb_is_analysed_in_a_gibibyte_as_scipy_does_it_cell_by_cell() {
    let Some(python) = support::python() else { return };
    let folder = tempfile::tempdir().unwrap();
    write_volume(&folder.path().join("volume.zarr"));
    let days: Vec<i32> = (0..SHAPE[0] as i32).map(|t| t / 60).collect();
    npy::write(&folder.path().join("days.npy"), &[SHAPE[0]], &days).unwrap();
    // The limit is one: with far too little the same command can't end well.
    assert!(!analyse_limited(folder.path(), 64 << 10).0, "the limit has no effect");
    let (success, most) = analyse_limited(folder.path(), 1 << 20);
    assert!(success, "the analysis failed under RLIMIT_DATA of 1 GiB");
    println!("{} MiB of anonymous memory at most", most >> 20);
    assert!((64 << 20..1 << 30).contains(&most), "{} MiB of anonymous memory", most >> 20);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_cells.py");
    let cell = (CELL_TILES * TILE_EDGE).to_string();
    let status = Command::new(python)
        .arg(script)
        .arg(folder.path())
        .args(["10.8", cell.as_str(), "0,0", "2,3", "5,5"])
        .status()
        .unwrap();
    assert!(status.success(), "cells differ from SciPy's");
}

/// 6 a.m. to 6 p.m. in steps of a minute.
const MINUTES: usize = 720;

#[test]
fn a_year_of_minutes_gives_what_the_slow_twin_gives() {
    let timesteps = 365 * MINUTES;
    let mut random = Stream::new(5, Purpose::Survey, 0);
    // Each day a spot of glare wanders over the picture at its own time.
    let starts: Vec<usize> = (0..365).map(|_| (random.uniform() * 600.0) as usize).collect();
    let volume = Memory::from_fn([timesteps, 5, 7], |t, y, x| {
        let (day, minute) = (t / MINUTES, t % MINUTES);
        let age = minute.wrapping_sub(starts[day]);
        let inside = age < 120 && (age / 20).abs_diff(x) + (day % 5).abs_diff(y) < 2;
        if inside { 15.0 + (age % 13) as f32 } else { 0.0 }
    });
    let segments = (0..365).map(|day| day * MINUTES..(day + 1) * MINUTES).collect();
    let case = Case { name: "minutes".into(), volume, segments, settings: Settings::default() };
    let expected = twin::analyse(&case.volume, &case.segments, &case.settings);
    assert!(expected.0.events.len() >= 365);
    assert_same(&run(&case, None), &expected, &case.name);
}

#[test]
fn an_event_may_last_all_the_minutes_of_a_year() {
    let timesteps = 262_800;
    // The left pixel always, the next one but for one minute, the last one every other minute.
    let volume = Memory::from_fn([timesteps, 1, 3], |t, _, x| match x {
        0 => 20.0,
        1 if t != 100_000 => 20.0,
        2 if t % 2 == 0 => 20.0,
        _ => 0.0,
    });
    let settings = Settings { sigma: [0.0; 3], ..Settings::default() };
    let all = std::iter::once(0..timesteps).collect::<Vec<_>>();
    let found = glare::analyse(&volume, &all, &settings, None, &Silent).unwrap();
    assert_eq!(found.cumulative.data(), [262_800, 262_799, 131_400]);
    assert_eq!(found.longest_run.data(), [262_800, 162_799, 1]);
    // At minute 100,000 the right pixel stands alone: an event of its own.
    assert_eq!(found.sustained.data(), [262_800, 262_799, 131_399]);
    let events = found.events.to_vec().unwrap();
    assert_eq!(events.len(), 2);
    assert_eq!((events[0].first, events[0].last, events[0].pixels), (0, 262_799, 3));
    assert_eq!((events[1].first, events[1].last, events[1].voxels), (100_000, 100_000, 1));
}
