//! A project of a handful of polygons that runs in seconds.

use glam::DVec2;

use super::export::{self, File};
use super::shape::{Face, Model, Stand, cuboid, rectangle};

fn model() -> Model {
    let here = Stand::ORIGIN;
    let mut model = Model::default();
    let ground = rectangle([-20.0, 20.0], [-15.0, 15.0]).map(|p| p.extend(0.0)).to_vec();
    model.add("ground", vec![Face { modifier: "meadow", points: ground }]);
    // In the west, where the mirrored morning sun goes.
    model.add("wall", cuboid(&here, "plaster", [-15.0, -14.5], [-10.0, 10.0], [-0.5, 6.0]));
    // Facing west at 27 %, 4 x 5 m.
    let plane = |p: DVec2| p.extend(4.0 + 0.27 * (p.x - 2.0));
    let roof = rectangle([2.0, 6.0], [-2.5, 2.5]).map(plane).to_vec();
    model.add("roof", vec![Face { modifier: "pv", points: roof }]);
    model
}

/// All files of the project.
pub(super) fn files() -> Vec<File> {
    let mut scene = export::radiance("scene.rad", "ground, a wall, a roof", &model());
    // The roof's modifier is `pv`, not one of the case study's.
    scene.text = scene.text.replace("\nvoid plastic pv\n0\n0\n5 .25 .25 .25 0 0\n", "");
    scene.text = scene.text.replace("glintmap-tools case-study", "glintmap-tools tiny");
    vec![
        scene,
        File { name: "project.toml", text: PROJECT.to_owned() },
        File { name: "README.md", text: README.to_owned() },
    ]
}

const PROJECT: &str = r#"# A handful of polygons, for the hashes of all outputs.

[site]
name = "Tiny"
latitude = 47.038
longitude = 8.312
meridian = 15.0
timezone = "Europe/Zurich"
elevation_m = 450.0

[scene]
files = ["scene.rad"]
default_reflectance = 0.25

[[pv]]
name = "roof"
select = { modifier = "pv" }

[[material]]
name = "standard"
model = { kind = "pv-glass", index = 1.52, ggx_alpha = 0.05, cell_reflectance = 0.04 }

[[material]]
name = "tile"
model = { kind = "lambertian", reflectance = 0.25 }

[reference]
material = "tile"

[time]
year = 2018
days = { from = "06-07", to = "06-28", step = 7 }
hours = { from = 5.5, to = 9.5, step = 0.25 }
sun = "gensky-2018"
irradiance = "gensky"
half_year = false

[photons]
stored = 4_000
max_path_m = 100.0
bounces = 1
seed = 1

[[view]]
name = "plan"
view = "-vtl -vp 30 0 20 -vd -1 0 -0.5 -vu 0 0 1 -vh 44 -vv 30"
size = [64, 48]
estimator = "photons"
bandwidth = 50
series_bandwidth = 200

[[observer]]
name = "Wall"
point = [-14.0, 0.0, 3.0]
direction = [1.0, 0.0, 0.0]
class = "dwelling"

[[observer]]
name = "On the wall"
point = [-14.5, 0.0, 3.0]
direction = [1.0, 0.0, 0.0]
class = "dwelling"

[[region]]
name = "The wall"
object = "wall"
class = "dwelling"

[[region]]
name = "Ground before the wall"
polygon = [[-14.0, -8.0], [-6.0, -8.0], [-6.0, 8.0], [-14.0, 8.0]]
class = "outdoor"

[glare]
thresholds_w_m2 = [10.0, 30.0]
quantity = "surface"
sigma = [1.0, 1.0, 1.0]
connectivity = 6
rules = ["paper-2018"]
"#;

const README: &str = r#"# The tiny project

Ground, a wall and one roof of photovoltaics; four days in June. It runs in seconds: tests compare
everything that it leaves behind, byte by byte, with `fixtures/tiny-hashes.json` and say what differs
by `fixtures/tiny-run.tar.zst`, the run itself without pictures and photons.

```
cargo run -p glintmap-tools -- tiny fixtures/projects/tiny
```

Both are written anew, once a change is understood, by

```
GLINTMAP_BLESS=1 cargo test --test all the_tiny_project_has_the_committed_bytes
```
"#;
