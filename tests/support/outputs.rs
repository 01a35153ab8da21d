//! What any run leaves behind, whatever its project asks for: files that open and numbers that are
//! numbers.

use std::path::Path;

use glintmap::picture::{exr, png};
use glintmap::volume::Volume;
use glintmap_formats::npy;

use super::series::files;

/// Opens every file below `run/`.
///
/// # Panics
/// Where one doesn't open, holds a number that isn't finite, or an irradiance below 0.
pub fn assert_sane(run: &Path) {
    let all = files(run);
    assert!(!all.is_empty(), "{} is empty", run.display());
    for (name, bytes) in &all {
        let path = run.join(name);
        let shown = path.display();
        if name.starts_with("log") {
            continue;
        }
        match path.extension().and_then(|e| e.to_str()) {
            Some("exr") => {
                let channels = exr::read(&path).unwrap_or_else(|e| panic!("{shown}: {e}"));
                for (channel, grid) in channels.list() {
                    numbers(&format!("{shown}, {channel}"), grid.data());
                }
            }
            Some("npy") => match npy::Reader::<f32>::open(&path) {
                Ok(file) => numbers(&shown.to_string(), &file.read_all().expect("reads")),
                Err(_) => {
                    let file = npy::Reader::<i32>::open(&path);
                    let file = file.unwrap_or_else(|e| panic!("{shown}: {e}"));
                    let counts = file.read_all().expect("reads");
                    assert!(counts.iter().all(|n| *n >= 0), "{shown}: a count below 0");
                }
            },
            Some("png") => drop(png::read(&path).unwrap_or_else(|e| panic!("{shown}: {e}"))),
            Some("json" | "geojson") => {
                let text = serde_json::from_slice::<serde_json::Value>(bytes);
                text.unwrap_or_else(|e| panic!("{shown}: {e}"));
            }
            Some("csv") => words(&shown.to_string(), bytes, ','),
            Some("html") => words(&shown.to_string(), bytes, ' '),
            _ => {}
        }
        let folder = path.parent().expect("a folder");
        if name.ends_with("zarr.json") && folder.extension().is_some_and(|e| e == "zarr") {
            series(folder);
        }
    }
}

/// A volume, whole.
fn series(folder: &Path) {
    let shown = folder.display().to_string();
    let volume = Volume::open(folder).unwrap_or_else(|e| panic!("{shown}: {e}"));
    let [timesteps, rows, columns] = volume.shape();
    let mut all = vec![0.0; timesteps * rows * columns];
    volume.read(0..timesteps, &mut all).unwrap_or_else(|e| panic!("{shown}: {e}"));
    numbers(&shown, &all);
}

fn numbers(what: &str, all: &[f32]) {
    let wrong = all.iter().position(|v| !(v.is_finite() && *v >= 0.0));
    assert!(wrong.is_none(), "{what}: {} at {}", all[wrong.unwrap_or(0)], wrong.unwrap_or(0));
}

/// Tables and texts say nothing that isn't a number.
fn words(what: &str, bytes: &[u8], separator: char) {
    let text = std::str::from_utf8(bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
    for (number, line) in text.lines().enumerate() {
        let found =
            line.split(separator).map(str::trim).find(|w| matches!(*w, "NaN" | "inf" | "-inf"));
        assert!(found.is_none(), "{what}:{}: {line}", number + 1);
    }
}
