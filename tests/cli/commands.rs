//! Commands as a new user would try them.

use crate::support::program::{project, say, succeed};

const TABLE_3: &[&str] = &[
    "suns",
    "--latitude",
    "47.038",
    "--longitude",
    "8.312",
    "--meridian",
    "15",
    "--days",
    "0:181:7",
    "--hours",
    "4.5:20.5:0.25",
];

#[test]
fn table_3_has_the_papers_number_of_suns() {
    for (sun, expected) in [("gensky-2018", 1280), ("gensky", 1281)] {
        let said = succeed(&[TABLE_3, &["--sun", sun]].concat());
        let mut lines = said.out.lines();
        let head = "index,day,hour,altitude_deg,azimuth_deg,x,y,z,irradiance_w_m2,weight_h";
        assert_eq!(lines.next(), Some(head));
        assert_eq!(lines.count(), expected, "{sun}");
    }
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in [
        "demo", "new", "run", "plan", "check", "probe", "suns", "convert", "inspect", "verify",
        "clean", "report", "bsdf", "mirror", "trace",
    ] {
        let said = succeed(&[command, "--help"]);
        assert!(said.out.contains("Example"), "{command} --help shows no example");
    }
    for (group, command) in [
        ("glare", "analyse"),
        ("volume", "info"),
        ("volume", "export"),
        ("volume", "import"),
        ("picture", "falsecolor"),
    ] {
        let said = succeed(&[group, command, "--help"]);
        assert!(said.out.contains("Example"), "{group} {command} --help shows no example");
    }
}

#[test]
fn wrong_arguments_are_exit_code_2() {
    for arguments in [
        &["frobnicate"][..],
        &["suns", "--latitude", "north"],
        &["run"],
        &["run", "x", "--until", "lunch"],
        &["probe", "x", "--view", "plan"],
    ] {
        assert_eq!(say(arguments).code, 2, "{arguments:?}");
    }
}

#[test]
fn plan_and_check_tell_and_write_nothing() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    let plan = succeed(&["plan", path]);
    for word in ["suns", "trace", "pages", "render", "glare", "free"] {
        assert!(plan.out.contains(word), "{}", plan.out);
    }
    let check = succeed(&["check", path]);
    assert!(check.out.contains("pv"), "{}", check.out);
    for command in ["plan", "check"] {
        let json = succeed(&[command, path, "--json"]);
        serde_json::from_str::<serde_json::Value>(&json.out).expect("one JSON document");
    }
    assert!(!folder.join("run").exists());
}

#[test]
fn a_run_can_be_probed_inspected_and_verified() {
    let (_keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    succeed(&["run", path, "--quiet"]);
    let found: serde_json::Value = {
        let info = succeed(&["inspect", &format!("{path}/run/standard/photons.gmp"), "--json"]);
        serde_json::from_str(&info.out).expect("one JSON document")
    };
    assert!(found.to_string().contains("photons"), "{found}");
    let probe = succeed(&["probe", path, "--view", "plan", "--pixel", "32,24"]);
    assert!(probe.out.contains("Wh/m²"), "{}", probe.out);
    let csv = succeed(&["probe", path, "--view", "plan", "--pixel", "32,24", "--csv"]);
    assert!(csv.out.starts_with("material,timestep,day,hour"), "{}", csv.out);
    assert_eq!(succeed(&["verify", path]).code, 0);
    // A flipped byte anywhere is found, and named with its file.
    let store = folder.join("run/standard/photons.gmp");
    let mut bytes = std::fs::read(&store).expect("reads");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(&store, bytes).expect("writes");
    let said = say(&["verify", path]);
    assert_eq!(said.code, 3, "{}{}", said.out, said.err);
    assert!(said.out.contains("photons.gmp"), "{}", said.out);
}

#[test]
fn new_writes_a_project_that_checks_and_runs() {
    let (keep, folder) = project("tiny");
    let scene = folder.join("scene.rad");
    let new = keep.path().join("mine");
    let (new, scene) = (new.to_str().expect("plain"), scene.to_str().expect("plain"));
    succeed(&[
        "new",
        new,
        "--scene",
        scene,
        "--latitude",
        "-33.9",
        "--longitude",
        "151.2",
        "--meridian",
        "150",
        "--pv",
        "modifier=pv",
    ]);
    succeed(&["check", new]);
    succeed(&["plan", new]);
    let again = say(&[
        "new",
        new,
        "--scene",
        scene,
        "--latitude",
        "0",
        "--longitude",
        "0",
        "--meridian",
        "0",
    ]);
    assert_eq!(again.code, 2, "{}", again.err);
}

#[test]
fn new_writes_nothing_for_a_place_that_is_not_on_earth() {
    let (keep, folder) = project("tiny");
    let new = keep.path().join("mine");
    let text = |p: &std::path::Path| p.to_str().expect("a plain path").to_owned();
    let (new_text, scene) = (text(&new), text(&folder.join("scene.rad")));
    let at = ["--latitude", "95", "--longitude", "8", "--meridian", "15", "--pv", "modifier=pv"];
    let said = say(&[&["new", &new_text, "--scene", &scene][..], &at[..]].concat());
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("latitude"), "{}", said.err);
    assert!(!new.exists());
}

#[test]
fn an_error_is_one_json_line_where_results_are_json() {
    let said = say(&["run", "no/such/project", "--json"]);
    assert_eq!((said.code, said.out.as_str()), (2, ""));
    let last = said.err.lines().last().expect("a line");
    let error: serde_json::Value = serde_json::from_str(last).expect("a JSON line");
    assert_eq!(error["exit_code"], 2);
    assert!(error["error"].to_string().contains("no/such/project"), "{error}");
}

#[test]
fn a_volume_becomes_pictures_of_one_scale() {
    let (keep, folder) = project("tiny");
    let path = folder.to_str().expect("a plain path");
    succeed(&["run", path, "--quiet", "--until", "render"]);
    let series = format!("{path}/run/standard/plan/series.zarr");
    let pictures = keep.path().join("june");
    let dir = pictures.to_str().expect("a plain path");
    let export = |range: &str| {
        let words =
            ["volume", "export", &series, "--pictures", dir, "--timesteps", range, "--json"];
        let said = succeed(&words);
        serde_json::from_str::<serde_json::Value>(&said.out).expect("one JSON document")
    };
    let (few, one) = (export("10:12"), export("20:20"));
    assert_eq!(few["pictures"]["scale_max_w_m2"], one["pictures"]["scale_max_w_m2"]);
    for name in ["t00010.exr", "t00012.png", "t00020.png"] {
        assert!(pictures.join(name).exists(), "{name}");
    }
    assert_eq!(std::fs::read_dir(&pictures).expect("reads").count(), 8);
    let beyond = say(&["volume", "export", &series, "--pictures", dir, "--timesteps", "10:999"]);
    assert_eq!(beyond.code, 2, "{}", beyond.err);
    assert!(beyond.err.contains("0:67"), "{}", beyond.err);
    assert_eq!(say(&["volume", "export", &series]).code, 2);
    assert!(succeed(&["inspect", &series]).out.contains("68 timesteps"));
}
