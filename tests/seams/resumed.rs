//! A run that is killed while it renders: the next one renders what is missing, nothing else.

use std::path::Path;

use serde_json::Value;

use crate::support::program::{hashes, killed_at, project, succeed};

/// A picture of some seconds, 15 x 15 tiles.
const MORE: [&str; 8] = [
    "--set",
    "view.plan.size=[480, 480]",
    "--set",
    "view.plan.series_bandwidth=2000",
    "--set",
    "photons.stored=20000",
    "--until",
    "render",
];

fn arguments(folder: &Path) -> Vec<&str> {
    let mut out = vec!["run", folder.to_str().expect("a plain path"), "--quiet", "--threads", "1"];
    out.extend(MORE);
    out
}

/// What the last rendering of a material in the plan says of its tiles.
fn gathered(folder: &Path, unit: &str) -> Option<Value> {
    let log = std::fs::read_to_string(folder.join("run/log/run.jsonl")).expect("a log");
    let entries = log.lines().rev().filter_map(|l| serde_json::from_str::<Value>(l).ok());
    entries.into_iter().find(|e| e["unit"] == unit).map(|e| e["facts"].clone())
}

#[test]
fn killed_while_rendering_only_missing_tiles_are_rendered() {
    let (_keep, whole) = project("tiny");
    succeed(&arguments(&whole));
    let unit = "render standard plan";
    let all = gathered(&whole, unit).expect("rendered")["gathered"]["tiles_rendered"].clone();
    assert_eq!(all, 225);

    // The sixth tile is done; the ledger and the notes know it.
    let (_keep, killed) = project("tiny");
    let series = killed.join("run/standard/plan/series.notes");
    assert!(killed_at(&arguments(&killed), "6 time series"), "it ended before it was killed");
    assert!(series.exists(), "the notes are there");
    let annual = killed.join("run/standard/plan/annual.exr");
    let before = std::fs::metadata(&annual).and_then(|m| m.modified()).expect("a map");

    succeed(&arguments(&killed));
    let facts = gathered(&killed, unit).expect("rendered");
    let count = |what: &str| facts["gathered"][what].as_u64().expect("a number");
    let (present, rendered) = (count("tiles_present"), count("tiles_rendered"));
    assert_eq!((present, rendered), (6, 219));
    assert_eq!(facts["annual"], Value::Null, "the annual map was there");
    let after = std::fs::metadata(&annual).and_then(|m| m.modified()).expect("a map");
    assert_eq!(before, after);
    assert!(!series.exists(), "the notes are gone");
    assert_eq!(hashes(&killed), hashes(&whole));
}
