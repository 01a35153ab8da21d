use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context as _;
use glam::DVec3;

use super::shape::Model;

/// A file of a project.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Its name in the folder.
    pub name: &'static str,
    /// What it holds.
    pub text: String,
}

/// Writes files into a folder.
///
/// # Errors
/// Whatever the file system says.
pub fn write(dir: &Path, files: &[File]) -> anyhow::Result<()> {
    std::fs::create_dir_all(dir).with_context(|| format!("making {}", dir.display()))?;
    for file in files {
        let path = dir.join(file.name);
        std::fs::write(&path, &file.text).with_context(|| format!("writing {}", path.display()))?;
    }
    Ok(())
}

/// Parts of a metre that are written: coarser ones bend turned windows so far that Radiance calls
/// them not planar.
const PARTS: i64 = 1_000_000;

/// A point on the grid of what is written: what the checks compare.
pub(super) fn on_grid(p: DVec3) -> [i64; 3] {
    [p.x, p.y, p.z].map(|c| (c * PARTS as f64).round() as i64)
}

/// The scene as Radiance reads it. Every material is Lambertian with 25 %: the names only tell a
/// reader what is what. Modifiers that begin with `pv_` stay undefined; the project gives them
/// their materials.
pub(super) fn radiance(name: &'static str, about: &str, model: &Model) -> File {
    let mut modifiers: Vec<&str> =
        model.solids.iter().flat_map(|s| &s.faces).map(|f| f.modifier).collect();
    modifiers.sort_unstable();
    modifiers.dedup();
    let mut text = format!(
        "# {about}: {} polygons, metres, x east, y north, z up\n\
         # made by glintmap-tools case-study; edit tools/src/case_study, not this\n",
        model.polygons()
    );
    for modifier in modifiers.iter().filter(|m| !m.starts_with("pv_")) {
        let _ = write!(text, "\nvoid plastic {modifier}\n0\n0\n5 .25 .25 .25 0 0\n");
    }
    for solid in &model.solids {
        text.push('\n');
        for face in &solid.faces {
            let _ = write!(text, "{} polygon {}\n0\n0\n", face.modifier, solid.name);
            let _ = writeln!(text, "{}", 3 * face.points.len());
            for &point in &face.points {
                let [x, y, z] = on_grid(point).map(metres);
                let _ = writeln!(text, "{x} {y} {z}");
            }
        }
    }
    File { name, text }
}

/// A coordinate on the grid in metres, without float formatting.
fn metres(parts: i64) -> String {
    let sign = if parts < 0 { "-" } else { "" };
    let (whole, rest) = (parts.abs() / PARTS, parts.abs() % PARTS);
    let text = format!("{sign}{whole}.{rest:06}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
