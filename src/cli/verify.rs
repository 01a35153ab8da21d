use std::path::{Path, PathBuf};

use super::{Context, own_format};
use crate::base::limits::MAX_FINDINGS_SHOWN;
use crate::pages;
use crate::project::Resolved;
use crate::run;
use crate::volume::Volume;

/// Check every checksum of a file of glintmap's own, or of a whole project, and list what is wrong
///
/// Reads everything. Exit code 0: sound; 3: something was found.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap verify church\n  glintmap verify church/run/standard/photons.gmp"
)]
pub(super) struct Arguments {
    /// A project's folder, its project.toml, or a file of ours: .gmp, .gmh, .zarr
    path: PathBuf,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let path = &arguments.path;
    let findings = findings(path, context)?;
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

fn findings(path: &Path, context: &Context) -> anyhow::Result<Vec<String>> {
    let is_project = path.join("project.toml").exists()
        || path.extension().is_some_and(|extension| extension == "toml");
    if is_project {
        let resolved = Resolved::read(path, &[], 1 << 30)?;
        return Ok(run::verify(&resolved, context.progress())?);
    }
    if path.is_dir() {
        return Ok(Volume::open(path)?.verify(context.progress())?);
    }
    match own_format::format_name(path, &["photons", "hits"])? {
        "photons" => Ok(pages::verify(path)?),
        _ => Ok(glintmap_formats::hits::verify(path)?),
    }
}
