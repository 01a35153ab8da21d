use crate::base::{FaultKind, Interrupted, SinkError};
use crate::pages;

/// Why photons can't be gathered.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The settings of the gather make no sense.
    #[error("{what}")]
    Settings {
        /// What was expected, what was found.
        what: String,
    },
    /// The photon store could not be read.
    #[error("the photon store can't be read")]
    Pages(#[from] pages::Error),
    /// The time series could not be written.
    #[error("the time series can't be written")]
    Sink(#[source] std::io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Settings { .. } => FaultKind::Input,
            Self::Pages(e) => e.kind(),
            Self::Sink(_) => FaultKind::Failed,
            Self::Interrupted(_) => FaultKind::Interrupted,
        }
    }
}

impl From<SinkError> for Error {
    fn from(error: SinkError) -> Self {
        match error {
            SinkError::Io(e) => Self::Sink(e),
            SinkError::Interrupted(e) => Self::Interrupted(e),
        }
    }
}
