use std::path::PathBuf;

use serde_json::json;

use super::Context;
use crate::picture::files;

/// Convert a picture or map between .hdr, .exr, .png, .npy and .tif
///
/// An EXR takes all channels; HDR, TIFF and NPY take colours (R, G, B) or one channel of values:
/// the only one, or the one that --channel names. A PNG holds 8-bit colours, tone mapped; values
/// get colours from `glintmap picture falsecolor`. Radiance pictures are divided by their
/// EXPOSURE.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: glintmap convert annual.exr annual.npy --channel annual.wh_m2")]
pub(super) struct Arguments {
    /// What to read
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// What to write; its ending decides the kind
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Only this channel
    #[arg(long, value_name = "NAME")]
    channel: Option<String>,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let (input, output) = (&arguments.input, &arguments.output);
    files::Kind::of(output)?;
    let channels = files::read(input)?;
    files::write(output, &channels, arguments.channel.as_deref(), input)?;
    let document = json!({
        "output": output,
        "columns": channels.columns(),
        "rows": channels.rows(),
        "channels": channels.list().iter().map(|(name, _)| name).collect::<Vec<_>>(),
    });
    let text = format!("{}: {} x {} pixels", output.display(), channels.columns(), channels.rows());
    context.print(&document, &text)
}
