use std::path::PathBuf;
use std::str::FromStr;

use anyhow::Context as _;
use serde_json::json;

use super::Context;
use crate::run::{self, SiteAt};
use crate::site::{Select, check};

/// Write a project for a site of one's own, with a plan view and a panorama that fit
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap new school --scene school.rad --latitude 47.4 --longitude 8.5 --meridian 15 --pv modifier=pv\n  glintmap new block --scene district.city.json --latitude 51.9 --longitude 4.4 --meridian 15 \\\n      --pv object=ID,surface=RoofSurface,min_tilt_deg=10"
)]
pub(super) struct Arguments {
    /// The folder; made if it isn't there
    dir: PathBuf,
    /// Scene files: .rad, .city.json, .city.jsonl
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
    /// Which surfaces are PV, as KEY=VALUE,…: modifier, material, object, surface,
    /// min_tilt_deg, max_tilt_deg
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
                other => {
                    return Err(format!(
                        "`{other}` is none of modifier, material, object, surface, min_tilt_deg, max_tilt_deg"
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
    let site = run::create(&arguments.dir, &arguments.scene, &at, &arguments.pv.0)
        .with_context(|| format!("no project was written into {}", arguments.dir.display()))?;
    let summary = check::summarise(&site);
    let folder = arguments.dir.display();
    let text = format!(
        "{summary}\nwrote {folder}/project.toml\nnext: glintmap plan {folder}, glintmap run {folder} --set photons.stored=200000"
    );
    let document = json!({ "project": arguments.dir.join("project.toml"), "site": summary });
    context.print(&document, &text)
}
