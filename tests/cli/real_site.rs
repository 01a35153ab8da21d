//! The real site: Rotterdam Delfshaven, at draft quality.

use crate::support::data;
use crate::support::program::{project, succeed};

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
    assert!(check.out.contains("105 RoofSurface faces have no area"), "{}", check.out);
    succeed(&[&["run", path, "--quiet"][..], &draft[..]].concat());
    for name in ["standard/plan/annual.png", "standard/plan/ratio.png", "report.html"] {
        assert!(folder.join("run").join(name).exists(), "{name}");
    }
}
