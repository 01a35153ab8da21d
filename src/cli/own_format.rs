//! Which of our formats a file has: the word behind `glintmap` in its first line.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::base::FaultKind;

/// Why a file can't be looked into.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It can't be read.
    #[error("{path}: {source}", path = .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the file system said.
        source: io::Error,
    },
    /// It is none of ours.
    #[error(
        "{path}: expected a file whose first line is `glintmap {known} …`, found `{found}`",
        path = .path.display(),
        known = .known.join("|")
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// The names that the command knows.
        known: &'static [&'static str],
        /// How the file begins.
        found: String,
    },
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        FaultKind::Input
    }
}

/// The format's name, one of `known`.
pub(super) fn format_name(
    path: &Path,
    known: &'static [&'static str],
) -> Result<&'static str, Error> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(80).read_to_end(&mut start))
        .map_err(|source| Error::Read { path: path.to_owned(), source })?;
    let text = String::from_utf8_lossy(&start);
    let line = text.lines().next().unwrap_or("");
    let mut words = line.split(' ');
    let name = (words.next() == Some("glintmap")).then(|| words.next()).flatten();
    known.iter().find(|k| Some(**k) == name).copied().ok_or_else(|| Error::Other {
        path: path.to_owned(),
        known,
        found: line.chars().filter(|c| !c.is_control()).take(40).collect(),
    })
}
