use crate::base::FaultKind;

/// Why a model can't be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside of what the model means.
    #[error("{model}: {field} must be from {low} to {high}, found {found}")]
    OutOfRange {
        /// The model's kind.
        model: &'static str,
        /// The number's name.
        field: &'static str,
        /// Smallest value allowed.
        low: f64,
        /// Largest value allowed.
        high: f64,
        /// What was given.
        found: f64,
    },
    /// A name that no preset has.
    #[error("no preset is named \"{found}\" (there are: {known})")]
    NoPreset {
        /// The name.
        found: String,
        /// All names.
        known: String,
    },
    /// Neither a file nor a preset.
    #[error("{found}: no such file, and no preset has this name (there are: {known})")]
    Unknown {
        /// What was named.
        found: String,
        /// All presets.
        known: String,
    },
    /// A mixture of too many or no parts, of mixtures, or of more than there is.
    #[error("mixture: expected {expected}, found {found}")]
    Mixture {
        /// What would do.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A file that can't be read.
    #[error("{path}: can't be read: {reason}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// A file that is no XML.
    #[error("{path}:{line}:{column}: not well-formed XML: {reason}")]
    Xml {
        /// The file.
        path: String,
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What the parser says.
        reason: String,
    },
    /// Something in a BSDF file isn't as it must be.
    #[error("{path}:{line}: {item}: expected {expected}, found {found}")]
    File {
        /// The file.
        path: String,
        /// Line, from 1.
        line: u32,
        /// Element, and what it belongs to.
        item: Box<str>,
        /// What would do.
        expected: Box<str>,
        /// What is there.
        found: String,
    },
    /// A block that scatters more light than comes in.
    #[error("{path}: {block} scatters up to {percent:.2} % of the light, more than came in")]
    TooMuch {
        /// The file.
        path: String,
        /// The block.
        block: &'static str,
        /// Its largest total, %.
        percent: f64,
    },
    /// More or less than one source where one is written.
    #[error("--write takes one FILE (or the files of one goniophotometer sample), found {found}")]
    OneToWrite {
        /// How many.
        found: usize,
    },
    /// A file without the reflection that was asked for.
    #[error(
        "{path}: holds no {wanted}; it has {found}. `side = \"front\"` (the default) is Radiance's front, WINDOW's `Reflection Back`; `side = \"back\"` is `Reflection Front`"
    )]
    NoReflection {
        /// The file.
        path: String,
        /// The block.
        wanted: String,
        /// All blocks.
        found: String,
    },
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::OutOfRange { .. }
            | Self::NoPreset { .. }
            | Self::Unknown { .. }
            | Self::Mixture { .. }
            | Self::Read { .. }
            | Self::Xml { .. }
            | Self::File { .. }
            | Self::TooMuch { .. }
            | Self::OneToWrite { .. }
            | Self::NoReflection { .. } => FaultKind::Input,
        }
    }
}
