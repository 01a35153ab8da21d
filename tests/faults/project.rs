//! Mistakes in a project: each a clear error with its place and the right exit code, and nothing
//! that existed is lost.

use std::fs;
use std::process::Command;

use crate::support::program::{hashes, project, say, succeed};

/// Changes the tiny project's file and returns what `run` says.
fn broken(from: &str, to: &str) -> crate::support::program::Said {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let text = fs::read_to_string(&file).expect("reads");
    assert!(text.contains(from), "the tiny project has no `{from}`");
    fs::write(&file, text.replacen(from, to, 1)).expect("writes");
    let said = say(&["run", folder.to_str().expect("a plain path"), "--quiet"]);
    assert!(!folder.join("run/manifest.json").exists() || said.code != 2, "{}", said.err);
    said
}

#[test]
fn a_misspelt_key_is_named_with_its_place_and_the_nearest() {
    let said = broken("stored =", "storred =");
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("did you mean `stored`"), "{}", said.err);
    assert!(said.err.contains("project.toml:"), "{}", said.err);
}

#[test]
fn values_out_of_range_say_what_was_expected() {
    for (from, to, word) in [
        ("latitude = ", "latitude = 9", "site.latitude"),
        ("sun = \"gensky-2018\"", "sun = \"moon\"", "\"spa\""),
        ("bounces = 1", "bounces = 3", "bounces"),
        ("connectivity = 6", "connectivity = 7", "6, 18 or 26"),
        ("name = \"plan\"", "name = \"a plan\"", "a plan"),
        ("-vtl", "-vtq", "-vt"),
        ("{ modifier = \"pv\" }", "{ modifier = \"pv\", min_tilt_deg = nan }", "select"),
        ("point = [-14.0", "point = [nan", "[[observer]]"),
        // Not after an hour of photons.
        (
            "[glare]",
            "[[moment]]\ndate = 0\ntime = \"01:30\"\nview = \"plan\"\n[glare]",
            "[[moment]]",
        ),
    ] {
        let said = broken(from, to);
        assert_eq!(said.code, 2, "{from} -> {to}: {}", said.err);
        assert!(said.err.contains(word), "{from} -> {to}: {}", said.err);
    }
}

/// Of several materials the one that leaves nothing to trace is named.
#[test]
fn a_material_that_reflects_nothing_is_named() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    let black = "material.tile.model={ kind = \"lambertian\", reflectance = 0.0 }";
    let said = say(&["run", path, "--quiet", "--set", black]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("photons of `tile`"), "{}", said.err);
    assert!(said.err.contains("reflects nothing"), "{}", said.err);
}

#[test]
fn a_missing_scene_file_is_named() {
    let said = broken("scene.rad", "nowhere.rad");
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("nowhere.rad"), "{}", said.err);
}

#[test]
fn a_project_that_is_not_there_is_named() {
    let said = say(&["run", "no/such/project"]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("no/such/project"), "{}", said.err);
    assert!(said.err.contains("glintmap new"), "{}", said.err);
}

#[test]
fn a_mistake_in_set_is_not_blamed_on_a_line_of_the_file() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    let said = say(&["run", path, "--set", "photons.storred=5"]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("with --set") && said.err.contains("`stored`"), "{}", said.err);
    assert!(!said.err.contains("project.toml:4"), "{}", said.err);
}

#[test]
fn a_name_that_is_taken_by_a_file_is_the_commands_mistake() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let out = keep.path().join("taken");
    fs::write(&out, "mine").expect("writes");
    let volume = keep.path().join("volume.npy");
    glintmap_formats::npy::write(&volume, &[1, 1, 1], &[1.0_f32]).expect("writes");
    let text = |p: &std::path::Path| p.to_str().expect("a plain path").to_owned();
    let words = ["glare", "analyse", &text(&volume), "--threshold", "1", "--out", &text(&out)];
    let said = say(&words);
    assert_eq!(said.code, 2, "{}", said.err);
    assert_eq!(fs::read_to_string(&out).expect("reads"), "mine");
}

/// Two files of one name in different folders: each counts.
#[test]
fn both_of_two_scene_files_of_one_name_decide() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    fs::create_dir(folder.join("other")).expect("makes");
    fs::write(folder.join("other/scene.rad"), "# nothing\n").expect("writes");
    let two = "scene.files=[\"scene.rad\", \"other/scene.rad\"]";
    let words = ["run", path, "--quiet", "--until", "pages", "--set", two];
    succeed(&words);
    let first = fs::read(folder.join("run/standard/photons.gmp")).expect("reads");
    let scene = folder.join("scene.rad");
    let text = fs::read_to_string(&scene).expect("reads") + "# changed\n";
    fs::write(&scene, text).expect("writes");
    succeed(&words);
    assert_ne!(first, fs::read(folder.join("run/standard/photons.gmp")).expect("reads"));
}

#[test]
fn a_selector_that_selects_nothing_lists_what_is_there() {
    let said = broken("modifier = \"pv\"", "modifier = \"solar\"");
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("solar") && said.err.contains("pv"), "{}", said.err);
}

#[test]
fn a_demo_does_not_overwrite_what_is_not_ours() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let thesis = keep.path().join("thesis.txt");
    fs::write(&thesis, "years of work").expect("writes");
    let said = say(&["demo", keep.path().to_str().expect("a plain path")]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert_eq!(fs::read_to_string(thesis).expect("reads"), "years of work");
    assert_eq!(fs::read_dir(keep.path()).expect("reads").count(), 1);
}

/// A disk that takes no more: the kernel refuses every write beyond a file size, as a full disk
/// refuses it (EFBIG for ENOSPC). The run fails with the file's name; with room again it goes on
/// and ends with the bytes of a run that never failed.
#[test]
fn a_disk_that_takes_no_more_loses_nothing() {
    let (_keep, whole) = project("tiny");
    succeed(&["run", whole.to_str().expect("a plain path"), "--quiet"]);
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    let program = env!("CARGO_BIN_EXE_glintmap");
    let mut failed = 0;
    for blocks in [1, 8, 24, 64] {
        let script =
            format!("trap '' XFSZ; ulimit -f {blocks}; exec '{program}' run '{path}' --quiet");
        let output = Command::new("bash").args(["-c", &script]).output().expect("bash starts");
        let err = String::from_utf8_lossy(&output.stderr).into_owned();
        match output.status.code() {
            Some(0) => {}
            Some(1) => {
                failed += 1;
                assert!(err.contains(path) || err.contains("run/"), "names no file: {err}");
            }
            other => panic!("exit {other:?} with {blocks} blocks: {err}"),
        }
    }
    assert!(failed > 0, "no limit was small enough");
    succeed(&["run", path, "--quiet"]);
    assert_eq!(hashes(&whole), hashes(&folder));
}
