//! What decides a unit of work is in its key: every key of a project file changes the key of some
//! unit, and where files lie changes none.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use glintmap::project::{Assignment, Folder, Resolved};
use glintmap::run;

use crate::support::program::{copy, root, succeed};

/// A project that holds every key there is; those that exclude each other in different tables.
const PROJECT: &str = r#"
[site]
name = "Full"
latitude = 47.0
longitude = 8.3
meridian = 15.0
timezone = "Europe/Zurich"
elevation_m = 450.0
horizon = "ridge.csv"

[scene]
files = ["scene.rad", { path = "ground.obj", unit = "m", up = "z" }]
default_reflectance = 0.25
lod = "2.2"
crs = "EPSG:2056"
north_deg = 1.0
reflectance = { meadow = 0.2 }
origin = [0.0, 0.0, 0.0]

[[pv]]
name = "roof"
two_sided = false
[pv.select]
modifier = "pv"
material = "pv"
object = "roof"
surface = "polygon"
min_tilt_deg = 1.0
max_tilt_deg = 80.0
azimuth_deg = [0.0, 359.0]
polygon = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]
coordinates = "local"

[[pv]]
name = "field"
[pv.array]
polygon = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]
coordinates = "local"
tilt_deg = 10.0
azimuth_deg = 180.0
height_m = 1.0
row_pitch_m = 5.0
module_m = 2.0

[[material]]
name = "glass"
model = { kind = "glass", index = 1.52 }

[[material]]
name = "file"
bsdf = "module.xml"
side = "front"
spectrum = "visible"

[[case]]
name = "mixed"
assign = { roof = "glass", field = "file" }

[reference]
material = "glass"

[time]
year = 2024
sun = "gensky"
half_year = false
[time.days]
from = 150
to = 160
step = 5
[time.hours]
from = 6.0
to = 18.0
step = 1.0
[[time.finer]]
from = 8.0
to = 10.0
step = 0.5
[time.irradiance]
model = "ineichen"
linke = [3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3]

[photons]
stored = 1000
max_path_m = 100.0
bounces = 1
seed = 1
sun_visibility = true
receivers = "all"

[[view]]
name = "plan"
view = "-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 40 -vv 40"
size = [40, 40]
estimator = "photons"
bandwidth = 50
series_bandwidth = 100
max_radius_m = 1.0
kernel = "flat"
normal_tolerance_deg = 60.0
plane_tolerance_m = 0.25
edges = true
series_edges = false
fuse = false
series_mantissa_bits = 23
both_quantities = false

[[view]]
name = "direct"
view_file = "panorama.vf"
size = [40, 40]
estimator = "direct"

[[view]]
name = "spots"
sensors = "spots.txt"
coordinates = "local"

[[observer]]
name = "Wall"
point = [-14.0, 0.0, 3.0]
direction = [1.0, 0.0, 0.0]
coordinates = "local"
class = "dwelling"

[[region]]
name = "House"
object = "wall"
spacing_m = 1.0
class = "dwelling"

[[region]]
name = "Plot"
polygon = [[-14.0, -8.0], [-6.0, -8.0], [-6.0, 8.0]]
height_m = 1.0
coordinates = "local"

[[region]]
name = "Drawn"
polygon = [[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]
view = "plan"

[receivers]
estimator = "photons"

[[season]]
modifier = "leaves"
transmittance = [0.5, 0.5, 0.5, 0.5, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5]

[[moment]]
name = "morning"
date = "06-01"
time = "08:30"
view = "plan"
size = [20, 20]

[[moment]]
name = "eye"
date = "06-01"
time = "09:30"
observer = "Wall"

[glare]
thresholds_w_m2 = [10.0, 30.0]
quantity = "surface"
sigma = [1.0, 1.0, 1.0]
truncate = 4.0
connectivity = 6
rules = ["paper-2018"]
"#;

/// Each key with another value.
const CHANGES: &[&str] = &[
    "site.name=\"Other\"",
    "site.latitude=47.1",
    "site.longitude=8.4",
    "site.meridian=16.0",
    "site.timezone=\"Europe/Berlin\"",
    "site.elevation_m=451.0",
    "site.horizon=[[0.0, 1.0], [180.0, 2.0]]",
    "scene.files=[\"scene.rad\"]",
    "scene.files=[\"scene.rad\", { path = \"ground.obj\", unit = \"mm\", up = \"z\" }]",
    "scene.files=[\"scene.rad\", { path = \"ground.obj\", unit = \"m\", up = \"y\" }]",
    "scene.default_reflectance=0.3",
    "scene.lod=\"1.2\"",
    "scene.crs=\"EPSG:21781\"",
    "scene.north_deg=2.0",
    "scene.reflectance={ meadow = 0.3 }",
    "scene.origin=[1.0, 0.0, 0.0]",
    "pv.roof.name=\"roof-1\"; case.mixed.assign={ roof-1 = \"glass\", field = \"file\" }",
    "pv.roof.two_sided=true",
    "pv.roof.select={ modifier = \"other\" }",
    "pv.roof.select.modifier=\"other\"",
    "pv.roof.select.material=\"other\"",
    "pv.roof.select.object=\"other\"",
    "pv.roof.select.surface=\"other\"",
    "pv.roof.select.min_tilt_deg=2.0",
    "pv.roof.select.max_tilt_deg=81.0",
    "pv.roof.select.azimuth_deg=[0.0, 358.0]",
    "pv.roof.select.polygon=[[0.0, 0.0], [8.0, 0.0], [9.0, 9.0]]",
    "pv.roof.select.coordinates=\"map\"",
    "pv.field.array.polygon=[[0.0, 0.0], [8.0, 0.0], [9.0, 9.0]]",
    "pv.field.array.coordinates=\"map\"",
    "pv.field.array.tilt_deg=11.0",
    "pv.field.array.azimuth_deg=181.0",
    "pv.field.array.height_m=1.1",
    "pv.field.array.row_pitch_m=5.1",
    "pv.field.array.module_m=2.1",
    "material.glass.name=\"pane\"; reference.material=\"pane\"; case.mixed.assign={ roof = \"pane\", field = \"file\" }",
    "material.glass.model={ kind = \"glass\", index = 1.53 }",
    "material.file.bsdf=\"other.xml\"",
    "material.file.side=\"back\"",
    "material.file.spectrum=\"solar\"",
    "case.mixed.name=\"both\"",
    "case.mixed.assign={ roof = \"file\", field = \"glass\" }",
    "reference.material=\"file\"",
    "time.year=2023",
    "time.sun=\"spa\"",
    "time.days.from=151",
    "time.days.to=161",
    "time.days.step=4",
    "time.hours.from=7.0",
    "time.hours.to=17.0",
    "time.hours.step=0.9",
    "time.irradiance.linke=[4, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3]",
    "photons.stored=2000",
    "photons.max_path_m=90.0",
    "photons.seed=2",
    "photons.sun_visibility=false",
    "photons.receivers=\"diffuse\"",
    "view.plan.view=\"-vtl -vp 0 0 50 -vd 0 0 -1 -vu 0 1 0 -vh 41 -vv 40\"",
    "view.plan.size=[41, 40]",
    "view.plan.estimator=\"radiance\"",
    "view.plan.bandwidth=51",
    "view.plan.series_bandwidth=101",
    "view.plan.max_radius_m=1.1",
    "view.plan.kernel=\"epanechnikov\"",
    "view.plan.normal_tolerance_deg=50.0",
    "view.plan.plane_tolerance_m=0.3",
    "view.plan.edges=false",
    "view.plan.series_edges=true",
    "view.plan.fuse=true",
    "view.plan.series_mantissa_bits=8",
    "view.plan.both_quantities=true",
    "view.direct.name=\"round\"",
    "view.direct.view_file=\"other.vf\"",
    "view.spots.sensors=\"other.txt\"",
    "view.spots.coordinates=\"map\"",
    "observer.Wall.name=\"Other\"; moment.eye.observer=\"Other\"",
    "observer.Wall.point=[-14.0, 0.0, 4.0]",
    "observer.Wall.direction=[1.0, 0.1, 0.0]",
    "observer.Wall.coordinates=\"map\"",
    "observer.Wall.class=\"office\"",
    "region.House.name=\"Home\"",
    "region.House.object=[\"wall\", \"roof\"]",
    "region.House.spacing_m=2.0",
    "region.House.class=\"office\"",
    "region.Plot.polygon=[[-14.0, -8.0], [-6.0, -8.0], [-6.0, 9.0]]",
    "region.Plot.height_m=2.0",
    "region.Plot.coordinates=\"map\"",
    "region.Drawn.view=\"direct\"",
    "receivers.estimator=\"direct\"",
    "moment.morning.name=\"early\"",
    "moment.morning.date=\"06-02\"",
    "moment.morning.time=\"08:45\"",
    "moment.morning.view=\"direct\"",
    "moment.morning.size=[21, 20]",
    "moment.eye.time=\"09:45\"",
    "moment.eye.observer=\"Door\"",
    "glare.thresholds_w_m2=[11.0, 30.0]",
    "glare.quantity=\"normal\"",
    "glare.sigma=[1.0, 1.0, 2.0]",
    "glare.truncate=3.0",
    "glare.connectivity=26",
    "glare.rules=[\"de-lai-2015\"]",
];

/// Keys that decide nothing, each with why.
const WITHOUT_EFFECT: &[(&str, &str)] = &[
    ("photons.bounces", "one value is possible in this version"),
    ("time.irradiance.constant", "excludes `linke`; a strength is a strength"),
    ("time.irradiance.epw", "excludes `linke`; the file's hash stands for it"),
    ("time.irradiance.model", "one value is possible in this version"),
];

/// Keys of tables without a name, which `--set` can't enter: text of the file, and what it becomes.
const REWRITTEN: &[(&str, &str, &str)] = &[
    ("time.finer.from", "from = 8.0", "from = 9.0"),
    ("time.finer.to", "to = 10.0", "to = 11.0"),
    ("time.finer.step", "step = 0.5", "step = 0.25"),
    ("season.modifier", "\"leaves\"", "\"needles\""),
    ("season.transmittance", "[0.5, 0.5", "[0.6, 0.5"),
    // Which goes without seasons.
    ("time.half_year", "half_year = false", "half_year = true"),
];

fn project(at: &Path) {
    copy(&root().join("fixtures/projects/tiny"), at);
    fs::write(at.join("ground.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("writes");
    fs::write(at.join("ridge.csv"), "0,1\n90,2\n").expect("writes");
    for (name, height) in [("panorama.vf", 76), ("other.vf", 70)] {
        let view = "-vtc -vp 1 5 25 -vd 0 -1 0 -vu 0 0 1 -vh 360";
        fs::write(at.join(name), format!("rvu {view} -vv {height}\n")).expect("writes");
    }
    fs::write(at.join("spots.txt"), "0 0 1 0 0 1\n").expect("writes");
    fs::write(at.join("other.txt"), "0 0 2 0 0 1\n").expect("writes");
    for (name, preset) in [("module.xml", "standard"), ("other.xml", "satinated")] {
        let path = at.join(name);
        succeed(&["bsdf", preset, "--write", path.to_str().expect("a plain path"), "--quiet"]);
        // Its other side and the other light, which a preset doesn't have.
        let text = fs::read_to_string(&path).expect("reads");
        let (from, to) = ("\t<WavelengthData>\n", "</WavelengthData>\n");
        let start = text.find(from).expect("a block");
        let end = text.rfind(to).expect("its end") + to.len();
        let block = &text[start..end];
        let more = [
            block.replace("Reflection Back", "Reflection Front"),
            block.replace(">Visible<", ">Solar<"),
        ];
        let text = [&text[..end], &more.concat(), &text[end..]].concat();
        fs::write(&path, text).expect("writes");
    }
    let door = "\n[[observer]]\nname = \"Door\"\npoint = [1.0, 2.0, 3.0]\n";
    fs::write(at.join("project.toml"), format!("{PROJECT}{door}")).expect("writes");
}

/// The keys of all units by their names.
fn keys(folder: &Path, set: &[&str]) -> Result<BTreeMap<String, String>, String> {
    let set: Vec<Assignment> = set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let resolved = Resolved::read(folder, &set, 1 << 30).map_err(|e| e.to_string())?;
    let run = Folder::new(resolved.run_folder());
    let units = run::units(&resolved, &run).map_err(|e| e.to_string())?;
    Ok(units.into_iter().map(|unit| (unit.name, unit.key)).collect())
}

/// `view.plan.size=[1, 2]` is about `view.size`, whatever the view's name.
fn label(assignment: &str) -> String {
    let lists = ["pv", "material", "case", "view", "observer", "region", "moment"];
    let path = assignment.split('=').next().unwrap_or(assignment);
    let mut parts: Vec<&str> = path.split('.').collect();
    if lists.contains(&parts[0]) {
        parts.remove(1);
    }
    parts.join(".")
}

/// The keys that a table knows, from what the reader says of one that it doesn't.
fn known(message: &str) -> BTreeSet<String> {
    let list = message.split("(known: ").nth(1).and_then(|rest| rest.split(')').next());
    let list = list.unwrap_or_else(|| panic!("names no known keys: {message}"));
    list.split(", ").map(str::to_owned).collect()
}

#[test]
fn every_key_of_a_project_decides_some_unit() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let folder = keep.path().join("full");
    project(&folder);
    let file = folder.join("project.toml");
    let text = fs::read_to_string(&file).expect("reads");
    let before = keys(&folder, &[]).expect("a project without a mistake");
    assert!(before.len() > 40, "{before:?}");

    let mut covered: BTreeSet<String> =
        WITHOUT_EFFECT.iter().map(|(key, _)| (*key).to_owned()).collect();
    for change in CHANGES {
        let set: Vec<&str> = change.split("; ").collect();
        let after = keys(&folder, &set).unwrap_or_else(|e| panic!("{change}: {e}"));
        assert_ne!(before, after, "{change} changes no key");
        covered.insert(label(change));
    }
    for (key, from, to) in REWRITTEN {
        assert!(text.contains(from), "{from}");
        let mut changed = text.replacen(from, to, 1);
        if *key == "time.half_year" {
            let season = changed.find("[[season]]").expect("a season");
            let next = changed.find("[[moment]]").expect("a moment");
            changed.replace_range(season..next, "");
        }
        fs::write(&file, changed).expect("writes");
        let after = keys(&folder, &[]).unwrap_or_else(|e| panic!("{key}: {e}"));
        assert_ne!(before, after, "{key} changes no key");
        covered.insert((*key).to_owned());
    }

    // Nothing that the tables know is left out above.
    let tables = [
        "site",
        "scene",
        "pv.roof",
        "pv.roof.select",
        "pv.field.array",
        "material.file",
        "case.mixed",
        "reference",
        "time",
        "time.days",
        "time.hours",
        "time.irradiance",
        "photons",
        "view.plan",
        "observer.Wall",
        "region.House",
        "receivers",
        "moment.morning",
        "glare",
    ];
    fs::write(&file, &text).expect("writes");
    let tell = |table: &str, message: String| {
        for key in known(&message) {
            let key = format!("{table}{key}");
            let below = format!("{key}.");
            let is_covered =
                covered.contains(&key) || covered.iter().any(|c| c.starts_with(&below));
            assert!(is_covered, "`{key}` is tried nowhere: does it change the key of a unit?");
        }
    };
    for table in tables {
        let message = keys(&folder, &[&format!("{table}.zzz=1")]).expect_err(table);
        tell(&format!("{}.", label(table)), message);
    }
    for (table, head) in
        [("", "\n[site]"), ("time.finer.", "\n[time.irradiance]"), ("season.", "\n[[moment]]")]
    {
        fs::write(&file, text.replacen(head, &format!("\nzzz = 1{head}"), 1)).expect("writes");
        tell(table, keys(&folder, &[]).expect_err(head));
    }
}

#[test]
fn a_key_names_what_decides_and_nothing_else() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let folder = keep.path().join("full");
    project(&folder);
    let before = keys(&folder, &[]).expect("a project");
    let changed = |set: &str| -> BTreeSet<String> {
        let after = keys(&folder, &[set]).expect(set);
        let names = before.keys().chain(after.keys());
        names.filter(|name| before.get(*name) != after.get(*name)).cloned().collect()
    };
    let has = |set: &str, unit: &str| changed(set).contains(unit);
    // Civil times stand in tables of events.
    let zone = "site.timezone=\"Europe/London\"";
    assert!(has(zone, "glare glass plan 10") && !has(zone, "render glass plan"));
    // The series alone keeps bits, the store alone is large.
    let bits = "view.plan.series_mantissa_bits=8";
    assert!(has(bits, "render glass plan") && !has(bits, "annual glass plan"));
    let stored = "photons.stored=2000";
    assert!(has(stored, "trace glass") && has(stored, "annual glass plan"));
    assert!(!has(stored, "hits plan") && !has(stored, "render glass direct"));
    // Photons of other views tell which surface sends an event of a direct view.
    assert!(has(stored, "glare glass direct 10"));
    // Whom a place stands for decides what is judged, not what is computed.
    let class = "observer.Wall.class=\"office\"";
    assert!(has(class, "verdicts") && has(class, "glare glass receivers points"));
    assert!(!has(class, "hits receivers") && !has(class, "render glass receivers"));
    let rules: BTreeSet<String> = changed("glare.rules=[\"de-lai-2015\"]");
    assert_eq!(rules, ["report", "verdicts"].map(str::to_owned).into());
}

#[test]
fn where_files_lie_changes_no_key() {
    let keep = tempfile::tempdir().expect("a temporary folder");
    let (here, there) = (keep.path().join("here"), keep.path().join("far/away"));
    project(&here);
    copy(&here, &there);
    let before = keys(&here, &[]).expect("a project");
    assert_eq!(before, keys(&there, &[]).expect("a project"));
    fs::create_dir(there.join("sub")).expect("makes");
    let mut text = fs::read_to_string(there.join("project.toml")).expect("reads");
    for name in ["scene.rad", "ground.obj", "ridge.csv", "module.xml", "panorama.vf", "spots.txt"] {
        fs::rename(there.join(name), there.join("sub").join(name)).expect(name);
        let quoted = format!("\"{name}\"");
        assert!(text.contains(&quoted), "{name}");
        text = text.replace(&quoted, &format!("\"sub/{name}\""));
    }
    fs::write(there.join("project.toml"), text).expect("writes");
    assert_eq!(before, keys(&there, &[]).expect("a project"));
}
