//! The project file of the case study and the page beside it.

use glam::DVec2;

use super::site_plan::HOUSES;
use super::{house, terrain};

/// Eye height above the floor of the upper storey, m above the ground floor.
const UPSTAIRS_M: f64 = 2.75 + 1.45;

/// A point before the wall that faces the church, upstairs.
fn upstairs(name: &str, before_m: f64) -> String {
    let plot = HOUSES.iter().find(|plot| plot.name == name).unwrap_or(&HOUSES[0]);
    let [x, y] = plot.at;
    format!("[{:.1}, {y:.1}, {:.2}]", x + before_m, house::floor_m(plot) + UPSTAIRS_M)
}

/// project.toml: the paper's Table 3 on our own scene.
pub(super) fn project() -> String {
    let on_street = DVec2::new(-74.8, -2.5);
    let street = format!(
        "[{:.1}, {:.1}, {:.2}]",
        on_street.x,
        on_street.y,
        terrain::street_m(on_street) + 1.6
    );
    TEMPLATE
        .replace("@CHALET@", &upstairs("chalet", 5.9))
        .replace("@OPEN_HOUSE@", &upstairs("open_house", 5.1))
        .replace("@STREET@", &street)
}

const TEMPLATE: &str = r#"# The built-in case study: a church on a rise gets photovoltaics on three roofs.
# Site, times and parameters follow Table 3 of the paper; the scene is our own (README.md).

[site]
name = "Church on the rise"
latitude = 47.038            # degrees north
longitude = 8.312            # degrees east
meridian = 15.0              # degrees east
timezone = "Europe/Zurich"
elevation_m = 450.0

[scene]
files = ["terrain.rad", "church.rad", "houses.rad", "trees.rad", "pv.rad"]
default_reflectance = 0.25

[[pv]]
name = "roof-west-lower"     # faces west, 27 %
select = { modifier = "pv_west_lower" }

[[pv]]
name = "roof-west-upper"     # faces west, 27 %
select = { modifier = "pv_west_upper" }

[[pv]]
name = "roof-south"          # faces south, 35 %
select = { modifier = "pv_south" }

[[material]]                 # standard modules: a narrow lobe over dark cells
name = "standard"
model = { kind = "pv-glass", index = 1.52, ggx_alpha = 0.05, cell_reflectance = 0.04 }

[[material]]                 # satinated front glass: a lobe wider than 10 degrees
name = "satinated"
model = { kind = "pv-glass", index = 1.52, ggx_alpha = 0.28, cell_reflectance = 0.06 }

[[material]]                 # today's roof
name = "tile"
model = { kind = "lambertian", reflectance = 0.25 }

[[material]]                 # smooth glass: what a module without any texture would do
name = "smooth"
model = { kind = "glass", index = 1.52 }

[reference]
material = "tile"

[time]
year = 2018
days = { from = 0, to = 181, step = 7 }
hours = { from = 4.5, to = 20.5, step = 0.25 }
sun = "gensky-2018"
irradiance = "gensky"        # visible watts, about half of the full spectrum
half_year = true             # Equation (1)

[photons]
stored = 250_000_000         # per material; 200_000 for a draft, 16_000_000 for good pictures
max_path_m = 100.0
bounces = 1
seed = 1

[[view]]
name = "plan"                # north up, 0.2 m a pixel
view = "-vtl -vp 0 0 200 -vd 0 0 -1 -vu 0 1 0 -vh 200 -vv 200"
size = [1000, 1000]
estimator = "photons"
bandwidth = 400
series_bandwidth = 4000

[[view]]
name = "panorama"            # south in the centre, west to the right; the church is clipped
view = "-vtc -vp 1 5 25 -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 76.3 -vo 32"
size = [2000, 500]
estimator = "photons"
bandwidth = 400
series_bandwidth = 4000

[[observer]]
name = "Chalet, upstairs"
point = @CHALET@
direction = [1.0, 0.0, 0.0]
class = "dwelling"

[[observer]]
name = "Open house, upstairs"
point = @OPEN_HOUSE@
direction = [1.0, 0.1, 0.0]
class = "dwelling"

[[observer]]
name = "Street up the hill"
point = @STREET@
direction = [1.0, 0.0, 0.0]
class = "road"

[[region]]                   # its walls, roof and balcony
name = "Chalet"
object = "chalet"
class = "dwelling"

[[region]]                   # the house that no tree protects
name = "Open house"
object = "open_house"
class = "dwelling"

[[region]]                   # the trees before the chalet: the hot spot
name = "Trees before the chalet"
object = ["tree_01", "tree_02", "tree_03", "tree_04", "tree_05", "tree_06", "tree_07"]
spacing_m = 1.5
class = "vegetation"

[[region]]
name = "Church yard"
polygon = [[-27.0, -14.0], [-18.0, -14.0], [-18.0, 16.0], [-27.0, 16.0]]
class = "outdoor"

[[region]]                   # what the church throws onto itself
name = "Church"
object = ["church_hall", "parish", "cloister", "tower", "choir"]
spacing_m = 2.0

[glare]
thresholds_w_m2 = [10.0, 30.0]
quantity = "surface"
sigma = [1.0, 1.0, 1.0]
connectivity = 6
rules = ["paper-2018"]
"#;

/// README.md beside the project.
pub(super) const README: &str = r#"# The built-in case study

A hamlet on a hillside and a church of exposed concrete that gets photovoltaics on three roofs. The
situation follows the paper's case; the design is our own and stands for no real place.

- **Church** on a rise: two halls whose roofs fall to the west (27 %), one 1.5 m above the other, a
  south wing (35 %), courtyard with cloister, low wings, a tower. The lower eaves lie some 10 m
  above the surroundings. Each roof holds one section of about 10 x 12 m: `pv_west_lower`,
  `pv_west_upper`, `pv_south`. They are rectangles whose modifiers the scene leaves undefined:
  project.toml gives them the candidate materials.
- **Terrain** of 200 x 200 m that rises to the west by some 19 m, with streets cut into it.
- **Houses**: 29 with gables. In the west, within 70 m, the two-storey `chalet` behind a group of
  trees, and `open_house` without any.
- **Trees**: closed shapes; a group adjoins the church in the east-southeast, a forest's edge tops
  the hillside.
- Every material is Lambertian with 25 %; modifiers only name things. Each solid is closed. All
  polygons of a building share its identifier.

`project.toml` holds site, times and parameters of the paper's Table 3.

The files are made, byte for byte the same everywhere, by

```
cargo run -p glintmap-tools -- case-study fixtures/projects/case-study
```

and `cargo test -p glintmap-tools` checks that they are. Change the numbers in
tools/src/case_study, never the files.
"#;
