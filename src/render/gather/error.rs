use crate::base::{FaultKind, Interrupted, SinkError};
use crate::pages;
use crate::render::view::error::Error as ViewError;

/// Why photons can't be gathered.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// For a reason that has nothing to do with photons.
    #[error(transparent)]
    View(#[from] ViewError),
    /// The photon store could not be read.
    #[error("the photon store can't be read")]
    Pages(#[from] pages::Error),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::View(e) => e.kind(),
            Self::Pages(e) => e.kind(),
        }
    }

    pub(in crate::render) fn settings(what: String) -> Self {
        Self::View(ViewError::Settings { what })
    }
}

impl From<SinkError> for Error {
    fn from(error: SinkError) -> Self {
        Self::View(error.into())
    }
}

impl From<Interrupted> for Error {
    fn from(error: Interrupted) -> Self {
        Self::View(error.into())
    }
}
