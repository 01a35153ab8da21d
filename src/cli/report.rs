use std::path::PathBuf;

use serde_json::json;

use super::Context;
use super::run::{How, finished, judge};
use crate::project::artifacts::REPORT;

/// Make the report for people who read no pixels, and whatever it needs; print where it lies
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  glintmap report church\n\nThe page shows pictures that lie beside it: pass on the whole folder church/run."
)]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    #[command(flatten)]
    how: How,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let summary = finished(&arguments.project, &arguments.how, context)?;
    let path = summary.folder.join(REPORT);
    context.print(&json!({ "report": path, "run": summary }), &path.display().to_string())?;
    judge(&arguments.how, &summary, context)
}
