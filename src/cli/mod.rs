//! One file a command: each parses its arguments, wires rooms together and prints. No logic.

mod bar;
mod bsdf;
mod check;
mod clean;
mod context;
mod convert;
mod demo;
mod exit;
mod eyes;
mod glare;
mod inspect;
mod mirror;
mod new;
mod own_format;
mod picture;
mod plan;
mod probe;
mod report;
mod run;
mod size;
mod suns;
mod trace;
mod verify;
mod volume;

pub use context::Context;
pub use exit::{exit_code, tell};

use clap::{Parser, Subcommand};
use context::Common;

/// Where, when and for how long does a photovoltaic surface dazzle its neighbourhood?
#[derive(Debug, Parser)]
#[command(name = "glintmap", version, propagate_version = true, max_term_width = 100)]
pub struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

impl Cli {
    /// Whether results and errors are for programs.
    pub fn wants_json(&self) -> bool {
        self.common.json
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Arguments),
    New(new::Arguments),
    Run(run::Arguments),
    Plan(plan::Arguments),
    Check(check::Arguments),
    Probe(probe::Arguments),
    Mirror(mirror::Arguments),
    Eyes(eyes::Arguments),
    Suns(suns::Arguments),
    Trace(trace::Arguments),
    #[command(subcommand)]
    Glare(glare::Command),
    #[command(subcommand)]
    Volume(volume::Command),
    #[command(subcommand)]
    Picture(Box<picture::Command>),
    Convert(convert::Arguments),
    Bsdf(bsdf::Arguments),
    Inspect(inspect::Arguments),
    Verify(verify::Arguments),
    Clean(clean::Arguments),
    Report(report::Arguments),
}

/// Reads the command line; ends the process where it is wrong or asks for help.
pub fn parse() -> Cli {
    Cli::parse_from(picture::with_two_dashes(std::env::args_os()))
}

/// Runs the command; what it returns was not yet printed.
///
/// # Errors
/// Any room's error, with the context that the command adds. [`exit_code`] says what it means.
pub fn run(cli: Cli) -> anyhow::Result<()> {
    let context = Context::new(cli.common)?;
    match cli.command {
        Command::Demo(arguments) => demo::run(&arguments, &context),
        Command::New(arguments) => new::run(&arguments, &context),
        Command::Run(arguments) => run::run(&arguments, &context),
        Command::Plan(arguments) => plan::run(&arguments, &context),
        Command::Check(arguments) => check::run(&arguments, &context),
        Command::Probe(arguments) => probe::run(&arguments, &context),
        Command::Mirror(arguments) => mirror::run(&arguments, &context),
        Command::Eyes(arguments) => eyes::run(&arguments, &context),
        Command::Suns(arguments) => suns::run(&arguments, &context),
        Command::Trace(arguments) => trace::run(&arguments, &context),
        Command::Glare(command) => glare::run(&command, &context),
        Command::Volume(command) => volume::run(&command, &context),
        Command::Picture(command) => picture::run(&command, &context),
        Command::Convert(arguments) => convert::run(&arguments, &context),
        Command::Bsdf(arguments) => bsdf::run(&arguments, &context),
        Command::Inspect(arguments) => inspect::run(&arguments, &context),
        Command::Verify(arguments) => verify::run(&arguments, &context),
        Command::Clean(arguments) => clean::run(&arguments, &context),
        Command::Report(arguments) => report::run(&arguments, &context),
    }
}
