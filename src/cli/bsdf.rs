use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::Context;
use crate::bsdf::{Account, Error, Fineness, PRESETS, Side, Source, Written};
use crate::picture::polar::{Curve, Polar, Radius};

/// What BSDF files, presets and goniophotometer data hold; plots of them; writes BSDF files
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example: two materials in one plot, and a file that Radiance reads
  glintmap bsdf standard satinated tile --plot coatings.svg --angles 30,60
  glintmap bsdf sample_*.txt --write sample.xml --resolution 7 --prune 80

FILE is a BSDF as WINDOW and Radiance write it (.xml), the name of a preset (--presets), or text of
a goniophotometer as pabopto2bsdf reads it: lines `theta phi value` under `#intheta`, `#inphi` and
`#format: theta phi BSDF`; all such files together are one sample.
`front` is Radiance's front side, WINDOW's `Reflection Back`; `back` is `Reflection Front`.")]
pub(super) struct Arguments {
    /// BSDF files, presets, goniophotometer data
    #[arg(required_unless_present = "presets", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Lists the presets and where their numbers come from
    #[arg(long)]
    presets: bool,
    /// Writes a polar plot of the reflection in the plane of incidence, all FILEs superimposed
    #[arg(long, value_name = "OUT.svg|OUT.png", requires = "files")]
    plot: Vec<PathBuf>,
    /// Incidence angles of the plot, degrees
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', default_values_t = [30.0, 60.0],
          value_parser = angle)]
    angles: Vec<f64>,
    /// Plots from zero instead of five decades
    #[arg(long)]
    linear: bool,
    /// Side to plot or to write: front or back
    #[arg(long, default_value = "front", value_parser = ["front", "back"])]
    side: String,
    /// Writes FILE as a tensor tree: rank 3 where isotropic, else 4
    #[arg(long, value_name = "OUT.xml", requires = "files")]
    write: Option<PathBuf>,
    /// Directions along each edge of the square, 2 to this power [default: 7, or 5 for rank 4]
    #[arg(long, value_name = "N", requires = "write")]
    resolution: Option<u32>,
    /// Share of the finest nodes that are merged, %
    #[arg(long, value_name = "P", default_value_t = 80.0, requires = "write")]
    prune: f64,
    /// Ends with exit code 2 where more light is scattered than comes in
    #[arg(long)]
    check: bool,
}

fn angle(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|a| (0.0..90.0).contains(a))
        .ok_or_else(|| "expected degrees from 0 to below 90".to_owned())
}

impl Arguments {
    fn plot(&self, sources: &[Source], side: Side, out: &Path) -> anyhow::Result<()> {
        let mut curves = Vec::new();
        for (colour, source) in sources.iter().enumerate() {
            for (dashes, &angle) in self.angles.iter().enumerate() {
                let steps = (-899..=899).map(|i| f64::from(i) * 0.1);
                let points = source.in_plane(side, angle, steps)?;
                let label = format!("{}, light at {angle}°", source.name());
                curves.push(Curve { label, dashes, colour, points });
            }
        }
        let polar = Polar {
            title: "Reflection in the plane of incidence".into(),
            quantity: "BRDF, 1/sr".into(),
            radius: if self.linear { Radius::Linear } else { Radius::Logarithmic },
            arrows: self.angles.iter().copied().enumerate().map(|(i, a)| (a, i)).collect(),
            curves,
        };
        let png = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        if png {
            polar.write_png(out)?;
        } else {
            glintmap_formats::seal::write_bytes(out, polar.svg().as_bytes())?;
        }
        Ok(())
    }

    fn write(&self, sources: &[Source], side: Side, out: &Path) -> anyhow::Result<Written> {
        let [source] = sources else {
            anyhow::bail!(Error::OneToWrite { found: sources.len() });
        };
        let resolution = self.resolution.unwrap_or(if source.is_isotropic(side)? { 7 } else { 5 });
        let written = source.write(side, Fineness { resolution, prune: self.prune })?;
        glintmap_formats::seal::write_bytes(out, written.text.as_bytes())?;
        Ok(written)
    }
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let side = if arguments.side == "back" { Side::Back } else { Side::Front };
    let mut text = String::new();
    // Writing into a String can't fail.
    if arguments.presets {
        for p in PRESETS {
            let _ = writeln!(text, "{:<16} {}\n{:17}{}", p.name, p.about, "", json!(p.model()));
            let _ = writeln!(text, "{:17}from: {}", "", p.source);
        }
    }
    let sources = Source::open(&arguments.files)?;
    let accounts: Vec<Account> = sources.iter().map(Account::of).collect();
    accounts.iter().for_each(|a| text.push_str(&a.text));
    for out in &arguments.plot {
        arguments.plot(&sources, side, out)?;
        let _ = writeln!(text, "wrote {}", out.display());
    }
    let mut document = json!({
        "files": accounts.iter().map(|a| &a.document).collect::<Vec<_>>(),
    });
    if arguments.presets {
        document["presets"] = PRESETS
            .iter()
            .map(|p| json!({ "name": p.name, "about": p.about, "source": p.source, "model": p.model() }))
            .collect();
    }
    if let Some(out) = &arguments.write {
        let written = arguments.write(&sources, side, out)?;
        let _ = write!(text, "wrote {}: {}", out.display(), written.told());
        document["written"] = json!(written);
    }
    context.print(&document, &text)?;
    if arguments.check
        && let Some((at, &(block, share))) =
            accounts.iter().enumerate().find_map(|(i, a)| a.violations.first().map(|v| (i, v)))
    {
        let path = sources[at].name();
        return Err(Error::TooMuch { path, block, percent: 100.0 * share }.into());
    }
    Ok(())
}
