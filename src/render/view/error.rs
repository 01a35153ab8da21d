use crate::base::{FaultKind, Interrupted, SinkError};

/// Why a view can't be rendered.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A word of the view's options doesn't fit.
    #[error("view, column {column}: expected {expected}, found {found}")]
    ViewWord {
        /// Where the word begins in the options, from 1.
        column: usize,
        /// What would fit.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The options can be read, but together they make no view.
    #[error("view: {what}")]
    View {
        /// What doesn't hold and what to do.
        what: String,
    },
    /// A setting of the estimator makes no sense.
    #[error("{what}")]
    Settings {
        /// What was expected, what was found.
        what: String,
    },
    /// Sensors can't be understood.
    #[error("{what}")]
    Sensors {
        /// Which lines, what was expected, what was found.
        what: String,
    },
    /// The file of hits could not be read or written.
    #[error("the file of hits can't be used")]
    Hits(#[from] glintmap_formats::hits::Error),
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
            Self::ViewWord { .. } | Self::View { .. } => FaultKind::Input,
            Self::Settings { .. } | Self::Sensors { .. } => FaultKind::Input,
            Self::Hits(e) if e.is_damage() => FaultKind::Damaged,
            Self::Hits(_) | Self::Sink(_) => FaultKind::Failed,
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
