#![allow(dead_code)]
//! What tests share: where real data and Python lie, and how a test says that it was skipped.

#[path = "../../tools/src/compare/mod.rs"]
pub mod compare;
pub mod golden;
pub mod outputs;
pub mod photons;
pub mod program;
pub mod series;
pub mod yard;

use std::path::PathBuf;
use std::time::Duration;

/// The folder of real inputs (`GLINTMAP_DATA`, else `../shared/data` beside the project).
pub fn data_dir() -> PathBuf {
    std::env::var_os("GLINTMAP_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    )
}

/// One file of [`data_dir`], or `None` (and the test counted as skipped) where it is missing.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = data_dir().join(name);
    if path.exists() {
        return Some(path);
    }
    skip(&format!("{} is missing (set GLINTMAP_DATA)", path.display()));
    None
}

/// A Python that has the packages of tools/requirements.txt (`GLINTMAP_PYTHON`), or `None` (and
/// the test counted as skipped).
pub fn python() -> Option<PathBuf> {
    let found = std::env::var_os("GLINTMAP_PYTHON").map(PathBuf::from);
    if found.is_none() {
        skip("GLINTMAP_PYTHON is not set; `tools/test` sets it");
    }
    found
}

/// CPU time of the calling thread: how long something takes whatever else the machine does.
pub fn cpu_time() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(now).expect("not negative")
}

/// Counts the calling test as skipped: a line in the file that `GLINTMAP_SKIPS` names.
///
/// # Panics
/// Where `GLINTMAP_SKIPS` is `deny`, as in CI.
pub fn skip(why: &str) {
    let test = std::thread::current().name().unwrap_or("?").to_owned();
    eprintln!("SKIPPED {test}: {why}");
    match std::env::var("GLINTMAP_SKIPS") {
        Ok(word) if word == "deny" => panic!("{test} must not be skipped here: {why}"),
        Ok(file) => {
            use std::io::Write;
            let line = format!("{test}: {why}\n");
            let opened = std::fs::OpenOptions::new().create(true).append(true).open(file);
            opened
                .and_then(|mut f| f.write_all(line.as_bytes()))
                .expect("GLINTMAP_SKIPS is writable");
        }
        Err(_) => {}
    }
}
