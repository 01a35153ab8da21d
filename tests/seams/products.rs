//! Every kind of material with every estimator and every kind of receiver, through the program, in
//! a yard where things hide each other. What was tried one by one must work together, too: the
//! first measured material on a scene with a fence stopped direct integration with a panic.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glintmap::picture::exr;
use glintmap::render::HitMap;
use glintmap::volume::Volume;
use serde_json::Value;

use crate::physics::bsdf_files::klems;
use crate::support::outputs::assert_sane;
use crate::support::program::succeed;
use crate::support::yard;

const ESTIMATORS: [&str; 3] = ["photons", "radiance", "direct"];

/// By name: one of each kind.
const MATERIALS: [(&str, &str); 11] = [
    ("lambertian", r#"model = { kind = "lambertian", reflectance = 0.3 }"#),
    (
        "coated",
        r#"model = { kind = "coated-glass", index = 1.52, ggx_alpha = 0.08, cell_reflectance = 0.04, coating = { index = 1.23, thickness_nm = 120.0 } }"#,
    ),
    ("smooth", r#"model = { kind = "coated-glass", index = 1.52, cell_reflectance = 0.04 }"#),
    ("glass", r#"model = { kind = "glass", index = 1.52 }"#),
    ("mirror", r#"model = { kind = "mirror", reflectance = 0.8 }"#),
    ("metal", r#"model = { kind = "metal", index = 1.4, extinction = 7.0, ggx_alpha = 0.1 }"#),
    (
        "rough",
        r#"model = { kind = "pv-glass", index = 1.52, ggx_alpha = 0.05, cell_reflectance = 0.04 }"#,
    ),
    (
        "mixture",
        r#"model = { kind = "mixture", parts = [{ share = 0.7, model = "standard" }, { share = 0.2, model = { kind = "mirror", reflectance = 0.6 } }] }"#,
    ),
    ("klems", r#"bsdf = "klems.xml""#),
    ("rank3", r#"bsdf = "rank3.xml""#),
    ("rank4", r#"bsdf = "rank4.xml""#),
];

const VIEWS: [(&str, &str, &str); 3] = [
    ("plan", "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 30", "[40, 30]"),
    ("perspective", "-vtv -vp -2 -14 9 -vd -0.5 1 -0.45 -vu 0 0 1 -vh 60 -vv 45", "[32, 24]"),
    ("angular", "-vta -vp 0 0 8 -vd -1 0 -0.3 -vu 0 0 1 -vh 180 -vv 180", "[24, 24]"),
];

/// Site, PV, materials and times; the scene and the files of the materials beside it.
fn begun(folder: &Path, stored: u32) -> String {
    yard::write(folder);
    let path = |name: &str| folder.join(name).to_str().expect("a plain path").to_owned();
    fs::write(folder.join("klems.xml"), klems("LBNL/Klems Quarter", " ")).expect("writes");
    let written = |from: &str, to: &str, resolution: &str, rank: &str| {
        let said = succeed(&["bsdf", from, "--write", &path(to), "--resolution", resolution]);
        assert!(said.out.contains(&format!("tensor tree of rank {rank}")), "{}", said.out);
    };
    written("standard", "rank3.xml", "5", "3");
    written(&path("klems.xml"), "rank4.xml", "3", "4");
    let mut text = "[site]\nname = \"Yard\"\nlatitude = 47.0\nlongitude = 8.0\nmeridian = 15.0\ntimezone = \"Europe/Zurich\"\n\n\
        [scene]\nfiles = [\"scene.rad\"]\n\n[[pv]]\nname = \"roof\"\nselect = { object = \"roof\" }\n\n"
        .to_owned();
    for (name, table) in MATERIALS {
        let _ = writeln!(text, "[[material]]\nname = \"{name}\"\n{table}\n");
    }
    let _ = writeln!(
        text,
        "[time]\ndays = {{ from = \"03-21\", to = \"06-21\", step = 92 }}\nhours = {{ from = 5.5, to = 19.5, step = 1.0 }}\n\n\
         [photons]\nstored = {stored}\n"
    );
    text
}

fn annual(run: &Path, material: &str, view: &str) -> Vec<f64> {
    let channels = exr::read(&run.join(material).join(view).join("annual.exr")).expect("reads");
    let grid = channels.get("annual.wh_m2").expect("a channel");
    grid.data().iter().map(|v| f64::from(*v)).collect()
}

/// Sums over a view by timestep.
fn by_timestep(run: &Path, material: &str, view: &str) -> Vec<f64> {
    let folder = run.join(material).join(view).join("series.zarr");
    let volume = Volume::open(&folder).expect("opens");
    let [timesteps, rows, columns] = volume.shape();
    let mut all = vec![0.0; timesteps * rows * columns];
    volume.read(0..timesteps, &mut all).expect("reads");
    all.chunks(rows * columns).map(|t| t.iter().map(|v| f64::from(*v)).sum()).collect()
}

/// Materials that throw a mirror image of the PV: its sharp edges run through pixels of a metre.
const SHARP: [&str; 4] = ["smooth", "glass", "mirror", "mixture"];

/// How many photons the discs of a plan hold that has a pixel for each square metre, none of them
/// counted twice.
fn photons_in_plan(run: &Path, material: &str) -> f64 {
    let path = run.join(material).join("plan-photons/annual.exr");
    let channels = exr::read(&path).expect("reads");
    let [annual, error, radius] = ["annual.wh_m2", "standard_error.wh_m2", "radius.m"]
        .map(|name| channels.get(name).expect(name).data());
    let lit = (0..annual.len()).filter(|i| annual[*i] > 0.0 && error[*i] > 0.0);
    lit.map(|i| {
        let [annual, error, radius] = [annual, error, radius].map(|all| f64::from(all[i]));
        (annual / error).powi(2) / (std::f64::consts::PI * radius * radius)
    })
    .sum()
}

#[test]
fn every_material_looks_alike_by_every_estimator_in_every_view() {
    let keep = tempfile::tempdir().expect("a folder");
    let folder = keep.path();
    let mut text = begun(folder, 60_000);
    for (name, options, size) in VIEWS {
        for estimator in ESTIMATORS {
            let _ = writeln!(
                text,
                "[[view]]\nname = \"{name}-{estimator}\"\nview = \"{options}\"\nsize = {size}\nestimator = \"{estimator}\"\n\
                 bandwidth = 50\nseries_bandwidth = 500\nmax_radius_m = 1.0\n"
            );
        }
    }
    fs::write(folder.join("project.toml"), text).expect("writes");
    succeed(&["run", folder.to_str().expect("a plain path"), "--quiet", "--until", "glare"]);
    let run = folder.join("run");
    assert_sane(&run);
    for (material, _) in MATERIALS {
        let sharp = SHARP.contains(&material);
        let photons = photons_in_plan(&run, material);
        for (view, _, _) in VIEWS {
            let of = |estimator: &str| format!("{view}-{estimator}");
            let totals = ESTIMATORS.map(|e| annual(&run, material, &of(e)).iter().sum::<f64>());
            let [counted, radiance, direct] = totals;
            let series = ["photons", "direct"].map(|e| by_timestep(&run, material, &of(e)));
            let whole: f64 = series[1].iter().sum();
            let apart: f64 = series[0].iter().zip(&series[1]).map(|(p, d)| (p - d).abs()).sum();
            let [off, off_radiance] = [counted, radiance].map(|total| total / direct - 1.0);
            println!(
                "{material:>10} {view:<12} {direct:9.0} photons {:+.1} % radiance {:+.1} %, by timestep {:.1} %, {photons:.0} photons",
                100.0 * off,
                100.0 * off_radiance,
                100.0 * apart / whole
            );
            // Four standard errors, and what discs of a metre and pixels of a metre miss of edges. Where
            // the view is a perspective, a few discs close to the camera fill much of the picture.
            let noise = 4.0 / photons.sqrt();
            let edges = if sharp { 0.1 } else { 0.04 };
            let allowed = noise + edges + if view == "plan" { 0.0 } else { 0.06 };
            assert!(direct > 0.0 && off.abs() < allowed, "{material}, {view}: {off} of {allowed}");
            // Radiance's rules count no edges: discs lose what hangs over them.
            assert!(off_radiance.abs() < allowed + 0.1, "{material}, {view}: {off_radiance}");
            // Times that were mixed up would be apart by more than 100 %.
            let most = if sharp { 0.6 } else { 0.3 };
            assert!(apart < most * whole, "{material}, {view}: {apart} of {whole}");
        }
    }
    // Behind the wall nothing arrives, by any of them.
    let (hits, _) = HitMap::read(&run.join("plan-direct/hits.gmh")).expect("reads");
    let behind = |i: &usize| {
        let at = hits.hits[*i].position;
        at.x < -15.5 && at.y.abs() < 10.0
    };
    let hidden: Vec<usize> = (0..hits.hits.len()).filter(behind).collect();
    assert!(hidden.len() > 50);
    for (material, _) in MATERIALS {
        for estimator in ESTIMATORS {
            let map = annual(&run, material, &format!("plan-{estimator}"));
            assert!(hidden.iter().all(|i| map[*i] == 0.0), "{material}, {estimator}");
        }
    }
}

const RECEIVERS: &str = r#"
[[observer]]
name = "On the wall"
point = [-13.5, 2, 4]
direction = [1, 0, 0]
class = "dwelling"

[[observer]]
name = "In the air"
point = [4, 0.5, 6]
direction = [0, 0, -1]
class = "road"

[[observer]]
name = "In the cellar"
point = [12, -10, 2]
direction = [-1, 0, 0]
class = "dwelling"

[[region]]
name = "Wall"
object = "wall"
spacing_m = 2.0
class = "dwelling"

[[region]]
name = "Cellar"
object = "cellar"

[[region]]
name = "Yard"
polygon = [[-13, -6], [-1, -6], [-1, 6], [-13, 6]]
spacing_m = 2.0
class = "outdoor"

[[region]]
name = "Before the roof"
polygon = [[-2.5, -3], [0, -3], [0, 0.5], [-2.5, 0.5]]
height_m = 1.0
spacing_m = 2.0

[glare]
thresholds_w_m2 = [10.0]
rules = ["paper-2018", "ch-practice-2021", "de-lai-2015", "sandia-hazard"]
"#;

/// Of the direct run alone, which is the quickest.
const PICTURES: &str = r#"
[[view]]
name = "plan"
view = "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 30"
size = [20, 15]
estimator = "direct"
fuse = true

[[region]]
name = "Drawn"
polygon = [[2, 2], [8, 2], [8, 10], [2, 10]]
view = "plan"

[[moment]]
date = "06-21"
time = "17:30"
observer = "On the wall"
size = [16, 12]

[[moment]]
date = "06-21"
time = "17:30"
view = "plan"
"#;

/// Runs the project of all receivers with an estimator.
fn received(folder: &Path, estimator: &str) -> PathBuf {
    let mut text = begun(folder, 4_000);
    let _ = writeln!(
        text,
        "[[view]]\nname = \"points\"\nsensors = \"sensors.txt\"\nestimator = \"{estimator}\"\nbandwidth = 50\nseries_bandwidth = 500\nmax_radius_m = 1.0\n"
    );
    text += RECEIVERS;
    if estimator == "direct" {
        text += PICTURES;
    }
    fs::write(folder.join("project.toml"), text).expect("writes");
    succeed(&["run", folder.to_str().expect("a plain path"), "--quiet"]);
    let run = folder.join("run");
    assert_sane(&run);
    run
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).expect("reads")).expect("JSON")
}

/// Sums of a set of points that one estimator made, by group: mean Wh/m2.
fn groups(run: &Path, material: &str, set: &str) -> Vec<(String, f64)> {
    let found = json(&run.join(material).join(set).join("receivers.json"));
    let all = found["groups"].as_array().expect("groups");
    let of = |g: &Value| {
        assert!(g["not_evaluated"].is_null(), "{g}");
        let peak = g["peak_w_m2"].as_f64().expect("W/m2");
        let mean = g["annual_mean_wh_m2"].as_f64().expect("Wh/m2");
        assert!((mean > 0.0) == (peak > 0.0), "{g}");
        (g["name"].as_str().expect("a name").to_owned(), mean)
    };
    all.iter().map(of).collect()
}

/// What each verdict is about: material, receiver and rule; and what it says.
fn verdicts(run: &Path) -> Vec<[String; 4]> {
    let all = json(&run.join("verdicts.json"));
    let word = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    let of = |v: &Value| {
        [&v["material"], &v["receiver"], &v["rule"], &v["verdict"]["outcome"]].map(word)
    };
    all.as_array().expect("a list").iter().map(of).collect()
}

#[test]
fn every_material_reaches_every_receiver_by_every_estimator() {
    let keep = tempfile::tempdir().expect("a folder");
    let runs = ESTIMATORS.map(|e| received(&keep.path().join(e), e));
    for (material, _) in MATERIALS {
        let all = runs.each_ref().map(|run| groups(run, material, "receivers"));
        assert_eq!((all[0].len(), all[2].len()), (7, 8));
        for (i, (name, direct)) in all[2].iter().enumerate() {
            let counted = [0, 1].map(|e| all[e].get(i).map_or(*direct, |g| g.1));
            println!(
                "{material:>10} {name:<16} direct {direct:.1}, photons, radiance {counted:.1?}"
            );
            // A mirror image may miss whatever is no larger than itself.
            let missed = ["glass", "mirror"].contains(&material);
            for value in counted.into_iter().chain([*direct]) {
                match name.as_str() {
                    "In the cellar" | "Cellar" => assert_eq!(value, 0.0, "{material}, {name}"),
                    // Of the photons in free air the disc above the roof takes most.
                    "Before the roof" => assert!(*direct > 0.0 || missed, "{material}, {name}"),
                    _ => assert!(value > 0.0 || missed, "{material}, {name}"),
                }
            }
            // 4,000 crossings or fewer, at one disc of several; a façade of a hundred square metres.
            let allowed = match name.as_str() {
                "In the air" => 0.1,
                "Wall" if !SHARP.contains(&material) => 0.15,
                _ => continue,
            };
            for value in counted {
                assert!(
                    (value / direct - 1.0).abs() < allowed,
                    "{material}, {name}: {value} {direct}"
                );
            }
        }
        for run in &runs {
            let points = annual(run, material, "points");
            for (i, value) in points.iter().enumerate() {
                if yard::DARK.contains(&i) {
                    assert_eq!(*value, 0.0, "{material}: sensor {i}");
                }
            }
            // In free air above the roof.
            assert!(points[4] > 0.0 && points[5] > 0.0, "{material}: {points:?}");
        }
        // Eyes integrate the same light in their own way.
        let eyes = json(&runs[2].join(material).join("receivers/observers.json"));
        for (eye, (name, direct)) in eyes["observers"].as_array().expect("eyes").iter().zip(&all[2])
        {
            let exposure = eye["exposure_wh_m2"].as_f64().expect("Wh/m2");
            println!("{material:>10} {name:<16} eyes {exposure:.1}");
            assert_eq!(eye["name"].as_str(), Some(name.as_str()));
            assert!(
                (exposure - direct).abs() <= 0.015 * direct,
                "{material}, {name}: {exposure} {direct}"
            );
        }
        for picture in
            ["06-21-1730-on-the-wall", "06-21-1730-on-the-wall-fisheye", "06-21-1730-plan"]
        {
            let path = runs[2].join(material).join("moments").join(picture);
            for end in ["exr", "hdr", "png"] {
                assert!(path.with_extension(end).exists(), "{}.{end}", path.display());
            }
        }
    }
    for (run, receivers) in runs.iter().zip([7, 7, 8]) {
        let all = verdicts(run);
        assert_eq!(all.len(), MATERIALS.len() * receivers * 4);
        for [material, receiver, rule, outcome] in &all {
            let known = ["kept", "exceeded", "not-evaluated", "not-applicable"];
            assert!(known.contains(&outcome.as_str()), "{material}, {receiver}, {rule}: {outcome}");
            let dark = receiver.to_lowercase().contains("cellar");
            assert!(!dark || outcome != "exceeded", "{material}, {receiver}, {rule}");
        }
        assert!(all.iter().any(|v| v[3] == "exceeded") && all.iter().any(|v| v[3] == "kept"));
    }
    commands(&keep.path().join("direct"));
}

/// The commands that need no run.
fn commands(folder: &Path) {
    let path = folder.to_str().expect("a plain path");
    let said = succeed(&["mirror", path, "--step", "30min", "--json"]);
    let mirrored: Value = serde_json::from_str(&said.out).expect("JSON");
    let hours = |name: &str| {
        let all = mirrored["receivers"].as_array().expect("receivers");
        all.iter().find(|r| r["name"] == name).expect(name)["hours"].as_f64().expect("h")
    };
    assert!(hours("On the wall") > 0.0 && hours("In the air") > 0.0);
    assert_eq!(hours("In the cellar"), 0.0);
    for (observer, lit) in [("In the air", true), ("In the cellar", false)] {
        let step = ["--step", "60min", "--coarse", "60min", "--json"];
        let said = succeed(&[&["eyes", path, "--observer", observer][..], &step].concat());
        let swept: Value = serde_json::from_str(&said.out).expect("JSON");
        let eyes = swept["eyes"].as_array().expect("eyes");
        let materials: Vec<_> = eyes.iter().filter_map(|e| e["material"].as_str()).collect();
        assert_eq!(materials, MATERIALS.map(|m| m.0));
        for eye in eyes {
            let hours = eye["exceeded"]["irradiance > 10 W/m2"]["hours"].as_f64().expect("h");
            assert!((hours > 0.0) == lit, "{observer}: {eye}");
        }
    }
}
