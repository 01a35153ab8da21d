//! Photons traced in shares, and runs that are killed while they trace: the same bytes as one
//! machine that was left alone.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::support::program::{Said, glintmap, hashes, project, say, succeed};

/// Enough for 17 units of the material `tile` and 2 of the other, so that one share has none.
const MANY: &str = "photons.stored=300000";

fn run(project: &Path, more: &[&str]) -> Said {
    let mut arguments = vec!["run", project.to_str().expect("a plain path"), "--set", MANY];
    arguments.extend(more);
    say(&arguments)
}

fn well(said: &Said) -> &Said {
    assert_eq!(said.code, 0, "stderr: {}", said.err);
    said
}

/// What pages leaves behind, without the account of what was made when.
fn stores(project: &Path) -> BTreeMap<String, String> {
    let found = hashes(project);
    assert!(found.keys().any(|name| name.ends_with(".gmp")), "{found:?}");
    found
}

fn units(project: &Path) -> usize {
    let text = std::fs::read_to_string(project.join("run/tile/shards/1-of-3/traced.json"))
        .expect("a share");
    let done: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    done["units"].as_array().expect("a list").len()
}

#[test]
fn three_shares_joined_are_what_one_machine_makes() {
    let (_keep, whole) = project("tiny");
    well(&run(&whole, &["--until", "pages"]));
    let (_keep, parts) = project("tiny");
    for (shard, threads) in [("2/3", "2"), ("3/3", "1")] {
        let more = ["--until", "trace", "--shard", shard, "--threads", threads];
        well(&run(&parts, &more));
    }
    let early = run(&parts, &["--until", "pages"]);
    assert_eq!(early.code, 2, "stderr: {}", early.err);
    assert!(early.err.contains("1-of-3") && !early.err.contains("2-of-3"), "{}", early.err);
    well(&run(&parts, &["--until", "trace", "--shard", "1/3"]));
    assert!(units(&parts) > 1, "each share should hold some units");
    let again = run(&parts, &["--until", "trace", "--shard", "1/3"]);
    assert!(well(&again).out.contains("nothing to do"), "{}", again.out);
    well(&run(&parts, &["--until", "pages"]));
    let (a, b) = (stores(&whole), stores(&parts));
    for (name, hash) in &a {
        assert_eq!(b.get(name), Some(hash), "{name} differs");
    }
    assert_eq!(a.len(), b.len(), "{:?}", b.keys());
}

#[test]
fn shares_of_other_settings_or_another_number_are_not_joined() {
    let (_keep, tiny) = project("tiny");
    let path = tiny.to_str().expect("a plain path");
    let with = |last: &[&'static str]| -> Vec<&str> {
        let first = ["run", path, "--until", "trace", "--quiet", "--shard"];
        first.into_iter().chain(last.iter().copied()).collect()
    };
    succeed(&with(&["1/2"]));
    succeed(&with(&["2/2", "--set", "photons.seed=7"]));
    let said = say(&["run", path, "--until", "pages"]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("2-of-2 (it is from other settings)"), "{}", said.err);
    succeed(&with(&["1/3"]));
    let said = say(&["run", path, "--until", "pages"]);
    assert!(said.code == 2 && said.err.contains("don't go together"), "{}", said.err);
    for wrong in [&["3/2"][..], &["0/2"], &["2"]] {
        assert_eq!(say(&with(wrong)).code, 2, "{wrong:?}");
    }
    let said = say(&["run", path, "--until", "pages", "--shard", "1/2"]);
    assert!(said.code == 2 && said.err.contains("--until trace"), "{}", said.err);
}

#[test]
fn a_run_killed_while_tracing_goes_on_from_its_checkpoint() {
    let (_keep, whole) = project("tiny");
    well(&run(&whole, &["--until", "pages"]));
    let (_keep, killed) = project("tiny");
    let path = killed.to_str().expect("a plain path");
    let arguments = ["run", path, "--set", MANY, "--until", "pages", "--quiet", "--threads", "1"];
    let mut child = glintmap(&arguments).spawn().expect("the program starts");
    let checkpoint = killed.join("run/tile/spill/checkpoint.json");
    let began = Instant::now();
    while !checkpoint.exists() {
        assert!(began.elapsed() < Duration::from_secs(120), "no checkpoint");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().expect("kills");
    child.wait().expect("waits");
    // Killed inside of a checkpoint: its beginning lies beside the one that holds.
    std::fs::write(checkpoint.with_extension("json.tmp"), b"{\"note\"").expect("writes");
    let resumed = run(&killed, &["--until", "trace"]);
    assert!(well(&resumed).err.contains("tile: goes on after 1 of"), "{}", resumed.err);
    // Killed again while the photons are sorted and the store grows.
    let mut child = glintmap(&arguments).spawn().expect("the program starts");
    let growing = killed.join("run/tile/photons.gmp.tmp");
    let sealed = killed.join("run/tile/photons.gmp");
    while !growing.exists() && !sealed.exists() {
        assert!(child.try_wait().expect("asks").is_none(), "it ended without a store");
        std::thread::sleep(Duration::from_micros(200));
    }
    child.kill().expect("kills");
    child.wait().expect("waits");
    println!("killed with the store {}", if sealed.exists() { "sealed" } else { "growing" });
    well(&run(&killed, &["--until", "pages"]));
    assert!(!growing.exists(), "a part of a store is left");
    assert_eq!(stores(&whole), stores(&killed));
}
