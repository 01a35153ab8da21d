use std::fmt::Write as _;
use std::path::PathBuf;

use glam::DVec3;
use glintmap_formats::seal;

use super::Context;
use super::mirror::{point, seconds};
use crate::project::Assignment;
use crate::project::Resolved;
use crate::receivers::sweep::{SweepAsked, Swept, sweep};

/// A year of observers' eyes to the minute: how long the PV is above an irradiance or a luminance
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  glintmap eyes church                          all observers, all materials, every minute
  glintmap eyes church --observer 'Open house, upstairs' --material standard --step 30s
  glintmap eyes church --point -47,2,11 --csv days.csv

Integrated over the PV's cells by its BSDF, without photons: the sun's disc whole, every day of the
year, clear as the project's sky is. It looks every 15 minutes first, and between two of them only
where a limit may be exceeded meanwhile; the result is that of looking at every instant (--coarse
1min does, for comparison). Limits: glare.thresholds_w_m2 of the project, and 30 and 50 kcd/m2.")]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// An [[observer]] of the project, by name; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    observer: Vec<String>,
    /// X,Y,Z in metres from the local origin; may be repeated
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_parser = point,
        allow_negative_numbers = true,
        allow_hyphen_values = true
    )]
    point: Vec<DVec3>,
    /// A material or case, by name; may be repeated [default: all]
    #[arg(long, value_name = "NAME")]
    material: Vec<String>,
    /// From one instant to the next: 10s to 60min, a whole part of the day
    #[arg(long, value_name = "STEP", default_value = "1min", value_parser = seconds)]
    step: u32,
    /// Between the instants that are looked at first
    #[arg(long, value_name = "STEP", default_value = "15min", value_parser = seconds)]
    coarse: u32,
    /// Writes a table of the days on which anything is exceeded
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Override a key of the project file, as for the run
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let asked = SweepAsked {
        observers: arguments.observer.clone(),
        points: arguments.point.clone(),
        materials: arguments.material.clone(),
        step_s: arguments.step,
        coarse_s: arguments.coarse,
    };
    let found = sweep(&resolved, &asked, context.progress())?;
    if let Some(path) = &arguments.csv {
        seal::write_bytes(path, found.daily_csv().as_bytes())
            .map_err(|source| crate::project::Error::Write { path: path.clone(), source })?;
    }
    context.print(&found, &told(&found))
}

fn told(found: &Swept) -> String {
    let mut text = format!(
        "every {} s of {}, {} suns by {}; {}\n",
        found.step_s, found.year, found.instants, found.sun, found.note
    );
    for eye in &found.eyes {
        // Writing into a String can't fail.
        let _ = writeln!(text, "\n{}, {}", eye.observer, eye.material);
        for (measure, e) in &eye.exceeded {
            let Some([first, last, most]) = &e.dates else {
                let _ = writeln!(text, "  {measure}: never");
                continue;
            };
            let _ = writeln!(
                text,
                "  {measure}: {:.1} h a year, at most {:.0} min a day ({most}), {} days from {first} to {last}",
                e.glare.hours,
                e.glare.longest_day_h * 60.0,
                e.glare.days
            );
        }
        let _ = writeln!(
            text,
            "  looked at {:.1} % of the instants, at shadows for {:.1} %",
            100.0 * eye.looked as f64 / found.instants as f64,
            100.0 * eye.asked as f64 / found.instants as f64
        );
    }
    text
}
