//! Where everything of a run lies: handbook names, in one place.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use super::error::Error;
use super::shard::Shard;
use crate::base::TileRect;
use crate::render::HitMap;

/// The names below a project's `run/`. All but [`Folder::root`] are relative to it.
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

    /// The timesteps.
    pub fn suns(&self) -> PathBuf {
        "suns.csv".into()
    }

    /// Per pixel: what the view sees.
    pub fn hits(&self, view: &str) -> PathBuf {
        Path::new(view).join("hits.gmh")
    }

    /// Of a set of sensors: whose points they are.
    pub fn points(&self, set: &str) -> PathBuf {
        Path::new(set).join("points.json")
    }

    /// The direct background.
    pub fn direct(&self, view: &str) -> PathBuf {
        Path::new(view).join("direct.exr")
    }

    /// A view's own pictures.
    pub fn view_file(&self, view: &str, name: &str) -> PathBuf {
        Path::new(view).join(name)
    }

    /// Where photons wait to be sorted.
    pub fn spill(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("spill")
    }

    /// Where shares of a candidate's photons wait to be joined.
    pub fn shards(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("shards")
    }

    /// Where the photons went: counts and flux.
    pub fn tally(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("tally.json")
    }

    /// The photon store.
    pub fn store(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("photons.gmp")
    }

    /// A file of a candidate's view.
    pub fn map(&self, candidate: &str, view: &str, name: &str) -> PathBuf {
        Path::new(candidate).join(view).join(name)
    }

    /// The time series.
    pub fn series(&self, candidate: &str, view: &str) -> PathBuf {
        self.map(candidate, view, "series.zarr")
    }

    /// Where the year's sums of a view that is integrated directly wait for the last tile.
    pub fn waiting_tiles(&self, candidate: &str, view: &str) -> PathBuf {
        self.map(candidate, view, "annual-tiles")
    }

    /// The file of a tile that waits.
    pub fn tile(tile: TileRect) -> String {
        format!("{}-{}.npy", tile.row, tile.column)
    }

    /// A file of a glare analysis.
    pub fn glare(&self, candidate: &str, view: &str, threshold: f64, name: &str) -> PathBuf {
        self.map(candidate, view, &format!("glare-{threshold}")).join(name)
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
