//! Whether what lies in a run folder is still what was written.

use std::path::Path;

use glintmap_formats::hits;

use super::error::Error;
use crate::base::{FaultKind, Progress};
use crate::pages;
use crate::project::Folder;
use crate::project::Resolved;
use crate::project::{Manifest, hash_path};
use crate::volume::Volume;

/// Checks every output that the manifest names, and every checksum inside our own files. What is
/// wrong comes back as findings, each with its file.
///
/// # Errors
/// When there is no run yet, or the disk can't be read.
pub fn verify(resolved: &Resolved, progress: &dyn Progress) -> Result<Vec<String>, Error> {
    let folder = Folder::new(resolved.run_folder());
    let manifest = Manifest::read(folder.root())?;
    if manifest.units.is_empty() {
        return Err(Error::NotMade {
            what: format!("nothing was made yet in {}", folder.root().display()),
            project: resolved.folder.clone(),
            stage: "report",
        });
    }
    let outputs: Vec<(&String, &String)> =
        manifest.units.values().flat_map(|unit| &unit.outputs).collect();
    let mut findings = Vec::new();
    for (at, (name, expected)) in outputs.iter().enumerate() {
        progress.check()?;
        let path = folder.at(Path::new(name.as_str()));
        if !path.exists() {
            findings.push(format!("{name}: is missing; run the project again to make it anew"));
            continue;
        }
        let found =
            hash_path(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        if &found == *expected {
            continue;
        }
        let before = findings.len();
        for detail in details(&path, progress)? {
            findings.push(format!("{name}: {detail}"));
        }
        if findings.len() == before {
            findings.push(format!(
                "{name}: is not what the run wrote (output {} of {}); remove it and run again",
                at + 1,
                outputs.len()
            ));
        }
    }
    Ok(findings)
}

/// What a file of ours says is wrong with it.
fn details(path: &Path, progress: &dyn Progress) -> Result<Vec<String>, Error> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("gmp") => Ok(pages::verify(path)?),
        Some("gmh") => {
            hits::verify(path).map_err(|source| Error::Read { path: path.to_owned(), source })
        }
        Some("zarr") => match Volume::open(path) {
            Ok(volume) => Ok(volume.verify(progress)?),
            Err(e) if e.kind() == FaultKind::Damaged => Ok(vec![e.to_string()]),
            Err(e) => Err(e.into()),
        },
        _ => Ok(Vec::new()),
    }
}
