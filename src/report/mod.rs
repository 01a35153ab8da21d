//! The report for people who read no pixels: one HTML page beside the pictures it shows; charts of
//! the mirror rule; numbers in words.

mod document;
mod error;
pub mod mirror_charts;
pub mod words;

pub use document::{Document, Figure, Mark, Point, Section, Table, html};
pub use error::Error;
