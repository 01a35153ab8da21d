//! From the text of a project file to its tables; where a mistake is.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::error::Error;
use super::set::{Assignment, apply};
use super::tables::Project;

/// Reads a project. `path` is its folder or its `project.toml`; `set` overrides single keys.
///
/// # Errors
/// A missing file, text that isn't TOML, an unknown key (the nearest known one is named), a value
/// of the wrong kind: with line and column.
pub fn read(path: &Path, set: &[Assignment]) -> Result<(PathBuf, Project), Error> {
    let file = if path.is_dir() { path.join("project.toml") } else { path.to_owned() };
    let text = fs::read_to_string(&file).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => Error::NoProject { path: file.clone() },
        _ => Error::Read { path: file.clone(), source },
    })?;
    // The text as it stands first, so that line numbers in errors are those of the file.
    let mut project = parse(&file, &text)?;
    if !set.is_empty() {
        let changed = apply(&file, &text, set)?;
        // Lines of the changed text are nobody's lines.
        project = parse(&file, &changed).map_err(|error| match error {
            Error::Project { path, message, .. } => {
                let message = format!("with --set: {message}");
                Error::Project { path, line: 0, column: 0, message }
            }
            other => other,
        })?;
    }
    Ok((file, project))
}

fn parse(file: &Path, text: &str) -> Result<Project, Error> {
    toml::from_str(text).map_err(|e| {
        let (line, column) = e.span().map_or((0, 0), |span| place(text, span.start));
        Error::Project { path: file.to_owned(), line, column, message: with_nearest(e.message()) }
    })
}

fn place(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

/// Serde says "unknown field `x`, expected one of `a`, `b`"; a user wants the nearest one first.
fn with_nearest(message: &str) -> String {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if !message.starts_with("unknown ") {
        return message.to_owned();
    }
    let Some((found, known)) = names.split_first() else { return message.to_owned() };
    let nearest = known.iter().min_by_key(|k| strsim::damerau_levenshtein(found, k));
    match nearest {
        Some(nearest) => {
            format!(
                "unknown key `{found}`; did you mean `{nearest}`? (known: {})",
                known.join(", ")
            )
        }
        None => message.to_owned(),
    }
}
