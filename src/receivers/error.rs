use std::io;
use std::path::PathBuf;

use crate::base::{FaultKind, Interrupted};
use crate::{glare, pages, project, render, rules, site, sky, volume};

/// Why it can't be told what arrives at a receiver.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// From the room `project`.
    #[error(transparent)]
    Project(#[from] project::Error),
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
    /// From the room `sky`.
    #[error(transparent)]
    Sky(#[from] sky::Error),
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
    /// From the room `rules`.
    #[error(transparent)]
    Rules(#[from] rules::Error),
    /// From the room `glare`.
    #[error(transparent)]
    Glare(#[from] glare::Error),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::NotMade { .. } | Self::Unsupported(_) => FaultKind::Input,
            Self::Io(_) => FaultKind::Failed,
            Self::Interrupted(_) => FaultKind::Interrupted,
            Self::Project(e) => e.kind(),
            Self::Site(e) => e.kind(),
            Self::Sky(e) => e.kind(),
            Self::Pages(e) => e.kind(),
            Self::Render(e) => e.kind(),
            Self::Gather(e) => e.kind(),
            Self::Volume(e) => e.kind(),
            Self::Rules(e) => e.kind(),
            Self::Glare(e) => e.kind(),
        }
    }
}
