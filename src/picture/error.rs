use std::io;
use std::path::{Path, PathBuf};

use crate::base::FaultKind;

/// Why a picture can't be read, made or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
        /// Whether it happened while writing.
        writing: bool,
    },
    /// The file is not what its name says, or damaged.
    #[error("{path}: {what}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where, what was expected, what was found.
        what: String,
    },
    /// The file is sound, but of a kind that is not read or written here.
    #[error("{path}: {what}", path = path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found, and the way out.
        what: String,
    },
    /// The picture claims to be larger than this program handles or than its file can hold.
    #[error("{path}: claims {columns} x {rows} pixels in {channels} channels; {limit}", path = path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Claimed width.
        columns: u64,
        /// Claimed height.
        rows: u64,
        /// Claimed number of channels.
        channels: u64,
        /// What is allowed.
        limit: String,
    },
    /// A channel is asked for that isn't there, or it isn't clear which one is meant.
    #[error("{path}: {what}; the channels are: {found}", path = path.display())]
    Channel {
        /// The file.
        path: PathBuf,
        /// What was asked.
        what: String,
        /// The channels that exist.
        found: String,
    },
    /// Two rasters that belong together differ in size.
    #[error(
        "{what} has {found_columns} x {found_rows} pixels, expected {columns} x {rows} as in {of}"
    )]
    Size {
        /// The raster that doesn't fit.
        what: String,
        /// Its width.
        found_columns: usize,
        /// Its height.
        found_rows: usize,
        /// The expected width.
        columns: usize,
        /// The expected height.
        rows: usize,
        /// Where the expectation comes from.
        of: String,
    },
    /// A name or number of a setting can't be used.
    #[error("{option} `{value}`: {what}")]
    Setting {
        /// The setting.
        option: &'static str,
        /// What was given.
        value: String,
        /// What is expected.
        what: String,
    },
}

impl Error {
    /// What kind of failure this is: writing fails the run, everything else is an input's fault.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Io { writing: true, .. } => FaultKind::Failed,
            _ => FaultKind::Input,
        }
    }

    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source, writing: false }
    }

    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), source, writing: true }
    }

    pub(super) fn malformed(path: &Path, what: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), what: what.into() }
    }

    pub(super) fn unsupported(path: &Path, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.to_owned(), what: what.into() }
    }
}
