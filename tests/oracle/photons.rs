//! Where our photons land against where those of Radiance's `mkpmap` land.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glintmap::bsdf::Model;
use glintmap::trace::Emission;

use crate::physics::trace::{Scene, bsdf, horizontal, settings, sun, timeline, trace, wall};
use crate::support;

pub(super) fn radiance() -> Option<PathBuf> {
    let python = support::python()?;
    let script = "import os, pyradiance; print(os.path.dirname(pyradiance.__file__))";
    let out = Command::new(python).args(["-c", script]).output().expect("python starts");
    let folder = PathBuf::from(String::from_utf8(out.stdout).expect("a path").trim());
    if !folder.join("bin/mkpmap").exists() {
        support::skip("pyradiance has no mkpmap");
        return None;
    }
    Some(folder)
}

pub(super) fn run(radiance: &Path, folder: &Path, command: &[&str]) -> Vec<u8> {
    let out = Command::new(radiance.join("bin").join(command[0]))
        .args(&command[1..])
        .current_dir(folder)
        .env("RAYPATH", format!(".:{}", radiance.join("lib").display()))
        .env("PATH", format!("{}:/usr/bin:/bin", radiance.join("bin").display()))
        .output()
        .expect("starts");
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

/// Cells of the scene, m: ground and walls fall into different ones.
const CELL_M: f64 = 0.75;

type Cells = BTreeMap<[i32; 3], [f64; 2]>;

/// Adds a photon to its cell: the flux, and its square.
fn add(cells: &mut Cells, [x, y, z]: [f64; 3], flux: f64) {
    let ground = z < 0.01;
    let cell = |v: f64| libm::floor(v / CELL_M) as i32;
    // A wall's photons lie on its plane, to the left or right of it by rounding.
    let key =
        if ground { [cell(x), cell(y), -1] } else { [cell(x + 0.5 * CELL_M), cell(y), cell(z)] };
    let sums = cells.entry(key).or_default();
    sums[0] += flux;
    sums[1] += flux * flux;
}

#[test]
fn photons_land_where_mkpmap_sends_them() {
    let Some(radiance) = radiance() else { return };
    let suns: Vec<_> = [(100.0, 20.0), (150.0, 45.0), (200.0, 60.0), (250.0, 35.0), (290.0, 25.0)]
        .iter()
        .map(|&(azimuth, elevation)| (sun(azimuth, elevation), 340.0))
        .collect();
    let (ground, left, right) = (
        horizontal([-60.0, 60.0], [-60.0, 60.0], 0.0),
        wall(-12.0, [-15.0, 15.0], [0.0, 8.0]),
        wall(6.0, [-6.0, 6.0], [0.0, 9.0]),
    );
    let roof = [[-2.0, -2.0, 6.0], [2.0, -2.0, 6.0], [2.0, 2.0, 6.75], [-2.0, 2.0, 6.75]];
    let site = Scene::new().pv(roof, false).quad(ground).quad(left).quad(right).site();
    let timeline = timeline(&suns);
    let tile = bsdf(Model::Lambertian { reflectance: 0.5 });
    let emission = Emission {
        site: &site,
        timeline: &timeline,
        bsdfs: vec![&tile],
        settings: settings(60_000),
    };
    let (_, photons, _) = trace(&emission);
    let mut ours = Cells::new();
    for p in &photons {
        let [x, y, z] = p.position.to_array().map(f64::from);
        add(&mut ours, [x, y, z], f64::from(p.flux_w));
    }

    let keep = tempfile::tempdir().expect("a temporary folder");
    let mut scene = String::from(
        "void plastic grey 0 0 5 .25 .25 .25 0 0\nvoid plastic pv 0 0 5 .5 .5 .5 0 0\n",
    );
    for (modifier, name, corners) in
        [("grey", "a", ground), ("grey", "b", left), ("grey", "c", right), ("pv", "d", roof)]
    {
        write!(scene, "{modifier} polygon {name} 0 0 12").unwrap();
        corners.iter().flatten().for_each(|v| write!(scene, " {v}").unwrap());
        scene.push('\n');
    }
    for (i, (sun, _)) in suns.iter().enumerate() {
        writeln!(scene, "void light l{i} 0 0 3 5e6 5e6 5e6").unwrap();
        writeln!(scene, "l{i} source s{i} 0 0 4 {} {} {} .533", sun.x, sun.y, sun.z).unwrap();
    }
    fs::write(keep.path().join("scene.rad"), scene).unwrap();
    let octree = run(&radiance, keep.path(), &["oconv", "scene.rad"]);
    fs::write(keep.path().join("scene.oct"), octree).unwrap();
    // With its default of 1,000 mkpmap takes each sun's flux from one sample of the disc.
    let command =
        "mkpmap -n 1 -fo+ -apC map.pm 60000 -apo- pv -lr 1 -ld 100 -t 0 -dp 1e6 scene.oct";
    run(&radiance, keep.path(), &command.split(' ').collect::<Vec<_>>());
    let listed = run(&radiance, keep.path(), &["pmapdump", "-a", "-n", "1000k", "-f", "map.pm"]);
    let mut theirs = Cells::new();
    let mut count = 0;
    for line in String::from_utf8(listed).expect("text").lines() {
        let words: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        add(&mut theirs, [words[0], words[1], words[2]], words[3]);
        count += 1;
    }
    assert!(count > 30_000, "{count} photons");

    // Shares of the flux: mkpmap's own scale plays no part.
    let whole = |cells: &Cells| cells.values().map(|c| c[0]).sum::<f64>();
    let (our_w, their_w) = (whole(&ours), whole(&theirs));
    let (mut chi, mut degrees) = (0.0, 0.0_f64);
    for (cell, [flux, squares]) in &theirs {
        // Fewer than 25 photons tell little.
        if flux * flux < 25.0 * squares {
            continue;
        }
        let found = ours.get(cell).copied().unwrap_or_default();
        let (a, b) = (found[0] / our_w, flux / their_w);
        let variance = found[1] / (our_w * our_w) + squares / (their_w * their_w);
        chi += (a - b).powi(2) / variance;
        degrees += 1.0;
    }
    println!("{} and {count} photons, chi2 {chi:.0} over {degrees} cells", photons.len());
    assert!(degrees > 100.0, "{degrees} cells");
    // One in a thousand lies above by chance: normal approximation, 3.1 sigma.
    let limit = degrees + 3.1 * (2.0 * degrees).sqrt();
    assert!(chi < limit, "chi2 {chi} over {degrees} cells, above {limit}");
}
