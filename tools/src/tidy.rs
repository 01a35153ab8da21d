//! `tools tidy`: the rules of the house, read off the source.
//!
//! - the import table: which room may `use` which;
//! - the home of each outside crate;
//! - every format module has its page;
//! - files above 500 lines, as a warning.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

/// A room and the rooms it may use.
const ROOMS: &[(&str, &[&str])] = &[
    ("base", &[]),
    ("site", &["base"]),
    ("sky", &["base"]),
    ("trace", &["base", "site", "sky"]),
    ("pages", &["base", "formats"]),
    ("render", &["base", "site", "sky", "pages", "formats"]),
    ("volume", &["base", "formats"]),
    ("glare", &["base", "volume"]),
    ("picture", &["base", "formats"]),
    ("report", &["base", "glare", "volume", "picture"]),
    (
        "run",
        &[
            "base", "formats", "site", "sky", "trace", "pages", "render", "volume", "glare",
            "picture", "report",
        ],
    ),
    (
        "cli",
        &[
            "base", "formats", "site", "sky", "trace", "pages", "render", "volume", "glare",
            "picture", "report", "run",
        ],
    ),
];

/// An outside crate and where it may be named.
const HOMES: &[(&str, &[&str])] = &[
    ("obvhs", &["src/site/bvh.rs"]),
    ("memmap2", &["src/pages/mapped.rs"]),
    ("exr", &["src/picture/exr.rs"]),
    ("clap", &["src/cli", "src/main.rs", "tools"]),
    ("bincode", &["formats/src/gmp"]),
];

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
    for (path, text) in &sources {
        let name = path.strip_prefix(root).unwrap_or(path).to_string_lossy().replace('\\', "/");
        check_file(&name, text, &mut findings);
    }
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

fn check_file(name: &str, text: &str, findings: &mut Findings) {
    let lines = text.lines().count();
    if lines > LONG {
        findings
            .warnings
            .push(format!("{name}: {lines} lines; would a reader find two rooms in it?"));
    }
    let room = name.strip_prefix("src/").and_then(|n| n.split_once('/')).map(|(room, _)| room);
    let allowed = room.and_then(|r| ROOMS.iter().find(|(n, _)| *n == r));
    if let (Some(room), None) = (room, allowed)
        && room != "docs"
    {
        findings.broken.push(format!("{name}: `{room}` is no room of the import table"));
    }
    for (number, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        let at = format!("{name}:{}", number + 1);
        if let Some((room, may)) = allowed {
            for (other, _) in ROOMS {
                let named = code.contains(&format!("crate::{other}::"))
                    || code.contains(&format!("crate::{other};"))
                    || code.contains(&format!("crate::{other} "));
                if named && other != room && !may.contains(other) {
                    findings.broken.push(format!("{at}: `{room}` may not use `{other}`"));
                }
            }
            if code.contains("use crate::{") {
                for other in grouped(text, number) {
                    let known = ROOMS.iter().any(|(n, _)| *n == other);
                    if known && other != *room && !may.contains(&other.as_str()) {
                        findings.broken.push(format!("{at}: `{room}` may not use `{other}`"));
                    }
                }
            }
            if code.contains("glintmap_formats") && !may.contains(&"formats") {
                findings.broken.push(format!("{at}: `{room}` may not use `formats`"));
            }
        }
        if name.starts_with("formats/") && code.contains("glintmap::") {
            findings.broken.push(format!("{at}: formats knows nothing of ours"));
        }
        if name.starts_with("tests/") || name == "tools/src/tidy.rs" {
            continue;
        }
        for (krate, homes) in HOMES {
            let named = [format!("{krate}::"), format!("use {krate};")].iter().any(|n| {
                code.match_indices(n.as_str()).any(|(i, _)| {
                    // A room of ours may have the crate's name: `picture::exr::write`.
                    let before = code[..i].chars().next_back();
                    !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
                }) && !text.contains(&format!("picture::{krate}"))
                    && !text.contains(&format!("mod {krate};"))
                    && !text.contains(&format!("{krate}, "))
                    && !text.contains(&format!(", {krate}"))
            });
            if named && !homes.iter().any(|h| name.starts_with(h)) {
                findings
                    .broken
                    .push(format!("{at}: the crate `{krate}` has its home in {homes:?}"));
            }
        }
    }
}

/// The first names of a `use crate::{a, b::C, …}` that begins at a line.
fn grouped(text: &str, line: usize) -> Vec<String> {
    let rest: String = text.lines().skip(line).collect::<Vec<_>>().join(" ");
    let Some((_, body)) = rest.split_once("crate::{") else { return Vec::new() };
    let mut depth = 0;
    let mut names = vec![String::new()];
    for c in body.chars() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(String::new()),
            _ => {
                if let Some(last) = names.last_mut() {
                    last.push(c);
                }
            }
        }
    }
    names.iter().filter_map(|n| n.trim().split("::").next().map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(name: &str, text: &str) -> usize {
        let mut findings = Findings::default();
        check_file(name, text, &mut findings);
        findings.broken.len()
    }

    #[test]
    fn what_the_table_forbids_is_found() {
        assert_eq!(broken("src/trace/path.rs", "use crate::pages::Store;\n"), 1);
        assert_eq!(broken("src/trace/path.rs", "use crate::{base::Photon, pages};\n"), 1);
        assert_eq!(
            broken("src/trace/path.rs", "use crate::{\n    base::Photon,\n    volume::V,\n};\n"),
            1
        );
        assert_eq!(broken("src/trace/path.rs", "use glintmap_formats::seal;\n"), 1);
        assert_eq!(broken("src/glare/x.rs", "fn f() { crate::render::hits(); }\n"), 1);
        assert_eq!(broken("src/kitchen/x.rs", "\n"), 1);
        assert_eq!(broken("src/render/x.rs", "use obvhs::cwbvh::CwBvh;\n"), 1);
        assert_eq!(broken("formats/src/npy.rs", "use glintmap::base::Grid;\n"), 1);
        assert_eq!(broken("formats/src/npy.rs", "let x = bincode::decode();\n"), 1);
    }

    #[test]
    fn what_the_table_allows_passes() {
        assert_eq!(broken("src/trace/path.rs", "use crate::{base::Photon, site::Site};\n"), 0);
        assert_eq!(broken("src/site/bvh.rs", "use obvhs::cwbvh::CwBvh;\n"), 0);
        assert_eq!(broken("src/run/x.rs", "use crate::picture::exr;\nexr::write();\n"), 0);
        assert_eq!(broken("src/trace/path.rs", "// crate::pages::Store keeps them\n"), 0);
    }

    #[test]
    fn this_house_is_tidy() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let findings = tidy(&root).expect("reads the sources");
        assert_eq!(findings.broken, Vec::<String>::new());
    }
}
