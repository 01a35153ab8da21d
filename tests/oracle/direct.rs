//! Direct integration against Radiance's rtrace on the case study.

use std::f64::consts::PI;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use glam::DVec3;
use glintmap::base::Silent;
use glintmap::bsdf::Term;
use glintmap::project::Resolved;
use glintmap::render::{Direct, DirectScene, DirectScratch, DirectYear, PvSight};
use glintmap::site::Site;
use glintmap::sky;
use serde_json::json;

use crate::support::{self, program::root};

#[test]
fn rtrace_finds_the_same_irradiance_at_chosen_spots_and_suns() {
    let Some(python) = support::python() else { return };
    let folder = root().join("fixtures/projects/case-study");
    let resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
    let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
    let mut timeline = sky::timeline(&resolved.place, &resolved.times).expect("has suns");
    // Morning and noon of two days of June.
    timeline
        .steps
        .retain(|s| [154, 168].contains(&s.day) && [6.5, 7.25, 8.0, 9.0, 12.0].contains(&s.hour));
    assert_eq!(timeline.steps.len(), 10);
    let spots = [
        ([-40.0, 2.0], DVec3::Z),
        ([-60.0, -5.0], DVec3::new(0.6, 0.0, 0.8)),
        ([-30.0, 12.0], DVec3::Z),
        ([8.0, -40.0], DVec3::Z),
    ];
    let sight = PvSight::new(&site, &timeline, true, &Silent).expect("looks");
    let mut cases = Vec::new();
    let mut own = Vec::new();
    for name in ["standard", "satinated"] {
        let candidate = resolved.candidates.iter().find(|c| c.name == name).expect("there");
        let terms = candidate.bsdfs[0].terms();
        let [(_, Term::Lobe(term))] = &terms[..] else { panic!("{name} is glass") };
        let (alpha, diffuse) = (term.alpha().expect("is rough"), term.ground_per_sr() * PI);
        // Fresnel's reflectance at the normal is ((n - 1) / (n + 1))^2.
        let root = term.reflectance(1.0).sqrt();
        let index = (1.0 + root) / (1.0 - root);
        let scene = DirectScene {
            site: &site,
            timeline: &timeline,
            bsdfs: site.pv.iter().map(|s| &candidate.bsdfs[s.entry]).collect(),
            max_path_m: 1000.0,
            sun_visibility: true,
        };
        let direct = Direct::new(scene, &sight).expect("fits");
        let (mut scratch, mut year) = (DirectScratch::default(), DirectYear::default());
        for ([x, y], normal) in spots {
            // A metre and a half above the ground.
            let from = DVec3::new(x, y, 200.0).as_vec3();
            let down = site.bvh.closest(from, glam::Vec3::NEG_Z, 0.0, 400.0).expect("ground");
            let spot = DVec3::new(x, y, 201.5 - f64::from(down.distance_m));
            direct.year(spot, normal, &mut scratch, &mut year);
            for (i, step) in timeline.steps.iter().enumerate() {
                let of = |pv: bool| {
                    site.triangles
                        .iter()
                        .filter(|t| site.faces[t.face as usize].pv.is_some() == pv)
                        .map(|t| t.corners.map(|c| c.to_array()))
                        .collect::<Vec<_>>()
                };
                if year.surface_w_m2[i] < 0.02 || i % 3 == 1 {
                    continue;
                }
                own.push((name, spot, i, year.surface_w_m2[i]));
                cases.push(json!({
                    "triangles": of(false), "pv": of(true),
                    "spot": spot.to_array(), "normal": normal.to_array(),
                    "sun": step.sun.to_array(), "strength": step.irradiance_w_m2,
                    "diameter_deg": timeline.sun_diameter_deg,
                    "index": index, "alpha": alpha, "diffuse": diffuse, "points": 4096,
                }));
            }
        }
    }
    assert!(own.len() >= 12, "{} cases", own.len());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/oracles/direct_rtrace.py");
    let mut child = Command::new(python)
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("Python starts");
    let text = json!({ "cases": cases }).to_string();
    child.stdin.take().expect("piped").write_all(text.as_bytes()).expect("takes the cases");
    let said = child.wait_with_output().expect("ends");
    assert!(said.status.success());
    let theirs: Vec<serde_json::Value> = serde_json::from_slice(&said.stdout).expect("JSON");
    let mut worst: f64 = 0.0;
    for ((name, spot, step, found), theirs) in own.iter().zip(&theirs) {
        let expected = theirs["w_m2"].as_f64().expect("a number");
        let error = theirs["error_w_m2"].as_f64().expect("a number");
        let miss = (found - expected) / expected;
        println!(
            "{name} at {spot}, sun {step}: {found:.4} W/m2, rtrace {expected:.4} ± {error:.4}, {miss:+.4}"
        );
        // Half of a percent for the cells of half a metre in which shadows are known.
        assert!((found - expected).abs() < 4.0 * error + 0.005 * expected, "{miss}");
        worst = worst.max(miss.abs());
    }
    println!("worst of {}: {worst:.4}", own.len());
}
