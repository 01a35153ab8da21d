//! For those who work on glintmap: what makes the fixtures.

mod case_study;

use std::path::PathBuf;

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
        Command::CaseStudy { dir } => case_study::write(&dir, &case_study::files()),
        Command::Tiny { dir } => case_study::write(&dir, &case_study::tiny_files()),
    }
}
