//! What eyes see, against Radiance's evalglare on our own fisheye.

use std::path::Path;
use std::process::Command;

use glam::DVec3;
use glintmap::project::Resolved;
use glintmap::render::eye::{Eye, EyeMaterial, EyePv, Glint, SunAt};
use glintmap::site::Site;

use crate::support::program::{project, succeed};
use crate::support::{python, series::run_python};

/// Luminance above which evalglare takes a pixel for a source, cd/m2: the sun and the PV's
/// reflection of it, not the sky around the sun.
const SOURCE_CD_M2: f64 = 50_000.0;

/// A line of `evalglare -d`: columns by their names.
fn sources(text: &str) -> (Vec<[f64; 3]>, f64) {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("a head").split_whitespace().collect();
    let column = |name: &str| head.iter().position(|h| *h == name).expect(name);
    // "N No pixels x-pos …" heads "n pixels x-pos …".
    let shift = column("pixels") - 1;
    let [l, omega, e_v, sigma] = ["L_s", "Omega_s", "E_v", "Sigma"].map(column);
    let mut out = Vec::new();
    let mut illuminance = 0.0;
    for line in lines.take_while(|l| !l.starts_with("dgp")) {
        let numbers: Vec<f64> = line.split_whitespace().map(|w| w.parse().expect(w)).collect();
        out.push([l, omega, sigma].map(|c| numbers[c - shift]));
        illuminance = numbers[e_v - shift];
    }
    (out, illuminance)
}

#[test]
fn evalglare_finds_the_luminances_that_we_computed() {
    let Some(python) = python() else { return };
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let before = std::fs::read_to_string(&file).expect("reads");
    let moment = "[[moment]]\nname = \"m\"\ndate = \"06-14\"\ntime = \"07:30\"\nobserver = \"Wall\"\nsize = [700, 500]\n";
    std::fs::write(&file, format!("{before}\n{moment}")).expect("writes");
    let path = folder.to_str().expect("a name");
    succeed(&["run", path, "--quiet", "--until", "pictures"]);
    let made = folder.join("run/standard/moments");
    for name in ["m.hdr", "m.png", "m-luminance.png", "m-fisheye.png"] {
        assert!(made.join(name).exists(), "{name}");
    }
    let text = std::fs::read_to_string(made.join("m-fisheye.json")).expect("facts");
    let facts: serde_json::Value = serde_json::from_str(&text).expect("JSON");

    let where_ = "import os, pyradiance; print(os.path.dirname(pyradiance.__file__))";
    let radiance = run_python(&python, where_, &[]);
    let radiance = Path::new(radiance.trim());
    let said = Command::new(radiance.join("bin/evalglare"))
        .env("RAYPATH", radiance.join("lib"))
        .args(["-d", "-b", &SOURCE_CD_M2.to_string()])
        .arg(made.join("m-fisheye.hdr"))
        .output()
        .expect("evalglare starts");
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    let (found, illuminance) = sources(&text);
    println!("{text}");

    // The whole picture.
    let own = facts["illuminance_lx"].as_f64().expect("a number");
    assert!((illuminance / own - 1.0).abs() < 2e-3, "{illuminance} {own}");

    // The PV's reflection: the same patches, looked at one by one, without a picture.
    let resolved = Resolved::read(&folder, &[], 1 << 30).expect("reads");
    let site = Site::load(&resolved.scene, &resolved.pv).expect("loads");
    let sun = &facts["sun"];
    let number = |key: &str| sun[key].as_f64().expect("a number");
    let (altitude, azimuth) =
        (number("altitude_deg").to_radians(), number("azimuth_deg").to_radians());
    let direction = DVec3::new(
        libm::cos(altitude) * libm::sin(azimuth),
        libm::cos(altitude) * libm::cos(azimuth),
        libm::sin(altitude),
    );
    let at = SunAt { direction, irradiance_w_m2: number("irradiance_w_m2"), diameter_deg: 0.5 };
    let material = EyeMaterial::new(&resolved.candidates[0].bsdfs[0]);
    let pv = EyePv::new(&site);
    let eye = Eye { position: DVec3::new(-14.0, 0.0, 3.0), direction: DVec3::X };
    let seen = pv.seen(eye, 5);
    let lit = pv.lit(direction, &seen, 5);
    let mut glints = Vec::new();
    pv.look(&seen, &lit, &at, &[material], &mut glints);
    let bright = |g: &&Glint| g.radiance_w_m2_sr * 179.0 > SOURCE_CD_M2;
    let solid: f64 = glints.iter().filter(bright).map(|g| g.solid_angle_sr).sum();
    let lux: f64 =
        glints.iter().filter(bright).map(|g| g.solid_angle_sr * g.radiance_w_m2_sr * 179.0).sum();
    assert_eq!(found.len(), 2, "the PV and the sun: {text}");
    let [luminance, omega, _] = found[0];
    assert!((omega / solid - 1.0).abs() < 0.05, "{omega} sr, {solid}");
    assert!((luminance * omega / lux - 1.0).abs() < 0.03, "{} lx, {lux}", luminance * omega);
    assert!((luminance / (lux / solid) - 1.0).abs() < 0.05, "{luminance} {}", lux / solid);

    // The sun: its illuminance across it, with the sky in its pixels.
    let [luminance, omega, sigma] = found[1];
    let sun_lx = number("irradiance_w_m2") * 179.0;
    assert!((luminance * omega / sun_lx - 1.0).abs() < 0.04, "{} lx", luminance * omega);
    let apart = libm::acos(direction.dot(DVec3::X)).to_degrees();
    assert!((sigma - apart).abs() < 0.2, "{sigma} {apart}");
}

#[test]
fn mistakes_in_moments_and_seasons_are_named() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a name");
    let file = folder.join("project.toml");
    let before = std::fs::read_to_string(&file).expect("reads");
    for (table, words) in [
        ("[[moment]]\ndate = \"06-14\"\ntime = \"7.5\"\nview = \"plan\"", "such as \"08:30\""),
        ("[[moment]]\ndate = \"06-14\"\ntime = \"07:30\"", "either `view` or `observer`"),
        ("[[moment]]\ndate = \"06-14\"\ntime = \"07:30\"\nview = \"pan\"", "there are: plan"),
        ("[[moment]]\ndate = \"06-14\"\ntime = \"07:30\"\nobserver = \"Wal\"", "Wall"),
        ("[[moment]]\ndate = \"06-14\"\ntime = \"07:30\"\nview = \"-vtx\"", "view"),
        (
            "[[moment]]\ndate = \"06-31\"\ntime = \"07:30\"\nview = \"plan\"",
            "date: day: expected a date of 2018",
        ),
        ("[[season]]\nmodifier = \"plaster\"\ntransmittance = [0.5]", "12 numbers"),
        (
            "[[season]]\nmodifier = \"plaster\"\ntransmittance = [0,0,0,0,0,0,0,0,0,0,0,2]",
            "0 to 1, found 2",
        ),
        (
            "[[season]]\nmodifier = \"plastr\"\ntransmittance = [0,0,0,0,0,0,0,0,0,0,0,0]",
            "the nearest are plaster",
        ),
    ] {
        std::fs::write(&file, format!("{before}\n{table}\n")).expect("writes");
        let said = crate::support::program::say(&["run", path, "--quiet", "--until", "suns"]);
        let said =
            if said.code == 0 { crate::support::program::say(&["check", path]) } else { said };
        assert_eq!(said.code, 2, "{table}: {}", said.err);
        assert!(said.err.contains(words), "{table}: {}", said.err);
    }
}
