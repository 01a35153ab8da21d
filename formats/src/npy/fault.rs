use std::io;

/// Why an array can't be read or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file system refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It isn't `.npy`, or a version that numpy doesn't have.
    #[error("expected an .npy file of version 1, 2 or 3, found {found}")]
    NotNpy {
        /// How the file begins.
        found: String,
    },
    /// The header doesn't follow the format.
    #[error("the .npy header is broken: {what}")]
    Header {
        /// What doesn't hold, and where.
        what: String,
    },
    /// Numbers of another kind.
    #[error(
        "expected numbers of type `{expected}`, found `{found}`: save it with .astype('{expected}')"
    )]
    Type {
        /// numpy's name of the expected type.
        expected: &'static str,
        /// What the header says.
        found: String,
    },
    /// Column-major order.
    #[error(
        "expected C order (fortran_order: False), found Fortran order: save np.ascontiguousarray(a)"
    )]
    FortranOrder,
    /// Another number of dimensions.
    #[error("expected an array of {expected} dimensions, found shape {found}")]
    Dimensions {
        /// What was asked for.
        expected: usize,
        /// The shape that the header claims, as numpy writes it.
        found: String,
    },
    /// The file is shorter or longer than its shape says.
    #[error("shape {shape} needs {expected} bytes of numbers, the file holds {found}")]
    Length {
        /// The shape that the header claims, as numpy writes it.
        shape: String,
        /// Bytes that follow from the shape, or "too many".
        expected: String,
        /// Bytes behind the header.
        found: u64,
    },
    /// Numbers outside the array were asked for, or more or fewer written than it has.
    #[error("numbers {first}..{end} of an array of {len}")]
    Range {
        /// First number.
        first: u64,
        /// Behind the last number.
        end: u64,
        /// Numbers in the array.
        len: u64,
    },
}

impl Error {
    pub(super) fn header(what: impl Into<String>) -> Self {
        Self::Header { what: what.into() }
    }
}
