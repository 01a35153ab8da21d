//! Rays of our views against Radiance's `vwrays`, and back through `project`.

use std::path::PathBuf;
use std::process::Command;

use glam::{DVec3, dvec3};
use glintmap::render::View;

use crate::support;

const VIEWS: [&str; 13] = [
    "-vtv -vp 1 2 3 -vd 0.3 1 -0.2 -vu 0 0 1 -vh 60 -vv 45",
    "-vtv -vp 1 2 3 -vd 0 2 0 -vu 0.1 0 1 -vh 120 -vv 90 -vs 0.25 -vl -0.5 -vo 1.5 -va 20",
    "-vtl -vp 0 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 200 -vv 150",
    "-vtl -vp 10 -20 200 -vd 0.2 0.1 -1 -vu 0 1 0 -vh 200 -vv 150 -vo 30 -va 250 -vs 0.1 -vl 0.2",
    "-vth -vp 0 0 1.5 -vd 1 1 1 -vu 0 0 1 -vh 180 -vv 180",
    "-vth -vp 0 0 1.5 -vd 1 1 0.1 -vu 0 0 1 -vh 120 -vv 90 -vo 2 -va 9 -vl 0.1",
    "-vta -vp 5 0 1.5 -vd 0 0 1 -vu 0 1 0 -vh 180 -vv 180",
    "-vta -vp 5 0 1.5 -vd 0 1 0 -vu 0 0 1 -vh 360 -vv 360 -vo 0.5 -va 9",
    "-vta -vp 5 0 1.5 -vd 0 1 0 -vu 0 0 1 -vh 90 -vv 60 -vs 0.3",
    "-vtc -vp 0 0 20 -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 60 -vo 8",
    "-vtc -vp 0 0 20 -vd 0.5 -1 0.3 -vu 0 0.2 1 -vh 180 -vv 90 -vo 1 -va 30 -vs -0.2 -vl 0.1",
    "-vts -vp 0 0 1 -vd 0 0 1 -vu 0 1 0 -vh 180 -vv 180",
    "-vts -vp 0 0 1 -vd 0 1 0.5 -vu 0 0 1 -vh 270 -vv 200 -vo 2 -va 7 -vs 0.1",
];

const SIZES: [(usize, usize); 2] = [(64, 48), (33, 51)];

fn vwrays() -> Option<PathBuf> {
    let python = support::python()?;
    let script = "import os, pyradiance; print(os.path.dirname(pyradiance.__file__))";
    let out = Command::new(python).args(["-c", script]).output().expect("python starts");
    let folder = String::from_utf8(out.stdout).expect("a path");
    let binary = PathBuf::from(folder.trim()).join("bin/vwrays");
    if !binary.exists() {
        support::skip("pyradiance has no vwrays");
        return None;
    }
    Some(binary)
}

#[test]
fn rays_are_those_of_vwrays() {
    let Some(binary) = vwrays() else { return };
    for options in VIEWS {
        for (columns, rows) in SIZES {
            let view = View::parse(options, columns, rows).expect(options);
            let out = Command::new(&binary)
                .args(["-fd", "-pa", "0", "-x", &columns.to_string(), "-y", &rows.to_string()])
                .args(options.split(' '))
                .output()
                .expect("vwrays starts");
            assert_eq!(out.stdout.len(), columns * rows * 48, "{options}: {out:?}");
            let values: Vec<f64> = out
                .stdout
                .chunks_exact(8)
                .map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes")))
                .collect();
            let mut misses = 0;
            for (i, v) in values.chunks_exact(6).enumerate() {
                let (column, row) = (i % columns, i / columns);
                let origin = dvec3(v[0], v[1], v[2]);
                let way = dvec3(v[3], v[4], v[5]);
                let ours = view.ray(column, row);
                if way == DVec3::ZERO {
                    assert_eq!(ours, None, "{options} at {column}, {row}");
                    misses += 1;
                    continue;
                }
                let ours = ours.unwrap_or_else(|| panic!("{options} at {column}, {row}: no ray"));
                // vwrays gives directions the length up to the aft plane, where there is one.
                let length = if ours.limit_m.is_finite() { ours.limit_m } else { 1.0 };
                let apart = (ours.origin - origin).abs().max((ours.direction * length - way).abs());
                assert!(
                    apart.max_element() < 1e-5,
                    "{options} at {column}, {row}: {ours:?}, vwrays {origin} {way}"
                );
            }
            assert!(misses < columns * rows / 2, "{options}: mostly nothing to compare");
        }
    }
}

/// What `view_file` reads: the header of a picture, and a view file; Radiance reads the same file.
#[test]
fn views_of_files_are_those_of_vwrays() {
    let Some(binary) = vwrays() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let (columns, rows) = (12, 9);
    for (number, options) in VIEWS.iter().enumerate() {
        let picture = format!(
            "#?RADIANCE\nrpict -vp 7 7 7 -ab 2 scene.oct\nVIEW= {options}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n    "
        );
        let path = folder.path().join(format!("{number}.hdr"));
        std::fs::write(&path, &picture).expect("writes");
        let view = View::from_file(picture.as_bytes(), columns, rows).expect("reads");
        let out = Command::new(&binary)
            .args(["-fd", "-pa", "0", "-x", &columns.to_string(), "-y", &rows.to_string(), "-vf"])
            .arg(&path)
            .output()
            .expect("vwrays starts");
        assert_eq!(out.stdout.len(), columns * rows * 48, "{options}: {out:?}");
        for (i, ray) in out.stdout.chunks_exact(48).enumerate() {
            let v: Vec<f64> = ray
                .chunks_exact(8)
                .map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes")))
                .collect();
            let way = dvec3(v[3], v[4], v[5]);
            let ours = view.ray(i % columns, i / columns);
            assert_eq!(ours.is_none(), way == DVec3::ZERO, "{options}");
            let Some(ours) = ours else { continue };
            let apart = (ours.direction - way.normalize()).abs().max_element();
            let origin = (ours.origin - dvec3(v[0], v[1], v[2])).abs().max_element();
            assert!(apart < 1e-5 && origin < 1e-5, "{options} at {i}: {ours:?}, vwrays {v:?}");
        }
    }
}

#[test]
fn points_on_rays_are_projected_back_to_their_pixels() {
    for options in VIEWS {
        for (columns, rows) in SIZES {
            let view = View::parse(options, columns, rows).expect(options);
            let mut met = 0;
            for row in 0..rows {
                for column in 0..columns {
                    let Some(ray) = view.ray(column, row) else { continue };
                    let along = if ray.limit_m.is_finite() { 0.7 * ray.limit_m } else { 3.0 };
                    let (x, y) = view
                        .project(ray.origin + ray.direction * along)
                        .unwrap_or_else(|| panic!("{options} at {column}, {row}: not seen"));
                    let expected = (column as f64 + 0.5, row as f64 + 0.5);
                    assert!(
                        (x - expected.0).abs() < 1e-6 && (y - expected.1).abs() < 1e-6,
                        "{options} at {column}, {row}: {x}, {y}"
                    );
                    let point = ray.origin + ray.direction * along;
                    assert_eq!(view.pixel_of(point), Some((column, row)));
                    // Cut off before the fore plane and behind the aft plane.
                    if (ray.origin - view.point()).length() > 0.01 {
                        let before = ray.origin - ray.direction * 1e-3;
                        assert_eq!(view.project(before), None, "{options}");
                    }
                    if ray.limit_m.is_finite() {
                        let beyond = ray.origin + ray.direction * (ray.limit_m + 1e-3);
                        assert_eq!(view.project(beyond), None, "{options}");
                    }
                    met += 1;
                }
            }
            assert!(met > columns * rows / 2);
        }
    }
}
