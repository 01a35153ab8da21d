use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Context, ours};
use crate::pages::{Access, OpenOptions, Store};
use crate::render::HitMap;

/// Look into a file of glintmap's own, without touching it
///
/// Prints what the file says about itself, and figures about what is in it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  glintmap inspect run/standard/photons.gmp --per-timestep > photons.csv"
)]
pub(super) struct Arguments {
    /// The file: photons.gmp, hits.gmh or series.zarr
    file: PathBuf,
    /// Of a photon store: print CSV `index,photons,flux_w` for all timesteps
    #[arg(long)]
    per_timestep: bool,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let path = &arguments.file;
    if path.is_dir() {
        return super::volume::look(path, true, context);
    }
    match ours::format_name(path, &["photons", "hits"])? {
        "photons" => photons(path, arguments.per_timestep, context),
        _ => hits(path, context),
    }
}

fn photons(path: &Path, per_timestep: bool, context: &Context) -> anyhow::Result<()> {
    let store = Store::open(path, &OpenOptions { cache_bytes: 0, access: Access::Mapped })?;
    if per_timestep {
        return print_timesteps(&store, context);
    }
    let info = store.info();
    let levels = store.levels();
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a String doesn't fail.
        let _ = writeln!(text, "{name:<20} {value}");
    };
    line("photons", info.photons.to_string());
    line("flux", format!("{:.6} W ({:?})", info.flux_w, info.basis).to_lowercase());
    line("flux of a photon", format!("{} to {} W", info.flux_min_w, info.flux_max_w));
    line("effective photons", format!("{:.0}", info.effective_photons));
    line("timesteps", info.timesteps.to_string());
    line("PV surfaces", info.surfaces.join(", "));
    line("bounds", format!("{} to {} m", info.bounds.min, info.bounds.max));
    line("pages", info.pages.to_string());
    let bytes: u64 = levels.iter().map(|l| l.bytes).sum();
    let per_photon = bytes as f64 / info.photons.max(1) as f64;
    line("bytes a photon", format!("{per_photon:.2}, from {}", store.raw_photon_bytes()));
    line("area of a photon", format!("{:.6} m2", info.area_m2_per_photon));
    line("search radius", format!("{} m for 400 photons", store.max_radius_m(400)));
    line("sent", format!("{} photons, {:.3} W", info.tally.sent.photons, info.tally.sent.flux_w));
    line("made by", info.provenance.program.clone());
    line("settings", info.provenance.settings.clone());
    line("seed", info.provenance.seed.to_string());
    for (name, hash) in &info.provenance.inputs {
        line("input", format!("{name} {hash}"));
    }
    for (name, words) in &info.provenance.about {
        line(name, words.clone());
    }
    text.push_str("\nlevel  inner  leaves   pages     photons       bytes  fill\n");
    for l in levels.iter().filter(|l| l.inner_nodes + l.leaves > 0) {
        let _ = writeln!(
            text,
            "{:5} {:6} {:7} {:7} {:11} {:11} {:4.0} %",
            l.level,
            l.inner_nodes,
            l.leaves,
            l.pages,
            l.photons,
            l.bytes,
            100.0 * l.fill
        );
    }
    let document = serde_json::json!({
        "format": "photons",
        "info": info,
        "bytes_per_photon": per_photon,
        "levels": levels,
    });
    context.print(&document, &text)
}

fn hits(path: &Path, context: &Context) -> anyhow::Result<()> {
    let (map, facts) = HitMap::read(path)?;
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for hit in &map.hits {
        *counts.entry(hit.kind.name()).or_default() += 1;
    }
    let mut text = format!("hits of {} x {} pixels\n", map.columns, map.rows);
    for (kind, count) in &counts {
        let share = 100.0 * *count as f64 / map.hits.len().max(1) as f64;
        // Writing to a String doesn't fail.
        let _ = writeln!(text, "{kind:<12} {count:>10}  {share:.1} %");
    }
    let document = serde_json::json!({ "format": "hits", "facts": facts, "pixels": counts });
    context.print(&document, &text)
}

fn print_timesteps(store: &Store, context: &Context) -> anyhow::Result<()> {
    let steps = store.per_timestep()?;
    if context.common.json {
        return context.print(&steps, "");
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    writeln!(out, "index,photons,flux_w")?;
    for (index, step) in steps.iter().enumerate() {
        writeln!(out, "{index},{},{}", step.photons, step.flux_w)?;
    }
    Ok(out.flush()?)
}
