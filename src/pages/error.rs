use std::io;
use std::path::{Path, PathBuf};

use glintmap_formats::{gmp, header};

use crate::base::{FaultKind, Interrupted, SinkError};

/// Why the photon store can't be written or read.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error("{path}: {doing}: {source}", path = .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was being done, with how many bytes.
        doing: String,
        /// What the file system said.
        source: io::Error,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// Bounds that can't hold a photon map.
    #[error("photons can't be kept in a box from {min:?} to {max:?} m: expected finite corners")]
    Bounds {
        /// Smallest corner.
        min: [f32; 3],
        /// Largest corner.
        max: [f32; 3],
    },
    /// Photons that were collected before a run was interrupted.
    #[error(
        "{path}: the photons in it were never completed (no {summary}): trace them again",
        path = .path.display(),
        summary = super::partitioner::SUMMARY
    )]
    Unfinished {
        /// The spill's folder.
        path: PathBuf,
    },
    /// The photons that were collected contradict what the store is said to hold.
    #[error(
        "photon of timestep {timestep} and PV surface {surface}; expected less than {timesteps} and {surfaces}"
    )]
    Photon {
        /// The photon's timestep.
        timestep: u32,
        /// The photon's PV surface.
        surface: u16,
        /// Number of timesteps.
        timesteps: u32,
        /// Number of PV surfaces.
        surfaces: usize,
    },
    /// Another process writes the same file.
    #[error("{path}: another glintmap is writing it; wait for it or stop it", path = .path.display())]
    Busy {
        /// The file that grows.
        path: PathBuf,
    },
    /// It isn't a photon store of a version that is known.
    #[error("{path}: {source}", path = .path.display())]
    Header {
        /// The store.
        path: PathBuf,
        /// Name, version or damage.
        source: header::Error,
    },
    /// Bytes on disk that don't hold what they promise.
    #[error("{path}: damaged at byte {byte}, {part}: {what}; make it again (`run --force {stage}`) or restore it from a copy", path = .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where in the file, bytes from its start.
        byte: u64,
        /// Directory, page number.
        part: String,
        /// Field, expected, found.
        what: String,
        /// The stage that makes the file.
        stage: &'static str,
    },
    /// Encoding failed; never by the content of photons.
    #[error("page: {0}")]
    Encode(#[from] gmp::Error),
    /// A page was asked for that isn't there.
    #[error("no such page: the store has {pages}, the first is 0")]
    NoPage {
        /// Number of pages.
        pages: u64,
    },
    /// `verify` found something.
    #[error("{path}: {count} findings: the file is damaged; make it again (`run --force pages`) or restore it from a copy", path = .path.display())]
    Findings {
        /// The file.
        path: PathBuf,
        /// How many.
        count: usize,
    },
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Io { source, .. } => match source.kind() {
                io::ErrorKind::NotFound
                | io::ErrorKind::PermissionDenied
                | io::ErrorKind::IsADirectory
                | io::ErrorKind::NotADirectory => FaultKind::Input,
                _ => FaultKind::Failed,
            },
            Self::Interrupted(_) => FaultKind::Interrupted,
            Self::Bounds { .. } | Self::Unfinished { .. } | Self::NoPage { .. } => FaultKind::Input,
            Self::Photon { .. } | Self::Busy { .. } | Self::Encode(_) => FaultKind::Failed,
            Self::Header { source, .. } => match source {
                header::Error::NotOurs { .. } | header::Error::Version { .. } => FaultKind::Input,
                header::Error::Io(_) => FaultKind::Failed,
                header::Error::Damaged { .. } => FaultKind::Damaged,
            },
            Self::Damaged { .. } | Self::Findings { .. } => FaultKind::Damaged,
        }
    }

    pub(super) fn io<D: Into<String>>(
        path: &Path,
        doing: D,
    ) -> impl FnOnce(io::Error) -> Self + use<'_, D> {
        let doing = doing.into();
        move |source| Self::Io { path: path.to_owned(), doing, source }
    }
}

/// A sink can say it in two ways only; the place and the amount go into the message.
impl From<Error> for SinkError {
    fn from(error: Error) -> Self {
        match error {
            Error::Interrupted(stop) => Self::Interrupted(stop),
            Error::Io { ref source, .. } => {
                Self::Io(io::Error::new(source.kind(), error.to_string()))
            }
            other => Self::Io(io::Error::other(other.to_string())),
        }
    }
}
