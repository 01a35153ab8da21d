use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::Context;
use crate::picture::polar::{self, Curve};
use crate::site::bsdf::{ANGLES_DEG, BsdfFile, Error, Measured, Side, Spectrum, Table};

/// What BSDF files hold: basis, blocks, reflectance by angle, reciprocity; polar plots
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example: two coatings in one plot, at 30 and 75 degrees of incidence
  glintmap bsdf standard.xml satinated.xml --plot coatings.svg --angles 30,75

`front` is Radiance's front side, WINDOW's `Reflection Back`; `back` is `Reflection Front`.")]
pub(super) struct Arguments {
    /// BSDF files as WINDOW and Radiance write them
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Writes a polar plot of the reflection in the plane of incidence, all files superimposed
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
    /// Incidence angles of the plot, degrees
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', default_values_t = [30.0, 60.0, 75.0],
          value_parser = angle)]
    angles: Vec<f64>,
    /// Side to plot: front or back
    #[arg(long, default_value = "front", value_parser = ["front", "back"])]
    side: String,
    /// Ends with exit code 2 where a file holds more light than came in
    #[arg(long)]
    check: bool,
}

fn angle(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|a| (0.0..90.0).contains(a))
        .ok_or_else(|| "expected degrees from 0 to below 90".to_owned())
}

fn basis(measured: &Table) -> String {
    match measured {
        Table::Matrix(m) => {
            format!("{}, {} x {}", m.incident.name, m.incident.len(), m.outgoing.len())
        }
        Table::Tree(t) => {
            format!("tensor tree, rank {}, 2^{} cells, {} values", t.rank(), t.levels(), t.values())
        }
    }
}

fn reflection(file: &BsdfFile, side: Side, spectrum: Spectrum) -> Option<Measured> {
    file.reflection(side, Some(spectrum)).ok()
}

fn told(file: &BsdfFile, text: &mut String) -> Value {
    // Writing into a String can't fail.
    let _ = writeln!(text, "{}: {} ({})", file.path, file.name, file.manufacturer);
    let mut blocks = Vec::new();
    for block in &file.blocks {
        let (way, most) = (block.way.name(), block.most_scattered);
        let spectrum = block.spectrum;
        let _ = writeln!(
            text,
            "  {:<8} {way:<19} {}; at most {:.1} % scattered{}",
            format!("{spectrum:?}"),
            basis(&block.table),
            100.0 * most,
            if most > 1.0 + 1e-6 { " — MORE THAN CAME IN" } else { "" }
        );
        blocks.push(json!({
            "spectrum": spectrum,
            "way": block.way,
            "basis": basis(&block.table),
            "most_scattered": most,
        }));
    }
    let mut sides = Vec::new();
    for (side, word) in [(Side::Front, "front"), (Side::Back, "back")] {
        for spectrum in [Spectrum::Visible, Spectrum::Solar] {
            let Some(measured) = reflection(file, side, spectrum) else { continue };
            let totals = ANGLES_DEG.map(|a| measured.total_at(a));
            let reciprocity = measured.reciprocity();
            let list: Vec<String> = ANGLES_DEG
                .iter()
                .zip(&totals)
                .map(|(a, t)| format!("{:.1} % at {a}°", 100.0 * t[1]))
                .collect();
            let _ = writeln!(text, "  {word}, {spectrum:?}: reflects {}", list.join(", "));
            let _ = writeln!(
                text,
                "    reciprocity error {:.1} % in the mean, {:.1} % at most",
                100.0 * reciprocity.mean,
                100.0 * reciprocity.most
            );
            let notes = measured.notes();
            for note in &notes {
                let _ = writeln!(text, "    note: {note}");
            }
            let rows: Vec<Value> = ANGLES_DEG
                .iter()
                .zip(&totals)
                .map(|(a, t)| {
                    let (cell_deg, share) = measured.cell_at(*a);
                    json!({ "angle_deg": a, "least": t[0], "mean": t[1], "most": t[2],
                            "cell_deg": cell_deg, "largest_share_in_one_cell": share })
                })
                .collect();
            sides.push(json!({
                "side": side, "spectrum": spectrum, "reflectance": rows,
                "reciprocity": reciprocity, "notes": notes,
            }));
        }
    }
    for note in &file.notes {
        let _ = writeln!(text, "  note: {note}");
    }
    json!({
        "file": file.path, "name": file.name, "manufacturer": file.manufacturer,
        "blocks": blocks, "reflection": sides, "notes": file.notes,
    })
}

/// `f` in the plane of incidence; light comes from the left.
fn curve(
    measured: &Measured,
    incidence_deg: f64,
    label: String,
    colour: usize,
    nth: usize,
) -> Curve {
    let direction = |deg: f64| {
        let a = deg.to_radians();
        glam::DVec3::new(libm::sin(a), 0.0, libm::cos(a))
    };
    let from = direction(-incidence_deg);
    let points = (-358..=358)
        .map(|i| {
            let angle = f64::from(i) * 0.25;
            (angle, measured.evaluate(from, direction(angle)))
        })
        .collect();
    let dashes = ["", "7 3", "2 3", "9 3 2 3"][nth % 4].to_owned();
    Curve { label, dashes, colour, points }
}

pub(super) fn run(arguments: &Arguments, context: &Context) -> anyhow::Result<()> {
    let files = arguments.files.iter().map(|p| BsdfFile::read(p)).collect::<Result<Vec<_>, _>>()?;
    let mut text = String::new();
    let document: Vec<Value> = files.iter().map(|f| told(f, &mut text)).collect();
    if let Some(out) = &arguments.plot {
        let side = if arguments.side == "back" { Side::Back } else { Side::Front };
        let mut curves = Vec::new();
        for (i, file) in files.iter().enumerate() {
            let measured = file.reflection(side, None)?;
            let name = arguments.files[i].file_name().unwrap_or_default().to_string_lossy();
            for (nth, &angle) in arguments.angles.iter().enumerate() {
                let label = format!("{name}, {} side, incidence {angle}°", arguments.side);
                curves.push(curve(&measured, angle, label, i, nth));
            }
        }
        let svg = polar::svg("Reflection in the plane of incidence", "1/sr", &curves);
        glintmap_formats::seal::write_bytes(out, svg.as_bytes())?;
        let _ = writeln!(text, "wrote {}", out.display());
    }
    context.print(&json!({ "files": document }), &text)?;
    if arguments.check
        && let Some((file, block)) = files
            .iter()
            .find_map(|f| f.blocks.iter().find(|b| b.most_scattered > 1.0 + 1e-6).map(|b| (f, b)))
    {
        return Err(Error::TooMuch {
            path: file.path.clone(),
            block: block.way.name(),
            percent: 100.0 * block.most_scattered,
        }
        .into());
    }
    Ok(())
}
