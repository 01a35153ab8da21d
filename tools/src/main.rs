//! For those who work on glintmap: the rules of the house, and what makes the fixtures.

mod case_study;
#[cfg(feature = "compare")]
mod compare;
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
    #[cfg(feature = "compare")]
    /// Say what differs between two run folders: which file, which channel, by how much
    Compare {
        /// The run folder as it was
        old: PathBuf,
        /// The run folder as it is
        new: PathBuf,
        /// Compare what was computed, not what headers and the manifest say of its making
        #[arg(long)]
        values: bool,
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
        #[cfg(feature = "compare")]
        Command::Compare { old, new, values } => {
            use std::io::Write;

            let what = if values { compare::What::Values } else { compare::What::Everything };
            let report = compare::compare(&old, &new, what)?;
            writeln!(std::io::stdout(), "{report}")?;
            anyhow::ensure!(report.findings.is_empty(), "the folders differ");
            Ok(())
        }
        Command::Tiny { dir } => case_study::write(&dir, &case_study::tiny_files()),
    }
}
