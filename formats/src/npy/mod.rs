//! NumPy's `.npy`, format versions 1 to 3
//! (<https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>): little-endian,
//! C-order arrays of plain numbers. What is written equals `numpy.save` byte for byte.

mod fault;
mod header;
mod read;
mod value;
mod write;

pub use fault::Error;
pub use header::{Header, MAGIC, shape_text};
pub use read::{Reader, read_integers};
pub use value::Value;
pub use write::{Writer, write};

/// Bytes that are read or written at a time.
const BLOCK_BYTES: usize = 1 << 18;
