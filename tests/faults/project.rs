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
    ] {
        let said = broken(from, to);
        assert_eq!(said.code, 2, "{from} -> {to}: {}", said.err);
        assert!(said.err.contains(word), "{from} -> {to}: {}", said.err);
    }
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

/// Eight mistakes of different kinds, each with its line and column, told at once: of TOML's
/// types, misspelt keys and words, numbers out of range, names that lead nowhere, files.
#[test]
fn all_mistakes_are_told_at_once_with_their_places() {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let mut text = fs::read_to_string(&file).expect("reads");
    let mut expected = Vec::new();
    for (from, to, at, words) in [
        ("latitude = 47.038", "latitude = 97.038", "97.038", "-90 to 90 degrees north"),
        ("meridian = 15.0", "meridian = \"east\"", "\"east\"", "expected a number"),
        ("\"scene.rad\"", "\"scene.rad\", \"gone.rad\"", "[\"scene.rad\"", "gone.rad"),
        ("sun = \"gensky-2018\"", "sun = \"moon\"", "\"moon\"", "\"spa\""),
        ("material = \"tile\"", "material = \"tiles\"", "\"tiles\"", "there are: standard, tile"),
        ("stored =", "storred =", "storred", "did you mean `stored`"),
        ("bandwidth = 50", "bandwidth = 1", "1\nseries", "expected 2 to"),
        ("object = \"wall\"", "object = \"wall\"\nview = \"pan\"", "[[region]]", "without `view`"),
        ("class = \"outdoor\"", "class = \"outdor\"", "\"outdor\"", "\"outdoor\""),
        ("connectivity = 6", "connectivity = 7", "7\nrules", "6, 18 or 26"),
    ] {
        assert!(text.contains(from), "the tiny project has no `{from}`");
        text = text.replacen(from, to, 1);
        expected.push((at, words));
    }
    fs::write(&file, &text).expect("writes");
    let path = folder.to_str().expect("a plain path");
    let said = say(&["run", path, "--quiet"]);
    assert_eq!(said.code, 2, "{}", said.err);
    let place = |at: &str| {
        let before = &text[..text.find(at).expect("is there")];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    };
    for (at, words) in &expected {
        let (line, column) = place(at);
        let start = format!("project.toml:{line}:{column}: ");
        let found = said.err.lines().any(|l| l.contains(&start) && l.contains(words));
        assert!(found, "{start}…{words}: {}", said.err);
    }
    assert_eq!(said.err.lines().count(), expected.len(), "{}", said.err);

    let said = say(&["run", path, "--quiet", "--json"]);
    let line: serde_json::Value = serde_json::from_str(said.err.trim()).expect("one line of JSON");
    let list = line["mistakes"].as_array().expect("a list");
    assert_eq!(list.len(), expected.len(), "{line}");
    for (at, words) in &expected {
        let (row, column) = place(at);
        let found = |m: &serde_json::Value| {
            m["line"] == row
                && m["column"] == column
                && m["message"].to_string().contains(words.replace('"', "\\\"").as_str())
        };
        assert!(list.iter().any(found), "{row}:{column} {words}: {line}");
    }
}

#[test]
fn a_mistake_names_the_assignment_that_makes_it() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    for (set, words) in [
        ("time.sun=\"moon\"", "\"spa\""),
        ("view.plan.size=[0, 5]", "0 x 5"),
        ("site.latitude=95", "-90 to 90"),
        ("view.pan.size=[5, 5]", "there are: plan"),
    ] {
        let said = say(&["run", path, "--quiet", "--set", set]);
        assert_eq!(said.code, 2, "{}", said.err);
        let start = format!("with --set {set}: ");
        assert!(said.err.contains(&start) && said.err.contains(words), "{set}: {}", said.err);
    }
    // What the file itself has wrong keeps its line.
    let file = folder.join("project.toml");
    let text = fs::read_to_string(&file).expect("reads");
    fs::write(&file, text.replace("bounces = 1", "bounces = 2")).expect("writes");
    let said = say(&["run", path, "--quiet", "--set", "site.latitude=95"]);
    let lines: Vec<&str> = said.err.lines().collect();
    assert!(lines.len() == 2 && lines[0].contains("with --set"), "{}", said.err);
    assert!(lines[1].contains("project.toml:") && lines[1].contains("bounces"), "{}", said.err);
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
