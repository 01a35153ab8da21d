//! Projects that nobody wrote: keys drawn at random, most of them good, now and then a wrong one.
//! Whatever comes out either runs to its end, with files that open and numbers that are numbers,
//! or is refused with exit code 2 and the name of the key. `GLINTMAP_ROUNDS=300` draws more of them
//! (`GLINTMAP_FIRST_ROUND` where to begin); a round that failed is repeated by its number.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Instant;

use glintmap::base::{Purpose, Stream};

use super::mistakes::MISTAKES;
use crate::support::outputs::assert_sane;
use crate::support::program::{copy, within};
use crate::support::yard;

/// Rounds where nobody asks for more.
const ROUNDS: u64 = 8;
struct Draw(Stream);

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        ((self.0.uniform() * n as f64) as usize).min(n - 1)
    }

    fn one<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    fn often(&mut self, share: f64) -> bool {
        self.0.uniform() < share
    }
}

/// A project file, and what it may be refused for.
struct Drawn {
    text: String,
    /// `--set KEY=VALUE` that is wrong.
    mistake: Option<String>,
    /// One of these words stands in the message that refuses it; empty where it must run.
    refused: Vec<&'static str>,
    /// Words of a refusal that the scene decides.
    perhaps: Vec<&'static str>,
}

const MATERIALS: [&str; 13] = [
    r#"model = { kind = "lambertian", reflectance = 0.3 }"#,
    r#"model = { kind = "lambertian", reflectance = 0.0 }"#,
    r#"model = { kind = "coated-glass", index = 1.52, ggx_alpha = 0.08, cell_reflectance = 0.04, coating = { index = 1.23, thickness_nm = 120.0 } }"#,
    r#"model = { kind = "coated-glass", index = 1.52, cell_reflectance = 0.04 }"#,
    r#"model = { kind = "glass", index = 1.52 }"#,
    r#"model = { kind = "mirror", reflectance = 0.8 }"#,
    r#"model = { kind = "metal", index = 1.4, extinction = 7.0, ggx_alpha = 0.1 }"#,
    r#"model = { kind = "pv-glass", index = 1.52, ggx_alpha = 0.004, cell_reflectance = 0.0 }"#,
    r#"model = { kind = "mixture", parts = [{ share = 0.7, model = "standard" }, { share = 0.2, model = { kind = "mirror", reflectance = 0.6 } }] }"#,
    r#"model = "satinated""#,
    "bsdf = \"tree.xml\"",
    "bsdf = \"tree.xml\"\nside = \"front\"\nspectrum = \"visible\"",
    "bsdf = \"klems.xml\"",
];

const VIEWS: [&str; 9] = [
    "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 30",
    "-vtv -vp -2 -14 9 -vd -0.5 1 -0.45 -vu 0 0 1 -vh 60 -vv 45",
    "-vta -vp 0 0 8 -vd -1 0 -0.3 -vu 0 0 1 -vh 180 -vv 180",
    "-vth -vp 0 8 4 -vd 0 -1 0 -vu 0 0 1 -vh 180 -vv 180",
    "-vtc -vp -3 0 3 -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 76",
    "-vts -vp -3 0 3 -vd -1 0 0 -vu 0 0 1 -vh 120 -vv 90",
    "-vtv -vp 0 0 3 -vd 0 0 1 -vu 0 1 0 -vh 40 -vv 40",
    "-vtv -vp -12 0 3 -vd 1 0 0 -vu 0 0 1 -vh 50 -vv 40 -vo 2 -va 30",
    "-vtl -vp -30 0 4 -vd 1 0 0 -vu 0 0 1 -vh 30 -vv 12 -vs 0.1 -vl -0.2",
];

const SIZES: [&str; 6] = ["[24, 18]", "[1, 1]", "[65, 3]", "[3, 33]", "[16, 16]", "[40, 30]"];

const RULES: [&str; 9] = [
    "paper-2018",
    "at-ove-r11-3-2016",
    "ch-practice-2021",
    "ch-swissolar-2021",
    "de-lai-2015",
    "sandia-hazard",
    "uk-pagerpower-4",
    "us-faa-2013",
    "us-faa-2021",
];

const CLASSES: [&str; 8] =
    ["dwelling", "office", "outdoor", "road", "rail", "aviation", "vegetation", "plot"];

/// A project by its number.
fn draw(round: u64) -> Drawn {
    let mut d = Draw(Stream::new(2026, Purpose::Survey, round));
    let mut text = String::new();
    let mut refused = Vec::new();
    let months = times(&mut d, &mut text, &mut refused);
    pv(&mut d, &mut text);
    materials(&mut d, &mut text);
    let pictures = views(&mut d, &mut text);
    receivers(&mut d, &mut text, pictures);
    if months {
        text += "[[season]]\nmodifier = \"leaves\"\ntransmittance = [0.5, 0.5, 0.4, 0.2, 0, 0, 0, 0, 1, 0.1, 0.3, 0.5]\n\n";
    }
    glare(&mut d, &mut text);
    let mut mistake = None;
    if d.often(0.2) {
        let (key, value, words) = d.one(&MISTAKES);
        // Of the lists only the tables that every project has.
        let mut parts = key.split('.');
        let known = match (parts.next(), parts.next()) {
            (Some("site" | "scene" | "time" | "photons" | "glare"), _) => true,
            (Some("pv"), name) => name == Some("roof"),
            (Some("material"), name) => name == Some("m0"),
            (Some("view"), name) => name == Some("v0") && text.contains("name = \"v0\""),
            _ => false,
        };
        // A preset where the model was a file leaves two of them; `side` may be right for a file.
        let known = known && !key.ends_with("side");
        if known {
            mistake = Some(format!("{key}={value}"));
            // Two mistakes at once: whichever is met first is told.
            refused.push(words);
        }
    }
    let perhaps = perhaps(&text);
    Drawn { text, mistake, refused, perhaps }
}

/// What only the scene or the sun says.
fn perhaps(text: &str) -> Vec<&'static str> {
    let mut out = Vec::new();
    for (key, words) in [
        ("[[moment]]", "the sun is below the horizon then"),
        ("\"PV itself\"", "\"PV itself\""),
        ("north_deg", "not one point of it lies on the scene"),
        ("view = \"v0\"", "not one point of it lies on the scene"),
        ("reflectance = 0.0 }", "photons of `m"),
        ("latitude = 69", "photons of `m"),
        ("from = 12.0, to = 12.0", "photons of `m"),
        ("max_path_m = 9.0", "photons.max_path_m"),
    ] {
        if text.contains(key) {
            out.push(words);
        }
    }
    out
}

/// Place, scene and times; whether crowns have seasons.
fn times(d: &mut Draw, text: &mut String, refused: &mut Vec<&'static str>) -> bool {
    let (latitude, zone) = d.one(&[
        (47.0, "timezone = \"Europe/Zurich\"\n"),
        (47.0, ""),
        (-33.0, "timezone = \"Australia/Sydney\"\n"),
        (69.0, "timezone = \"Europe/Oslo\"\n"),
        (1.0, ""),
    ]);
    let east = if latitude < 0.0 { 151.0 } else { 8.0 };
    let meridian = if latitude < 0.0 { 150.0 } else { 15.0 };
    let _ = writeln!(
        text,
        "[site]\nname = \"Yard\"\nlatitude = {latitude}\nlongitude = {east}\nmeridian = {meridian}\n{zone}{}",
        d.one(&["", "", "elevation_m = 450.0\n", "horizon = [[0, 2.5], [90, 8], [200, 1]]\n"])
    );
    let _ = writeln!(
        text,
        "[scene]\nfiles = [\"scene.rad\"]\n{}{}{}",
        d.one(&["", "default_reflectance = 0.0\n", "reflectance = { grey = 0.4 }\n"]),
        d.one(&["", "", "north_deg = 30.0\n"]),
        d.one(&["", "", "", "origin = [1000.0, 2000.0, 400.0]\n"]),
    );
    let days = d.one(&[
        "{ from = \"03-21\", to = \"09-21\", step = 92 }",
        "{ from = 0, to = 181, step = 60 }",
        "{ from = 172, to = 172, step = 1 }",
        "{ from = \"06-20\", to = \"06-22\", step = 1 }",
        "{ from = 0, to = 364, step = 120 }",
        "{ from = 360, to = 364, step = 7 }",
    ]);
    let hours = d.one(&[
        "{ from = 5.0, to = 20.0, step = 1.0 }",
        "{ from = 0.0, to = 23.0, step = 1.0 }",
        "{ from = 12.0, to = 12.0, step = 0.5 }",
        "{ from = 5.25, to = 19.5, step = 0.75 }",
    ]);
    let finer = match d.below(5) {
        0 if hours.contains("5.0") => "finer = [{ from = 6.0, to = 8.0, step = 0.25 }]\n",
        1 if hours.contains("0.0, to = 23") => {
            "finer = [{ from = 6.0, to = 7.0, step = 0.5 }, { from = 17.0, to = 18.0, step = 0.1 }]\n"
        }
        _ => "",
    };
    let irradiance = d.one(&[
        "",
        "irradiance = \"clear-sky\"\n",
        "irradiance = \"gensky\"\n",
        "irradiance = { constant = 1000 }\n",
        "irradiance = { constant = 0.5 }\n",
        "irradiance = { model = \"ineichen\", linke = [2, 2, 3, 3, 4, 4, 4, 4, 3, 3, 2, 2] }\n",
        "irradiance = { epw = \"site.epw\" }\n",
    ]);
    let half = d.often(0.25);
    let season = d.often(0.3);
    let weather = irradiance.contains("epw");
    let half_fits = !days.contains("09-21") && !days.contains("364");
    if half && (weather || season || !half_fits) {
        refused.push("half_year");
    }
    if weather && (latitude != 47.0) {
        refused.push("weather");
    }
    // Above the Arctic circle, or at midnight.
    if latitude > 60.0 && days.contains("360") {
        refused.push("below the horizon");
    }
    let _ = writeln!(
        text,
        "[time]\nyear = {}\ndays = {days}\nhours = {hours}\n{}{irradiance}{finer}{}",
        d.one(&[2025, 2024, 2018]),
        d.one(&["", "sun = \"gensky\"\n", "sun = \"gensky-2018\"\n", "sun = \"spa\"\n"]),
        if half { "half_year = true\n" } else { "" },
    );
    let _ = writeln!(
        text,
        "[photons]\nstored = {}\n{}{}{}seed = {}\n",
        d.one(&[400, 2000, 1, 6000]),
        d.one(&["", "max_path_m = 9.0\n", "max_path_m = 1e6\n"]),
        d.one(&["", "", "sun_visibility = false\n"]),
        d.one(&["", "", "receivers = \"diffuse\"\n"]),
        d.one(&["1", "0", "9000000000000000000"]),
    );
    season
}

fn pv(d: &mut Draw, text: &mut String) {
    let select = d.one(&[
        "object = \"roof\"",
        "modifier = \"pv\"",
        "material = \"pv\"",
        "min_tilt_deg = 5.0, max_tilt_deg = 60.0",
        "azimuth_deg = [200.0, 340.0], min_tilt_deg = 5.0, max_tilt_deg = 80.0",
        "object = \"roof\", polygon = [[1, -2], [5, -2], [7, 3], [3, 6]]",
    ]);
    // Polygons are drawn with north at the top.
    let turned = select.contains("polygon") && text.contains("north_deg");
    let select = if turned { "object = \"roof\"" } else { select };
    let _ = writeln!(
        text,
        "[[pv]]\nname = \"roof\"\nselect = {{ {select} }}\n{}",
        d.one(&["", "", "two_sided = true\n"])
    );
    // Rows have a tilt as well; each face belongs to one entry.
    if !select.contains("tilt") && d.often(0.25) {
        let _ = writeln!(
            text,
            "[[pv]]\nname = \"rows\"\narray = {{ polygon = [[8, 2], [14, 2], [14, 8], [8, 8]], tilt_deg = {}, azimuth_deg = 200, height_m = 0.6, row_pitch_m = 3, module_m = 1.1 }}\n{}",
            d.one(&[0, 35, 85]),
            d.one(&["", "two_sided = true\n"])
        );
    }
}

fn materials(d: &mut Draw, text: &mut String) {
    let count = 1 + d.below(2);
    for i in 0..count {
        let _ = writeln!(text, "[[material]]\nname = \"m{i}\"\n{}\n", d.one(&MATERIALS));
    }
    if d.often(0.2) {
        let rows = if text.contains("\"rows\"") {
            format!(", rows = \"m{}\"", count - 1)
        } else {
            String::new()
        };
        let _ = writeln!(text, "[[case]]\nname = \"mixed\"\nassign = {{ roof = \"m0\"{rows} }}\n");
    }
    if d.often(0.4) {
        let _ = writeln!(text, "[reference]\nmaterial = \"m{}\"\n", d.below(count));
    }
}

/// How many pictures there are.
fn views(d: &mut Draw, text: &mut String) -> usize {
    let pictures = d.below(3);
    for i in 0..pictures {
        let fuse = d.often(0.25);
        let both = !fuse && d.often(0.25);
        let _ = writeln!(
            text,
            "[[view]]\nname = \"v{i}\"\nview = \"{}\"\nsize = {}\n{}{}{}",
            d.one(&VIEWS),
            d.one(&SIZES),
            gathered(d),
            if fuse { "fuse = true\n" } else { "" },
            if both { "both_quantities = true\n" } else { "" },
        );
    }
    if d.often(0.4) {
        let _ = writeln!(
            text,
            "[[view]]\nname = \"points\"\nsensors = \"sensors.txt\"\n{}",
            gathered(d)
        );
    }
    pictures
}

/// The keys that say how photons become irradiance.
fn gathered(d: &mut Draw) -> String {
    let mut out =
        format!("estimator = \"{}\"\n", d.one(&["photons", "radiance", "direct", "direct"]));
    for (keys, share) in [
        (&["bandwidth = 2\n", "bandwidth = 50\n", "bandwidth = 5000\n"], 0.6),
        (&["series_bandwidth = 2\n", "series_bandwidth = 300\n", "series_bandwidth = 9000\n"], 0.6),
        (&["max_radius_m = 0.3\n", "max_radius_m = 5.0\n", "max_radius_m = 1e4\n"], 0.4),
        (
            &["kernel = \"flat\"\n", "kernel = \"epanechnikov\"\n", "kernel = \"epanechnikov\"\n"],
            0.4,
        ),
        (&["normal_tolerance_deg = 1.0\n", "normal_tolerance_deg = 90\n", ""], 0.3),
        (
            &["plane_tolerance_m = 0\n", "plane_tolerance_m = 0.01\n", "plane_tolerance_m = 100\n"],
            0.3,
        ),
        (&["edges = false\n", "edges = true\n", "edges = false\n"], 0.3),
        (&["series_edges = true\n", "series_edges = true\n", "series_edges = false\n"], 0.3),
    ] {
        if d.often(share) {
            out += d.one(keys);
        }
    }
    if !out.contains("direct") && d.often(0.3) {
        out += d.one(&["series_mantissa_bits = 1\n", "series_mantissa_bits = 9\n"]);
    }
    out
}

fn receivers(d: &mut Draw, text: &mut String, pictures: usize) {
    let class = |d: &mut Draw| match d.often(0.7) {
        true => format!("class = \"{}\"\n", d.one(&CLASSES)),
        false => String::new(),
    };
    let observers = [
        ("On the wall", "[-13.5, 2, 4]"),
        ("In the air", "[-1, 1, 5]"),
        ("In the cellar", "[12, -10, 2]"),
        ("On the roof", "[4, 0, 2.7]"),
        ("Far away", "[-500, 20, 9]"),
    ];
    let mut seen = Vec::new();
    for (name, point) in observers {
        if d.often(0.25) {
            seen.push(name);
            let direction = d.one(&["", "direction = [1, 0, 0]\n", "direction = [0, 0, -1]\n"]);
            let _ = writeln!(
                text,
                "[[observer]]\nname = \"{name}\"\npoint = {point}\n{direction}{}",
                class(d)
            );
        }
    }
    let drawn = "polygon = [[0, 0], [12, 0], [12, 12], [0, 12]]\nview = \"v0\"";
    let regions = [
        ("Wall", "object = \"wall\"\nspacing_m = 2.0"),
        ("Things", "object = [\"fence\", \"chimney\", \"tree\"]\nspacing_m = 1.5"),
        ("PV itself", "object = \"roof\""),
        ("Yard", "polygon = [[-13, -6], [-1, -6], [-1, 6], [-13, 6]]\nspacing_m = 3.0"),
        (
            "Above",
            "polygon = [[-12, -3], [-8, -3], [-8, 2], [-12, 2]]\nheight_m = 2.0\nspacing_m = 2.0",
        ),
    ];
    for (name, how) in regions {
        if d.often(0.2) {
            let _ = writeln!(text, "[[region]]\nname = \"{name}\"\n{how}\n{}", class(d));
        }
    }
    if pictures > 0 && text.contains("-vtl -vp 0 0 50") && d.often(0.3) {
        let _ = writeln!(text, "[[region]]\nname = \"Drawn\"\n{drawn}\n{}", class(d));
    }
    if d.often(0.4) {
        let _ = writeln!(text, "[receivers]\nestimator = \"{}\"\n", d.one(&["direct", "photons"]));
    }
    if d.often(0.25) {
        let camera = match (pictures, seen.last()) {
            (_, Some(name)) if d.often(0.5) => format!("observer = \"{name}\""),
            (1.., _) if d.often(0.5) => "view = \"v0\"".to_owned(),
            _ => format!("view = \"{}\"", d.one(&VIEWS)),
        };
        let _ = writeln!(
            text,
            "[[moment]]\ndate = {}\ntime = \"{}\"\n{camera}\nsize = {}\n",
            d.one(&["\"06-11\"", "0", "\"12-21\""]),
            d.one(&["08:30", "12:00", "00:00", "23:59", "19:05"]),
            d.one(&["[12, 9]", "[1, 1]", "[16, 16]"]),
        );
    }
}

fn glare(d: &mut Draw, text: &mut String) {
    let rules: Vec<String> =
        RULES.iter().filter(|_| d.often(0.35)).map(|r| format!("\"{r}\"")).collect();
    let _ = writeln!(
        text,
        "[glare]\nthresholds_w_m2 = {}\nrules = [{}]\n{}{}{}",
        d.one(&["[10.0, 30.0]", "[10.0]", "[]", "[0.0]", "[0.001, 1000.0, 5.0]"]),
        rules.join(", "),
        d.one(&["", "quantity = \"surface\"\n", "quantity = \"normal\"\n"]),
        d.one(&[
            "",
            "sigma = [0.0, 0.0, 0.0]\n",
            "sigma = [2.5, 0.5, 0.0]\ntruncate = 3.0\n",
            "sigma = [0.0, 30.0, 1.0]\n",
            "sigma = [1.0, 1.0, 1.0]\ntruncate = 0.0\n",
        ]),
        d.one(&["", "connectivity = 18\n", "connectivity = 26\n"]),
    );
}

/// Weather of any day: 500 W/m2 at each hour.
fn weather() -> String {
    let mut out =
        "LOCATION,Here,-,-,-,-,47.0,8.0,1,400\nDATA PERIODS,1,1,Data,Sunday,1/1,12/31\n".to_owned();
    let lengths = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    for (month, length) in (1..).zip(lengths) {
        for day in 1..=length {
            for hour in 1..=24 {
                let _ = writeln!(out, "2020,{month},{day},{hour},60,?,1,1,1,1,0,0,0,0,500,0,0");
            }
        }
    }
    out
}

/// Runs a drawn project; what is wrong with how it ends.
fn go(folder: &Path, drawn: &Drawn) {
    fs::write(folder.join("project.toml"), &drawn.text).expect("writes");
    let path = folder.to_str().expect("a plain path");
    let set: Vec<&str> = drawn.mistake.iter().flat_map(|m| ["--set", m.as_str()]).collect();
    let run = |command: &str| {
        let quiet = if command == "run" { &["--quiet"][..] } else { &[] };
        within(&[&[command, path][..], &set, quiet].concat())
    };
    let said = run("run");
    if said.code == 2 {
        let mut words = drawn.refused.iter().chain(&drawn.perhaps);
        assert!(words.any(|w| said.err.contains(w)), "{:?}: {}", drawn.refused, said.err);
        // What the project file tells is refused before anything is made.
        let made = folder.join("run/manifest.json").exists();
        assert!(!made || drawn.refused.is_empty(), "something was made before {}", said.err);
        return;
    }
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(drawn.refused.is_empty(), "{:?} isn't refused", drawn.refused);
    assert_sane(&folder.join("run"));
    let again = run("run");
    assert!(again.code == 0 && again.out.contains("nothing to do"), "{} {}", again.out, again.err);
    for command in ["check", "plan"] {
        let said = run(command);
        assert_eq!(said.code, 0, "{command}: {}", said.err);
    }
    let said = within(&["verify", path]);
    assert_eq!(said.code, 0, "verify: {} {}", said.out, said.err);
}

#[test]
fn whatever_keys_a_project_has_it_runs_or_is_refused_by_name() {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse().ok());
    let (first, rounds) =
        (number("GLINTMAP_FIRST_ROUND").unwrap_or(0), number("GLINTMAP_ROUNDS").unwrap_or(ROUNDS));
    let keep = tempfile::tempdir().expect("a temporary folder");
    let files = keep.path().join("files");
    yard::write(&files);
    fs::write(files.join("site.epw"), weather()).expect("writes");
    fs::write(
        files.join("klems.xml"),
        crate::physics::bsdf_files::klems("LBNL/Klems Quarter", " "),
    )
    .expect("writes");
    let tree = files.join("tree.xml");
    let said = within(&[
        "bsdf",
        "standard",
        "--write",
        tree.to_str().expect("a plain path"),
        "--resolution",
        "5",
    ]);
    assert_eq!(said.code, 0, "{}", said.err);
    let (mut ran, mut failed) = (0, Vec::new());
    for round in first..first + rounds {
        let folder = keep.path().join(format!("round-{round}"));
        copy(&files, &folder);
        let drawn = draw(round);
        let begun = Instant::now();
        let outcome = std::panic::catch_unwind(|| go(&folder, &drawn));
        ran += usize::from(folder.join("run/report.html").exists());
        println!("round {round}: {:.1} s, {:?}", begun.elapsed().as_secs_f64(), drawn.refused);
        if let Err(what) = outcome {
            let what = what.downcast_ref::<String>().cloned().unwrap_or_default();
            println!("FAILED round {round}: {what}\n--set {:?}\n{}", drawn.mistake, drawn.text);
            failed.push(round);
        }
        fs::remove_dir_all(&folder).expect("removes");
    }
    assert!(failed.is_empty(), "rounds {failed:?}");
    assert!(ran > 0 || rounds < 4, "not one of {rounds} projects ran to its end");
}
