use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Context;
use super::run::{How, go};
use crate::project::{self, Quality};

/// Write the built-in case study into a folder and run it to the pictures; again, it resumes
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap demo church\n  glintmap demo church --quality standard"
)]
pub(super) struct Arguments {
    /// The folder; made if it isn't there
    dir: PathBuf,
    /// Stored photons per material: draft 200 thousand, standard 16 million, paper 250 million
    #[arg(long, default_value = "draft", value_parser = quality())]
    quality: Quality,
    #[command(flatten)]
    how: How,
}

fn quality() -> impl TypedValueParser<Value = Quality> {
    PossibleValuesParser::new(Quality::ALL.map(|(name, _)| name)).map(|name| {
        // The parser let only names of qualities through.
        Quality::ALL.into_iter().find(|(n, _)| *n == name).map_or(Quality::Draft, |(_, q)| q)
    })
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let demo = project::demo(&arguments.dir, arguments.quality)?;
    go(&demo.folder, &arguments.how, context)
}
