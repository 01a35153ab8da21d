use std::io;

/// Why a part of a Zarr store can't be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A `zarr.json` that isn't what this program reads.
    #[error("`{field}`: expected {expected}, found {found}")]
    Metadata {
        /// Where in the document, from its root.
        field: String,
        /// What this program reads.
        expected: String,
        /// What the document says.
        found: String,
    },
    /// Bytes that don't hold what they claim.
    #[error("damaged: {what}")]
    Damaged {
        /// What doesn't hold.
        what: String,
    },
    /// A ledger of another kind or version, or damaged.
    #[error(transparent)]
    Header(#[from] crate::header::Error),
}

impl Error {
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged { what: what.into() }
    }
}
