//! `tools tidy`: the rules of the house, read off the source.
//!
//! - the table of rooms and wings in [`rooms`]: who may use whom, also through re-exports;
//! - no circles of files that import each other, but those that [`rooms`] lists by name;
//! - the home of each outside crate;
//! - the files of a run and their channels are named in one file;
//! - every format module has its page;
//! - files above 150 lines begin with an essay (`//!`);
//! - files above 500 lines, as a warning.

mod house;
mod imports;
mod rooms;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use house::House;
use rooms::{ARTIFACTS, CIRCLES, ENDINGS, HOMES};

/// Above so many lines a file begins with a word about its problem and its idea.
const SPEAKING: usize = 150;
/// Above so many lines a file may hold two.
const LONG: usize = 500;

/// What tidy found.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Findings {
    /// Rules that are broken.
    pub broken: Vec<String>,
    /// Worth a look.
    pub warnings: Vec<String>,
}

/// Prints what [`tidy`] finds; an error where a rule is broken.
pub fn report(root: &Path) -> Result<()> {
    let findings = tidy(root)?;
    for warning in &findings.warnings {
        println!("warning: {warning}");
    }
    for broken in &findings.broken {
        println!("broken: {broken}");
    }
    if !findings.broken.is_empty() {
        bail!("{} rules of the house are broken", findings.broken.len());
    }
    println!("tidy");
    Ok(())
}

/// Reads all sources below `root`.
pub fn tidy(root: &Path) -> Result<Findings> {
    let mut findings = Findings::default();
    let mut sources = BTreeMap::new();
    for top in ["src", "formats/src", "tools/src", "tests"] {
        collect(&root.join(top), &mut sources)?;
    }
    if sources.is_empty() {
        bail!("no sources below {}", root.display());
    }
    let sources: BTreeMap<String, String> = sources
        .into_iter()
        .map(|(path, text)| {
            let name =
                path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            (name, text)
        })
        .collect();
    for (name, text) in &sources {
        check_length(name, text, &mut findings);
        check_homes(name, text, &mut findings)?;
    }
    let house = House::read(
        sources.iter().filter_map(|(n, t)| Some((n.strip_prefix("src/")?, t.as_str()))),
    )
    .map_err(anyhow::Error::msg)?;
    findings.broken.extend(house.forbidden());
    check_circles(&house, CIRCLES, &mut findings);
    check_pages(root, &mut findings)?;
    Ok(findings)
}

fn collect(folder: &Path, into: &mut BTreeMap<PathBuf, String>) -> Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, into)?;
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = fs::read_to_string(&path)?;
            into.insert(path, text);
        }
    }
    Ok(())
}

fn check_length(name: &str, text: &str, findings: &mut Findings) {
    let lines = text.lines().count();
    if lines > LONG {
        findings
            .warnings
            .push(format!("{name}: {lines} lines; would a reader find two rooms in it?"));
    }
    let speaks = text.lines().take(3).any(|l| l.starts_with("//!") || l.starts_with("#![doc"));
    if lines > SPEAKING && !speaks {
        findings.warnings.push(format!(
            "{name}: {lines} lines that begin without `//!`: the problem, the idea, the source?"
        ));
    }
}

/// Outside crates and the files of a run are named at home only; `formats` names nothing of ours.
fn check_homes(name: &str, text: &str, findings: &mut Findings) -> Result<()> {
    if name.starts_with("tests/") {
        return Ok(());
    }
    let below = name.split_once("src/").map_or(name, |(_, below)| below);
    let source = imports::read(below, text).with_context(|| name.to_owned())?;
    check_artifacts(name, &source, findings);
    for named in source.named.iter().filter(|n| !n.ours) {
        let krate = named.path[0].as_str();
        let at = format!("{name}:{}", named.line);
        if name.starts_with("formats/") && krate == "glintmap" {
            findings.broken.push(format!("{at}: formats knows nothing of ours"));
        }
        let Some((_, homes)) = HOMES.iter().find(|(known, _)| *known == krate) else { continue };
        if !homes.iter().any(|h| name.starts_with(h)) {
            findings.broken.push(format!("{at}: the crate `{krate}` has its home in {homes:?}"));
        }
    }
    Ok(())
}

/// The names of files of a run stand in one file: what one room writes another one reads.
fn check_artifacts(name: &str, source: &imports::Source, findings: &mut Findings) {
    let Some(below) = name.strip_prefix("src/") else { return };
    let (rooms, home) = ARTIFACTS;
    let knows = rooms.iter().any(|room| below.split('/').next() == Some(room));
    if !knows || below.starts_with(home) || house::is_for_tests(below) {
        return;
    }
    for (text, line) in &source.strings {
        if ENDINGS.iter().any(|ending| text.ends_with(ending)) {
            findings.broken.push(format!(
                "{name}:{line}: \"{text}\" names a file of a run or a channel of one: that belongs \
                 into src/{home}"
            ));
        }
    }
}

/// Circles are refused unless they are listed; what is listed and is none any more goes.
fn check_circles(house: &House, listed: &[&[&str]], findings: &mut Findings) {
    let listed: Vec<BTreeSet<&str>> = listed.iter().map(|c| c.iter().copied().collect()).collect();
    let found = house.circles();
    for circle in &found {
        if !listed.iter().any(|known| circle.is_subset(known)) {
            findings.broken.push(format!(
                "these {} files import each other in a circle: {}",
                circle.len(),
                house.ties(circle).join(", ")
            ));
        }
    }
    for known in &listed {
        if !found.iter().any(|circle| circle == known) {
            findings.broken.push(format!(
                "tools/src/tidy/rooms.rs: {known:?} is listed as a circle and is none (any more): \
                 take it off the list"
            ));
        }
    }
}

/// Every page of a format is the documentation of a module.
fn check_pages(root: &Path, findings: &mut Findings) -> Result<()> {
    for entry in fs::read_dir(root.join("formats/src"))? {
        let path = entry?.path();
        let is_page = path.extension().is_some_and(|e| e == "md");
        let module = path.with_extension("rs");
        let text = if module.exists() {
            fs::read_to_string(&module)?
        } else {
            fs::read_to_string(path.with_extension("").join("mod.rs")).unwrap_or_default()
        };
        let page = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if is_page && !text.contains(&format!("include_str!(\"{page}\")")) {
            findings
                .broken
                .push(format!("formats/src/{page}: no module has it as its documentation"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strangers(name: &str, text: &str) -> usize {
        let mut findings = Findings::default();
        check_homes(name, text, &mut findings).expect("reads");
        findings.broken.len()
    }

    #[test]
    fn crates_away_from_home_are_found() {
        assert_eq!(strangers("src/render/x.rs", "use obvhs::cwbvh::CwBvh;\n"), 1);
        assert_eq!(strangers("src/render/x.rs", "fn f() -> obvhs::Bvh { obvhs::new() }\n"), 2);
        assert_eq!(strangers("formats/src/npy.rs", "use glintmap::base::Grid;\n"), 1);
        assert_eq!(strangers("formats/src/npy.rs", "fn f() { bincode::decode(); }\n"), 1);
        assert_eq!(strangers("src/site/bvh.rs", "use obvhs::cwbvh::CwBvh;\n"), 0);
        // A room of ours may have the crate's name.
        let ours = "use crate::picture::exr;\nfn f() { exr::write(); }\n";
        assert_eq!(strangers("src/run/x.rs", ours), 0);
        assert_eq!(strangers("src/run/x.rs", "fn f() { exr::write(); }\n"), 1);
    }

    #[test]
    fn files_of_a_run_are_named_in_one_place() {
        let file = "fn f() { open(\"events.csv\"); }\n";
        let channel = "fn f() { format!(\"{map}.h\"); }\n";
        assert_eq!(
            [strangers("src/run/x.rs", file), strangers("src/report/x.rs", channel)],
            [1, 1]
        );
        assert_eq!(strangers("src/project/artifacts.rs", file), 0);
        // Names that users give, and those inside of a format.
        assert_eq!(strangers("src/cli/x.rs", file) + strangers("src/volume/x.rs", file), 0);
        let told = "/// \"horizon.csv\"\n#[doc = \"a.csv\"]\nfn f() { say(\"threshold_w_m2\"); }\n";
        let test = format!("#[cfg(test)]\nmod tests {{ {file} }}\n");
        assert_eq!(strangers("src/run/x.rs", told) + strangers("src/run/x.rs", &test), 0);
    }

    #[test]
    fn long_files_say_what_they_are_about() {
        let warnings = |text: &str| {
            let mut findings = Findings::default();
            check_length("src/x.rs", text, &mut findings);
            findings.warnings.len()
        };
        let code = "fn f() {}\n".repeat(160);
        assert_eq!(warnings(&code), 1);
        assert_eq!(warnings(&format!("//! Why.\n{code}")), 0);
        assert_eq!(warnings(&"fn f() {}\n".repeat(600)), 2);
    }

    #[test]
    fn listed_circles_pass_and_leave_the_list_when_they_are_open() {
        let circle = House::read([
            ("base/a.rs", "use super::b::B;\npub struct A;"),
            ("base/b.rs", "use super::a::A;\npub struct B;"),
        ])
        .expect("reads");
        let broken = |listed: &[&[&str]]| {
            let mut findings = Findings::default();
            check_circles(&circle, listed, &mut findings);
            findings.broken.len()
        };
        assert_eq!(broken(&[]), 1);
        assert_eq!(broken(&[&["base/a.rs", "base/b.rs"]]), 0);
        assert_eq!(broken(&[&["base/a.rs", "base/b.rs"], &["base/c.rs", "base/d.rs"]]), 1);
    }

    #[test]
    fn this_house_is_tidy() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let findings = tidy(&root).expect("reads the sources");
        assert_eq!(findings.broken, Vec::<String>::new());
    }
}
