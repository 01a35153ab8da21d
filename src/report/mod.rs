//! The report for people who read no pixels: one HTML page beside the pictures it shows. What the
//! rules say of each receiver; sentences, tables and charts; charts of the mirror rule.

mod document;
mod error;
pub mod hazard_chart;
pub mod judgements;
mod maps;
pub mod mirror_charts;
pub mod occurrence_charts;
mod receiver_sections;
mod sections;
mod sentences;
mod view_verdicts;
mod words;

pub use document::html;
pub use error::Error;
pub use judgements::{Judgement, judge};
pub use sections::document;
