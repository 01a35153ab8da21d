//! From the text of a project file to its tables. All that is wrong with the text itself is found at
//! once: where a value can't be read, it is told and taken out, and the rest is read without it. So
//! a mistyped word doesn't hide the next one, nor the mistakes that the [`Reader`] finds.
//!
//! [`Reader`]: super::reader::Reader

use std::path::Path;
use std::{fs, io};

use serde::Deserialize;
use toml::de::{DeTable, Deserializer};

use super::error::Error;
use super::places::{Key, Mistake, Mistakes, Places, Struck, place_at, strike};
use super::set::{Assignment, apply};
use super::tables::Project;
use crate::base::limits::MAX_FINDINGS_SHOWN;

/// A project file as it was read.
pub(super) struct Read {
    pub places: Places,
    pub project: Project,
    /// What is wrong with the text.
    pub mistakes: Vec<Mistake>,
    /// Its keys: the tables are without them, or have stand-ins.
    pub struck: Vec<Key>,
}

/// Reads a project. `path` is its folder or its `project.toml`; `set` overrides single keys.
///
/// # Errors
/// A missing file, text that isn't TOML, tables that can't be read even without what is wrong in
/// them.
pub(super) fn read(path: &Path, set: &[Assignment]) -> Result<Read, Error> {
    let file = if path.is_dir() { path.join("project.toml") } else { path.to_owned() };
    let text = fs::read_to_string(&file).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => Error::NoProject { path: file.clone() },
        _ => Error::Read { path: file.clone(), source },
    })?;
    refuse_what_is_no_toml(&file, &text)?;
    let (changed, assigned) = apply(&file, &text, set)?;
    let places = Places { file, text, changed, assigned };
    let (mut tree, _) = DeTable::parse_recoverable(&places.changed);
    let mut mistakes: Vec<Mistake> = Vec::new();
    let mut struck: Vec<Key> = Vec::new();
    let mut whole = true;
    loop {
        let error = match Project::deserialize(Deserializer::from(tree.clone())) {
            Ok(project) if whole => return Ok(Read { places, project, mistakes, struck }),
            Ok(_) => break,
            Err(error) => error,
        };
        let span = error.span().unwrap_or_default();
        let key = places.key_at(&span);
        match missing(error.message()) {
            // A table without what it needs: all of it goes.
            Some(name) if struck.contains(&key.key(name)) => {}
            Some(name) => {
                mistakes.push(places.mistake_at(&span, &key, &format!("`{name}` is missing")));
            }
            None => mistakes.push(places.mistake_at(&span, &key, &words(error.message()))),
        }
        // What has to be there is stood in for, once.
        let stand_in = stand_in(error.message()).filter(|_| !struck.contains(&key));
        struck.push(key);
        // Others may name what stood in a list: what they say is not to be trusted any more.
        match strike(tree.get_mut(), &span, stand_in) {
            Some(Struck::Value) if mistakes.len() < MAX_FINDINGS_SHOWN => {}
            Some(Struck::Element) if mistakes.len() < MAX_FINDINGS_SHOWN => whole = false,
            _ => break,
        }
    }
    Err(Mistakes { path: places.file, list: mistakes }.into())
}

/// What TOML itself doesn't allow: all of it, with its places.
fn refuse_what_is_no_toml(file: &Path, text: &str) -> Result<(), Error> {
    let (_, errors) = DeTable::parse_recoverable(text);
    if errors.is_empty() {
        return Ok(());
    }
    let mistake = |e: &toml::de::Error| {
        let place = place_at(text, e.span().map_or(0, |span| span.start));
        Mistake { place: Some(place), message: e.message().to_owned() }
    };
    Err(Mistakes { path: file.to_owned(), list: errors.iter().map(mistake).collect() }.into())
}

/// A value of the type that serde expects.
fn stand_in(message: &str) -> Option<&'static str> {
    match message.strip_prefix("invalid type: ")?.rsplit_once(", expected ")?.1 {
        "f64" | "f32" => Some("1.0"),
        "usize" | "u32" | "u64" | "i32" => Some("1"),
        "a string" => Some("\"x\""),
        _ => None,
    }
}

/// The key that serde misses.
fn missing(message: &str) -> Option<&str> {
    message.strip_prefix("missing field `")?.strip_suffix('`')
}

/// Serde's words for people. "unknown field `x`, expected one of `a`, `b`": they want the nearest
/// one first. "invalid type: string "x", expected f64": they don't write Rust.
fn words(message: &str) -> String {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if let (true, Some((found, known))) =
        (message.starts_with("unknown field"), names.split_first())
    {
        let nearest = known.iter().min_by_key(|k| strsim::damerau_levenshtein(found, k));
        return format!(
            "unknown key `{found}`; did you mean `{}`? (known: {})",
            nearest.unwrap_or(&""),
            known.join(", ")
        );
    }
    if let (true, Some((found, known))) =
        (message.starts_with("unknown variant"), names.split_first())
    {
        let known: Vec<String> = known.iter().map(|word| format!("\"{word}\"")).collect();
        let known = match known.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
            _ => known.concat(),
        };
        return format!("expected {known}, found \"{found}\"");
    }
    let parts = message.strip_prefix("invalid ").and_then(|rest| rest.split_once(": "));
    match parts.and_then(|(_, rest)| rest.split_once(", expected ")) {
        Some((found, expected)) => {
            let expected = match expected {
                "f64" | "f32" => "a number",
                "usize" | "u32" | "u64" => "a whole number from 0",
                "i32" => "a whole number",
                "a string" => "a text in quotes",
                "a boolean" => "true or false",
                other => other,
            };
            format!("expected {expected}, found {found}")
        }
        None => message.to_owned(),
    }
}
