use std::io;
use std::path::PathBuf;

use crate::base::{FaultKind, Interrupted};
use crate::{glare, pages, picture, project, receivers, render, report, site, sky, trace, volume};

/// Why a run could not go on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// From the room `project`.
    #[error(transparent)]
    Project(#[from] project::Error),
    /// From the room `receivers`.
    #[error(transparent)]
    Receivers(#[from] receivers::Error),
    /// From the room `report`.
    #[error(transparent)]
    Report(#[from] report::Error),
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
    /// From the gather in the room `render`.
    #[error(transparent)]
    Gather(#[from] render::GatherError),
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
            Self::NotMade { .. } | Self::Shards { .. } | Self::Unsupported(_) => FaultKind::Input,
            Self::Read { source, .. } => FaultKind::of_reading(source),
            Self::Write { source, .. } => FaultKind::of_writing(source),
            Self::Io(_) | Self::Npy(_) | Self::Disk { .. } => FaultKind::Failed,
            Self::Exceeded(_) => FaultKind::Exceeded,
            Self::Manifest { .. } => FaultKind::Damaged,
            Self::Interrupted(_) => FaultKind::Interrupted,
            Self::Project(e) => e.kind(),
            Self::Receivers(e) => e.kind(),
            Self::Report(e) => e.kind(),
            Self::Site(e) => e.kind(),
            Self::Sky(e) => e.kind(),
            Self::Trace(e) | Self::Photons { source: e, .. } => e.kind(),
            Self::Pages(e) => e.kind(),
            Self::Render(e) => e.kind(),
            Self::Gather(e) => e.kind(),
            Self::Volume(e) => e.kind(),
            Self::Glare(e) => e.kind(),
            Self::Picture(e) => e.kind(),
        }
    }
}
