//! `glintmap volume`: looks into a time series, exports and imports it.

mod pictures;

use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde_json::{Value, json};

use super::Context;
use crate::base::Irradiance;
use crate::volume::{self, Volume};

#[derive(Debug, clap::Subcommand)]
/// Look into a volume (a time series of pictures), or turn it into another file
pub(super) enum Command {
    /// Print a volume's shape, how full it is, its range and its time axis
    #[command(after_help = "Example: glintmap volume info run/standard/plan/series.zarr")]
    Info(Info),
    /// Write a volume, or some timesteps of it, as .npy or as pictures, or both
    #[command(
        group(clap::ArgGroup::new("what").required(true).multiple(true).args(["out", "pictures"])),
        after_help = "Examples:\n  glintmap volume export run/standard/plan/series.zarr --out series.npy\n  glintmap volume export run/standard/plan/series.zarr --pictures june --timesteps 100:163"
    )]
    Export(Export),
    /// Make a volume of an .npy file (little-endian float32, [timestep, row, column])
    #[command(
        after_help = "Example: glintmap volume import series.npy --segments days.npy --out series.zarr"
    )]
    Import(Import),
}

#[derive(Debug, clap::Args)]
pub(super) struct Info {
    /// The volume: a folder in Zarr, or an .npy file
    volume: PathBuf,
    /// Don't read the numbers: no range, no count of what isn't 0
    #[arg(long)]
    fast: bool,
}

#[derive(Debug, clap::Args)]
pub(super) struct Export {
    /// The volume: a folder in Zarr, or an .npy file
    volume: PathBuf,
    /// The .npy file to write
    #[arg(long, value_name = "FILE.npy")]
    out: Option<PathBuf>,
    /// A folder for pictures: t00000.exr with the numbers (W/m2), t00000.png in colours of one
    /// scale for the whole volume, one pair for each timestep
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Only these timesteps, the last included [default: all]
    #[arg(long, value_name = "FIRST:LAST", value_parser = parse_timesteps)]
    timesteps: Option<(usize, usize)>,
}

#[derive(Debug, clap::Args)]
pub(super) struct Import {
    /// The .npy file
    volume: PathBuf,
    /// The folder to write
    #[arg(long, value_name = "DIR.zarr")]
    out: PathBuf,
    /// One whole number for each timestep; a segment starts wherever it changes [default: one segment]
    #[arg(long, value_name = "FILE.npy")]
    segments: Option<PathBuf>,
    /// What the irradiance is measured on: the surface, or a plane that faces the beam
    #[arg(long, value_enum, default_value = "surface")]
    quantity: QuantityName,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum QuantityName {
    Surface,
    Normal,
}

impl From<QuantityName> for Irradiance {
    fn from(name: QuantityName) -> Self {
        match name {
            QuantityName::Surface => Self::Surface,
            QuantityName::Normal => Self::FacingBeam,
        }
    }
}

fn parse_timesteps(text: &str) -> Result<(usize, usize), String> {
    let expected = || format!("expected FIRST:LAST or one number, found `{text}`");
    let (first, last) = text.split_once(':').unwrap_or((text, text));
    let number = |word: &str| word.trim().parse::<usize>().map_err(|_| expected());
    let (first, last) = (number(first)?, number(last)?);
    if first > last || last == usize::MAX { Err(expected()) } else { Ok((first, last)) }
}

pub(super) fn run(command: &Command, context: &Context) -> anyhow::Result<()> {
    match command {
        Command::Info(arguments) => look(&arguments.volume, arguments.fast, context),
        Command::Export(arguments) => export(arguments, context),
        Command::Import(arguments) => import(arguments, context),
    }
}

/// Says what a volume holds; `fast`: without reading its numbers.
pub(super) fn look(path: &Path, fast: bool, context: &Context) -> anyhow::Result<()> {
    let volume = Volume::open(path)?;
    let [timesteps, rows, columns] = volume.shape();
    let segments = volume.segments();
    let quantity = volume.quantity();
    let mut text = format!("{timesteps} timesteps x {rows} rows x {columns} columns, W/m2");
    match quantity {
        Some(Irradiance::Surface) => text.push_str(" on the surface\n"),
        Some(Irradiance::FacingBeam) => text.push_str(" on a plane that faces the beam\n"),
        None => text.push('\n'),
    }
    let mut document = json!({
        "shape": [timesteps, rows, columns],
        "axes": ["timestep", "row", "column"],
        "units": "W m-2",
        "quantity": quantity,
        "chunk_timesteps": volume.chunk_timesteps(),
        "segments": segments.len(),
    });
    if let Some(summary) = volume.summary() {
        let part = 100.0 * summary.lit_chunks as f64 / summary.chunks as f64;
        writeln!(
            text,
            "{} of {} chunks of {} timesteps hold light ({part:.2} %), {} of {} tiles none",
            summary.lit_chunks,
            summary.chunks,
            volume.chunk_timesteps(),
            summary.empty_tiles,
            summary.tiles
        )?;
        let (stored, dense) = (size(summary.bytes), size(summary.dense_bytes));
        writeln!(text, "{stored} on disk, {dense} uncompressed and dense")?;
        document["summary"] = json!(summary);
    }
    if !fast {
        let survey = volume.survey(context.progress())?;
        let voxels = timesteps as f64 * (rows * columns) as f64;
        let part = 100.0 * survey.nonzero as f64 / voxels;
        writeln!(
            text,
            "{} to {} W/m2, {} numbers are not 0 ({part:.3} %), {} are not finite",
            survey.min_w_m2, survey.max_w_m2, survey.nonzero, survey.nonfinite
        )?;
        document["survey"] = json!(survey);
    }
    document["time"] = time(&volume, segments.len(), &mut text)?;
    context.print(&document, &text)
}

fn size(bytes: u64) -> indicatif::DecimalBytes {
    indicatif::DecimalBytes(bytes)
}

fn time(volume: &Volume, segments: usize, text: &mut String) -> anyhow::Result<Value> {
    let range = volume.axis().and_then(|axis| {
        let ends = |v: &[f64]| Some((*v.first()?, *v.last()?));
        Some((axis, axis.day.first()?, axis.day.last()?, ends(&axis.hour)?))
    });
    let Some((axis, first_day, last_day, (first_hour, last_hour))) = range else {
        writeln!(text, "{segments} segments; days and hours unknown")?;
        return Ok(Value::Null);
    };
    let weight_h: f64 = axis.weight_h.iter().sum();
    writeln!(
        text,
        "{}: day {first_day} {first_hour:.3} h to day {last_day} {last_hour:.3} h in steps of {} h, \
         {segments} segments, weights sum to {weight_h:.1} h{}",
        axis.year,
        axis.step_h,
        if axis.half_year { " (half a year stands for the year)" } else { "" }
    )?;
    Ok(json!({
        "year": axis.year,
        "first": {"day": first_day, "hour": first_hour},
        "last": {"day": last_day, "hour": last_hour},
        "step_h": axis.step_h,
        "half_year": axis.half_year,
        "weight_h": weight_h,
        "spectral_basis": axis.basis,
    }))
}

fn export(arguments: &Export, context: &Context) -> anyhow::Result<()> {
    let volume = Volume::open(&arguments.volume)?;
    let [timesteps, rows, columns] = volume.shape();
    let range: Range<usize> =
        arguments.timesteps.map_or(0..timesteps, |(first, last)| first..last + 1);
    if range.is_empty() || range.end > timesteps {
        return Err(volume::Error::Shape {
            what: "--timesteps",
            expected: format!("a part of 0:{}", timesteps.saturating_sub(1)),
            found: format!("{}:{}", range.start, range.end.saturating_sub(1)),
        }
        .into());
    }
    let progress = context.progress();
    let mut document = json!({ "shape": [range.len(), rows, columns] });
    let mut text = String::new();
    if let Some(out) = &arguments.out {
        volume::export_npy(&volume, range.clone(), out, progress)?;
        document["out"] = json!(out);
        writeln!(text, "{}: {} x {rows} x {columns}", out.display(), range.len())?;
    }
    if let Some(dir) = &arguments.pictures {
        let max = pictures::write(&volume, range.clone(), dir, progress)?;
        document["pictures"] = json!({ "dir": dir, "scale_max_w_m2": max });
        let (count, dir) = (range.len(), dir.display());
        writeln!(text, "{dir}: {count} timesteps of {columns} x {rows} pixels, up to {max} W/m2")?;
    }
    context.print(&document, &text)
}

fn import(arguments: &Import, context: &Context) -> anyhow::Result<()> {
    let volume = Volume::open(&arguments.volume)?;
    let timesteps = volume.shape()[0];
    let segments = arguments
        .segments
        .as_ref()
        .map(|path| volume::read_segments(path, timesteps).context("--segments"))
        .transpose()?;
    let quantity = arguments.quantity.into();
    let progress = context.progress();
    let summary =
        volume::import_npy(&volume, segments.as_deref(), quantity, &arguments.out, progress)?;
    let text = format!(
        "{}: {} numbers that are not 0 in {} ({} uncompressed and dense)",
        arguments.out.display(),
        summary.nonzero,
        size(summary.bytes),
        size(summary.dense_bytes)
    );
    context.print(&json!({"out": arguments.out, "summary": summary}), &text)
}
