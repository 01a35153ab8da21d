use std::path::PathBuf;

use super::{Context, ours};
use crate::base::limits::MAX_FINDINGS_SHOWN;
use crate::pages;

/// Check every checksum of a file of glintmap's own, and list what is wrong
///
/// Reads the whole file. Exit code 0: sound; 3: something was found.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  glintmap verify run/standard/photons.gmp")]
pub(super) struct Arguments {
    /// The file
    file: PathBuf,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let path = &arguments.file;
    let findings = match ours::format_name(path, &["photons"])? {
        "photons" => pages::verify(path)?,
        other => anyhow::bail!("{}: nothing is known about {other}", path.display()),
    };
    let mut lines: Vec<String> = findings.iter().take(MAX_FINDINGS_SHOWN).cloned().collect();
    if findings.len() > lines.len() {
        lines.push(format!("and {} more", findings.len() - lines.len()));
    }
    if findings.is_empty() {
        lines.push(format!("{}: sound", path.display()));
    }
    let document = serde_json::json!({ "file": path, "findings": findings });
    context.print(&document, &lines.join("\n"))?;
    match findings.len() {
        0 => Ok(()),
        count => Err(pages::Error::Findings { path: path.clone(), count }.into()),
    }
}
