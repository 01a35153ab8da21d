//! The one integration test binary: each module is a subject.
#![allow(clippy::needless_pass_by_value)]

mod cli;
mod faults;
mod oracle;
mod physics;
mod seams;
mod support;
