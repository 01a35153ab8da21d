//! The program as its users start it, in a folder of its own.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

/// The project's root.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The program with arguments, not started yet.
pub fn glintmap<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_glintmap"));
    command.args(arguments);
    command
}

/// What a finished program said.
pub struct Said {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl From<Output> for Said {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

/// Runs the program to its end.
pub fn say<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Said {
    glintmap(arguments).output().expect("the program starts").into()
}

/// A project of these few pixels and suns takes seconds; one that takes longer hangs, however busy
/// the machine is.
const LONGEST: Duration = Duration::from_secs(1200);

/// Runs the program, at most for [`LONGEST`].
pub fn within(arguments: &[&str]) -> Said {
    let mut command = glintmap(arguments);
    command.env("RUST_BACKTRACE", "0").stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().expect("the program starts");
    let id = child.id();
    let (done, finished) = mpsc::channel();
    thread::spawn(move || done.send(child.wait_with_output()));
    match finished.recv_timeout(LONGEST) {
        Ok(output) => output.expect("the program ends").into(),
        Err(_) => {
            let _ = Command::new("kill").arg(id.to_string()).status();
            panic!("{arguments:?} has not ended after {LONGEST:?}")
        }
    }
}

/// Runs the program and expects it to succeed.
pub fn succeed<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Said {
    let said = say(arguments);
    assert_eq!(said.code, 0, "stderr: {}", said.err);
    said
}

/// Runs the program and ends it, as SIGKILL would, at a counted step of its work: `"7"`, or
/// `"2 photons.gmp"` (see `glintmap_formats::fault`). Whether it came so far; else it succeeded.
pub fn killed_at<S: AsRef<std::ffi::OsStr>>(arguments: &[S], step: &str) -> bool {
    let fault = format!("abort {step}");
    let output = glintmap(arguments).env("GLINTMAP_FAULT", fault).output();
    let output = output.expect("the program starts");
    let killed = output.status.signal().is_some();
    assert!(
        killed || output.status.success(),
        "killed at {step}: {}, stderr: {}",
        output.status,
        String::from_utf8_lossy(&output.stderr)
    );
    killed
}

/// A copy of a project under fixtures/projects in a temporary folder.
pub fn project(name: &str) -> (tempfile::TempDir, PathBuf) {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let folder = keep.path().join(name);
    copy(&root().join("fixtures/projects").join(name), &folder);
    (keep, folder)
}

pub fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("makes a folder");
    for entry in fs::read_dir(from).expect("reads a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).expect("copies");
        }
    }
}

/// BLAKE3 of every file below `run/` except `run/log/`, by its name.
pub fn hashes(project: &Path) -> BTreeMap<String, String> {
    let run = project.join("run");
    let mut out = BTreeMap::new();
    walk(&run, &run, &mut out);
    out
}

fn walk(run: &Path, at: &Path, out: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(at).unwrap_or_else(|e| panic!("{}: {e}", at.display())) {
        let path = entry.expect("an entry").path();
        if path == run.join("log") {
            continue;
        }
        if path.is_dir() {
            walk(run, &path, out);
        } else {
            let name = path.strip_prefix(run).expect("below run").to_string_lossy().into_owned();
            let bytes = fs::read(&path).expect("reads");
            out.insert(name, blake3::hash(&bytes).to_hex().to_string());
        }
    }
}
