//! The run folder over time: interrupted, changed, cleaned.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::support::program::{Said, glintmap, hashes, project, succeed};

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn made(said: &Said) -> Vec<String> {
    let summary: serde_json::Value = serde_json::from_str(&said.out).expect("one JSON document");
    let list = summary["made"].as_array().expect("a list");
    list.iter().filter_map(|m| m.as_str().map(str::to_owned)).collect()
}

#[test]
fn interrupted_it_says_so_and_the_same_command_goes_on() {
    let (_keep, whole) = project("tiny");
    let until = ["--until", "pages"];
    succeed(&[&["run", text(&whole)][..], &until[..]].concat());
    let (_keep, folder) = project("tiny");
    // While it traces it is held, until the signal has come through.
    let mut child = glintmap(&[&["run", text(&folder)][..], &until[..]].concat())
        .env("GLINTMAP_FAULT", "hold 1 tracing")
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let suns = folder.join("run/suns.csv");
    while !suns.exists() {
        assert!(child.try_wait().expect("asks").is_none(), "it ended before the signal");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.expect("kill starts").success());
    let mut err = BufReader::new(child.stderr.take().expect("piped"));
    let mut said = String::new();
    while !said.contains("stopping") {
        assert!(err.read_line(&mut said).expect("reads") > 0, "it ended unimpressed: {said}");
    }
    drop(child.stdin.take());
    let code = child.wait().expect("waits").code();
    err.read_to_string(&mut said).expect("reads");
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("run the same command again"), "{said}");
    succeed(&[&["run", text(&folder)][..], &until[..]].concat());
    assert_eq!(hashes(&whole), hashes(&folder));
}

#[test]
fn another_reference_leaves_no_picture_of_the_old_one() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    succeed(&["run", path, "--quiet"]);
    assert!(folder.join("run/standard/plan/ratio.exr").exists());
    let other = "reference.material=\"standard\"";
    let said = succeed(&["run", path, "--quiet", "--json", "--set", other]);
    assert_eq!(made(&said), ["pictures", "verdicts", "report"]);
    assert!(!folder.join("run/standard/plan/ratio.exr").exists());
    assert!(!folder.join("run/standard/plan/ratio.png").exists());
    assert!(folder.join("run/tile/plan/ratio.exr").exists());
}

/// Materials that swap their names swap their results, though each set of numbers is there.
#[test]
fn names_decide_about_maps_and_pictures() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    succeed(&["run", path, "--quiet"]);
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    fs::write(&file, before.replace("name = \"standard\"", "name = \"planned\"")).expect("writes");
    let said = succeed(&["run", path, "--quiet", "--json"]);
    for unit in ["trace planned", "render planned plan", "pictures", "report"] {
        assert!(made(&said).iter().any(|m| m == unit), "{unit}: {:?}", made(&said));
    }
    assert!(folder.join("run/planned/plan/annual.png").exists());
}

#[test]
fn a_changed_scene_is_traced_anew_and_changed_rules_only_reported() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    let all = made(&succeed(&["run", path, "--quiet", "--json"]));
    let rules = "glare.rules=[\"paper-2018\", \"de-lai-2015\"]";
    let said = succeed(&["run", path, "--quiet", "--json", "--set", rules]);
    assert_eq!(made(&said), ["verdicts", "report"]);
    let scene = folder.join("scene.rad");
    let text = fs::read_to_string(&scene).expect("reads");
    fs::write(&scene, text + "\n# moved\n").expect("writes");
    let again = made(&succeed(&["run", path, "--quiet", "--json"]));
    let without_suns: Vec<&String> = all.iter().filter(|u| *u != "suns").collect();
    assert_eq!(again.iter().collect::<Vec<_>>(), without_suns);
}

/// The old results of a unit are forgotten before the first byte of the new ones: stopped in
/// between and set back, the run makes it again and doesn't take the half for the whole.
#[test]
fn stopped_between_two_settings_nothing_is_mixed() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    succeed(&["run", path, "--quiet"]);
    let expected = hashes(&folder);
    // The new series can't be written: its folder is taken by a file.
    let manifest = || fs::read_to_string(folder.join("run/manifest.json")).expect("reads");
    assert!(manifest().contains("render standard plan"));
    let script = "trap '' XFSZ; ulimit -f 4; exec \"$0\" \"$@\"";
    let failed = Command::new("bash")
        .args(["-c", script, env!("CARGO_BIN_EXE_glintmap"), "run", path, "--quiet"])
        .args(["--set", "view.plan.bandwidth=20"])
        .output()
        .expect("bash starts");
    assert_eq!(failed.status.code(), Some(1));
    succeed(&["run", path, "--quiet"]);
    assert_eq!(expected, hashes(&folder));
}

#[test]
fn clean_lists_and_removes_only_what_it_is_told_to() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    assert!(succeed(&["clean", path]).out.contains("nothing was made"));
    succeed(&["run", path, "--quiet"]);
    let expected = hashes(&folder);
    let mine = folder.join("run/standard/notes.txt");
    fs::write(&mine, "my notes").expect("writes");
    let listed = succeed(&["clean", path]);
    for word in ["trace", "pages", "render", "glare", "pictures", "report", "nothing was removed"] {
        assert!(listed.out.contains(word), "{word}: {}", listed.out);
    }
    // A threshold that is gone leaves its results behind; the other one's stay current.
    let one = ["--set", "glare.thresholds_w_m2=[10.0]"];
    let said = succeed(&[&["clean", path, "--remove", "left-over"][..], &one[..]].concat());
    assert!(said.out.contains("removed"), "{}", said.out);
    assert!(!folder.join("run/standard/plan/glare-30").join("cumulative.exr").exists());
    assert!(folder.join("run/standard/plan/glare-10/cumulative.exr").exists());
    assert_eq!(fs::read_to_string(&mine).expect("reads"), "my notes");
    succeed(&["clean", path, "--all"]);
    assert!(!folder.join("run/standard/photons.gmp").exists());
    assert_eq!(fs::read_to_string(&mine).expect("still there"), "my notes");
    fs::remove_file(&mine).expect("removes");
    succeed(&["run", path, "--quiet"]);
    assert_eq!(expected, hashes(&folder));
}

/// The manifest is a file like any other: what it names outside of `run/` isn't touched.
#[test]
fn a_manifest_that_names_other_peoples_files_removes_none() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    let thesis = folder.join("thesis.txt");
    fs::write(&thesis, "years of work").expect("writes");
    fs::create_dir_all(folder.join("run")).expect("makes");
    let units = format!(
        "{{\"program\":\"\",\"units\":{{\"suns\":{{\"key\":\"\",\"outputs\":{{\"../thesis.txt\":\"\",\"{}\":\"\"}}}}}}}}",
        thesis.display()
    );
    for arguments in [&["clean", path, "--all"][..], &["run", path, "--quiet", "--until", "suns"]] {
        fs::write(folder.join("run/manifest.json"), &units).expect("writes");
        succeed(arguments);
        assert_eq!(fs::read_to_string(&thesis).expect("still there"), "years of work");
    }
}

#[test]
fn report_makes_what_is_missing_and_prints_where_it_lies() {
    let (_keep, folder) = project("tiny");
    let said = succeed(&["report", text(&folder), "--quiet"]);
    let page = Path::new(said.out.trim());
    assert!(page.ends_with("run/report.html") && page.exists(), "{}", said.out);
}

#[test]
fn the_log_knows_command_means_and_end() {
    let (_keep, folder) = project("tiny");
    succeed(&["run", text(&folder), "--quiet", "--until", "suns", "--threads", "1"]);
    let log = fs::read_to_string(folder.join("run/log/run.jsonl")).expect("reads");
    let lines: Vec<serde_json::Value> =
        log.lines().map(|l| serde_json::from_str(l).expect("a JSON line")).collect();
    assert!(lines[0]["command"].to_string().contains("--until"), "{}", lines[0]);
    assert!(lines[0]["program"].is_string() && lines[0]["memory_bytes"].is_u64());
    assert!(lines.iter().any(|l| l["unit"] == "suns" && l["threads"] == 1));
    assert_eq!(lines.last().expect("lines")["ended"], "done");
}
