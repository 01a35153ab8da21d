//! The case study's run, watched from outside: anonymous memory as the kernel counts it.

#![cfg(target_os = "linux")]

use std::fs;
use std::process::Stdio;
use std::time::Duration;

use crate::support::program::glintmap;

/// `RssAnon` of a process, bytes; `None` once it has ended.
fn anonymous_bytes(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

/// All 1,280 suns, both views, every stage up to glare, with fewer photons and pixels than the
/// draft. Neither makes it larger: they cost time and disk only.
#[test]
fn the_case_study_runs_in_less_than_a_gibibyte_of_anonymous_memory() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let folder = keep.path().join("church");
    let mut arguments = vec!["demo", folder.to_str().expect("a plain path"), "--quiet"];
    arguments.extend(["--until", "glare"]);
    for set in [
        "photons.stored=20000",
        "view.plan.size=[80, 80]",
        "view.panorama.size=[160, 40]",
        "glare.thresholds_w_m2=[10.0]",
    ] {
        arguments.extend(["--set", set]);
    }
    let mut child = glintmap(&arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::inherit())
        .spawn()
        .expect("the program starts");
    let (mut most, mut looks) = (0, 0);
    let status = loop {
        if let Some(status) = child.try_wait().expect("asks") {
            break status;
        }
        if let Some(bytes) = anonymous_bytes(child.id()) {
            most = most.max(bytes);
            looks += 1;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(status.success(), "{status}");
    println!("{} MiB of anonymous memory at most, seen in {looks} looks", most >> 20);
    assert!(looks > 50, "it was hardly looked at: {looks} times");
    assert!(most > 4 << 20, "{most} bytes: that was not the program");
    assert!(most < 1 << 30, "{} MiB of anonymous memory", most >> 20);
}
