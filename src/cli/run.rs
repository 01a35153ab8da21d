//! `glintmap run`: runs a project and says what was made.
//!
//! `demo` and `report` run projects, too, and share [`How`] with it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::{Context, size};
use crate::project::Assignment;
use crate::project::Resolved;
use crate::project::Shard;
use crate::project::artifacts::REPORT;
use crate::rules::Outcome;
use crate::run;
use crate::run::{Options, Stage, Summary};

/// Run what is missing or out of date, resume what was interrupted
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap run church\n  glintmap run church --until trace\n  glintmap run church --until trace --shard 2/8\n  glintmap run church --set photons.stored=200000 --set view.plan.bandwidth=50\n  glintmap run church --fail-on paper-2018"
)]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    #[command(flatten)]
    how: How,
}

/// How to run: shared by `run` and `demo`.
#[derive(Debug, clap::Args)]
pub(super) struct How {
    /// The last stage to run
    #[arg(long, value_name = "STAGE", value_parser = stage())]
    until: Option<Stage>,
    /// Redo this stage and what follows
    #[arg(long, value_name = "STAGE", value_parser = stage())]
    force: Option<Stage>,
    /// Trace only the I-th of N shares of the photons (with --until trace)
    ///
    /// Each share can be traced on another machine, if all see the project's folder. A run without
    /// it joins them, and goes on with the same bytes as if one machine had traced everything.
    #[arg(long, value_name = "I/N", requires = "until")]
    shard: Option<Shard>,
    /// Override a key of the project file; tables by name, TOML values
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
    /// Leave with exit code 4 where an observer or a region is above this rule, with any material
    /// but the reference
    #[arg(long, value_name = "RULE")]
    fail_on: Vec<String>,
    /// Bound of anonymous memory
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = size::parse)]
    memory: u64,
    /// Of the photon store's page cache
    #[arg(long, value_name = "SIZE", default_value = "256MiB", value_parser = size::parse)]
    page_cache: u64,
}

fn stage() -> impl TypedValueParser<Value = Stage> {
    PossibleValuesParser::new(Stage::ALL.map(Stage::name)).map(|name| {
        // The parser let only names of stages through.
        Stage::ALL.into_iter().find(|s| s.name() == name).unwrap_or(Stage::Report)
    })
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    go(&arguments.project, &arguments.how, context)
}

/// Runs a project and prints what was done.
pub(super) fn go(project: &Path, how: &How, context: &Context) -> anyhow::Result<()> {
    let summary = finished(project, how, context)?;
    context.print(&summary, &told(&summary, how.until.unwrap_or(Stage::Report)))?;
    judge(how, &summary, context)
}

/// What `--fail-on` asks for.
pub(super) fn judge(how: &How, summary: &Summary, context: &Context) -> anyhow::Result<()> {
    let of = |outcome| {
        let asked =
            summary.verdicts.iter().filter(|j| !j.reference && how.fail_on.contains(&j.rule));
        asked.filter(move |j| j.verdict.outcome == outcome)
    };
    for j in of(Outcome::NotEvaluated) {
        context.progress().say(&format!("{}, {}: {}", j.receiver, j.material, j.sentence));
    }
    let over: Vec<String> = of(Outcome::Exceeded)
        .map(|j| format!("{}, {}: {}", j.receiver, j.material, j.sentence))
        .collect();
    match over.is_empty() {
        true => Ok(()),
        false => Err(run::Error::Exceeded(over.join("\n")).into()),
    }
}

/// Runs a project.
pub(super) fn finished(project: &Path, how: &How, context: &Context) -> anyhow::Result<Summary> {
    let resolved = Resolved::read(project, &how.set, how.memory)?;
    if how.shard.is_some() && how.until != Some(Stage::Trace) {
        let what = "--shard: a share of the photons is traced with `--until trace`; a run without \
                    --shard joins the shares and goes on";
        return Err(run::Error::Unsupported(what.to_owned()).into());
    }
    for rule in &how.fail_on {
        let known: Vec<&str> = resolved.rules.iter().map(|r| r.id.as_str()).collect();
        if !known.contains(&rule.as_str()) {
            let what = format!(
                "--fail-on {rule}: glare.rules of the project doesn't name it (there are: {})",
                known.join(", ")
            );
            return Err(run::Error::Unsupported(what).into());
        }
    }
    let nobody = resolved.project.observer.is_empty() && resolved.project.region.is_empty();
    let until = how.until.unwrap_or(Stage::Report);
    if !how.fail_on.is_empty() && (nobody || until != Stage::Report) {
        let what = "--fail-on judges observers and regions once the report is there: the project \
                    names none, or --until stops before it";
        return Err(run::Error::Unsupported(what.to_owned()).into());
    }
    let options = Options {
        until: how.until.unwrap_or(Stage::Report),
        force: how.force,
        shard: how.shard,
        memory_bytes: how.memory,
        page_cache_bytes: how.page_cache,
    };
    Ok(run::run(&resolved, options, context.progress())?)
}

fn told(summary: &Summary, until: Stage) -> String {
    let mut text = String::new();
    for j in summary.verdicts.iter().filter(|j| !j.reference) {
        // Writing into a String can't fail.
        let _ = writeln!(text, "{}, {}: {}", j.receiver, j.material, j.sentence);
    }
    let _ = match (summary.made.len(), summary.current.len()) {
        (0, current) => writeln!(text, "nothing to do: all {current} units are up to date"),
        (made, 0) => writeln!(text, "made {made} units"),
        (made, current) => writeln!(text, "made {made} units, {current} were up to date"),
    };
    let cache = summary.page_cache;
    if cache.hits + cache.misses > 0 {
        let _ = writeln!(
            text,
            "photon pages: {} hits, {} misses, {} evictions; {} MiB decompressed",
            cache.hits,
            cache.misses,
            cache.evictions,
            cache.decompressed_bytes >> 20
        );
    }
    if summary.draft {
        let _ =
            writeln!(text, "draft, not for assessment: fewer than 4 million photons a material");
    }
    if until == Stage::Report {
        let _ = writeln!(text, "look at {}", summary.folder.join(REPORT).display());
    } else {
        let _ = writeln!(text, "results lie in {}", summary.folder.display());
    }
    text
}
