//! The folder of a run: reads and writes files below it by their names, which stand in
//! [`artifacts`](super::artifacts).

use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use glintmap_formats::seal;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::Error;
use super::shard::Shard;
use crate::render::HitMap;

/// A project's `run/`. Names of files are relative to it.
#[derive(Clone, Debug)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// The run folder of a project.
    pub fn new(root: PathBuf) -> Self {
        Self { root }
    }

    /// `run/` itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The whole path of a name below `run/`.
    pub fn at(&self, name: &Path) -> PathBuf {
        self.root.join(name)
    }

    /// What the pixels of a view, or the points of a set, see.
    ///
    /// # Errors
    /// When the file is missing or damaged.
    pub fn read_hits(&self, view: &str) -> Result<HitMap, Error> {
        Ok(HitMap::read(&self.at(&self.hits(view)))?.0)
    }

    /// Makes the folder that `name` lies in.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn prepare(&self, name: &Path) -> Result<PathBuf, Error> {
        let path = self.at(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)
                .map_err(|source| Error::Write { path: parent.to_owned(), source })?;
        }
        Ok(path)
    }

    /// Reads a file that holds one value as JSON.
    ///
    /// # Errors
    /// [`Error::Read`], or [`Error::Manifest`] where it holds something else.
    pub fn read_json<T: DeserializeOwned>(&self, name: &Path) -> Result<T, Error> {
        let path = self.at(name);
        let text = fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
    }

    /// Reads the rows of a table.
    ///
    /// # Errors
    /// [`Error::Read`], or [`Error::Manifest`] where a row isn't one of these.
    pub fn read_table<R: DeserializeOwned>(&self, name: &Path) -> Result<Vec<R>, Error> {
        let path = self.at(name);
        let file =
            File::open(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        let rows = csv::Reader::from_reader(file).into_deserialize().collect::<Result<_, _>>();
        rows.map_err(|e| Error::Manifest { path, message: e.to_string() })
    }

    /// Writes a value as JSON for people, whole or not at all.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write_json(&self, name: &Path, value: &impl Serialize) -> Result<(), Error> {
        let text = serde_json::to_vec_pretty(value).map_err(io::Error::from)?;
        self.write(name, |out| out.write_all(&text))
    }

    /// Writes a file, whole or not at all; makes the folder that it lies in.
    ///
    /// # Errors
    /// Whatever `fill` and the file system say.
    pub fn write(
        &self,
        name: &Path,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Error> {
        let path = self.prepare(name)?;
        seal::write(&path, |out| fill(out))
            .map_err(|source: io::Error| Error::Write { path: path.clone(), source })
    }

    /// Locks the run folder against another run of ours, or one share of its photons against
    /// another run of the same share; the lock ends with the value.
    ///
    /// # Errors
    /// [`Error::Busy`] when another process holds it.
    pub fn lock(&self, shard: Option<Shard>) -> Result<File, Error> {
        let name = shard.map_or("lock".to_owned(), |shard| format!("lock-{}", shard.name()));
        let path = self.prepare(&Path::new("log").join(name))?;
        let file =
            File::create(&path).map_err(|source| Error::Write { path: path.clone(), source })?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(Error::Busy { path }),
            // A file system without locks (some network mounts): go on, as without this check.
            Err(TryLockError::Error(_)) => Ok(file),
        }
    }
}
