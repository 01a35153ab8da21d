//! For those who work on glintmap: the rules of the house, and what makes the fixtures.

mod case_study;
mod tidy;

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};

/// Tools for those who work on glintmap
#[derive(Debug, Parser)]
#[command(name = "glintmap-tools")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Hold the sources against the rules of the house
    Tidy,
    /// Write the built-in case study: scene and project
    CaseStudy {
        /// Folder, created if missing
        dir: PathBuf,
    },
    /// Write the tiny project whose output hashes are a fixture
    Tiny {
        /// Folder, created if missing
        dir: PathBuf,
    },
}

fn main() -> anyhow::Result<()> {
    match Cli::parse().command {
        Command::Tidy => tidy::report(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..")),
        Command::CaseStudy { dir } => case_study::write(&dir, &case_study::files()),
        Command::Tiny { dir } => case_study::write(&dir, &case_study::tiny_files()),
    }
}
