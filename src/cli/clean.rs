use std::fmt::Write as _;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Context;
use crate::project::Assignment;
use crate::project::Resolved;
use crate::run;
use crate::run::bytes_in_words;
use crate::run::{Cleaned, Part};

/// Show the disk use of a project's results, stage by stage, and remove what can be made again
///
/// Without --remove or --all it only lists. What is removed is what the manifest names and what
/// interrupted runs leave; the log and files of others stay. The next run makes anew what it needs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap clean church                        # only lists\n  glintmap clean church --remove left-over     # of materials, views, thresholds that are gone\n  glintmap clean church --remove trace pages   # the photons; maps and series stay\n  glintmap clean church --all"
)]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// Remove the results of these stages, what is `unfinished`, or what is `left-over`
    #[arg(long, num_args = 1.., value_name = "STAGE", value_parser = part(), conflicts_with = "all")]
    remove: Vec<Part>,
    /// Remove all results
    #[arg(long)]
    all: bool,
    /// Override a key of the project file, as for the run
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

fn part() -> impl TypedValueParser<Value = Part> {
    PossibleValuesParser::new(Part::ALL.map(Part::name)).map(|name| {
        // The parser let only names of parts through.
        Part::ALL.into_iter().find(|p| p.name() == name).unwrap_or(Part::Unfinished)
    })
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let parts = if arguments.all { &Part::ALL[..] } else { &arguments.remove[..] };
    let cleaned = run::clean(&resolved, parts)?;
    context.print(&cleaned, &table(&cleaned))
}

fn table(cleaned: &Cleaned) -> String {
    if cleaned.parts.is_empty() && cleaned.other_bytes == 0 {
        return format!("{}: nothing was made yet", cleaned.folder.display());
    }
    let mut text = format!("{}\n", cleaned.folder.display());
    for part in &cleaned.parts {
        // Writing into a String can't fail.
        let _ = writeln!(
            text,
            "{:10} {:>10}  {} files or folders{}",
            part.part,
            bytes_in_words(part.bytes),
            part.outputs.len(),
            if part.removed { ", removed" } else { "" }
        );
    }
    let _ = writeln!(
        text,
        "{:10} {:>10}  the log and what is none of ours; stays",
        "other",
        bytes_in_words(cleaned.other_bytes)
    );
    if cleaned.parts.iter().any(|p| p.removed) {
        let _ = writeln!(text, "freed {}", bytes_in_words(cleaned.freed_bytes));
    } else if !cleaned.parts.is_empty() {
        let _ =
            writeln!(text, "nothing was removed; name what is to go: --remove STAGE... or --all");
    }
    text
}
