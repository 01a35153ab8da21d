//! Two folders, file by file.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glintmap::volume::Volume;

use super::contents::{Numbers, place};
use super::text;
use super::values::Difference;

/// What of the files is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// All of it.
    Everything,
    /// What was computed, without what headers and the manifest say of its making.
    Values,
}

/// What differs between two run folders.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Files in both; a time series counts as one.
    pub compared: usize,
    /// Names of files, and what differs there.
    pub findings: Vec<(String, String)>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut last = "";
        for (file, what) in &self.findings {
            if file != last {
                writeln!(f, "{file}")?;
            }
            writeln!(f, "    {what}")?;
            last = file;
        }
        let files: BTreeSet<&String> = self.findings.iter().map(|(file, _)| file).collect();
        write!(f, "{} of {} files differ", files.len(), self.compared)
    }
}

/// Compares two run folders; the log, which differs from run to run, is left out.
///
/// # Errors
/// When a folder can't be read, or a file isn't what its name says.
pub fn compare(old: &Path, new: &Path, what: What) -> Result<Report> {
    let (a, b) = (files(old)?, files(new)?);
    let mut report = Report::default();
    for name in a.union(&b) {
        // The manifest holds nothing but hashes.
        if what == What::Values && name == "manifest.json" {
            continue;
        }
        let found = match (a.contains(name), b.contains(name)) {
            (true, false) => vec![format!("only in {}", old.display())],
            (false, true) => vec![format!("only in {}", new.display())],
            _ => differences(&old.join(name), &new.join(name), what)?,
        };
        report.compared += 1;
        report.findings.extend(found.into_iter().map(|found| (name.clone(), found)));
    }
    Ok(report)
}

/// All files below a folder but the log; a time series is one.
fn files(folder: &Path) -> Result<BTreeSet<String>> {
    let mut out = BTreeSet::new();
    let mut waiting = vec![folder.to_owned()];
    while let Some(at) = waiting.pop() {
        let entries = fs::read_dir(&at).with_context(|| at.display().to_string())?;
        for entry in entries {
            let path = entry?.path();
            let name = path.strip_prefix(folder)?.to_string_lossy().replace('\\', "/");
            if path.is_dir() && !is_series(&path) {
                if name != "log" {
                    waiting.push(path);
                }
            } else {
                out.insert(name);
            }
        }
    }
    Ok(out)
}

fn is_series(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "zarr")
}

fn differences(old: &Path, new: &Path, what: What) -> Result<Vec<String>> {
    let same = |old: &Path, new: &Path| -> Result<bool> { Ok(fs::read(old)? == fs::read(new)?) };
    let mut out = Vec::new();
    if is_series(old) {
        let (a, b) = (files(old)?, files(new)?);
        let mut unlike = Vec::new();
        for name in a.union(&b) {
            let both = a.contains(name) && b.contains(name);
            if !both || !same(&old.join(name), &new.join(name))? {
                unlike.push(name);
            }
        }
        if unlike.is_empty() {
            return Ok(out);
        }
        out.extend(series(old, new)?);
        if what == What::Everything {
            for name in unlike.iter().filter(|name| name.ends_with(".json")) {
                let read = |folder: &Path| fs::read_to_string(folder.join(name));
                let said = text::json(&read(old)?, &read(new)?).unwrap_or_default();
                out.extend(said.into_iter().map(|said| format!("{name}: {said}")));
            }
        }
    } else if same(old, new)? {
        return Ok(out);
    } else if let (Some(a), Some(b)) = (Numbers::read(old)?, Numbers::read(new)?) {
        out.extend(a.differences(&b));
        if what == What::Everything {
            out.extend(header(&a.header, &b.header));
        }
    } else {
        let read = |path: &PathBuf| -> Result<Option<String>> {
            let text = String::from_utf8(fs::read(path)?).ok();
            let all = what == What::Everything;
            Ok(text.map(|text| if all { text } else { text::without_hashes(&text) }))
        };
        if let (Some(a), Some(b)) = (read(&old.to_owned())?, read(&new.to_owned())?) {
            let ending = old.extension().and_then(|e| e.to_str()).unwrap_or_default();
            let said = match ending {
                "json" | "geojson" => text::json(&a, &b),
                "csv" => text::table(&a, &b),
                _ => None,
            };
            out.extend(said.unwrap_or_else(|| text::lines(&a, &b)));
        } else {
            out.push("its bytes, of a kind that isn't read here".to_owned());
        }
    }
    if out.is_empty() && what == What::Everything {
        out.push("its bytes, though it holds the same".to_owned());
    }
    Ok(out)
}

/// What differs in what files say of their making.
fn header(old: &[(String, String)], new: &[(String, String)]) -> Vec<String> {
    let names: BTreeSet<&String> = old.iter().chain(new).map(|(name, _)| name).collect();
    let of = |all: &[(String, String)], name: &str| {
        let known = all.iter().find(|(n, _)| n == name);
        known.map(|(_, value)| value.clone()).unwrap_or_default()
    };
    let differ = names.into_iter().filter(|name| of(old, name) != of(new, name));
    differ
        .flat_map(|name| {
            let said = text::lines(&of(old, name), &of(new, name));
            said.into_iter().map(move |said| format!("header, {name}, {said}"))
        })
        .collect()
}

/// What differs in two time series, a few timesteps at a time.
fn series(old: &Path, new: &Path) -> Result<Vec<String>> {
    let (a, b) = (Volume::open(old)?, Volume::open(new)?);
    if a.shape() != b.shape() {
        return Ok(vec![format!("its shape: {:?} -> {:?}", a.shape(), b.shape())]);
    }
    let mut out = Vec::new();
    if a.axis() != b.axis() {
        out.push("its timesteps".to_owned());
    }
    let [timesteps, rows, columns] = a.shape();
    let mut difference = Difference::default();
    let mut slices = [Vec::new(), Vec::new()];
    for first in (0..timesteps).step_by(a.chunk_timesteps().max(1)) {
        let range = first..timesteps.min(first + a.chunk_timesteps().max(1));
        for (slice, volume) in slices.iter_mut().zip([&a, &b]) {
            slice.resize(range.len() * rows * columns, 0.0f32);
            volume.read(range.clone(), slice)?;
        }
        let [old, new] = &slices;
        old.iter().zip(new).for_each(|(old, new)| difference.push((*old).into(), (*new).into()));
    }
    let said = difference.words("values", |at| place(&a.shape(), at));
    out.extend(said.map(|said| format!("irradiance: {said}")));
    Ok(out)
}
