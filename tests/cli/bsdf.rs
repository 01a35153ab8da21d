//! `glintmap bsdf`, `suns --irradiance epw=…`, presets in projects.

use std::fs;

use serde_json::Value;

use crate::support::{self, program};

#[test]
fn presets_are_listed_with_their_sources_and_told_as_files() {
    let said = program::succeed(&["bsdf", "--presets"]);
    for word in ["satinated", "anti-reflective", "metal-sheet", "from: the case study's"] {
        assert!(said.out.contains(word), "{word}: {}", said.out);
    }
    let said = program::succeed(&["bsdf", "tile", "anti-reflective", "--json"]);
    let document: Value = serde_json::from_str(&said.out).expect("JSON");
    let rows = &document["files"][0]["reflectance"];
    assert_eq!(rows.as_array().unwrap().len(), 5);
    assert!((rows[3]["mean"].as_f64().unwrap() - 0.25).abs() < 1e-9);
    assert!(document["files"][1]["source"].as_str().unwrap().contains("porous silica"));
    let said = program::say(&["bsdf", "satin"]);
    assert_eq!(said.code, 2);
    assert!(said.err.contains("no such file") && said.err.contains("satinated"), "{}", said.err);
    assert_eq!(program::say(&["bsdf"]).code, 2);
}

#[test]
fn a_preset_is_written_read_plotted_and_used() {
    let keep = tempfile::tempdir().unwrap();
    let at = |name: &str| keep.path().join(name).display().to_string();
    let (xml, svg, png) = (at("s.xml"), at("p.svg"), at("p.png"));
    let said =
        program::succeed(&["bsdf", "satinated", "--write", &xml, "--resolution", "4", "--json"]);
    let document: Value = serde_json::from_str(&said.out).expect("JSON");
    assert_eq!(document["written"]["rank"], 3);
    let cost = &document["written"]["costs"][2];
    assert!(cost["peak_per_sr"].as_f64().unwrap() > cost["pruned_per_sr"].as_f64().unwrap() * 0.99);
    let said = program::succeed(&[
        "bsdf", &xml, "tile", "--plot", &svg, "--plot", &png, "--angles", "30,60", "--check",
    ]);
    assert!(said.out.contains("rank 3, 2^4 cells"), "{}", said.out);
    let svg = fs::read_to_string(svg).unwrap();
    assert!(svg.contains("tile, light at 60°") && svg.contains("1/sr"));
    assert!(fs::read(png).unwrap().starts_with(b"\x89PNG"));
    for (arguments, expected) in [
        (vec!["bsdf", "tile", "satinated", "--write", &xml], "one FILE"),
        (vec!["bsdf", "tile", "--write", &xml, "--resolution", "12"], "resolution"),
        (vec!["bsdf", "tile", "--write", &xml, "--prune", "100"], "prune"),
        (vec!["bsdf", "tile", "--plot", "x.svg", "--angles", "95"], "0 to below 90"),
    ] {
        let said = program::say(&arguments);
        assert_eq!(said.code, 2, "{arguments:?}");
        assert!(said.err.contains(expected), "{}", said.err);
    }
}

#[test]
fn points_of_several_files_are_one_sample() {
    let keep = tempfile::tempdir().unwrap();
    let mut arguments = vec!["bsdf".to_owned()];
    for theta in [10, 50] {
        let mut text =
            format!("#sample_name \"matt\"\n#format: theta phi BSDF\n#intheta {theta}\n#inphi 0\n");
        for i in 0..400 {
            text.push_str(&format!("{} {} 0.08\n", 4.5 * f64::from(i / 20) + 1.0, 18 * (i % 20)));
        }
        let path = keep.path().join(format!("{theta}.txt"));
        fs::write(&path, text).unwrap();
        arguments.push(path.display().to_string());
    }
    let xml = keep.path().join("matt.xml").display().to_string();
    arguments.extend(["--write".into(), xml.clone(), "--resolution".into(), "3".into()]);
    let said = program::succeed(&arguments);
    assert!(
        said.out
            .contains("matt: goniophotometer data, 2 incident directions, 800 points, isotropic"),
        "{}",
        said.out
    );
    assert!(
        said.out.contains("41.3 % of light from all directions comes in beyond"),
        "{}",
        said.out
    );
    let said = program::succeed(&["bsdf", &xml, "--json"]);
    let document: Value = serde_json::from_str(&said.out).expect("JSON");
    let mean = document["files"][0]["reflection"][0]["reflectance"][2]["mean"].as_f64().unwrap();
    assert!((mean - 0.2513).abs() < 2e-3, "{mean}");
}

#[test]
fn more_light_than_came_in_ends_with_2() {
    let keep = tempfile::tempdir().unwrap();
    let path = keep.path().join("bright.xml");
    let text = crate::physics::bsdf_files::file(
        "TensorTree3",
        "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>",
        "{ 0.6 }",
    );
    fs::write(&path, text).unwrap();
    let path = path.display().to_string();
    assert!(program::succeed(&["bsdf", &path]).out.contains("MORE THAN CAME IN"));
    let said = program::say(&["bsdf", &path, "--check"]);
    assert_eq!(said.code, 2);
    assert!(said.err.contains("188.50 %"), "{}", said.err);
}

#[test]
fn suns_take_the_strength_of_a_weather_file() {
    let Some(path) = support::data("weather/DEU_NW_Aachen.105010_TMYx.epw") else { return };
    let strength = format!("epw={}", path.display());
    let place = [
        "--latitude",
        "50.8",
        "--longitude",
        "6.02",
        "--meridian",
        "15",
        "--days",
        "100:100:1",
        "--hours",
        "10.5:12.5:1",
    ];
    let mut arguments = vec!["suns"];
    arguments.extend(place);
    arguments.extend(["--irradiance", &strength]);
    let said = program::succeed(&arguments);
    assert_eq!(said.out.lines().count(), 4, "{}", said.out);
    let Some(partial) = support::data("weather/LAUSANNE_20230901_20230911_partial.epw") else {
        return;
    };
    let missing = format!("epw={}", partial.display());
    let last = arguments.len() - 1;
    arguments[last] = &missing;
    let said = program::say(&arguments);
    assert_eq!(said.code, 2);
    assert!(said.err.contains("9999 (missing)"), "{}", said.err);
    arguments[last] = "epw=";
    assert!(program::say(&arguments).err.contains("epw=FILE"));
}
