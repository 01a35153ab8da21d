//! `glintmap inspect`: what a file of our own holds, read only.
//!
//! The first line of each of our files names its format; what isn't ours is refused with what was
//! found.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Context, own_format};
use crate::pages::{Access, Error, OpenOptions, Share, Store};
use crate::render::HitMap;

/// Look into a file of glintmap's own, without touching it
///
/// Prints what the file says about itself, and figures about what is in it.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  glintmap inspect run/standard/photons.gmp\n  glintmap inspect run/standard/photons.gmp --per-timestep > photons.csv\n  glintmap inspect run/standard/photons.gmp --per-surface\n  glintmap inspect run/standard/photons.gmp --page 17 > page.csv\n  glintmap inspect run/standard/photons.gmp --ply photons.ply --sample 1000000"
)]
pub(super) struct Arguments {
    /// The file: photons.gmp, hits.gmh or series.zarr
    file: PathBuf,
    /// Of a photon store: print CSV `index,photons,flux_w` for all timesteps
    #[arg(long)]
    per_timestep: bool,
    /// Of a photon store: print CSV `surface,photons,flux_w` for all PV surfaces
    #[arg(long, conflicts_with = "per_timestep")]
    per_surface: bool,
    /// Of a photon store: print all photons of page N as CSV; the first page is 0
    #[arg(long, value_name = "N", conflicts_with_all = ["per_timestep", "per_surface"])]
    page: Option<u64>,
    /// Of a photon store: write a sample of the photons as binary PLY, for MeshLab or CloudCompare
    #[arg(long, value_name = "OUT", conflicts_with_all = ["per_timestep", "per_surface", "page"])]
    ply: Option<PathBuf>,
    /// Photons in the sample, evenly spaced
    #[arg(long, value_name = "N", default_value_t = 1_000_000, requires = "ply")]
    sample: u64,
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let path = &arguments.file;
    if path.is_dir() {
        return super::volume::look(path, true, context);
    }
    match own_format::format_name(path, &["photons", "hits"])? {
        "photons" => photons(path, arguments, context),
        _ => hits(path, context),
    }
}

fn photons(path: &Path, arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let store = Store::open(path, &OpenOptions { cache_bytes: 0, access: Access::Mapped })?;
    if arguments.per_timestep {
        return shares("index", |i| i.to_string(), &store.per_timestep()?, context);
    }
    if arguments.per_surface {
        let name = |i: usize| format!("\"{}\"", store.info().surfaces[i].replace('"', "\"\""));
        return shares("surface", name, &store.per_surface()?, context);
    }
    if let Some(number) = arguments.page {
        return page(&store, number, context);
    }
    if let Some(out) = &arguments.ply {
        let photons = store.write_ply(out, arguments.sample)?;
        let text = format!("{photons} of {} photons in {}\n", store.info().photons, out.display());
        let document = serde_json::json!({ "file": out, "photons": photons });
        return context.print(&document, &text);
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
    let raw = store.raw_photon_bytes() as f64;
    let ratio = if bytes == 0 { 1.0 } else { raw / per_photon };
    line("bytes a photon", format!("{per_photon:.2}, from {raw}: {ratio:.1} times smaller"));
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
    let fill = store.fill_histogram();
    text.push_str("\nfill of pages       pages\n");
    for (tenth, pages) in fill.iter().enumerate() {
        let _ = writeln!(text, "{:3} to {:3} %  {pages:12}", 10 * tenth, 10 * tenth + 10);
    }
    let document = serde_json::json!({
        "format": "photons",
        "info": info,
        "bytes_per_photon": per_photon,
        "compression": ratio,
        "levels": levels,
        "pages_by_tenths_of_fill": fill,
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

/// One line a timestep or surface.
fn shares(
    column: &str,
    name: impl Fn(usize) -> String,
    shares: &[Share],
    context: &Context,
) -> anyhow::Result<()> {
    if context.common.json {
        return context.print(&shares, "");
    }
    let mut out = BufWriter::new(std::io::stdout().lock());
    writeln!(out, "{column},photons,flux_w")?;
    for (index, share) in shares.iter().enumerate() {
        writeln!(out, "{},{},{}", name(index), share.photons, share.flux_w)?;
    }
    Ok(out.flush()?)
}

/// One line a photon.
fn page(store: &Store, number: u64, context: &Context) -> anyhow::Result<()> {
    let pages = store.info().pages;
    let number = usize::try_from(number).ok().filter(|&n| (n as u64) < pages);
    let Some(number) = number else {
        return Err(Error::NoPage { pages }.into());
    };
    if context.common.json {
        let mut photons = Vec::new();
        store.in_page(number, |index, p| {
            photons.push(serde_json::json!({
                "index": index, "position_m": p.position, "normal": p.normal,
                "direction": p.direction, "flux_w": p.flux_w, "timestep": p.timestep,
                "surface": p.surface,
            }));
        })?;
        return context.print(&photons, "");
    }
    let mut text = "index,x_m,y_m,z_m,nx,ny,nz,dx,dy,dz,flux_w,timestep,surface\n".to_owned();
    store.in_page(number, |index, p| {
        let ([x, y, z], n, d) = (p.position.to_array(), p.normal, p.direction);
        // Writing to a String doesn't fail.
        let _ = writeln!(
            text,
            "{index},{x},{y},{z},{},{},{},{},{},{},{},{},{}",
            n.x, n.y, n.z, d.x, d.y, d.z, p.flux_w, p.timestep, p.surface
        );
    })?;
    let mut out = BufWriter::new(std::io::stdout().lock());
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}
