//! What lies in a run folder, stage by stage, and how to be rid of it. Only what the manifest
//! names, or what a run that was interrupted is known to leave, is ever removed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use glintmap_formats::seal;
use serde::Serialize;

use super::disk::{lies_inside, remove, used_bytes};
use super::error::Error;
use super::stage::Stage;
use super::units::units;
use crate::project::Folder;
use crate::project::Manifest;
use crate::project::Resolved;

/// What a file or folder below `run/` belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Results of a stage of the project as it is now.
    Made(Stage),
    /// Begun and not finished: a run goes on there.
    Unfinished,
    /// Results of materials, views or thresholds that the project no longer has.
    LeftOver,
}

impl Part {
    /// All parts, in the order in which they are listed.
    pub const ALL: [Self; 9] = [
        Self::Made(Stage::Suns),
        Self::Made(Stage::Trace),
        Self::Made(Stage::Pages),
        Self::Made(Stage::Render),
        Self::Made(Stage::Glare),
        Self::Made(Stage::Pictures),
        Self::Made(Stage::Report),
        Self::Unfinished,
        Self::LeftOver,
    ];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Made(stage) => stage.name(),
            Self::Unfinished => "unfinished",
            Self::LeftOver => "left-over",
        }
    }
}

/// Disk use of one part.
#[derive(Clone, Debug, Serialize)]
pub struct Usage {
    /// Name of the part.
    pub part: &'static str,
    /// Files and folders below `run/`.
    pub outputs: Vec<String>,
    /// Bytes of all of them.
    pub bytes: u64,
    /// Whether they are gone now.
    pub removed: bool,
}

/// What was found, and what became of it.
#[derive(Clone, Debug, Serialize)]
pub struct Cleaned {
    /// The run folder.
    pub folder: PathBuf,
    /// Part by part; parts without files are left out.
    pub parts: Vec<Usage>,
    /// Bytes that were freed.
    pub freed_bytes: u64,
    /// Bytes of files that are none of ours, or of the log: never removed.
    pub other_bytes: u64,
}

/// Lists what lies in a project's run folder, and removes `parts` of it. The next run makes anew
/// what it needs.
///
/// # Errors
/// When another run works there, or files can't be removed.
pub fn clean(resolved: &Resolved, parts: &[Part]) -> Result<Cleaned, Error> {
    let folder = Folder::new(resolved.run_folder());
    let mut cleaned = Cleaned {
        folder: folder.root().to_owned(),
        parts: Vec::new(),
        freed_bytes: 0,
        other_bytes: 0,
    };
    if !folder.root().is_dir() {
        return Ok(cleaned);
    }
    // Who only looks needs no lock: a run may be going on.
    let _lock = if parts.is_empty() { None } else { Some(folder.lock(None)?) };
    let mut manifest = Manifest::read(folder.root())?;
    let found = sort_out(resolved, &folder, &manifest)?;
    let mut ours = 0;
    for part in Part::ALL {
        let Some(outputs) = found.get(&part) else { continue };
        let mut usage = Usage { part: part.name(), outputs: Vec::new(), bytes: 0, removed: false };
        for output in outputs {
            usage.bytes += size(&folder.at(output))?;
            usage.outputs.push(output.to_string_lossy().replace('\\', "/"));
        }
        ours += usage.bytes;
        if parts.contains(&part) {
            // First the manifest forgets, then the files go: it never names what is half gone.
            let gone: BTreeSet<&str> = usage.outputs.iter().map(String::as_str).collect();
            manifest.units.retain(|_, u| !u.outputs.keys().any(|o| gone.contains(o.as_str())));
            manifest.write(folder.root())?;
            for output in outputs {
                remove(&folder.at(output))?;
                forget_empty_folders(&folder, output);
            }
            usage.removed = true;
            cleaned.freed_bytes += usage.bytes;
        }
        cleaned.parts.push(usage);
    }
    let all = used_bytes(folder.root())? + cleaned.freed_bytes;
    cleaned.other_bytes = all.saturating_sub(ours);
    Ok(cleaned)
}

/// What is there of each part, relative to `run/`.
fn sort_out(
    resolved: &Resolved,
    folder: &Folder,
    manifest: &Manifest,
) -> Result<BTreeMap<Part, BTreeSet<PathBuf>>, Error> {
    let planned = units(resolved, folder)?;
    let mut found: BTreeMap<Part, BTreeSet<PathBuf>> = BTreeMap::new();
    let mut named = BTreeSet::new();
    let mut add = |part: Part, name: PathBuf| {
        if fs::symlink_metadata(folder.at(&name)).is_ok() {
            found.entry(part).or_default().insert(name);
        }
    };
    for (unit, made) in &manifest.units {
        let planned = planned.iter().find(|planned| planned.name == *unit);
        let part = planned.map_or(Part::LeftOver, |planned| Part::Made(planned.stage));
        for output in made.outputs.keys().map(Path::new).filter(|o| lies_inside(o)) {
            named.insert(output.to_owned());
            add(part, output.to_owned());
            add(Part::Unfinished, seal::growing(output));
        }
    }
    // What a run leaves that was interrupted.
    for draft in planned.into_iter().flat_map(|unit| unit.drafts) {
        if !named.contains(&draft) {
            add(Part::Unfinished, draft);
        }
    }
    Ok(found)
}

fn size(path: &Path) -> Result<u64, Error> {
    let meta = fs::symlink_metadata(path)?;
    if meta.is_dir() { used_bytes(path) } else { Ok(meta.len()) }
}

/// Folders that held nothing else go as well; one that isn't empty refuses, and stays.
fn forget_empty_folders(folder: &Folder, output: &Path) {
    let mut at = output.parent();
    while let Some(name) = at.filter(|n| !n.as_os_str().is_empty()) {
        if fs::remove_dir(folder.at(name)).is_err() {
            return;
        }
        at = name.parent();
    }
}
