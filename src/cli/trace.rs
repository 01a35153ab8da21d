use std::fmt::Write as _;
use std::path::PathBuf;

use super::Context;
use crate::project::Assignment;
use crate::project::Resolved;
use crate::run::replay::{Replayed, replay};

/// Follow one photon of a run from the sun to its end, in words
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example: the photon with the number 12345 of those sent for the material `standard`
  glintmap trace church --material standard --replay 12345

Most photons never land; `run/MATERIAL/tally.json` says how many were sent. Options that were
set for the run with --set must be given here as well.")]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// Number of the photon, from 0 to the number sent, exclusive
    #[arg(long, value_name = "PHOTON")]
    replay: u64,
    /// The material or case [default: the first]
    #[arg(long)]
    material: Option<String>,
    /// Override a key of the project file, as for the run
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let found = replay(&resolved, arguments.material.as_deref(), arguments.replay)?;
    context.print(&found, &told(&found))
}

fn told(found: &Replayed) -> String {
    let path = &found.path;
    let place = |[x, y, z]: [f64; 3]| format!("{x:.3}, {y:.3}, {z:.3}");
    let mut text = format!(
        "Photon {} of {} sent for {}.\n\
         {}: the sun stands {:.2}° high at azimuth {:.2}° (timestep {}).\n\
         It falls onto the {} of {} at {:.2}° of incidence.\n",
        path.photon,
        path.emitted,
        found.material,
        found.at,
        found.sun_altitude_deg,
        found.sun_azimuth_deg,
        path.timestep,
        if path.back { "back" } else { "front" },
        found.pv,
        path.incidence_deg,
    );
    // Writing into a String can't fail.
    let _ = writeln!(
        text,
        "Drawn from {:.4} % of the lobe `{}`, to start from {:.1} % of the surface.",
        100.0 * path.lobe_share,
        path.lobe,
        100.0 * path.area_share
    );
    if let Some(start) = path.start {
        let _ = writeln!(text, "It starts at {} m.", place(start));
    }
    match path.sun_visible {
        Some(true) => text.push_str("From there the sun is seen.\n"),
        Some(false) => text.push_str("From there something hides the sun.\n"),
        None => {}
    }
    if let Some(direction) = path.direction {
        let _ = writeln!(text, "It leaves towards {}.", place(direction));
    }
    let far = path.distance_m.unwrap_or_default();
    let object = found.object.as_deref().unwrap_or_default();
    let end = match path.fate {
        "stored" => format!(
            "After {far:.3} m it lands on {object} at {} m and is stored with {:.6} W",
            place(path.landed.unwrap_or_default().map(f64::from)),
            path.flux_w
        ),
        "on-pv" => format!("After {far:.3} m it falls onto PV and is lost"),
        "too-far" => "It meets nothing within the path limit, but something beyond: lost".into(),
        "escaped" if path.distance_m.is_some() => {
            format!("After {far:.3} m it lands on {object}, which keeps no photons: lost")
        }
        "escaped" => "It meets nothing and leaves the scene: lost".into(),
        "not-sampled" => {
            "From the piece of PV that was drawn nothing is reached that way: not traced".into()
        }
        "blocked" if path.start.is_none() => {
            "This point of the sun's disc is below the horizon or behind the PV: no light".into()
        }
        "blocked" => "Without the sun there is no light to reflect: blocked".into(),
        _ => "The PV takes it: absorbed".into(),
    };
    let _ = writeln!(text, "{end}.");
    text
}
