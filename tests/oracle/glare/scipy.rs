//! Held against SciPy, one Python process for all volumes.

use std::fs;
use std::path::Path;
use std::process::Command;

use glintmap::glare::Kernel;

use super::{Case, random_case, run, same_bits, shaped_cases};
use crate::support;

fn write_volumes(folder: &Path, cases: &[Case]) {
    let list: Vec<serde_json::Value> = cases
        .iter()
        .enumerate()
        .map(|(number, case)| {
            let numbers: Vec<usize> =
                case.segments.iter().enumerate().flat_map(|(i, s)| vec![i % 2; s.len()]).collect();
            serde_json::json!({
                "number": number,
                "shape": case.volume.shape,
                "threshold": case.settings.threshold,
                "sigma": case.settings.sigma,
                "truncate": case.settings.truncate,
                "connectivity": case.settings.connectivity.neighbours(),
                "segments": numbers,
            })
        })
        .collect();
    fs::write(folder.join("cases.json"), serde_json::to_string(&list).unwrap()).unwrap();
    for (number, case) in cases.iter().enumerate() {
        let bytes: Vec<u8> = case.volume.data.iter().flat_map(|v| v.to_le_bytes()).collect();
        fs::write(folder.join(format!("{number}.f32")), bytes).unwrap();
    }
}

fn words(path: &Path) -> Vec<[u8; 4]> {
    fs::read(path).unwrap().as_chunks().0.to_vec()
}

#[test]
fn volumes_give_the_integers_and_the_bits_of_scipy() {
    let Some(python) = support::python() else { return };
    let mut cases: Vec<Case> = (0..1600).map(random_case).collect();
    cases.extend(shaped_cases());
    let folder = tempfile::tempdir().unwrap();
    write_volumes(folder.path(), &cases);
    let sigmas = "0.3 0.5 0.7 1.0 1.5 2.0 2.3 3.0 5.0 20.0 40.0";
    fs::write(folder.path().join("sigmas.txt"), sigmas).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/glare_cases.py");
    let status = Command::new(python).arg(script).arg(folder.path()).status().unwrap();
    assert!(status.success());

    let (mut skipped, mut events, mut differing) = (0, 0, 0_usize);
    for (number, case) in cases.iter().enumerate() {
        let read = |name: &str| words(&folder.path().join(format!("{number}.{name}")));
        let (analysis, filtered) = run(case, None);
        let reference: Vec<f32> =
            read("filtered.f32").into_iter().map(f32::from_le_bytes).collect();
        assert_eq!(filtered.len(), reference.len(), "{}", case.name);
        let exact = case.settings.sigma.iter().all(|s| [0.0, 0.1, 1.0].contains(s));
        let unequal = filtered.iter().zip(&reference).filter(|(a, b)| !same_bits(**a, **b)).count();
        if exact {
            assert_eq!(unequal, 0, "{}", case.name);
        } else {
            differing += unequal;
            for (a, b) in filtered.iter().zip(&reference) {
                let close = (a - b).abs() <= 2e-7 * b.abs().max(1e-30);
                assert!(same_bits(*a, *b) || close, "{}: {a} {b}", case.name);
            }
            let threshold = case.settings.threshold as f32;
            if unequal > 0 && reference.iter().any(|v| (v - threshold).abs() <= 1e-6 * threshold) {
                skipped += 1;
                continue;
            }
        }
        let maps: Vec<i32> = read("maps.i32").into_iter().map(i32::from_le_bytes).collect();
        let found = [&analysis.cumulative, &analysis.sustained, &analysis.longest_run];
        for (name, (found, expected)) in ["cumulative", "sustained", "longest run"]
            .iter()
            .zip(found.iter().zip(maps.chunks_exact(maps.len() / 3)))
        {
            assert!(found.data() == expected, "{name} of {}", case.name);
        }
        let text = fs::read_to_string(folder.path().join(format!("{number}.events.json")));
        let expected: Vec<serde_json::Value> = serde_json::from_str(&text.unwrap()).unwrap();
        let found: Vec<serde_json::Value> = (analysis.events.iter())
            .map(|e| {
                serde_json::json!({
                    "first": e.first, "last": e.last, "voxels": e.voxels, "pixels": e.pixels
                })
            })
            .collect();
        assert_eq!(found, expected, "events of {}", case.name);
        events += found.len();
        let nonfinite = case.volume.data.iter().filter(|v| !v.is_finite()).count() as u64;
        assert_eq!(analysis.nonfinite, nonfinite);
    }
    eprintln!(
        "{} volumes, {events} events; at other sigmas than 1 {differing} voxels differ in the last bit, {skipped} volumes skipped because of them",
        cases.len()
    );
    assert!(events > 90_000, "the volumes have become too easy: {events} events");
    assert!(skipped < cases.len() / 50, "{skipped} volumes were not compared");
    compare_kernels(folder.path());
}

/// At most one bit between numpy's weights and ours, and none at sigma 1.
fn compare_kernels(folder: &Path) {
    let text = fs::read_to_string(folder.join("kernels.json")).unwrap();
    let kernels: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    for (sigma, expected) in kernels {
        let kernel = Kernel::gaussian('t', sigma.parse().unwrap(), 4.0).unwrap();
        let expected: Vec<u64> = serde_json::from_value(expected).unwrap();
        assert_eq!(kernel.weights().len(), expected.len(), "sigma {sigma}");
        let apart = |(w, e): (&f64, &u64)| w.to_bits().abs_diff(*e);
        let worst = kernel.weights().iter().zip(&expected).map(apart).max().unwrap();
        eprintln!("sigma {sigma}: weights differ from numpy's by at most {worst} ulp");
        assert!(worst <= if sigma == "1.0" { 0 } else { 2 }, "sigma {sigma}");
    }
}
