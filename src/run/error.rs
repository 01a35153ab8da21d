use std::io;
use std::path::PathBuf;

use crate::base::{FaultKind, Interrupted};
use crate::{glare, pages, picture, render, site, sky, trace, volume};

/// Why a run could not go on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The project file has a mistake.
    #[error("{}{}: {message}", path.display(), at(*line, *column))]
    Project {
        /// The project file.
        path: PathBuf,
        /// From 1; 0 where it is about no single line.
        line: usize,
        /// From 1.
        column: usize,
        /// What was expected, what was found, what to do.
        message: String,
    },
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
    /// A full disk, foreseen.
    #[error("this run is expected to need {needed} on disk, {free} are free at {}; {remedy}", path.display())]
    Disk {
        /// The run folder.
        path: PathBuf,
        /// Expected bytes, in words.
        needed: String,
        /// Free bytes, in words.
        free: String,
        /// What would make room.
        remedy: String,
    },
    /// Something asked for isn't there yet.
    #[error("{what}; run `glintmap run {} --until {stage}` first", project.display())]
    NotMade {
        /// What is missing.
        what: String,
        /// The project's folder.
        project: PathBuf,
        /// The stage that makes it.
        stage: &'static str,
    },
    /// Shares of the photons are missing.
    #[error("{}: {what}; make them with `glintmap run PROJECT --until trace --shard I/N`, or remove the folder to trace everything here", path.display())]
    Shards {
        /// The folder of the shares.
        path: PathBuf,
        /// Which, and why.
        what: String,
    },
    /// A rule that the user named is exceeded.
    #[error("{0}")]
    Exceeded(String),
    /// Something outside what this version can do.
    #[error("{0}")]
    Unsupported(String),
    /// From the file system, without a path worth telling.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// From the room `site`.
    #[error(transparent)]
    Site(#[from] site::Error),
    /// From the room `site`, about a material.
    #[error("material `{name}`")]
    Material {
        /// The material's name.
        name: String,
        /// What is wrong.
        source: site::bsdf::Error,
    },
    /// From the room `trace`, about a material or case.
    #[error("photons of `{name}`")]
    Photons {
        /// The material's or case's name.
        name: String,
        /// What is wrong.
        source: trace::Error,
    },
    /// From the room `sky`.
    #[error(transparent)]
    Sky(#[from] sky::Error),
    /// From the room `trace`.
    #[error(transparent)]
    Trace(#[from] trace::Error),
    /// From the room `pages`.
    #[error(transparent)]
    Pages(#[from] pages::Error),
    /// From the room `render`.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// From the room `volume`.
    #[error(transparent)]
    Volume(#[from] volume::Error),
    /// From the room `glare`.
    #[error(transparent)]
    Glare(#[from] glare::Error),
    /// From the room `picture`.
    #[error(transparent)]
    Picture(#[from] picture::Error),
    /// From an `.npy` file.
    #[error(transparent)]
    Npy(#[from] glintmap_formats::npy::Error),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Project { .. } | Self::NoProject { .. } => FaultKind::Input,
            Self::InTheWay { .. } | Self::NotMade { .. } => FaultKind::Input,
            Self::Shards { .. } | Self::Unsupported(_) | Self::Material { .. } => FaultKind::Input,
            // What was named can't be read: another name, other rights, another kind of file.
            Self::Read { source, .. }
                if matches!(
                    source.kind(),
                    io::ErrorKind::NotFound
                        | io::ErrorKind::PermissionDenied
                        | io::ErrorKind::IsADirectory
                        | io::ErrorKind::NotADirectory
                        | io::ErrorKind::InvalidData
                ) =>
            {
                FaultKind::Input
            }
            // The name leads through a file, or to something that is not ours to write.
            Self::Write { source, .. }
                if matches!(
                    source.kind(),
                    io::ErrorKind::AlreadyExists
                        | io::ErrorKind::NotADirectory
                        | io::ErrorKind::IsADirectory
                        | io::ErrorKind::PermissionDenied
                        | io::ErrorKind::ReadOnlyFilesystem
                ) =>
            {
                FaultKind::Input
            }
            Self::Read { .. } | Self::Write { .. } | Self::Io(_) | Self::Npy(_) => {
                FaultKind::Failed
            }
            Self::Exceeded(_) => FaultKind::Exceeded,
            Self::Busy { .. } | Self::Disk { .. } => FaultKind::Failed,
            Self::Manifest { .. } => FaultKind::Damaged,
            Self::Interrupted(_) => FaultKind::Interrupted,
            Self::Site(e) => e.kind(),
            Self::Sky(e) => e.kind(),
            Self::Trace(e) | Self::Photons { source: e, .. } => e.kind(),
            Self::Pages(e) => e.kind(),
            Self::Render(e) => e.kind(),
            Self::Volume(e) => e.kind(),
            Self::Glare(e) => e.kind(),
            Self::Picture(e) => e.kind(),
        }
    }
}

fn at(line: usize, column: usize) -> String {
    if line == 0 { String::new() } else { format!(":{line}:{column}") }
}
