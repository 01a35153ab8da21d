//! What differs between two run folders: which file, which channel, how many pixels, by how much.
//!
//! A hash says that something changed; whoever has to judge the change must know what. So each
//! file is first compared byte by byte, and one that differs is read as what it is: pictures and
//! arrays channel by channel, the time series timestep by timestep, photons and hits field by
//! field, JSON value by value, tables column by column, other text line by line. Only what none
//! of this explains is reported as bytes.
//!
//! Headers say what a file was made from (hashes of settings and inputs), and change with every
//! rename of a setting. [`What::Values`] leaves them out: what remains is what was computed.
//!
//! The tests of the golden bytes include this module by its path, so that the tool and the tests
//! say the same, without a crate that both would have to be built with.

mod contents;
mod folders;
mod text;
mod values;

pub use folders::{What, compare};
