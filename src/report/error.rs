use crate::base::FaultKind;
use crate::{glare, picture, project, receivers, volume};

/// Why a report can't be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// From the room `project`.
    #[error(transparent)]
    Project(#[from] project::Error),
    /// From the room `receivers`.
    #[error(transparent)]
    Receivers(#[from] receivers::Error),
    /// From the room `picture`.
    #[error(transparent)]
    Picture(#[from] picture::Error),
    /// From the room `glare`.
    #[error(transparent)]
    Glare(#[from] glare::Error),
    /// From the room `volume`.
    #[error(transparent)]
    Volume(#[from] volume::Error),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Project(e) => e.kind(),
            Self::Receivers(e) => e.kind(),
            Self::Picture(e) => e.kind(),
            Self::Glare(e) => e.kind(),
            Self::Volume(e) => e.kind(),
        }
    }
}
