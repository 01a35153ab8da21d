//! Same inputs, same seed: the same bytes in every output, whatever the threads, the cache, the
//! memory, the shards, and however often the run was killed.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::golden;
use crate::support::program::{hashes, killed_at, project, succeed};

fn run(project: &Path, more: &[&str]) -> BTreeMap<String, String> {
    let path = project.to_str().expect("a plain path");
    let mut arguments = vec!["run", path, "--quiet"];
    arguments.extend(more);
    succeed(&arguments);
    hashes(project)
}

fn assert_same(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>, what: &str) {
    let differ: Vec<&String> =
        a.keys().chain(b.keys()).filter(|name| a.get(*name) != b.get(*name)).collect();
    assert!(differ.is_empty(), "{what}: these differ: {differ:?}");
}

#[test]
fn threads_cache_and_memory_change_no_byte() {
    let (_keep, one) = project("tiny");
    let first = run(&one, &["--threads", "1", "--page-cache", "1MiB"]);
    assert!(first.len() > 20, "a whole run leaves many files, found {}", first.len());
    let (_keep, two) = project("tiny");
    let second = run(&two, &["--threads", "2", "--page-cache", "256MiB", "--memory", "256MiB"]);
    assert_same(&first, &second, "1 thread and 1 MiB against 2 threads and 256 MiB");
}

#[test]
fn another_seed_changes_the_photons() {
    let (_keep, one) = project("tiny");
    let first = run(&one, &["--until", "pages"]);
    let second = run(&one, &["--until", "pages", "--set", "photons.seed=2"]);
    let stores = |h: &BTreeMap<String, String>| {
        h.iter().filter(|(n, _)| n.ends_with(".gmp")).map(|(_, v)| v.clone()).collect::<Vec<_>>()
    };
    assert_ne!(stores(&first), stores(&second));
}

/// The outputs of a tiny project, committed: what changes a byte anywhere shows up here, and is
/// told by map, channel and amount. `GLINTMAP_BLESS=1` writes them anew, after the change was
/// understood.
#[test]
fn the_tiny_project_has_the_committed_bytes() {
    let (_keep, tiny) = project("tiny");
    let found = run(&tiny, &[]);
    if std::env::var_os("GLINTMAP_BLESS").is_some() {
        golden::write(&tiny.join("run"), &found);
    }
    let differ = golden::differences(&tiny.join("run"), &found);
    assert!(
        differ.is_empty(),
        "the committed run (see the comment of this test) differs:\n{differ}"
    );
}

/// Files and pieces of work of all stages, in the order of a run.
const STEPS: [&str; 22] = [
    "suns.csv",
    "manifest.json",
    "standard/spill",
    "tile/spill",
    "tile/tally.json",
    "standard/photons.gmp",
    "tile/photons.gmp",
    "plan/hits.gmh",
    "plan/direct.exr",
    "receivers/points.json",
    "annual map",
    "standard/plan/annual.npy",
    "time series",
    "standard/plan/series.zarr",
    "standard/plan/peak.exr",
    "tile/receivers/series.zarr",
    "standard/plan/glare-10/cumulative.npy",
    "tile/plan/glare-30/events.csv",
    "tile/receivers/receivers.json",
    "standard/plan/annual.png",
    "verdicts.json",
    "report.html",
];

#[test]
fn killed_in_every_stage_it_resumes_to_the_same_bytes() {
    let (_keep, whole) = project("tiny");
    let expected = run(&whole, &[]);
    let (_keep, killed) = project("tiny");
    let arguments = ["run", killed.to_str().expect("a plain path"), "--quiet"];
    for name in STEPS {
        for number in 1..=2 {
            let step = format!("{number} {name}");
            assert!(killed_at(&arguments, &step), "it ended before step {step}");
        }
    }
    assert_same(&expected, &run(&killed, &[]), "killed and resumed");
}

/// At any step: each run comes a quarter farther than the one before.
#[test]
fn killed_again_and_again_it_ends_with_the_same_bytes() {
    let (_keep, whole) = project("tiny");
    let expected = run(&whole, &[]);
    let (_keep, killed) = project("tiny");
    let arguments = ["run", killed.to_str().expect("a plain path"), "--quiet"];
    let (mut step, mut kills) = (1, 0);
    while killed_at(&arguments, &step.to_string()) {
        kills += 1;
        step += 1 + step / 4;
    }
    assert!(kills >= 15, "killed {kills} times only");
    assert_same(&expected, &run(&killed, &[]), "killed again and again");
}

#[test]
fn a_second_run_makes_nothing_and_a_changed_key_only_what_follows() {
    let (_keep, tiny) = project("tiny");
    run(&tiny, &[]);
    let path = tiny.to_str().expect("a plain path");
    let again = succeed(&["run", path, "--quiet", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&again.out).expect("one JSON document");
    assert_eq!(summary["made"].as_array().map(Vec::len), Some(0), "{summary}");
    let changed =
        succeed(&["run", path, "--quiet", "--json", "--set", "glare.thresholds_w_m2=[5.0]"]);
    let summary: serde_json::Value = serde_json::from_str(&changed.out).expect("JSON");
    let made: Vec<&str> = summary["made"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(serde_json::Value::as_str)
        .collect();
    assert!(made.iter().any(|m| m.starts_with("glare")), "{made:?}");
    assert!(!made.iter().any(|m| m.starts_with("trace") || m.starts_with("render")), "{made:?}");
}
