//! What a source of scattering holds, for people and for programs.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::survey::from_angle;
use super::{
    ANGLES_DEG, Block, Bsdf, BsdfFile, Goniophotometer, Interpolation, Lobe, Preset, Reciprocity,
    Side, Source, Spectrum, Table, on_hemisphere,
};

/// A source told: as text and as JSON.
#[derive(Clone, Debug, Default)]
pub struct Account {
    /// Lines for people.
    pub text: String,
    /// The same for programs.
    pub document: Value,
    /// Energy violations: block or side, and the share of light scattered.
    pub violations: Vec<(&'static str, f64)>,
}

/// Reflection at one angle of incidence.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// Incidence.
    pub angle_deg: f64,
    /// Share of the light that is reflected: least over the azimuths.
    pub least: f64,
    /// In the mean.
    pub mean: f64,
    /// At most.
    pub most: f64,
    /// In the plane of incidence.
    pub lobe: Lobe,
    /// Width of a file's cells about the mirror direction; nothing for models.
    pub cell_deg: Option<f64>,
    /// Largest share of the reflected light in one of them.
    pub largest_share_in_one_cell: Option<f64>,
}

/// More than this is no rounding.
const ALL: f64 = 1.0 + 1e-6;

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn table(text: &mut String, rows: &[Row], reciprocity: Reciprocity) {
    // Writing into a String can't fail.
    let _ = writeln!(text, "    incidence  reflects   lobe width  peak 1/sr  brightest cell");
    for r in rows {
        let cell = match (r.cell_deg, r.largest_share_in_one_cell) {
            (Some(deg), Some(share)) => format!("{deg:.1}° wide, {} of it", percent(share)),
            _ => "-".into(),
        };
        let peak = if r.lobe.peak_per_sr.is_finite() {
            format!("{:.3}", r.lobe.peak_per_sr)
        } else {
            "mirror".into()
        };
        let _ = writeln!(
            text,
            "    {:>7}°  {:>8}  {:>9.1}°  {:>10}  {cell}",
            r.angle_deg,
            percent(r.mean),
            r.lobe.width_deg,
            peak
        );
    }
    let _ = writeln!(
        text,
        "    reciprocity error {} in the mean, {} at most",
        percent(reciprocity.mean),
        percent(reciprocity.most)
    );
}

fn basis(table: &Table) -> String {
    match table {
        Table::Matrix(m) => {
            format!("{}, {} x {}", m.incident.name, m.incident.len(), m.outgoing.len())
        }
        Table::Tree(t) => {
            format!("tensor tree, rank {}, 2^{} cells, {} values", t.rank(), t.levels(), t.values())
        }
    }
}

impl Account {
    /// Tells a source.
    pub fn of(source: &Source) -> Self {
        match source {
            Source::File(file) => Self::of_file(file),
            Source::Preset(preset, bsdf) => Self::of_preset(preset, bsdf),
            Source::Points(data, surface) => Self::of_points(data, surface),
        }
    }

    fn of_file(file: &BsdfFile) -> Self {
        let mut out = Self::default();
        let text = &mut out.text;
        let _ = writeln!(text, "{}: {} ({})", file.path, file.name, file.manufacturer);
        let blocks: Vec<Value> = file.blocks.iter().map(|b| told(b, text)).collect();
        out.violations.extend(
            file.blocks
                .iter()
                .filter(|b| b.most_scattered > ALL)
                .map(|b| (b.way.name(), b.most_scattered)),
        );
        let mut sides = Vec::new();
        for (side, word) in [(Side::Front, "front"), (Side::Back, "back")] {
            for spectrum in [Spectrum::Visible, Spectrum::Solar] {
                let Ok(measured) = file.reflection(side, Some(spectrum)) else { continue };
                let _ = writeln!(text, "  {word}, {spectrum:?}");
                let notes = measured.notes();
                let bsdf = Bsdf::Measured(measured.clone());
                let rows = ANGLES_DEG.map(|angle_deg| {
                    let [least, mean, most] = measured.total_at(angle_deg);
                    let (cell_deg, share) = measured.cell_at(angle_deg);
                    let lobe = bsdf.lobe(angle_deg);
                    let (cell_deg, share) = (Some(cell_deg), Some(share));
                    Row {
                        angle_deg,
                        least,
                        mean,
                        most,
                        lobe,
                        cell_deg,
                        largest_share_in_one_cell: share,
                    }
                });
                let reciprocity = Reciprocity::of(|a, b| measured.evaluate(a, b));
                table(text, &rows, reciprocity);
                for note in &notes {
                    let _ = writeln!(text, "    note: {note}");
                }
                sides.push(json!({
                    "side": side, "spectrum": spectrum, "reflectance": rows,
                    "reciprocity": reciprocity, "notes": notes,
                }));
            }
        }
        for note in &file.notes {
            let _ = writeln!(text, "  note: {note}");
        }
        out.document = json!({
            "file": file.path, "name": file.name, "manufacturer": file.manufacturer,
            "blocks": blocks, "reflection": sides, "notes": file.notes,
        });
        out
    }

    fn of_preset(preset: &Preset, bsdf: &Bsdf) -> Self {
        let mut out = Self::default();
        let model = preset.model();
        let _ = writeln!(out.text, "preset {}: {}", preset.name, preset.about);
        let _ = writeln!(out.text, "  {}", json!(model));
        let _ = writeln!(out.text, "  from: {}", preset.source);
        let rows = ANGLES_DEG.map(|angle_deg| {
            let mean = bsdf.reflectance(from_angle(angle_deg, 0.0));
            let (cell_deg, largest_share_in_one_cell) = (None, None);
            let lobe = bsdf.lobe(angle_deg);
            Row {
                angle_deg,
                least: mean,
                mean,
                most: mean,
                lobe,
                cell_deg,
                largest_share_in_one_cell,
            }
        });
        let reciprocity = Reciprocity::of(|a, b| bsdf.evaluate(a, b));
        table(&mut out.text, &rows, reciprocity);
        out.document = json!({
            "preset": preset.name, "about": preset.about, "source": preset.source,
            "model": model, "reflectance": rows, "reciprocity": reciprocity,
        });
        out
    }

    fn of_points(data: &Goniophotometer, surface: &Interpolation) -> Self {
        let mut out = Self::default();
        let reach = surface.reach();
        let count: usize = data.incidents.iter().map(|i| i.points.len()).sum();
        let symmetry = if data.is_isotropic() { "isotropic" } else { "not isotropic" };
        let _ = writeln!(
            out.text,
            "{}: goniophotometer data, {} incident directions, {count} points, {symmetry}",
            data.name,
            data.incidents.len()
        );
        let _ = writeln!(
            out.text,
            "  measured from {}° to {}°: {} of light from all directions comes in beyond, where the last angle counts",
            reach.incidence_deg.0,
            reach.incidence_deg.1,
            percent(reach.beyond)
        );
        let mut rows = Vec::new();
        for (incident, &(angle_deg, unseen)) in data.incidents.iter().zip(&reach.unseen) {
            let reflects = hemispherical(surface, angle_deg, incident.phi_deg);
            let _ = writeln!(
                out.text,
                "    {angle_deg:>6.1}°, azimuth {:>5.1}°: {:>6} points, reflects {}, {} of it where no point is nearby",
                incident.phi_deg,
                incident.points.len(),
                percent(reflects),
                percent(unseen)
            );
            if reflects > 1.01 {
                out.violations.push(("the measured reflection", reflects));
            }
            rows.push(json!({
                "angle_deg": angle_deg, "azimuth_deg": incident.phi_deg,
                "points": incident.points.len(), "mean": reflects, "unseen": unseen,
            }));
        }
        for note in &data.notes {
            let _ = writeln!(out.text, "  note: {note}");
        }
        out.document = json!({
            "sample": data.name, "isotropic": data.is_isotropic(),
            "incidence_deg": reach.incidence_deg, "beyond": reach.beyond,
            "reflectance": rows, "notes": data.notes,
        });
        out
    }
}

/// Share of the light that the points reflect, by a midpoint rule.
fn hemispherical(surface: &Interpolation, angle_deg: f64, azimuth_deg: f64) -> f64 {
    const EDGE: u32 = 96;
    let from = from_angle(angle_deg, azimuth_deg.rem_euclid(360.0) / 360.0);
    let sum: f64 = (0..EDGE * EDGE)
        .map(|i| {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(EDGE);
            surface.value(from, on_hemisphere(at(i / EDGE), at(i % EDGE)))
        })
        .sum();
    sum * std::f64::consts::PI / f64::from(EDGE * EDGE)
}

fn told(block: &Block, text: &mut String) -> Value {
    let (way, most, spectrum) = (block.way.name(), block.most_scattered, block.spectrum);
    let _ = writeln!(
        text,
        "  {:<8} {way:<19} {}; at most {} scattered{}{}",
        format!("{spectrum:?}"),
        basis(&block.table),
        percent(most),
        if most > ALL { " — MORE THAN CAME IN" } else { "" },
        if block.reciprocal { ", by reciprocity" } else { "" },
    );
    json!({
        "spectrum": spectrum, "way": block.way, "basis": basis(&block.table),
        "most_scattered": most, "by_reciprocity": block.reciprocal,
    })
}
