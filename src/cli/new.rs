use std::path::PathBuf;
use std::str::FromStr;

use anyhow::Context as _;
use serde_json::json;

use super::Context;
use crate::project::{self, NewScene, SiteAt};
use crate::run;
use crate::site::{SceneFile, Select, check};

/// Write a project for a site of one's own, with a plan view and a panorama that fit
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap new school --scene school.rad --latitude 47.4 --longitude 8.5 --meridian 15 --pv modifier=pv\n  glintmap new block --scene district.city.json --latitude 51.9 --longitude 4.4 --meridian 15 \\\n      --pv object=ID,surface=RoofSurface,min_tilt_deg=10"
)]
pub(super) struct Arguments {
    /// The folder; made if it isn't there
    dir: PathBuf,
    /// Scene files: .rad, .city.json, .city.jsonl, .obj, .gltf, .glb, .ply, .stl, .asc, .tif
    #[arg(long, required = true, num_args = 1.., value_name = "FILE")]
    scene: Vec<PathBuf>,
    /// Degrees north
    #[arg(long, allow_negative_numbers = true, value_name = "D")]
    latitude: f64,
    /// Degrees east
    #[arg(long, allow_negative_numbers = true, value_name = "D")]
    longitude: f64,
    /// Degrees east, of the time zone's standard time (Central Europe: 15)
    #[arg(long, allow_negative_numbers = true, value_name = "D")]
    meridian: f64,
    /// Unit of the meshes' coordinates: m, cm, mm, km, in, ft. OBJ, PLY and STL don't say it
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Which axis of the meshes points up: z, y, x. OBJ, PLY and STL don't say it
    #[arg(long, value_name = "AXIS")]
    up: Option<String>,
    /// True north, degrees clockwise from the files' y axis; left out, the map's projection says it
    #[arg(long, allow_negative_numbers = true, value_name = "D")]
    north: Option<f64>,
    /// Which surfaces are PV, as KEY=VALUE,…: modifier, material, object, surface,
    /// min_tilt_deg, max_tilt_deg, azimuth_deg=FROM:TO
    #[arg(long, default_value = "modifier=pv", value_name = "SELECTOR")]
    pv: Selector,
}

#[derive(Clone, Debug)]
struct Selector(Select);

impl FromStr for Selector {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut select = Select::default();
        for part in text.split(',') {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| format!("expected KEY=VALUE, found `{part}`"))?;
            let number =
                || value.parse::<f64>().map_err(|_| format!("{key}: `{value}` is no number"));
            match key.trim() {
                "modifier" => select.modifier = Some(value.into()),
                "material" => select.material = Some(value.into()),
                "object" => select.object = Some(value.into()),
                "surface" => select.surface = Some(value.into()),
                "min_tilt_deg" => select.min_tilt_deg = Some(number()?),
                "max_tilt_deg" => select.max_tilt_deg = Some(number()?),
                "azimuth_deg" => {
                    let ends = value.split_once(':').map(|(a, b)| (a.parse(), b.parse()));
                    let Some((Ok(from), Ok(to))) = ends else {
                        return Err(format!("azimuth_deg: expected FROM:TO, found `{value}`"));
                    };
                    select.azimuth_deg = Some([from, to]);
                }
                other => {
                    return Err(format!(
                        "`{other}` is none of modifier, material, object, surface, min_tilt_deg, max_tilt_deg, azimuth_deg"
                    ));
                }
            }
        }
        Ok(Self(select))
    }
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let at = SiteAt {
        latitude: arguments.latitude,
        longitude: arguments.longitude,
        meridian: arguments.meridian,
    };
    let folder = arguments.dir.display();
    let loaded = project::create(&arguments.dir, &scene(arguments)?, &at)
        .with_context(|| format!("no project was written into {folder}"))?;
    let summary = check::summarise_loaded(&loaded);
    let name = arguments.dir.file_name().unwrap_or_default().to_string_lossy();
    let plan = run::draw_site(&arguments.dir, &name, &loaded.site, &summary)?;
    let text = format!(
        "{summary}\nwrote {folder}/project.toml, {}\nnext: glintmap plan {folder}, glintmap run {folder} --set photons.stored=200000",
        plan.display()
    );
    let document =
        json!({ "project": arguments.dir.join("project.toml"), "site": summary, "plan": plan });
    context.print(&document, &text)
}

fn scene(arguments: &Arguments) -> anyhow::Result<NewScene> {
    let mut files: Vec<SceneFile> = arguments.scene.iter().map(SceneFile::new).collect();
    let stated = arguments.unit.is_some() || arguments.up.is_some();
    if stated && !files.iter().any(SceneFile::is_mesh) {
        anyhow::bail!(run::Error::Unsupported(
            "--unit and --up are for meshes (OBJ, glTF, PLY, STL), and --scene names none; files of all other formats are in metres, z up".into()
        ));
    }
    for file in files.iter_mut().filter(|f| f.is_mesh()) {
        (file.unit, file.up) = (arguments.unit.clone(), arguments.up.clone());
    }
    Ok(NewScene { files, north_deg: arguments.north, select: arguments.pv.0.clone() })
}
