use std::fmt::Write as _;
use std::path::PathBuf;

use super::{Context, size};
use crate::project::Assignment;
use crate::project::Resolved;
use crate::run::{Estimate, bytes_in_words, estimate};

/// Say what a run will cost, stage by stage, before an hour is spent; nothing is written. What
/// doesn't fit on the disk is refused
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  glintmap plan church --set photons.stored=250000000")]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// Override a key of the project file
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
    /// Bound of anonymous memory
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = size::parse)]
    memory: u64,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, arguments.memory)?;
    for note in &resolved.notes {
        context.progress().say(&format!("warning: {note}"));
    }
    let estimate = estimate(&resolved, arguments.memory)?;
    context.print(&estimate, &table(&estimate))?;
    Ok(estimate.refuse_full_disk()?)
}

fn table(estimate: &Estimate) -> String {
    let mut text = String::new();
    // Writing into a String can't fail.
    let _ = writeln!(
        text,
        "{} timesteps, {} materials; rough, on two cores:\n",
        estimate.timesteps, estimate.candidates
    );
    let _ = writeln!(
        text,
        "{:9} {:>10} {:>10} {:>10} {:>9}  work",
        "stage", "disk", "at most", "memory", "time"
    );
    for s in &estimate.stages {
        let _ = writeln!(
            text,
            "{:9} {:>10} {:>10} {:>10} {:>9}  {}",
            s.stage.name(),
            bytes_in_words(s.disk_bytes),
            bytes_in_words(s.disk_bound_bytes),
            bytes_in_words(s.memory_bytes),
            time(s.time_s),
            s.work
        );
    }
    let total: f64 = estimate.stages.iter().map(|s| s.time_s).sum();
    let _ = writeln!(
        text,
        "\nin all about {}; {} on disk of {} free",
        time(total),
        bytes_in_words(estimate.disk_bytes),
        bytes_in_words(estimate.free_bytes)
    );
    text
}

fn time(seconds: f64) -> String {
    if seconds < 90.0 {
        format!("{:.0} s", seconds.max(1.0))
    } else if seconds < 5400.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    }
}
