//! What was made from what: so that a run makes only what is missing or out of date.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use glintmap_formats::seal;
use serde::{Deserialize, Serialize};

use super::artifacts::MANIFEST;
use super::error::Error;

/// `run/manifest.json`: for each unit of work the key it was made from, and what it left behind.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Manifest {
    /// The program that wrote it.
    pub program: String,
    /// By name of the unit: `suns`, `trace standard`, `render standard plan`, ….
    pub units: BTreeMap<String, Done>,
    /// Units that were begun and not finished, each with its key: what lies there of one is gone
    /// on with under the same key only. A finished run has none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub begun: BTreeMap<String, String>,
}

/// One unit of work that is done.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq)]
pub struct Done {
    /// Hash of all that decides its outputs: settings, inputs, the units before it.
    pub key: String,
    /// Hash of each output by its path below `run/`. A folder has one hash over its files.
    pub outputs: BTreeMap<String, String>,
}

impl Done {
    /// Whether all that it left behind is still there.
    pub fn is_whole(&self, run: &Path) -> bool {
        self.outputs.keys().all(|o| run.join(o).exists())
    }
}

impl Manifest {
    /// Reads the manifest of a run folder; an empty one where there is none yet.
    ///
    /// # Errors
    /// When it is there and can't be read.
    pub fn read(run: &Path) -> Result<Self, Error> {
        let path = run.join(MANIFEST);
        let text = match fs::read(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Err(source) => return Err(Error::Read { path, source }),
        };
        serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write(&self, run: &Path) -> Result<(), Error> {
        let path = run.join(MANIFEST);
        let mut text = serde_json::to_vec_pretty(self).map_err(io::Error::from)?;
        text.push(b'\n');
        seal::write_bytes(&path, &text).map_err(|source| Error::Write { path, source })
    }

    /// Whether the unit was made from `key` and all it left behind is still there.
    pub fn is_current(&self, run: &Path, unit: &str, key: &str) -> bool {
        self.units.get(unit).is_some_and(|u| u.key == key && u.is_whole(run))
    }

    /// Notes that the unit is done: its outputs (paths below `run/`) are hashed.
    ///
    /// # Errors
    /// When an output can't be read back.
    pub fn record(
        &mut self,
        run: &Path,
        unit: &str,
        key: &str,
        outputs: &[PathBuf],
    ) -> Result<(), Error> {
        let mut hashes = BTreeMap::new();
        for output in outputs {
            let path = run.join(output);
            let hash = hash_path(&path).map_err(|source| Error::Read { path, source })?;
            hashes.insert(output.to_string_lossy().replace('\\', "/"), hash);
        }
        self.program = crate::base::Provenance::PROGRAM.into();
        self.units.insert(unit.into(), Done { key: key.into(), outputs: hashes });
        self.begun.remove(unit);
        self.write(run)
    }
}

/// BLAKE3 of a file, or of a folder: of its files' paths and hashes in order.
///
/// # Errors
/// Whatever the file system says.
pub fn hash_path(path: &Path) -> io::Result<String> {
    if path.is_dir() {
        let mut all = blake3::Hasher::new();
        let mut entries: Vec<PathBuf> =
            fs::read_dir(path)?.map(|e| e.map(|e| e.path())).collect::<io::Result<_>>()?;
        entries.sort();
        for entry in entries {
            let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
            all.update(name.as_bytes());
            all.update(b"\0");
            all.update(hash_path(&entry)?.as_bytes());
        }
        return Ok(all.finalize().to_hex().to_string());
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}
