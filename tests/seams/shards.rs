//! Photons traced in shares, and runs that are killed while they trace: the same bytes as one
//! machine that was left alone.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::program::{Said, hashes, killed_at, project, say, succeed};

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

/// What all stages so far left behind, the manifest included.
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
    // Begun, complete, under its name: the first checkpoint is sealed.
    assert!(killed_at(&arguments, "3 tile/spill/checkpoint.json"), "it ended before it was killed");
    let checkpoint = killed.join("run/tile/spill/checkpoint.json");
    assert!(checkpoint.exists(), "no checkpoint");
    // Killed inside of a checkpoint: its beginning lies beside the one that holds.
    std::fs::write(checkpoint.with_extension("json.tmp"), b"{\"note\"").expect("writes");
    let resumed = run(&killed, &["--until", "trace"]);
    assert!(well(&resumed).err.contains("tile: goes on after 1 of"), "{}", resumed.err);
    // Killed again while a store grows, when one is complete, and when it has its name.
    for (step, material, is_sealed) in [
        ("2 pages", "standard", false),
        ("1 tile/photons.gmp", "tile", false),
        ("2 tile/photons.gmp", "tile", true),
    ] {
        assert!(killed_at(&arguments, step), "it ended before {step}");
        let there = ["photons.gmp.tmp", "photons.gmp"]
            .map(|name| killed.join("run").join(material).join(name).exists());
        assert_eq!(there, [!is_sealed, is_sealed], "{step}");
    }
    well(&run(&killed, &["--until", "pages"]));
    assert!(!killed.join("run/tile/photons.gmp.tmp").exists(), "a part of a store is left");
    assert_eq!(stores(&whole), stores(&killed));
}
