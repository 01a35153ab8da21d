//! `glintmap mirror`: the authorities' mirror rule at observers, regions, points and objects.

use std::fmt::Write as _;
use std::path::PathBuf;

use glam::DVec3;
use glintmap_formats::seal;

use super::Context;
use crate::project::Assignment;
use crate::project::Resolved;
use crate::receivers::mirror::{MirrorAsked, Mirrored, MirroredAt, mirror};

/// The authorities' mirror rule: at this window, when and for how long?
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  glintmap mirror church                         all observers and regions of the project
  glintmap mirror church --observer 'Chalet, upstairs' --csv days.csv --plot chalet.png
  glintmap mirror church --point -54.1,10.5,9.2 --step 30s --refraction
  glintmap mirror church --region Chalet --spacing 0.25 --points-csv facade.csv --plot chalet.png
  glintmap mirror church --object chalet --csv days.csv

Germany's LAI (2015): a point sun, an ideal mirror, no intensity, always clear, every minute of the
year, all PV together, while sun and reflection are at least 10 degrees apart. Terrain, buildings
and trees stand in the way of the sun and of its reflection. Times are local standard time.")]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// An [[observer]] of the project, by name; may be repeated [default: all, with all regions]
    #[arg(long, value_name = "NAME")]
    observer: Vec<String>,
    /// A [[region]] of the project, by name; may be repeated
    #[arg(long, value_name = "NAME")]
    region: Vec<String>,
    /// X,Y,Z in metres from the local origin; may be repeated
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_parser = point,
        allow_negative_numbers = true,
        allow_hyphen_values = true
    )]
    point: Vec<DVec3>,
    /// Covers the faces of an object (a façade) with points
    #[arg(long, value_name = "ID")]
    object: Option<String>,
    /// Distance of the points of regions and objects, m [default: the project's spacing_m, else 1;
    /// 0.5 for --object]
    #[arg(long, value_name = "M")]
    spacing: Option<f64>,
    /// From one instant to the next: 1s to 60min, a whole part of the day
    #[arg(long, value_name = "STEP", default_value = "1min", value_parser = seconds)]
    step: u32,
    /// Least angle between sun and reflection, degrees; the rule says 10
    #[arg(long, value_name = "DEG", default_value_t = crate::render::SEPARATION_DEG)]
    separation: f64,
    /// Let the air lift the sun, as it does near the horizon
    #[arg(long)]
    refraction: bool,
    /// Writes a table of the lit days of each observer, point and region (anywhere on it)
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Writes a table with a line for each point of the regions: hours a year, most minutes a day,
    /// first and last date
    #[arg(long, value_name = "OUT.csv")]
    points_csv: Option<PathBuf>,
    /// Draws day against clock time, coloured by PV surface; numbered where there are several
    #[arg(long, value_name = "OUT.png")]
    plot: Option<PathBuf>,
    /// Override a key of the project file, as for the run
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

pub(super) fn point(text: &str) -> Result<DVec3, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|t| t.trim().parse().ok()).collect();
    match numbers.as_slice() {
        &[x, y, z] if text.split(',').count() == 3 && DVec3::new(x, y, z).is_finite() => {
            Ok(DVec3::new(x, y, z))
        }
        _ => Err(format!("expected X,Y,Z in metres, found `{text}`")),
    }
}

pub(super) fn seconds(text: &str) -> Result<u32, String> {
    let wrong = || format!("expected a step such as 30s, 1min or 5min, found `{text}`");
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let number: u32 = number.parse().map_err(|_| wrong())?;
    let factor = match unit.trim() {
        "s" => 1,
        "min" | "m" => 60,
        "h" => 3600,
        _ => return Err(wrong()),
    };
    number.checked_mul(factor).ok_or_else(wrong)
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let asked = MirrorAsked {
        observers: arguments.observer.clone(),
        regions: arguments.region.clone(),
        points: arguments.point.clone(),
        object: arguments.object.clone(),
        spacing_m: arguments.spacing,
        step_s: arguments.step,
        separation_deg: arguments.separation,
        refraction: arguments.refraction,
    };
    let found = mirror(&resolved, &asked, context.progress())?;
    let tables = [(&arguments.csv, found.daily_csv()), (&arguments.points_csv, found.points_csv())];
    for (path, text) in tables.iter().filter_map(|(path, text)| Some((path.as_ref()?, text))) {
        seal::write_bytes(path, text.as_bytes())
            .map_err(|source| crate::project::Error::Write { path: path.clone(), source })?;
    }
    if let Some(path) = &arguments.plot {
        found.write_charts(&resolved, path)?;
    }
    context.print(&found, &told(&found))
}

fn told(found: &Mirrored) -> String {
    let a = &found.assumptions;
    let mut text = format!(
        "{}: every {} s of {}, {} suns by {} ({} worked out){}{}\n",
        found.rule,
        a.step_s,
        a.year,
        a.suns,
        a.sun,
        a.worked_out,
        if a.refraction { ", refracted" } else { "" },
        if a.far_horizon { ", above the far horizon" } else { "" },
    );
    for r in &found.receivers {
        // Writing into a String can't fail.
        let _ = writeln!(text, "\n{}", r.name);
        tell(&mut text, r);
        let _ = match r.exceeded.as_slice() {
            [] => writeln!(text, "  within the limits of the rule"),
            limits => writeln!(text, "  exceeds the rule's limit: {}", limits.join(", ")),
        };
    }
    for r in &found.regions {
        let _ = writeln!(text, "\n{}: {} points, {}", r.name, r.points.len(), r.notes.join("; "));
        let _ = writeln!(
            text,
            "  {} points are lit; {} ({:.1} of {:.1} m2) are above a limit of the rule",
            r.lit_points, r.exceeding_points, r.exceeding_m2, r.area_m2
        );
        if let Some([x, y, z]) = r.worst_point {
            let _ = writeln!(
                text,
                "  its points have up to {:.1} h a year (at {x:.1},{y:.1},{z:.1}) and up to {} min a day; anywhere on it:",
                r.worst.hours, r.worst.most_minutes
            );
        }
        tell(&mut text, &r.anywhere);
    }
    text
}

fn tell(text: &mut String, r: &MirroredAt) {
    let Some([first, last, most]) = &r.dates else {
        text.push_str("  never\n");
        return;
    };
    let y = &r.year;
    let _ = writeln!(
        text,
        "  {:.1} h a year, at most {} min a day ({most}), {} days from {first} to {last}, {} to {} standard time",
        y.hours,
        y.most_minutes,
        y.days,
        clock(y.earliest_h),
        clock(y.latest_h)
    );
    for (surface, minutes) in &r.minutes_by_surface {
        let _ = writeln!(text, "  from {surface}: {:.1} h", minutes / 60.0);
    }
}

fn clock(hour: f64) -> String {
    let minutes = (hour * 60.0).round() as u32;
    format!("{:02}:{:02}", minutes / 60, minutes % 60)
}
