//! One wrong value at a time in a project that has every table: each is refused with exit code 2 and
//! its key, before anything is made. What is found only once photons are traced, or not at all,
//! costs its user an hour or the result.

use std::fs;

use crate::support::program::within;
use crate::support::yard;

/// Wrong values, each with the words that its refusal must hold; keys are those of [`WHOLE`].
pub const MISTAKES: [(&str, &str, &str); 94] = [
    ("site.latitude", "91.0", "latitude"),
    ("site.longitude", "nan", "longitude"),
    ("site.meridian", "-181.0", "meridian"),
    ("site.elevation_m", "nan", "elevation"),
    ("site.elevation_m", "1e9", "elevation"),
    ("site.timezone", "\"Europe/Nowhere\"", "timezone"),
    ("site.horizon", "[[0.0, 95.0]]", "horizon"),
    ("site.horizon", "\"nowhere.csv\"", "horizon"),
    ("scene.files", "[]", "files"),
    ("scene.files", "[\"nowhere.rad\"]", "nowhere.rad"),
    ("scene.default_reflectance", "1.5", "default_reflectance"),
    ("scene.north_deg", "nan", "north_deg"),
    ("scene.origin", "\"middle\"", "origin"),
    ("scene.origin", "[nan, 0.0, 0.0]", "origin"),
    ("scene.origin", "[1e300, 0.0, 0.0]", "origin"),
    ("scene.reflectance", "{ grey = 2.0 }", "reflectance"),
    ("pv.roof.select", "{ object = \"rof\" }", "roof"),
    ("pv.roof.select", "{ min_tilt_deg = nan }", "select"),
    ("pv.roof.select", "{ polygon = [[0, 0], [1, 0]] }", "polygon"),
    ("pv.roof.select", "{}", "select"),
    (
        "pv.roof.array",
        "{ polygon = [[8, 2], [14, 2], [14, 8]], tilt_deg = 10, azimuth_deg = 0, height_m = 1, row_pitch_m = 3, module_m = 1 }",
        "roof",
    ),
    (
        "pv.rows.array",
        "{ polygon = [[8, 2], [14, 2], [14, 8]], tilt_deg = 90, azimuth_deg = 0, height_m = 1, row_pitch_m = 3, module_m = 1 }",
        "tilt_deg",
    ),
    (
        "pv.rows.array",
        "{ polygon = [[8, 2], [14, 2], [14, 8]], tilt_deg = 10, azimuth_deg = nan, height_m = 1, row_pitch_m = 3, module_m = 1 }",
        "azimuth_deg",
    ),
    (
        "pv.rows.array",
        "{ polygon = [[8, 2], [14, 2], [14, 8]], tilt_deg = 10, azimuth_deg = 0, height_m = 1, row_pitch_m = 0, module_m = 1 }",
        "row_pitch_m",
    ),
    ("material.m0.model", "{ kind = \"lambertian\", reflectance = 1.5 }", "reflectance"),
    ("material.m0.model", "{ kind = \"mixture\", parts = [] }", "mixture"),
    ("material.m0.model", "\"standart\"", "standart"),
    ("material.m0.bsdf", "\"nowhere.xml\"", "m0"),
    ("material.m0.side", "\"back\"", "side"),
    ("case.mixed.assign", "{ roof = \"m9\", rows = \"m0\" }", "m9"),
    ("case.mixed.assign", "{ roof = \"m0\" }", "rows"),
    ("reference.material", "\"m9\"", "reference.material"),
    ("time.year", "100", "year"),
    ("time.days.step", "0", "days"),
    ("time.days.to", "400", "days"),
    ("time.days.from", "\"13-01\"", "days"),
    ("time.hours.step", "0.0", "hours"),
    ("time.hours.step", "nan", "hours"),
    ("time.hours.to", "24.5", "hours"),
    ("time.finer", "[{ from = 3.0, to = 2.0, step = 0.1 }]", "finer"),
    ("time.finer", "[{ from = 9.0, to = 10.0, step = 9.0 }]", "finer"),
    ("time.sun", "\"spar\"", "sun"),
    ("time.irradiance", "\"cloudy\"", "irradiance"),
    ("time.irradiance", "{ constant = -1.0 }", "irradiance"),
    ("time.irradiance", "{ constant = nan }", "irradiance"),
    ("time.irradiance", "{ model = \"ineichen\", linke = [3.0] }", "linke"),
    ("time.irradiance", "{ epw = \"nowhere.epw\" }", "nowhere.epw"),
    ("photons.stored", "0", "stored"),
    ("photons.max_path_m", "0.0", "max_path_m"),
    ("photons.max_path_m", "1e9", "max_path_m"),
    ("photons.bounces", "2", "bounces"),
    ("photons.receivers", "\"some\"", "receivers"),
    ("view.v0.size", "[0, 4]", "size"),
    ("view.v0.size", "[70000, 70000]", "size"),
    ("view.v0.view", "\"-vtx\"", "view"),
    ("view.v0.view", "\"-vtv -vd 0 0 0\"", "view"),
    ("view.v0.view_file", "\"nowhere.vf\"", "view_file"),
    ("view.v0.estimator", "\"photon\"", "estimator"),
    ("view.v0.bandwidth", "1", "bandwidth"),
    ("view.v0.series_bandwidth", "0", "series_bandwidth"),
    ("view.v0.max_radius_m", "0.0", "max_radius_m"),
    ("view.v0.kernel", "\"round\"", "kernel"),
    ("view.v0.normal_tolerance_deg", "0.0", "normal_tolerance_deg"),
    ("view.v0.plane_tolerance_m", "-1.0", "plane_tolerance_m"),
    ("view.v0.series_mantissa_bits", "24", "series_mantissa_bits"),
    ("view.fused.both_quantities", "true", "both_quantities"),
    ("view.points.fuse", "true", "fuse"),
    ("view.points.both_quantities", "true", "both_quantities"),
    ("view.points.sensors", "\"nowhere.txt\"", "nowhere.txt"),
    ("view.points.coordinates", "\"maps\"", "coordinates"),
    ("observer.Wall.class", "\"dweling\"", "dwelling"),
    ("observer.Wall.direction", "[0.0, 0.0, 0.0]", "direction"),
    ("observer.Wall.point", "[1e30, 0.0, 0.0]", "[[observer]] \"Wall\""),
    ("region.Yard.spacing_m", "0.0", "spacing_m"),
    ("region.Yard.height_m", "inf", "height_m"),
    ("region.Yard.polygon", "[[0, 0], [1, 1]]", "polygon"),
    (
        "region.Yard.polygon",
        "[[1e6, 1e6], [1e9, 1e6], [1e9, 1e9], [1e6, 1e9]]",
        "[[region]] \"Yard\"",
    ),
    ("receivers.estimator", "\"radiance\"", "receivers.estimator"),
    ("moment.eye.size", "[0, 9]", "size"),
    ("moment.plan.size", "[100000, 100000]", "size"),
    ("moment.eye.time", "\"25:00\"", "time"),
    ("moment.eye.time", "\"01:30\"", "[[moment]] \"eye\""),
    ("moment.eye.date", "366", "date"),
    ("moment.eye.observer", "\"Nobody\"", "Nobody"),
    ("glare.thresholds_w_m2", "[10.0, 10.0]", "thresholds_w_m2"),
    ("glare.thresholds_w_m2", "[1e39]", "threshold"),
    ("glare.quantity", "\"both\"", "quantity"),
    ("glare.sigma", "[1.0, -1.0, 1.0]", "sigma"),
    ("glare.truncate", "nan", "truncate"),
    ("glare.truncate", "inf", "truncate"),
    ("glare.truncate", "1e9", "truncate"),
    ("glare.connectivity", "7", "connectivity"),
    ("glare.rules", "[\"paper-2019\"]", "rules"),
    ("glare.rules", "[\"paper-2018\", \"paper-2018\"]", "rules"),
];

/// A project in which every table is there.
const WHOLE: &str = r#"
[site]
name = "Yard"
latitude = 47.0
longitude = 8.0
meridian = 15.0
[scene]
files = ["scene.rad"]
[reference]
material = "m0"
[[pv]]
name = "roof"
select = { object = "roof" }
[[pv]]
name = "rows"
array = { polygon = [[8, 2], [14, 2], [14, 8]], tilt_deg = 10, azimuth_deg = 200, height_m = 0.6, row_pitch_m = 3, module_m = 1.1 }
[[material]]
name = "m0"
model = "standard"
[[case]]
name = "mixed"
assign = { roof = "m0", rows = "m0" }
[time]
days = { from = "06-21", to = "06-21", step = 1 }
hours = { from = 9.0, to = 17.0, step = 2.0 }
[photons]
stored = 400
[[view]]
name = "v0"
view = "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 30"
size = [8, 6]
[[view]]
name = "fused"
view = "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 30"
size = [8, 6]
fuse = true
[[view]]
name = "points"
sensors = "sensors.txt"
[[observer]]
name = "Wall"
point = [-13.5, 2, 4]
direction = [1, 0, 0]
[[region]]
name = "Yard"
polygon = [[-13, -6], [-1, -6], [-1, 6], [-13, 6]]
spacing_m = 3.0
[receivers]
estimator = "photons"
[[moment]]
name = "eye"
date = "06-11"
time = "08:30"
observer = "Wall"
size = [8, 6]
[[moment]]
name = "plan"
date = "06-11"
time = "08:30"
view = "v0"
size = [8, 6]
[glare]
rules = ["paper-2018"]
"#;

#[test]
fn every_wrong_value_is_refused_by_its_key_before_anything_is_made() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let folder = keep.path();
    yard::write(folder);
    fs::write(folder.join("project.toml"), WHOLE).expect("writes");
    let path = folder.to_str().expect("a plain path");
    let check = within(&["check", path]);
    assert_eq!(check.code, 0, "{}", check.err);
    let mut wrong = Vec::new();
    for (key, value, words) in MISTAKES {
        let set = format!("{key}={value}");
        let said = within(&["run", path, "--quiet", "--set", &set]);
        let made = folder.join("run/manifest.json").exists();
        if said.code != 2 || made || !said.err.contains(words) {
            wrong.push(format!("{set}: exit code {}, made {made}: {}", said.code, said.err));
            let _ = fs::remove_dir_all(folder.join("run"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
