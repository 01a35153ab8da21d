//! `glintmap glare`: the analysis of a volume from anywhere, without a project.
//!
//! A volume is a folder in Zarr or a plain `.npy`; the latter says nothing of time, so segments may
//! come from a file of numbers beside it.

use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use glintmap_formats::{npy, seal};
use serde_json::json;

use super::{Context, size};
use crate::base::{Grid, Provenance};
use crate::glare::{self, Analysis, Connectivity, Regular, Settings, Slices, YearMap};
use crate::picture::exr;
use crate::run::Watch;
use crate::volume::{Volume, read_segments, segments_from_numbers};

#[derive(Debug, clap::Subcommand)]
/// How long each pixel is dazzled, and by which glare events
pub(super) enum Command {
    /// Smooth a volume, compare it with a threshold, and write durations and glare events
    #[command(
        after_help = "Example: glintmap glare analyse series.npy --threshold 10 --segments days.npy --out glare-10"
    )]
    Analyse(Box<Analyse>),
}

#[derive(Debug, clap::Args)]
pub(super) struct Analyse {
    /// The volume: a folder in Zarr, or an .npy file (little-endian float32, C order,
    /// [timestep, row, column])
    volume: PathBuf,
    /// Glare is irradiance strictly above it, W/m2
    #[arg(long, value_name = "W", allow_negative_numbers = true)]
    threshold: f64,
    /// Standard deviations of the Gaussian along time, rows and columns; 0 leaves an axis alone
    #[arg(long, num_args = 3, value_names = ["T", "Y", "X"], default_values_t = [1.0, 1.0, 1.0], allow_negative_numbers = true)]
    sigma: Vec<f64>,
    /// Where the Gaussian ends, in standard deviations
    #[arg(long, default_value_t = 4.0, allow_negative_numbers = true)]
    truncate: f64,
    /// Neighbours of a voxel: by faces, also by edges, or also by corners
    #[arg(long, default_value = "6", value_parser = parse_connectivity, value_name = "6|18|26")]
    connectivity: Connectivity,
    /// One whole number for each timestep, a segment starts wherever it changes; or `none` for one
    /// segment [default: what the volume says]
    #[arg(long, value_name = "FILE.npy|none")]
    segments: Option<PathBuf>,
    /// The folder to write into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write the filtered volume as well
    #[arg(long)]
    keep_filtered: bool,
    /// Analyse NaN and infinities as they are
    #[arg(long)]
    allow_nonfinite: bool,
    /// How much memory to use at most
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = size::parse)]
    memory: u64,
}

fn parse_connectivity(text: &str) -> Result<Connectivity, String> {
    let neighbours = text.parse().ok().and_then(Connectivity::from_neighbours);
    neighbours.ok_or_else(|| format!("expected 6, 18 or 26, found `{text}`"))
}

pub(super) fn run(command: &Command, context: &Context) -> anyhow::Result<()> {
    match command {
        Command::Analyse(arguments) => analyse(arguments, context),
    }
}

fn analyse(arguments: &Analyse, context: &Context) -> anyhow::Result<()> {
    let volume = Volume::open(&arguments.volume)?;
    let shape @ [timesteps, ..] = volume.shape();
    let segments = segments(arguments, &volume)?;
    let settings = Settings {
        threshold: arguments.threshold,
        sigma: [arguments.sigma[0], arguments.sigma[1], arguments.sigma[2]],
        truncate: arguments.truncate,
        connectivity: arguments.connectivity,
        allow_nonfinite: arguments.allow_nonfinite,
        memory_bytes: arguments.memory,
        spill: arguments.out.clone(),
    };
    let grid = match volume.axis() {
        Some(axis) => Regular::of(&volume, axis, &segments)?,
        None => None,
    };
    let regular_axis = grid.as_ref().zip(volume.axis()).map(|(grid, axis)| grid.axis(axis));
    let axis = regular_axis.as_ref().or(volume.axis());
    let source: &dyn Slices = grid.as_ref().map_or(&volume, |grid| grid);
    let segments = grid.as_ref().map_or(segments, |grid| grid.segments().to_vec());
    let instants = source.shape()[0];
    let plan = glare::plan(source, &settings, arguments.keep_filtered)?;
    let out = &arguments.out;
    fs::create_dir_all(out).with_context(|| format!("{} can't be made", out.display()))?;

    let filtered_path = out.join("filtered.npy");
    let mut writer = match arguments.keep_filtered {
        true => Some(npy::Writer::<f32>::create(&filtered_path, &source.shape())?),
        false => None,
    };
    let mut keep = writer
        .as_mut()
        .map(|writer| move |_: usize, slice: &[f32]| writer.push(slice).map_err(io::Error::other));
    let filtered: Option<glare::Filtered<'_>> = match &mut keep {
        Some(keep) => Some(keep),
        None => None,
    };
    let progress = context.progress();
    let watch = Watch::start();
    let found = glare::analyse_planned(source, &segments, &settings, &plan, filtered, progress)?;
    let took = watch.read();
    let mut written = Vec::new();
    if let Some(writer) = writer {
        writer.finish().with_context(|| filtered_path.display().to_string())?;
        written.push("filtered.npy".to_owned());
    }
    write_maps(out, &found, &settings, &mut written)?;
    seal::write(&out.join("events.csv"), |to| glare::write_events(to, &found.events, axis))
        .with_context(|| format!("{} can't be written", out.join("events.csv").display()))?;
    written.push("events.csv".to_owned());
    write_year(out, &volume, &settings, context, &mut written)?;

    let most = |grid: &Grid<i32>| grid.data().iter().copied().max().unwrap_or(0);
    let document = json!({
        "shape": shape,
        "segments": segments.len(),
        "settings": {
            "threshold_w_m2": settings.threshold,
            "sigma": settings.sigma,
            "truncate": settings.truncate,
            "connectivity": settings.connectivity.neighbours(),
        },
        "events": found.events.len(),
        "glare_pixels": found.cumulative.data().iter().filter(|n| **n > 0).count(),
        "cumulative_max_timesteps": most(&found.cumulative),
        "sustained_max_timesteps": most(&found.sustained),
        "longest_run_max_timesteps": most(&found.longest_run),
        "nonfinite": found.nonfinite,
        "instants": instants,
        "took": took,
        "written": written,
    });
    let mut text = format!(
        "{} events in {timesteps} timesteps ({} segments); cumulative max {}, sustained max {}, \
         longest run max {} timesteps\n",
        found.events.len(),
        segments.len(),
        most(&found.cumulative),
        most(&found.sustained),
        most(&found.longest_run)
    );
    if grid.is_some() {
        text += &format!(
            "its steps differ in length: put onto {instants} instants at equal distances\n"
        );
    }
    if found.nonfinite > 0 {
        text += &format!("{} voxels of the volume are NaN or infinite\n", found.nonfinite);
    }
    text += &format!("{} written into {}", written.join(", "), out.display());
    context.print(&document, &text)
}

fn segments(arguments: &Analyse, volume: &Volume) -> anyhow::Result<Vec<Range<usize>>> {
    let timesteps = Slices::shape(volume)[0];
    Ok(match &arguments.segments {
        None => volume.segments(),
        Some(word) if word.as_os_str() == "none" => std::iter::once(0..timesteps).collect(),
        Some(path) => segments_from_numbers(&read_segments(path, timesteps)?),
    })
}

/// The maps of the volume as it is, without any filter, as `.npy` (float32) and `.exr`; nothing
/// where it has no calendar.
fn write_year(
    out: &Path,
    volume: &Volume,
    settings: &Settings,
    context: &Context,
    written: &mut Vec<String>,
) -> anyhow::Result<()> {
    let (Some(axis), Some(_)) = (volume.axis(), volume.tiles()) else { return Ok(()) };
    let [_, rows, columns] = volume.shape();
    let folder = out.join("unfiltered");
    fs::create_dir_all(&folder).with_context(|| format!("{} can't be made", folder.display()))?;
    let maps = YearMap::all(axis);
    let npy_path = |map: YearMap| folder.join(format!("{}.npy", map.name()));
    let create = |map: &YearMap| npy::Writer::<f32>::create(&npy_path(*map), &[rows, columns]);
    let mut writers = maps.iter().map(create).collect::<Result<Vec<_>, _>>()?;
    let mut push = |map: YearMap, band: &[f32]| {
        let at = maps.iter().position(|m| *m == map).unwrap_or(0);
        writers[at].push(band).map_err(io::Error::other)
    };
    glare::year(volume, settings.threshold, None, &mut push, context.progress())?;
    let attributes = [
        ("program".to_owned(), Provenance::PROGRAM.to_owned()),
        ("threshold_w_m2".to_owned(), settings.threshold.to_string()),
    ];
    for (writer, map) in writers.into_iter().zip(maps) {
        let (name, path) = (map.name(), npy_path(map));
        writer.finish().with_context(|| path.display().to_string())?;
        // One map in memory at a time.
        let grid = Grid::from_vec(columns, rows, npy::Reader::<f32>::open(&path)?.read_all()?);
        let file = format!("{name}.exr");
        exr::write(&folder.join(&file), &[(name.as_str(), &grid)], &attributes)?;
        written.extend([format!("unfiltered/{name}.npy"), format!("unfiltered/{file}")]);
    }
    Ok(())
}

/// Each map as `.npy` (int32) and as `.exr`, timestep counts.
fn write_maps(
    out: &Path,
    found: &Analysis,
    settings: &Settings,
    written: &mut Vec<String>,
) -> anyhow::Result<()> {
    let [t, y, x] = settings.sigma;
    let attributes = [
        ("program".to_owned(), Provenance::PROGRAM.to_owned()),
        ("threshold_w_m2".to_owned(), settings.threshold.to_string()),
        ("sigma".to_owned(), format!("{t} {y} {x}")),
        ("truncate".to_owned(), settings.truncate.to_string()),
        ("connectivity".to_owned(), settings.connectivity.neighbours().to_string()),
    ];
    let maps = [
        ("cumulative", "cumulative.timesteps", Some(&found.cumulative)),
        ("sustained", "sustained.timesteps", Some(&found.sustained)),
        ("longest_run", "longest_run.timesteps", Some(&found.longest_run)),
        ("days", "days.d", found.days.as_ref()),
        ("longest_day", "longest_day.timesteps", found.longest_day.as_ref()),
    ];
    for (name, channel, map) in maps {
        let Some(map) = map else { continue };
        let file = out.join(format!("{name}.npy"));
        npy::write(&file, &[map.rows(), map.columns()], map.data())
            .with_context(|| format!("{} can't be written", file.display()))?;
        // Counts stay below MAX_TIMESTEPS, 2^24: float32 holds them exactly.
        let grid = map.map(|count| *count as f32);
        exr::write(&out.join(format!("{name}.exr")), &[(channel, &grid)], &attributes)?;
        written.extend([format!("{name}.npy"), format!("{name}.exr")]);
    }
    Ok(())
}
