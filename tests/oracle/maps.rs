//! Annual map and timesteps against Radiance's rtrace and rcontrib: the same scene, the same BSDF
//! file, the same suns, photons of its own.

use std::path::Path;
use std::process::Command;

use crate::support;

/// `tools/bench/compare_maps.py` with few photons: a z-test for each block of pixels.
#[test]
fn rtrace_and_rcontrib_find_the_same_maps() {
    let Some(python) = support::python() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/bench/compare_maps.py");
    let said = Command::new(python)
        .arg(script)
        .args(["--glintmap", env!("CARGO_BIN_EXE_glintmap")])
        .args(["--photons", "100000", "--suns", "20", "--most", "0.12"])
        .output()
        .expect("Python starts");
    let text = String::from_utf8_lossy(&said.stdout);
    println!("{text}");
    assert!(said.status.success(), "{text}{}", String::from_utf8_lossy(&said.stderr));
}
