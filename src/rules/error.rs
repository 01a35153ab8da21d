use crate::base::FaultKind;

/// Why a profile of rules can't be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A rule profile can't be understood.
    #[error("rule profile {name}: {message}")]
    Profile {
        /// The profile's file or id.
        name: String,
        /// What is wrong, with line and column where known.
        message: String,
    },
    /// No profile has this id.
    #[error("there is no rule profile {name:?}; known are {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The ids that exist.
        known: String,
    },
}

impl Error {
    /// What the error means for the process: the user named it or wrote it.
    pub fn kind(&self) -> FaultKind {
        FaultKind::Input
    }
}
