//! The real site: Rotterdam Delfshaven, at draft quality.

use crate::support::data;
use crate::support::program::{project, say, succeed};

#[test]
fn rotterdam_runs_at_draft_quality() {
    let Some(scene) = data("city/rotterdam_delfshaven.city.json") else { return };
    let (_keep, folder) = project("rotterdam");
    let path = folder.to_str().expect("a plain path");
    let scene = scene.canonicalize().expect("exists");
    let files = format!("scene.files=[{scene:?}, \"ground.rad\"]");
    let draft = [
        "--set",
        &files,
        "--set",
        "photons.stored=100000",
        "--set",
        "view.plan.size=[200, 200]",
        "--set",
        "view.panorama.size=[400, 100]",
        "--set",
        "view.plan.bandwidth=50",
        "--set",
        "view.panorama.bandwidth=50",
        "--set",
        "view.plan.series_bandwidth=1000",
        "--set",
        "view.panorama.series_bandwidth=1000",
    ];
    let check = succeed(&[&["check", path][..], &draft[..2]].concat());
    for words in ["105 RoofSurface faces have no area", "true north: 0.732 degrees", "EPSG:28992"] {
        assert!(check.out.contains(words), "{words}: {}", check.out);
    }
    assert!(folder.join("site.png").exists());
    succeed(&[&["run", path, "--quiet"][..], &draft[..]].concat());
    for name in ["standard/plan/annual.png", "standard/plan/ratio.png", "report.html"] {
        assert!(folder.join("run").join(name).exists(), "{name}");
    }
}

/// Millimetres, y up: a yard of 60 m with a slope of PV 6 m wide that faces south.
const SHED: &str = "o pv\nv 0 3000 0\nv 6000 3000 0\nv 6000 5000 -8000\nv 0 5000 -8000\nf 1 2 3 4\n\
o yard\nv -30000 0 30000\nv 30000 0 30000\nv 30000 0 -30000\nv -30000 0 -30000\nf 5 6 7 8\n";

#[test]
fn a_mesh_in_millimetres_becomes_a_project() {
    let keep = tempfile::tempdir().expect("a folder");
    let at = |name: &str| keep.path().join(name).to_str().expect("a plain path").to_owned();
    std::fs::write(at("shed.obj"), SHED).expect("writes");
    let (scene, project) = (at("shed.obj"), at("shed"));
    let place =
        ["--latitude", "47.4", "--longitude", "8.5", "--meridian", "15", "--pv", "object=pv"];
    let new = |more: &[&str]| {
        say(&[&["new", &project, "--scene", &scene][..], &place[..], more].concat())
    };
    let unsaid = new(&[]);
    assert_eq!(unsaid.code, 2, "{}", unsaid.err);
    assert!(unsaid.err.contains("--unit m --up z"), "{}", unsaid.err);
    let made = new(&["--unit", "mm", "--up", "y", "--north", "10"]);
    assert_eq!(made.code, 0, "{}", made.err);
    let text = std::fs::read_to_string(at("shed/project.toml")).expect("a project");
    assert!(text.contains("shed.obj\", unit = \"mm\", up = \"y\" }"), "{text}");
    assert!(text.contains("north_deg = 10.0"), "{text}");
    // `check` reads the same scene from the project.
    let check = succeed(&["check", &project]);
    for words in ["tilt  14.0", "azimuth    170.0", "10.000 degrees clockwise", "site.png"] {
        assert!(made.out.contains(words), "{words}: {}", made.out);
        assert!(check.out.contains(words), "{words}: {}", check.out);
    }
    assert!(keep.path().join("shed/site.png").exists());
}
