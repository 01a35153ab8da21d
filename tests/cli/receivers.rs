//! Sensors, observers and regions, and what is said of them.

use std::fs;
use std::path::Path;

use glintmap::glare::{Lengths, margins, spot};
use glintmap::picture::png;
use glintmap::render::HitMap;
use glintmap::volume::Volume;
use glintmap_formats::npy;
use serde_json::Value;

use crate::support::program::{project, say, succeed};

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).expect("reads")).expect("JSON")
}

/// One run of the tiny project tells of an eye in free air, a point on the wall, a façade and the
/// ground.
#[test]
fn receivers_are_told_of_and_never_silently_dark() {
    let (_keep, folder) = project("tiny");
    let said = succeed(&["run", text(&folder), "--quiet"]);
    assert!(said.out.contains("The wall, standard: "), "{}", said.out);
    let run = folder.join("run");
    let received = json(&run.join("standard/receivers/receivers.json"));
    let groups = received["groups"].as_array().expect("groups");
    let air = &groups[0];
    assert_eq!(air["name"], "Wall");
    assert!(air["not_evaluated"].is_null() && air["in_air"] == 1, "{air}");
    assert!(air["annual_max_wh_m2"].as_f64().expect("Wh/m2") > 0.0, "{air}");
    let verdicts = json(&run.join("verdicts.json"));
    let of = |receiver: &str| -> Vec<Value> {
        let all = verdicts.as_array().expect("a list");
        all.iter().filter(|v| v["receiver"] == receiver).cloned().collect()
    };
    for v in of("Wall") {
        assert_ne!(v["verdict"]["outcome"], "not-evaluated", "{v}");
        assert!(v["criteria"].to_string().contains("distance to the PV"), "{v}");
    }
    let report = fs::read_to_string(run.join("report.html")).expect("reads");
    for words in ["In short", "The wall (dwelling)", "free air", "worst day", "CEST"] {
        assert!(report.contains(words), "{words}");
    }

    // The wall: a façade of 20 x 6.5 m, its back, top, bottom and ends.
    let wall = &groups[2];
    assert!((wall["area_m2"].as_f64().expect("m2") - 286.5).abs() < 1e-6, "{wall}");
    let ten = &wall["thresholds"][0];
    let hours = |v: &Value| v.as_f64().expect("h");
    assert!(hours(&ten["hours"]["value"]) > 0.0);
    assert!(hours(&ten["hours"]["low"]) <= hours(&ten["hours"]["value"]));
    assert!(hours(&ten["hours"]["value"]) <= hours(&ten["anywhere"]["hours"]));
    assert!(run.join("standard/receivers/occurrence/03-the-wall.png").exists());

    // A row for each point; what isn't known is left out, not 0.
    let sheet = fs::read_to_string(run.join("standard/receivers/sensors.csv")).expect("reads");
    let mut rows = sheet.lines();
    let columns = rows.next().expect("a head").split(',').count();
    assert!(rows.all(|r| r.split(',').count() == columns), "{sheet}");
    let first = sheet.lines().nth(1).expect("a row");
    assert!(first.starts_with("Wall,0,") && first.contains(",air,"), "{first}");
    assert_eq!(sheet.lines().count() as u64, 1 + points(groups));

    events_say_when_where_and_who(&run);
    maps_of_the_year_are_those_of_each_pixel(&run);
    clocks_of_eyes_are_civil(&run);
    all_rules_stand_in_a_line(&report, &verdicts, "The wall");
    for map in ["month_06_h", "longest_run_h", "exceeded_30min_w_m2", "exceeded_50h_w_m2"] {
        let png = format!("standard/plan/glare-10/unfiltered/{map}.png");
        assert!(run.join(&png).exists(), "{png}");
    }
    assert!(!run.join("standard/plan/glare-10/unfiltered/month_05_h.png").exists());
}

/// Observers and regions integrated, without a photon: as the first picture is, or where the project
/// says so; and what photons say of them.
#[test]
fn receivers_are_integrated_where_the_project_says_so() {
    let run = |change: &dyn Fn(String) -> String, stored: &str| {
        let (keep, folder) = project("tiny");
        let file = folder.join("project.toml");
        let before = fs::read_to_string(&file).expect("reads");
        fs::write(&file, change(before)).expect("writes");
        let stored = format!("photons.stored={stored}");
        succeed(&["run", text(&folder), "--quiet", "--until", "report", "--set", &stored]);
        (keep, folder.join("run/standard"))
    };
    let (_a, alone) =
        run(&|p| p.replace("estimator = \"photons\"", "estimator = \"direct\""), "4000");
    assert!(!alone.join("photons.gmp").exists() && !alone.join("receivers/air.gmp").exists());
    let (_b, beside) = run(&|p| p + "\n[receivers]\nestimator = \"direct\"\n", "4000");
    assert!(beside.join("photons.gmp").exists());
    let sheet = |run: &Path| fs::read_to_string(run.join("receivers/sensors.csv")).expect("reads");
    assert_eq!(sheet(&alone), sheet(&beside));
    // The few photons beside make a draft, but not of these.
    let chart = |run: &Path| png::read(&run.join("receivers/occurrence/03-the-wall.png"));
    assert!(chart(&alone).expect("a chart") == chart(&beside).expect("a chart"));

    let (_c, counted) = run(&|p| p, "400000");
    let groups = |run: &Path| json(&run.join("receivers/receivers.json"))["groups"].clone();
    let (exact, photons) = (groups(&alone), groups(&counted));
    // Four seeds differ by 1.1, 9, 1.6 and 6.9 % (one standard deviation) at these four.
    for (at, allowed) in [(0, 0.15), (1, 0.2), (2, 0.05), (3, 0.2)] {
        let mean = |of: &Value| of[at]["annual_mean_wh_m2"].as_f64().expect("Wh/m2");
        let (exact, photons) = (mean(&exact), mean(&photons));
        println!(
            "{}: {exact} by integration, {photons} Wh/m2 by photons",
            groups(&alone)[at]["name"]
        );
        assert!(exact > 0.0 && (photons / exact - 1.0).abs() < allowed, "{photons} {exact}");
    }
    // Without noise there is no band.
    let ten = &exact[2]["thresholds"][0]["hours"];
    assert_eq!((&ten["low"], &ten["high"]), (&ten["value"], &ten["value"]), "{ten}");
    let verdicts = json(&alone.parent().expect("run").join("verdicts.json"));
    let limits = verdicts.as_array().expect("a list").iter().filter(|v| v["receiver"].is_string());
    let limits: Vec<&Value> =
        limits.flat_map(|v| v["verdict"]["limits"].as_array().expect("limits")).collect();
    assert!(limits.iter().any(|l| l["band"][0].as_f64() > Some(0.0)));
    assert!(limits.iter().all(|l| l["band"][0] == l["band"][1]), "{verdicts}");

    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    fs::write(&file, before + "\n[receivers]\nestimator = \"radiance\"\n").expect("writes");
    let said = say(&["check", text(&folder)]);
    assert_eq!(said.code, 2);
    assert!(said.err.contains("expected \"photons\" or \"direct\""), "{}", said.err);
}

/// `between_h` of each observer, against the clock times in its table.
fn clocks_of_eyes_are_civil(run: &Path) {
    let eyes = json(&run.join("standard/receivers/observers.json"));
    assert_eq!(eyes["clock"], "Europe/Zurich");
    let sheet = fs::read_to_string(run.join("standard/receivers/observers.csv")).expect("reads");
    let columns: Vec<&str> = sheet.lines().next().expect("a head").split(',').collect();
    let at = |name: &str| columns.iter().position(|c| *c == name).expect(name);
    let mut checked = 0;
    for eye in eyes["observers"].as_array().expect("observers") {
        let glare = &eye["times"][0]["glare"];
        let Some(between) = glare["between_h"].as_array() else { continue };
        let hours: Vec<f64> = sheet
            .lines()
            .skip(1)
            .map(|line| line.split(',').collect::<Vec<_>>())
            .filter(|w| {
                w[0] == eye["name"]
                    && w[at("irradiance_w_m2")].parse::<f64>().is_ok_and(|v| v > 10.0)
            })
            .map(|w| {
                // `06-14 07:30 CEST`
                let clock =
                    w[at("at")].split(' ').nth(1).expect("a time").split_once(':').expect("h:m");
                let number = |t: &str| t.parse::<f64>().expect("a number");
                number(clock.0) + number(clock.1) / 60.0
            })
            .collect();
        let least = hours.iter().copied().fold(24.0, f64::min);
        let most = hours.iter().copied().fold(0.0, f64::max);
        assert_eq!([between[0].as_f64(), between[1].as_f64()], [Some(least), Some(most)]);
        checked += 1;
    }
    assert!(checked > 0, "no observer is dazzled");
}

/// `24 min on 21 June, 17 h in the year: within paper-2018`, in the report.
fn all_rules_stand_in_a_line(report: &str, verdicts: &Value, receiver: &str) {
    let of = |v: &&Value| v["receiver"] == receiver && v["material"] == "standard";
    let found = verdicts.as_array().expect("a list").iter().find(of).expect("a verdict");
    let limits = found["verdict"]["limits"].as_array().expect("limits");
    let word = match found["verdict"]["outcome"].as_str() {
        _ if limits.iter().any(|l| l["certain"] == false) => "Not certain within the noise",
        Some("kept") => "Kept",
        Some("exceeded") => "Exceeded",
        other => panic!("{other:?}"),
    };
    let expected = format!(" {word}: {}.", found["rule"].as_str().expect("an id"));
    let lines: Vec<&str> = report.split(" in the year.").collect();
    assert!(lines[1..].iter().any(|rest| rest.starts_with(&expected)), "{expected}");
}

fn points(groups: &[Value]) -> u64 {
    // The two observers, and all points of the regions: none of them lies in the air.
    2 + groups[2..].iter().map(|g| g["points"].as_u64().expect("points")).sum::<u64>()
}

fn events_say_when_where_and_who(run: &Path) {
    let glare = run.join("standard/plan/glare-10");
    let csv = fs::read_to_string(glare.join("events.csv")).expect("reads");
    let head = csv.lines().next().expect("a head");
    assert!(head.starts_with("first,last,voxels,pixels,peak_w_m2,"), "{head}");
    let columns: Vec<&str> = head.split(',').collect();
    let at = |name: &str| columns.iter().position(|c| *c == name).expect(name);
    let points = json(&glare.join("events.geojson"));
    let features = points["features"].as_array().expect("features");
    assert_eq!(features.len(), csv.lines().count() - 1);
    assert!(!features.is_empty());
    for (line, feature) in csv.lines().skip(1).zip(features) {
        let words: Vec<&str> = line.split(',').collect();
        assert_eq!(words.len(), columns.len(), "{line}");
        assert!(words[at("first_at")].starts_with("06-") && words[at("last_at")].ends_with("CEST"));
        assert_eq!(words[at("pv_surface")], "roof", "{line}");
        assert_eq!(feature["properties"]["object"], words[at("object")]);
        let x: f64 = words[at("x_m")].parse().expect("a number");
        assert_eq!(feature["geometry"]["coordinates"][0].as_f64(), Some(x));
        assert!((-15.1..=20.0).contains(&x), "{line}");
    }
}

/// The maps that stream through the volume tile by tile against a look at each pixel's series.
fn maps_of_the_year_are_those_of_each_pixel(run: &Path) {
    let volume = Volume::open(&run.join("standard/plan/series.zarr")).expect("opens");
    let mut axis = volume.axis().expect("a calendar").clone();
    let lengths = Lengths::of(&axis).expect("hours that rise");
    // June in Zurich: clocks show summer time.
    axis.hour.iter_mut().for_each(|hour| *hour += 1.0);
    let [_, rows, columns] = volume.shape();
    let map = |name: &str| {
        let path = run.join("standard/plan/glare-10/unfiltered").join(format!("{name}.npy"));
        npy::Reader::<f32>::open(&path).expect("opens").read_all().expect("reads")
    };
    let names = [
        "above_h",
        "days",
        "longest_run_h",
        "longest_day_h",
        "first_hour",
        "last_hour",
        "exceeded_30min_w_m2",
        "exceeded_50h_w_m2",
        "month_06_h",
    ];
    let maps = names.map(map);
    let mut dazzled = 0;
    for row in 0..rows {
        for column in 0..columns {
            let series = volume.pixel(column, row).expect("reads");
            let s = spot(&axis, &lengths, |t| series[t] > 10.0);
            let [worst, year] = margins(&axis, &lengths, &series).expect("fits");
            let [first, last] = s.between_h.unwrap_or_default();
            let expected = [
                s.hours as f32,
                s.days as f32,
                s.longest_run_h as f32,
                s.longest_day_h as f32,
                first as f32,
                last as f32,
                worst,
                year,
                s.months_h[5] as f32,
            ];
            for ((name, map), expected) in names.iter().zip(&maps).zip(expected) {
                assert_eq!(map[row * columns + column], expected, "{name} at {column}, {row}");
            }
            dazzled += usize::from(s.hours > 0.0);
        }
    }
    assert!(dazzled > 20, "{dazzled}");
}

/// A sensor where a pixel looks receives what the pixel receives.
#[test]
fn sensors_receive_what_pixels_there_receive() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    succeed(&["run", path, "--quiet", "--until", "render"]);
    let run = folder.join("run");
    let (hits, _) = HitMap::read(&run.join("plan/hits.gmh")).expect("reads");
    let pixels: Vec<usize> =
        (0..hits.hits.len()).filter(|i| hits.hits[*i].kind.receives()).collect();
    let chosen: Vec<usize> = pixels.iter().copied().step_by(pixels.len() / 150).collect();
    let mut lines = String::from("# from the plan\n\n");
    for i in &chosen {
        let h = &hits.hits[*i];
        let [p, n] = [h.position, h.normal];
        lines += &format!("{} {} {} {} {} {} # pixel {i}\n", p.x, p.y, p.z, n.x, n.y, n.z);
    }
    fs::write(folder.join("points.txt"), lines).expect("writes");
    let file = folder.join("project.toml");
    let before = fs::read_to_string(&file).expect("reads");
    let view = "[[view]]\nname = \"spots\"\nsensors = \"points.txt\"\nbandwidth = 50\nseries_bandwidth = 200\n";
    fs::write(&file, format!("{before}\n{view}")).expect("writes");
    succeed(&["run", path, "--quiet"]);
    let volume = |view: &str| {
        Volume::open(&run.join("standard").join(view).join("series.zarr")).expect("opens")
    };
    let (plan, spots) = (volume("plan"), volume("spots"));
    assert_eq!(spots.shape()[1..], [1, chosen.len()]);
    let mut lit = 0;
    for (sensor, i) in chosen.iter().enumerate() {
        let here = plan.pixel(i % hits.columns, i / hits.columns).expect("reads");
        let there = spots.pixel(sensor, 0).expect("reads");
        let (a, b): (f32, f32) = (here.iter().sum(), there.iter().sum());
        // The place is found anew, a rounding of float32 away.
        assert!((a - b).abs() <= 0.01 * a, "pixel {i}: {a} {b}");
        lit += usize::from(a > 0.0);
    }
    assert!(lit > 20, "{lit}");
    let sheet = fs::read_to_string(run.join("standard/spots/sensors.csv")).expect("reads");
    assert_eq!(sheet.lines().count(), chosen.len() + 1);
    let found = succeed(&["probe", path, "--view", "spots", "--pixel", "3,0"]);
    assert!(found.out.contains("standard"), "{}", found.out);
    fs::write(folder.join("points.txt"), "1 2 3 0 0 1\n1 2 3\n").expect("writes");
    let wrong = say(&["run", path, "--quiet"]);
    assert_eq!(wrong.code, 2);
    assert!(wrong.err.contains("points.txt") && wrong.err.contains("line 2"), "{}", wrong.err);
}

#[test]
fn a_rule_of_ones_own_decides_the_exit_code() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    let rule = |limit: f64| {
        let text = format!(
            "id = \"mine\"\nversion = \"1\"\nstatus = \"orientation\"\nsource = \"the neighbour\"\n\n\
             [[limit]]\nid = \"year\"\nquantity = \"annual_h\"\nvalue = {limit}\nthreshold_w_m2 = 10.0\n\
             classes = [\"dwelling\"]\n"
        );
        fs::write(folder.join("mine.toml"), text).expect("writes");
    };
    let set = ["run", path, "--quiet", "--set", "glare.rules=[\"mine.toml\", \"sandia-hazard\"]"];
    let fail_on = |rule: &'static str| [&set[..], &["--fail-on", rule]].concat();
    rule(1.0);
    let said = say(&fail_on("mine"));
    assert_eq!(said.code, 4, "{}", said.err);
    assert!(
        said.err.contains(
            "The wall, standard: Rule mine is exceeded. The limit of 1 h of glare a year"
        ),
        "{}",
        said.err
    );
    // Today's tile roof is no reason to fail, nor is a rule that can't be evaluated.
    assert!(!said.err.contains("tile"), "{}", said.err);
    assert_eq!(say(&fail_on("sandia-hazard")).code, 0);
    rule(1000.0);
    let said = succeed(&fail_on("mine"));
    assert!(said.out.contains("The wall, standard: Rule mine is kept."), "{}", said.out);
    let unknown = say(&fail_on("theirs"));
    assert_eq!(unknown.code, 2);
    assert!(unknown.err.contains("mine, sandia-hazard"), "{}", unknown.err);
    fs::write(folder.join("mine.toml"), "id = \"mine\"\nversion = 1\n").expect("writes");
    let wrong = say(&set);
    assert_eq!(wrong.code, 2);
    assert!(wrong.err.contains("mine.toml") && wrong.err.contains("line 2"), "{}", wrong.err);
}

/// The same ground in local and in map coordinates, and a part of it drawn into the picture.
#[test]
fn a_region_is_the_same_however_it_is_drawn() {
    let (_keep, folder) = project("tiny");
    let file = folder.join("project.toml");
    let project = fs::read_to_string(&file).expect("reads");
    let project = project.replacen("[scene]\n", "[scene]\norigin = [1000.0, 2000.0, 0.0]\n", 1);
    let regions = r#"
[[region]]
name = "By map"
polygon = [[986.0, 1992.0], [994.0, 1992.0], [994.0, 2008.0], [986.0, 2008.0]]
coordinates = "map"
class = "outdoor"

[[region]]
name = "In the picture"
polygon = [[20, 24], [44, 24], [44, 40], [20, 40]]
view = "plan"
"#;
    fs::write(&file, project + regions).expect("writes");
    succeed(&["run", text(&folder), "--quiet", "--until", "glare"]);
    let run = folder.join("run");
    let received = json(&run.join("standard/receivers/receivers.json"));
    let group = |name: &str| {
        let all = received["groups"].as_array().expect("groups");
        let mut found = all.iter().find(|g| g["name"] == name).expect("a group").clone();
        found.as_object_mut().expect("an object").remove("name");
        found
    };
    let (local, map) = (group("Ground before the wall"), group("By map"));
    assert!(local["peak_w_m2"].as_f64().expect("W/m2") > 0.0, "{local}");
    for key in ["points", "area_m2", "peak_w_m2", "annual_max_wh_m2", "exceeded_30min_w_m2"] {
        assert_eq!(local[key], map[key], "{key}");
    }
    assert_eq!(local["thresholds"][0]["hours"], map["thresholds"][0]["hours"]);

    // A point for each pixel inside that takes light, where that pixel looks.
    let (hits, _) = HitMap::read(&run.join("plan/hits.gmh")).expect("reads");
    let inside: Vec<_> = (24..40)
        .flat_map(|row| (20..44).map(move |column| (column, row)))
        .map(|(column, row)| hits.at(column, row))
        .filter(|h| h.kind.receives())
        .collect();
    let sheet = fs::read_to_string(run.join("standard/receivers/sensors.csv")).expect("reads");
    let points: Vec<[f32; 3]> = sheet
        .lines()
        .filter(|line| line.starts_with("In the picture,"))
        .map(|line| {
            let words: Vec<&str> = line.split(',').collect();
            [2, 3, 4].map(|i| words[i].parse().expect("a number"))
        })
        .collect();
    assert_eq!(points.len(), inside.len());
    for p in points {
        let far = |h: &&glintmap::render::Hit| (h.position - glam::Vec3::from_array(p)).length();
        let nearest = inside.iter().map(far).fold(f32::INFINITY, f32::min);
        assert!(nearest < 1.0, "{p:?} lies {nearest} m from all pixels of the region");
    }
}

#[test]
fn mistakes_in_regions_are_named_before_anything_is_made() {
    let (_keep, folder) = project("tiny");
    let path = text(&folder);
    for (key, value, words) in [
        ("region.The wall.object", "\"wal\"", "the nearest are wall"),
        ("region.The wall.spacing_m", "0.0", "spacing_m"),
        ("region.The wall.polygon", "[[0, 0], [1, 1], [0, 1]]", "either `object` or `polygon`"),
        ("region.Ground before the wall.view", "\"pan\"", "there are: plan"),
        ("region.Ground before the wall.coordinates", "\"maps\"", "\"local\" or \"map\""),
        ("observer.Wall.class", "\"dweling\"", "dwelling"),
    ] {
        let said = say(&["run", path, "--quiet", "--set", &format!("{key}={value}")]);
        assert_eq!(said.code, 2, "{key}: {}", said.err);
        assert!(said.err.contains(words), "{key}: {}", said.err);
    }
    assert!(!folder.join("run/standard").exists());
}
