//! `--set KEY=VALUE`: single keys changed without losing a file's comments.

use std::path::Path;
use std::str::FromStr;

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::error::Error;

/// One `KEY=VALUE`: a dotted key, tables of a list by their name, a TOML value.
#[derive(Clone, Debug)]
pub struct Assignment {
    key: Vec<String>,
    value: Value,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or_else(|| {
            format!("expected KEY=VALUE, found `{text}`; for example photons.stored=200000")
        })?;
        let value = value.trim().parse().map_err(|_| {
            format!("`{value}` is no TOML value; text needs quotes: {key}='\"{}\"'", value.trim())
        })?;
        let key: Vec<String> = key.trim().split('.').map(str::to_owned).collect();
        if key.iter().any(String::is_empty) {
            return Err(format!("`{text}` has an empty part in its key"));
        }
        Ok(Self { key, value })
    }
}

/// The project's text with the assignments made; comments and order stay.
///
/// # Errors
/// When the text isn't TOML, or a key names a table that isn't there.
pub fn apply(file: &Path, text: &str, set: &[Assignment]) -> Result<String, Error> {
    let fail =
        |message: String| Error::Project { path: file.to_owned(), line: 0, column: 0, message };
    let mut document: DocumentMut = text.parse().map_err(|e| fail(format!("{e}")))?;
    for assignment in set {
        let whole = assignment.key.join(".");
        let (last, path) = assignment.key.split_last().ok_or_else(|| fail("empty key".into()))?;
        let mut at: &mut dyn TableLike = document.as_table_mut();
        let mut parts = path.iter();
        while let Some(part) = parts.next() {
            let known = at.iter().map(|(k, _)| k.to_owned()).collect::<Vec<_>>().join(", ");
            let missing =
                || fail(format!("--set {whole}: there is no `{part}` (there are: {known})"));
            let item = at.get_mut(part).ok_or_else(missing)?;
            at = match item {
                Item::ArrayOfTables(list) => {
                    let name = parts.next().ok_or_else(|| {
                        fail(format!(
                            "--set {whole}: `{part}` is a list; name one: {part}.NAME.KEY"
                        ))
                    })?;
                    named(list, name).map_err(|known| {
                        fail(format!(
                            "--set {whole}: no `{part}` is named `{name}` (there are: {known})"
                        ))
                    })?
                }
                other => other.as_table_like_mut().ok_or_else(|| {
                    fail(format!("--set {whole}: `{part}` is a value, nothing lies below it"))
                })?,
            };
        }
        match at.get_mut(last).and_then(Item::as_value_mut) {
            Some(old) => {
                let decor = old.decor().clone();
                *old = assignment.value.clone();
                *old.decor_mut() = decor;
            }
            None => {
                at.insert(last, Item::Value(assignment.value.clone()));
            }
        }
    }
    Ok(document.to_string())
}

/// The table of a list that has this `name`, or the names that there are.
fn named<'a>(list: &'a mut ArrayOfTables, name: &str) -> Result<&'a mut dyn TableLike, String> {
    let name_of = |t: &Table| t.get("name").and_then(Item::as_str).unwrap_or("").to_owned();
    let known: Vec<String> = list.iter().map(name_of).collect();
    match list.iter_mut().find(|t| name_of(t) == name) {
        Some(table) => Ok(table),
        None => Err(known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a church\n[photons]\nstored = 5 # few\n[[view]]\nname = \"plan\"\n";

    fn set(text: &str) -> Result<String, Error> {
        apply(Path::new("project.toml"), TEXT, &[text.parse().expect("an assignment")])
    }

    #[test]
    fn comments_stay_and_lists_are_entered_by_name() {
        assert_eq!(set("photons.stored=7").expect("sets"), TEXT.replace("= 5", "= 7"));
        let added = set("view.plan.bandwidth=50").expect("sets");
        assert_eq!(added, format!("{TEXT}bandwidth = 50\n"));
    }

    #[test]
    fn what_is_not_there_is_named() {
        for (text, word) in [
            ("view.pan.bandwidth=50", "plan"),
            ("view.bandwidth=50", "view.NAME.KEY"),
            ("photon.stored=5", "photons"),
            ("photons.stored.more=5", "nothing lies below"),
        ] {
            let message = set(text).expect_err(text).to_string();
            assert!(message.contains(word), "{message}");
        }
        assert!("photons.stored=many".parse::<Assignment>().is_err());
        assert!("photons.stored".parse::<Assignment>().is_err());
    }
}
