use std::io;
use std::path::PathBuf;

use super::places::Mistakes;
use crate::base::{FaultKind, Interrupted};
use crate::{bsdf, glare, render, rules, site, sky};

/// Why a project can't be read, or its run folder can't be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The project file has mistakes: all of them.
    #[error("{0}")]
    Project(Mistakes),
    /// There is no project.
    #[error("{}: there is no such project; expected a folder with a project.toml, or that file (`glintmap new` and `glintmap demo` make one)", path.display())]
    NoProject {
        /// The project file that was looked for.
        path: PathBuf,
    },
    /// A file can't be read.
    #[error("can't read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file can't be written.
    #[error("can't write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// `run/manifest.json` is damaged.
    #[error("{} is damaged: {message}; remove it and the run makes everything again", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// There is something in the way that would be lost.
    #[error("{} is there already and would be overwritten; name an empty or a new folder", path.display())]
    InTheWay {
        /// The folder or file.
        path: PathBuf,
    },
    /// Another process works in the same run folder.
    #[error("{} is in use by another glintmap; wait for it or stop it", path.display())]
    Busy {
        /// The lock file.
        path: PathBuf,
    },
    /// Something outside what this version can do.
    #[error("{0}")]
    Unsupported(String),
    /// From the file system, without a path worth telling.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// From the room `bsdf`, about a material.
    #[error("material `{name}`")]
    Material {
        /// The material's name.
        name: String,
        /// What is wrong.
        source: bsdf::Error,
    },
    /// From the room `site`.
    #[error(transparent)]
    Site(#[from] site::Error),
    /// From the room `sky`.
    #[error(transparent)]
    Sky(#[from] sky::Error),
    /// From the room `render`.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// From the room `glare`.
    #[error(transparent)]
    Glare(#[from] glare::Error),
    /// From the room `rules`.
    #[error(transparent)]
    Rules(#[from] rules::Error),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Project(_)
            | Self::NoProject { .. }
            | Self::InTheWay { .. }
            | Self::Unsupported(_)
            | Self::Material { .. } => FaultKind::Input,
            Self::Read { source, .. } => FaultKind::of_reading(source),
            Self::Write { source, .. } => FaultKind::of_writing(source),
            Self::Io(_) | Self::Busy { .. } => FaultKind::Failed,
            Self::Manifest { .. } => FaultKind::Damaged,
            Self::Interrupted(_) => FaultKind::Interrupted,
            Self::Site(e) => e.kind(),
            Self::Sky(e) => e.kind(),
            Self::Render(e) => e.kind(),
            Self::Glare(e) => e.kind(),
            Self::Rules(e) => e.kind(),
        }
    }
}

impl From<Mistakes> for Error {
    fn from(mistakes: Mistakes) -> Self {
        Self::Project(mistakes)
    }
}
