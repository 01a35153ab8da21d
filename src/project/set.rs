//! `--set KEY=VALUE`: single keys changed without losing a file's comments.

use std::path::Path;
use std::str::FromStr;

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::error::Error;
use super::places::{Key, Mistake, Mistakes, Place};

/// One `KEY=VALUE`: a dotted key, tables of a list by their name, a TOML value.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// As it was given.
    text: String,
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
        Ok(Self { text: text.to_owned(), key, value })
    }
}

/// The project's text with the assignments made (comments and order stay), and each assignment with
/// the key that it means.
///
/// # Errors
/// When the text isn't TOML, or a key names a table that isn't there.
pub fn apply(
    file: &Path,
    text: &str,
    set: &[Assignment],
) -> Result<(String, Vec<(Key, String)>), Error> {
    let mut assigned = Vec::new();
    if set.is_empty() {
        return Ok((text.to_owned(), assigned));
    }
    let fail = |set: &str, message: String| {
        let place = Some(Place::Set { set: set.to_owned() });
        Error::from(Mistakes { path: file.to_owned(), list: vec![Mistake { place, message }] })
    };
    let mut document: DocumentMut =
        text.parse().map_err(|e| Mistakes::nowhere(file.to_owned(), format!("{e}")))?;
    for assignment in set {
        let fail = |message: String| fail(&assignment.text, message);
        let (last, path) = assignment.key.split_last().ok_or_else(|| fail("empty key".into()))?;
        let mut at: &mut dyn TableLike = document.as_table_mut();
        let mut key = Key::default();
        let mut parts = path.iter();
        while let Some(part) = parts.next() {
            let known = at.iter().map(|(k, _)| k.to_owned()).collect::<Vec<_>>().join(", ");
            let item = at.get_mut(part);
            let item =
                item.ok_or_else(|| fail(format!("there is no `{part}` (there are: {known})")))?;
            key = key.key(part);
            at = match item {
                Item::ArrayOfTables(list) => {
                    let name = parts.next().ok_or_else(|| {
                        fail(format!("`{part}` is a list; name one: {part}.NAME.KEY"))
                    })?;
                    let (number, table) = named(list, name).map_err(|known| {
                        fail(format!("no `{part}` is named `{name}` (there are: {known})"))
                    })?;
                    key = Key::item(part, number);
                    table
                }
                other => other
                    .as_table_like_mut()
                    .ok_or_else(|| fail(format!("`{part}` is a value, nothing lies below it")))?,
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
        assigned.push((key.key(last), assignment.text.clone()));
    }
    Ok((document.to_string(), assigned))
}

/// The table of a list that has this `name`, with its number, or the names that there are.
fn named<'a>(
    list: &'a mut ArrayOfTables,
    name: &str,
) -> Result<(usize, &'a mut dyn TableLike), String> {
    let name_of = |t: &Table| t.get("name").and_then(Item::as_str).unwrap_or("").to_owned();
    let known: Vec<String> = list.iter().map(name_of).collect();
    match list.iter_mut().enumerate().find(|(_, t)| name_of(t) == name) {
        Some((number, table)) => Ok((number, table)),
        None => Err(known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a church\n[photons]\nstored = 5 # few\n[[view]]\nname = \"plan\"\n";

    fn set(text: &str) -> Result<String, Error> {
        let set = [text.parse().expect("an assignment")];
        apply(Path::new("project.toml"), TEXT, &set).map(|(text, _)| text)
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
