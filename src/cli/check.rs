use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;

use super::Context;
use crate::base::limits::MAX_FINDINGS_SHOWN;
use crate::project::Assignment;
use crate::project::Resolved;
use crate::receivers::points::receivers;
use crate::run;
use crate::site::{self, check};

/// Read all inputs and say what was understood and what looks wrong, without running
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  glintmap check church")]
pub(super) struct Arguments {
    /// The project's folder or its project.toml
    project: PathBuf,
    /// Override a key of the project file
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Assignment>,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let resolved = Resolved::read(&arguments.project, &arguments.set, 1 << 30)?;
    let timeline = resolved.timeline()?;
    let loaded = site::load(&resolved.scene, &resolved.pv)?;
    let (site, summary) = (&loaded.site, check::summarise_loaded(&loaded));
    // A folder that can't be written to is no reason not to say what was read.
    let plan = run::draw_site(&resolved.folder, &resolved.project.site.name, site, &summary);
    let names: Vec<&str> = resolved.candidates.iter().map(|c| c.name.as_str()).collect();
    let mut text = format!("{summary}\n");
    // Writing into a String can't fail.
    let _ = match &plan {
        Ok(path) => writeln!(text, "plan of the site: {}", path.display()),
        Err(why) => writeln!(text, "no plan of the site: {why}"),
    };
    let _ = writeln!(text, "{} timesteps with the sun above the horizon", timeline.steps.len());
    let _ = writeln!(text, "materials: {}", names.join(", "));
    let receivers = receivers(&resolved, site)?;
    for line in &receivers {
        let _ = writeln!(text, "{line}");
    }
    for note in &resolved.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for candidate in &resolved.candidates {
        for note in &candidate.notes {
            let _ = writeln!(text, "note: {}: {note}", candidate.name);
        }
    }
    for finding in site.findings.iter().take(MAX_FINDINGS_SHOWN) {
        let _ = writeln!(text, "{finding}");
    }
    if site.findings.len() > MAX_FINDINGS_SHOWN {
        let more = site.findings.len() - MAX_FINDINGS_SHOWN;
        let _ = writeln!(text, "… and {more} more; --json prints all");
    }
    let document = json!({
        "site": summary,
        "timesteps": timeline.steps.len(),
        "materials": names,
        "receivers": receivers,
        "plan": plan.ok(),
        "notes": resolved.notes,
        "findings": site.findings,
    });
    context.print(&document, &text)
}
