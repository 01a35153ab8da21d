//! The report for people who read no pixels: one HTML page beside the pictures it shows.

mod document;

pub use document::{Document, Figure, Mark, Point, Section, Table, html};
