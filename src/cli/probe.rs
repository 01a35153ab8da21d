use std::fmt::Write as _;
use std::path::PathBuf;

use glam::DVec3;

use super::Context;
use crate::project::Assignment;
use crate::project::Resolved;
use crate::receivers::probe::{Probed, Spot, probe};

/// Look at one spot: annual values, days, times, irradiance over time, which PV surface
#[derive(Debug, clap::Args)]
#[command(
    group(clap::ArgGroup::new("spot").required(true).args(["pixel", "point"])),
    after_help = "Examples:\n  glintmap probe church --view plan --pixel 60,125\n  glintmap probe church --view plan --point -60,5,8 --csv"
)]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// Name of the view
    #[arg(long)]
    view: String,
    /// COLUMN,ROW, from 0 at the top left
    #[arg(long, value_delimiter = ',', num_args = 1, value_name = "COLUMN,ROW")]
    pixel: Option<Vec<usize>>,
    /// X,Y,Z in metres from the local origin
    #[arg(
        long,
        value_delimiter = ',',
        num_args = 1,
        allow_negative_numbers = true,
        allow_hyphen_values = true,
        value_name = "X,Y,Z"
    )]
    point: Option<Vec<f64>>,
    /// Print the time series as CSV
    #[arg(long)]
    csv: bool,
    /// Override a key of the project file, as for the run
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let spot = match (arguments.pixel.as_deref(), arguments.point.as_deref()) {
        (Some([column, row]), _) => Spot::Pixel(*column, *row),
        (_, Some([x, y, z])) => Spot::Point(DVec3::new(*x, *y, *z)),
        _ => {
            let error = clap::Error::raw(
                clap::error::ErrorKind::WrongNumberOfValues,
                "expected --pixel COLUMN,ROW or --point X,Y,Z\n",
            );
            error.exit()
        }
    };
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let found = probe(&resolved, &arguments.view, spot)?;
    let text = if arguments.csv { csv(&found) } else { told(&found) };
    context.print(&found, &text)
}

fn csv(found: &Probed) -> String {
    let mut text = String::from(
        "material,timestep,day,hour,at,sun_altitude_deg,sun_azimuth_deg,irradiance_w_m2\n",
    );
    for m in &found.materials {
        for s in &m.series {
            // Writing into a String can't fail.
            let _ = writeln!(
                text,
                "{},{},{},{:.6},{},{:.6},{:.6},{:.6}",
                m.name,
                s.timestep,
                s.day,
                s.hour,
                s.at,
                s.sun_altitude_deg,
                s.sun_azimuth_deg,
                s.irradiance_w_m2
            );
        }
    }
    text
}

fn told(found: &Probed) -> String {
    let [x, y, z] = found.position;
    let mut text = format!(
        "{} pixel {},{}: {} at {x:.2}, {y:.2}, {z:.2} m",
        found.view, found.pixel[0], found.pixel[1], found.kind
    );
    // Writing into a String can't fail.
    let _ = match found.pv_distance_m {
        0.0 => writeln!(text, ", sees no PV"),
        d => writeln!(text, ", {d:.1} m from the nearest PV it sees"),
    };
    for m in &found.materials {
        let _ = writeln!(
            text,
            "\n{}: {:.1} Wh/m² a year, at most {:.2} W/m² ({})",
            m.name, m.annual_wh_m2, m.peak_w_m2, m.peak_at
        );
        for (threshold, hours) in &m.hours_above {
            let _ = writeln!(text, "  above {threshold} W/m², unfiltered: {hours:.2} h a year");
        }
        for (surface, share) in &m.shares {
            let _ = writeln!(text, "  from {surface}: {:.0} %", share * 100.0);
        }
        let mut strongest: Vec<_> = m.series.iter().collect();
        strongest.sort_by(|a, b| b.irradiance_w_m2.total_cmp(&a.irradiance_w_m2));
        for s in strongest.iter().take(5) {
            let _ = writeln!(
                text,
                "  {}: {:.2} W/m², sun {:.1}° high at azimuth {:.0}°",
                s.at, s.irradiance_w_m2, s.sun_altitude_deg, s.sun_azimuth_deg
            );
        }
    }
    text
}
