//! Radiance pictures: 8 bits of mantissa a channel with a common exponent (RGBE), run-length
//! encoded. Format: Ward, "Real Pixels", Graphics Gems II; Radiance's src/common/color.c and
//! resolu.h.

mod read;
mod rgbe;
mod write;

pub use read::{Header, decode, read};
pub use rgbe::{color_from_rgbe, rgbe_from_color};
pub use write::{encode, write};
