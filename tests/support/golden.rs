//! The run of the tiny project that is committed: what later ones are held against.
//!
//! `fixtures/tiny-hashes.json` has the hash of each of its files, and says that something
//! changed. `fixtures/tiny-run.tar.zst` has the files themselves, so that it can be said what.
//! Left out there are the pictures, which show what lies beside them as numbers, and the photon
//! stores, of which all else is made: they would be most of it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::Path;

use super::compare::{self, What};
use super::program::root;

const HASHES: &str = "fixtures/tiny-hashes.json";
const FILES: &str = "fixtures/tiny-run.tar.zst";

fn is_kept(name: &str) -> bool {
    !name.ends_with(".png") && !name.ends_with(".gmp")
}

/// Commits a run folder; `hashes` of all its files but the log.
pub fn write(run: &Path, hashes: &BTreeMap<String, String>) {
    let text = serde_json::to_string_pretty(hashes).expect("writes") + "\n";
    fs::write(root().join(HASHES), text).expect("writes the hashes");
    let file = File::create(root().join(FILES)).expect("makes the archive");
    let packed = zstd::Encoder::new(file, 19).expect("packs").auto_finish();
    let mut archive = tar::Builder::new(packed);
    archive.mode(tar::HeaderMode::Deterministic);
    for name in hashes.keys().filter(|name| is_kept(name)) {
        archive.append_path_with_name(run.join(name), name).expect("archives");
    }
    archive.finish().expect("ends the archive");
}

/// What differs between the committed run and another one, for people; empty if nothing does.
pub fn differences(run: &Path, hashes: &BTreeMap<String, String>) -> String {
    let text = fs::read(root().join(HASHES)).expect(HASHES);
    let committed: BTreeMap<String, String> = serde_json::from_slice(&text).expect("reads");
    let names: BTreeSet<&String> = committed.keys().chain(hashes.keys()).collect();
    let differ: Vec<&String> =
        names.into_iter().filter(|name| committed.get(*name) != hashes.get(*name)).collect();
    if differ.is_empty() {
        return String::new();
    }
    let old = tempfile::tempdir().expect("a folder");
    let file = File::open(root().join(FILES)).expect(FILES);
    let unpacked = zstd::Decoder::new(file).expect("unpacks");
    tar::Archive::new(unpacked).unpack(old.path()).expect("unpacks");
    let mut report = compare::compare(old.path(), run, What::Everything).expect("compares");
    report.findings.retain(|(name, _)| is_kept(name));
    let mut out = report.to_string();
    for name in differ.into_iter().filter(|name| !is_kept(name)) {
        let how = match (committed.contains_key(name), hashes.contains_key(name)) {
            (true, true) => "differs (what it was isn't kept)",
            (true, false) => "is missing",
            _ => "is new",
        };
        // Writing into a String can't fail.
        let _ = write!(out, "\n{name} {how}");
    }
    out
}
