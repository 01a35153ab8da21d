//! Why a volume can't be read or written, and what that means for the process.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::base::{FaultKind, Interrupted};
use glintmap_formats::{npy, zarr};

/// Why a volume can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error("{}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: io::Error,
    },
    /// It is neither of the two kinds of volume.
    #[error("{}: expected a volume (a Zarr group with the array `irradiance`, or an .npy file), found {found}", path.display())]
    NotAVolume {
        /// The file or folder.
        path: PathBuf,
        /// What is there instead.
        found: String,
    },
    /// Something else than an `.npy` file where only that will do.
    #[error("{}: expected an .npy file, found a volume of ours, which needs no import", path.display())]
    NotNpy {
        /// The volume.
        path: PathBuf,
    },
    /// An `.npy` file that can't be used.
    #[error("{}", path.display())]
    Npy {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: npy::Error,
    },
    /// A part of a Zarr store that can't be used.
    #[error("{}", path.display())]
    Zarr {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: zarr::Error,
    },
    /// Metadata that don't fit each other or the program's limits.
    #[error("{}: {field}: expected {expected}, found {found}", path.display())]
    Layout {
        /// The file.
        path: PathBuf,
        /// The field or array.
        field: &'static str,
        /// What it must be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// A shard is not what was written.
    #[error("{}: the tile of columns {columns:?}, rows {rows:?} is damaged: {what}; remove the volume and make it again", path.display())]
    Tile {
        /// The shard.
        path: PathBuf,
        /// Its columns.
        columns: Range<usize>,
        /// Its rows.
        rows: Range<usize>,
        /// What doesn't hold.
        what: String,
    },
    /// A chunk is not what was written.
    #[error("{}: chunk {chunk} (timesteps {timesteps:?}, columns {columns:?}, rows {rows:?}) is damaged: {what}; remove the volume and make it again", path.display())]
    Chunk {
        /// The shard.
        path: PathBuf,
        /// Number of the chunk in its shard.
        chunk: usize,
        /// Its timesteps.
        timesteps: Range<usize>,
        /// Its columns.
        columns: Range<usize>,
        /// Its rows.
        rows: Range<usize>,
        /// What doesn't hold.
        what: String,
    },
    /// The ledger of tiles is not what was written.
    #[error("{}: the ledger of tiles is damaged: {what}; remove the volume and make it again", path.display())]
    Ledger {
        /// The ledger.
        path: PathBuf,
        /// What doesn't hold.
        what: String,
    },
    /// What Zarr's metadata say of the timesteps or the quantity isn't what was written.
    #[error("{}: a zarr.json or a coordinate array was changed after it was written (its ledger of tiles knows it otherwise); put it back or make the volume again", path.display())]
    Metadata {
        /// The volume.
        path: PathBuf,
    },
    /// The volume was not written to its end.
    #[error("{}: the volume isn't finished; run the command that makes it again, it goes on from there", path.display())]
    Unfinished {
        /// The volume.
        path: PathBuf,
    },
    /// [`super::Writer::finish`] before all tiles were there.
    #[error("{}: {missing} of {tiles} tiles are missing", path.display())]
    MissingTiles {
        /// The volume.
        path: PathBuf,
        /// Tiles that were not put.
        missing: usize,
        /// All tiles.
        tiles: usize,
    },
    /// What lies there was made from something else.
    #[error("{}: a volume of another {what} is there (expected {expected}, found {found}); remove it or write elsewhere", path.display())]
    Different {
        /// The volume.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// What is to be written.
        expected: String,
        /// What is there.
        found: String,
    },
    /// Something that isn't ours lies there.
    #[error("{}: expected nothing or a volume of ours, found something else; remove it or write elsewhere", path.display())]
    Occupied {
        /// The file or folder.
        path: PathBuf,
    },
    /// Another process writes there.
    #[error("{}: another glintmap writes this volume; wait for it or stop it", path.display())]
    Busy {
        /// The volume.
        path: PathBuf,
    },
    /// More or other numbers than fit.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// Which number.
        what: &'static str,
        /// What it must be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// A number or a word that isn't what it must be.
#[derive(Clone, Debug)]
pub(super) struct Wrong {
    /// Which one.
    pub what: &'static str,
    pub expected: String,
    pub found: String,
}

impl From<Wrong> for Error {
    fn from(Wrong { what, expected, found }: Wrong) -> Self {
        Self::Shape { what, expected, found }
    }
}

impl Wrong {
    /// In the file at `path`.
    pub fn at(self, path: PathBuf) -> Error {
        Error::Layout { path, field: self.what, expected: self.expected, found: self.found }
    }
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Io { source, .. } => io_kind(source),
            Self::Npy { source: npy::Error::Io(e), .. } => io_kind(e),
            Self::Zarr { source: zarr::Error::Io(e), .. } => io_kind(e),
            Self::Zarr { source: zarr::Error::Metadata { .. }, .. }
            | Self::Npy { .. }
            | Self::NotAVolume { .. }
            | Self::NotNpy { .. }
            | Self::Layout { .. }
            | Self::Unfinished { .. }
            | Self::Different { .. }
            | Self::Occupied { .. }
            | Self::Shape { .. } => FaultKind::Input,
            Self::Zarr { .. }
            | Self::Metadata { .. }
            | Self::Tile { .. }
            | Self::Chunk { .. }
            | Self::Ledger { .. } => FaultKind::Damaged,
            Self::MissingTiles { .. } | Self::Busy { .. } => FaultKind::Failed,
            Self::Interrupted(_) => FaultKind::Interrupted,
        }
    }

    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn npy(path: &Path) -> impl Fn(npy::Error) -> Self + '_ {
        |source| Self::Npy { path: path.to_owned(), source }
    }

    pub(super) fn zarr(path: &Path) -> impl Fn(zarr::Error) -> Self + '_ {
        |source| Self::Zarr { path: path.to_owned(), source }
    }
}

fn io_kind(error: &io::Error) -> FaultKind {
    match error.kind() {
        io::ErrorKind::NotFound
        | io::ErrorKind::PermissionDenied
        | io::ErrorKind::IsADirectory
        | io::ErrorKind::NotADirectory => FaultKind::Input,
        _ => FaultKind::Failed,
    }
}
