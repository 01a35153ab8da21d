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

#[cfg(test)]
mod tests {
    use glintmap::base::Grid;
    use glintmap::picture::exr;
    use glintmap_formats::npy;

    use super::*;

    /// A run folder with one file of each kind; `nudged` in one number each.
    fn written(folder: &Path, nudged: bool, settings: &str) {
        let by = if nudged { 0.25 } else { 0.0 };
        let mut map = Grid::filled(4, 3, 1.5_f32);
        map[(2, 1)] += by;
        let same = Grid::filled(4, 3, 2.0_f32);
        let header = [("glintmap.settings".to_owned(), settings.to_owned())];
        exr::write(&folder.join("annual.exr"), &[("e", &map), ("radius", &same)], &header)
            .expect("writes");
        let dark = if nudged { 0 } else { 7 };
        npy::write(&folder.join("counts.npy"), &[2, 2], &[1, 2, dark, 4]).expect("writes");
        let write = |name: &str, text: String| fs::write(folder.join(name), text).expect("writes");
        write("manifest.json", format!("{{\"suns\": \"{settings}\"}}"));
        write("receivers.json", format!("{{\"peak\": {}}}", 10.0 + by));
        write("sensors.csv", format!("name,e\nwall,{}\n", 3.0 + by));
        write("report.html", format!("<p>settings {settings}</p>\n<p>{} h</p>\n", 3.0 + by));
        let raw = folder.join("raw.npy");
        let numbers: Vec<f32> = (0..8).map(|i| if i == 5 { 1.0 + by } else { 0.5 }).collect();
        npy::write(&raw, &[2, 2, 2], &numbers).expect("writes");
    }

    fn told(old: (bool, &str), new: (bool, &str), what: What) -> String {
        let folders =
            [tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder")];
        for (folder, (nudged, settings)) in folders.iter().zip([old, new]) {
            written(folder.path(), nudged, &settings.repeat(64));
        }
        let [old, new] = &folders;
        compare(old.path(), new.path(), what).expect("compares").to_string()
    }

    #[test]
    fn a_number_that_differs_is_told_by_file_channel_place_and_amount() {
        let all = told((false, "a"), (true, "a"), What::Values);
        for words in [
            "annual.exr\n    e: 1 of 12 pixels differ, by up to 0.2500 (row 1, column 2: 1.5 -> 1.75;",
            "counts.npy\n    values: 1 of 4 values differ, by up to 7.000 (row 1, column 0: 7 -> 0;",
            "; 1 became 0, 0 were 0",
            "raw.npy\n    values: 1 of 8 values differ, by up to 0.2500 (timestep 1, row 0, column 1: 1 -> 1.25;",
            "receivers.json\n    /peak: 10 -> 10.25",
            "sensors.csv\n    column e: 1 of 1 rows differ by up to 0.250000 (line 2: 3 -> 3.25)",
            "report.html\n    line 2: <p>3 h</p> -> <p>3.25 h</p>",
            "6 of 6 files differ",
        ] {
            assert!(all.contains(words), "{words} isn't in\n{all}");
        }
        assert!(!all.contains("radius"), "{all}");
    }

    #[test]
    fn hashes_of_settings_are_told_unless_values_are_asked_for() {
        let all = told((false, "a"), (false, "b"), What::Everything);
        for words in
            ["annual.exr\n    header, glintmap.settings", "manifest.json\n    /suns", "report.html"]
        {
            assert!(all.contains(words), "{words} isn't in\n{all}");
        }
        assert_eq!(told((false, "a"), (false, "b"), What::Values), "0 of 6 files differ");
        assert_eq!(told((true, "a"), (true, "a"), What::Everything), "0 of 7 files differ");
    }

    #[test]
    fn a_file_that_only_one_has_is_told() {
        let folders =
            [tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder")];
        let [old, new] = [folders[0].path(), folders[1].path()];
        fs::write(old.join("a.csv"), "x\n").expect("writes");
        fs::create_dir(new.join("log")).expect("makes");
        fs::write(new.join("log/run.jsonl"), "{}").expect("writes");
        let report = compare(old, new, What::Values).expect("compares");
        let expected = ("a.csv".to_owned(), format!("only in {}", old.display()));
        assert_eq!(report.findings, [expected]);
    }
}
