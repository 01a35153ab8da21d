//! Where in the project file something stands, so that every mistake has a line and a column.
//!
//! A mistake is found long after the text was read: by the reader that checks a table, by a room
//! that can't use a number, by receivers that look for an object. What all of them know is the
//! [`Key`] that they talk about. The text is kept, and a key is looked up in it when a mistake has
//! to be told. Places inside the tables (serde's spans) were the other way; they would be in every
//! field of every struct, for the sake of runs that don't happen.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

use serde::Serialize;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::error::Error;
use crate::base::limits::MAX_FINDINGS_SHOWN;

/// A key of the project file: `site.latitude`, or `size` of the third `[[view]]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Key(Vec<Step>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Name(String),
    Item(usize),
}

impl Key {
    /// Of tables within each other: `"time.hours.from"`.
    pub fn of(names: &str) -> Self {
        Self(names.split('.').map(|name| Step::Name(name.to_owned())).collect())
    }

    /// An element of a list of tables, from 0.
    pub fn item(list: &str, number: usize) -> Self {
        Self(vec![Step::Name(list.to_owned()), Step::Item(number)])
    }

    /// A key of this table.
    pub fn key(&self, name: &str) -> Self {
        let step = Step::Name(name.to_owned());
        Self(self.0.iter().cloned().chain([step]).collect())
    }
}

/// Where a mistake stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Place {
    /// In the project file, both from 1.
    Line {
        /// The line.
        line: usize,
        /// The letter in it.
        column: usize,
    },
    /// In an assignment of the command line.
    Set {
        /// `KEY=VALUE`, as it was given.
        set: String,
    },
}

/// A mistake in a project.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Mistake {
    /// Where; `None` where it is about no place of the file.
    #[serde(flatten)]
    pub place: Option<Place>,
    /// What was expected, what was found, what to do.
    pub message: String,
}

/// Mistakes of one file.
#[derive(Clone, Debug)]
pub struct Mistakes {
    /// The project file.
    pub path: PathBuf,
    /// In the order in which they stand there.
    pub list: Vec<Mistake>,
}

impl Mistakes {
    /// One about no place of the file.
    pub fn nowhere(path: PathBuf, message: String) -> Self {
        Self { path, list: vec![Mistake { place: None, message }] }
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, mistake) in self.list.iter().take(MAX_FINDINGS_SHOWN).enumerate() {
            out.write_str(if i == 0 { "" } else { "\n" })?;
            write!(out, "{}", self.path.display())?;
            match &mistake.place {
                None => {}
                Some(Place::Line { line, column }) => write!(out, ":{line}:{column}")?,
                Some(Place::Set { set }) => write!(out, ": with --set {set}")?,
            }
            write!(out, ": {}", mistake.message)?;
        }
        match self.list.len().saturating_sub(MAX_FINDINGS_SHOWN) {
            0 => Ok(()),
            more => write!(out, "\n… and {more} more"),
        }
    }
}

/// The text of a project file, and what the command line changed in it.
#[derive(Clone, Debug)]
pub struct Places {
    /// The project file.
    pub file: PathBuf,
    /// As it lies there.
    pub text: String,
    /// With the assignments made.
    pub changed: String,
    /// Each assignment with its key.
    pub assigned: Vec<(Key, String)>,
}

impl Places {
    /// A mistake about a key.
    pub fn mistake(&self, key: &Key, what: &str) -> Mistake {
        let message = match self.show(key) {
            shown if shown.is_empty() => what.to_owned(),
            shown => format!("{shown}: {what}"),
        };
        Mistake { place: Some(self.place(key)), message }
    }

    /// An error of one mistake.
    pub fn wrong(&self, key: &Key, what: &str) -> Error {
        Mistakes { path: self.file.clone(), list: vec![self.mistake(key, what)] }.into()
    }

    /// Where a key stands; where it is missing, the table that misses it.
    pub fn place(&self, key: &Key) -> Place {
        let touches = |(assigned, _): &&(Key, String)| {
            !key.0.is_empty() && (assigned.0.starts_with(&key.0) || key.0.starts_with(&assigned.0))
        };
        if let Some((_, set)) = self.assigned.iter().find(touches) {
            return Place::Set { set: set.clone() };
        }
        let (tree, _) = DeTable::parse_recoverable(&self.text);
        let mut at = 0;
        walk(tree.get_ref(), &key.0, &mut |span, _| at = span.start);
        place_at(&self.text, at)
    }

    /// The key of what stands at a place of the changed text.
    pub(super) fn key_at(&self, span: &Range<usize>) -> Key {
        let (tree, _) = DeTable::parse_recoverable(&self.changed);
        Key(find(tree.get_ref(), span).unwrap_or_default())
    }

    /// `site.latitude`; `[[view]] "plan": size`.
    pub fn show(&self, key: &Key) -> String {
        let mut names: Vec<String> = Vec::new();
        let (tree, _) = DeTable::parse_recoverable(&self.changed);
        walk(tree.get_ref(), &key.0, &mut |_, value| {
            names.push(value.and_then(name_of).map_or_else(String::new, |n| format!(" \"{n}\"")));
        });
        let mut text = String::new();
        let mut of_list = false;
        for (i, step) in key.0.iter().enumerate() {
            match (step, key.0.get(i + 1)) {
                (Step::Name(list), Some(Step::Item(number))) if i == 0 => {
                    let name = names.get(1).filter(|name| !name.is_empty()).cloned();
                    let name = name.unwrap_or_else(|| format!(" {}", number + 1));
                    text = format!("[[{list}]]{name}");
                    of_list = true;
                }
                (Step::Name(name), _) => {
                    text += match (i, of_list) {
                        (0, _) => "",
                        (2, true) => ": ",
                        _ => ".",
                    };
                    text += name;
                }
                (Step::Item(number), _) if i > 1 => text += &format!(" {}", number + 1),
                (Step::Item(_), _) => {}
            }
        }
        text
    }
}

/// Line and column of a place in a text.
pub(super) fn place_at(text: &str, at: usize) -> Place {
    let before = text.get(..at).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    Place::Line { line, column }
}

fn name_of<'v>(value: &'v DeValue<'_>) -> Option<&'v str> {
    let table = value.as_table()?;
    ["name", "modifier", "time"].into_iter().find_map(|key| table.get(key)?.get_ref().as_str())
}

/// Calls `each` with the span and value of every step of a key that is there.
fn walk<'v>(
    table: &'v DeTable<'_>,
    steps: &[Step],
    each: &mut dyn FnMut(Range<usize>, Option<&'v DeValue<'_>>),
) {
    let [Step::Name(name), rest @ ..] = steps else { return };
    let Some(value) = table.get(name.as_str()) else { return };
    let mut value: &Spanned<DeValue<'_>> = value;
    let mut rest = rest;
    // A list of tables has no place of its own: its first element has.
    each(value.span(), None);
    while let ([Step::Item(number), more @ ..], Some(list)) = (rest, value.get_ref().as_array()) {
        let Some(item) = list.get(*number) else { return };
        (value, rest) = (item, more);
        each(value.span(), Some(value.get_ref()));
    }
    if let Some(table) = value.get_ref().as_table() {
        walk(table, rest, each);
    }
}

/// The steps to what stands at a place: the deepest key or table that holds it.
fn find(table: &DeTable<'_>, span: &Range<usize>) -> Option<Vec<Step>> {
    let holds = |s: Range<usize>| s.start <= span.start && span.start < s.end.max(s.start + 1);
    for (name, value) in table {
        let own = Step::Name(name.get_ref().clone().into_owned());
        let below = match value.get_ref() {
            DeValue::Table(table) => find(table, span),
            DeValue::Array(list) => list.iter().enumerate().find_map(|(i, item)| {
                let table = item.get_ref().as_table()?;
                let below = find(table, span).or_else(|| holds(item.span()).then(Vec::new))?;
                Some([vec![Step::Item(i)], below].concat())
            }),
            _ => None,
        };
        if let Some(below) = below {
            return Some([vec![own], below].concat());
        }
        if holds(name.span()) || holds(value.span()) {
            return Some(vec![own]);
        }
    }
    None
}

/// What was taken out of the tables.
pub(super) enum Struck {
    /// A key.
    Value,
    /// An element of a list of tables.
    Element,
}

/// Takes what stands at a place out of a table, or puts a stand-in there; `None` where nothing
/// stands.
pub(super) fn strike(
    table: &mut DeTable<'_>,
    span: &Range<usize>,
    stand_in: Option<&'static str>,
) -> Option<Struck> {
    fn inner(
        table: &mut DeTable<'_>,
        steps: &[Step],
        stand_in: Option<&'static str>,
    ) -> Option<Struck> {
        let [Step::Name(name), rest @ ..] = steps else { return None };
        let value = table.get_mut(name.as_str())?.get_mut();
        match (rest, value) {
            ([], value) => match stand_in.and_then(|text| DeValue::parse(text).ok()) {
                Some(other) => {
                    *value = other.into_inner();
                    Some(Struck::Value)
                }
                None => table.remove(name.as_str()).map(|_| Struck::Value),
            },
            ([Step::Item(number)], DeValue::Array(list)) => {
                let all = std::mem::replace(list, DeArray::new()).into_iter().enumerate();
                *list = all.filter(|(i, _)| i != number).map(|(_, item)| item).collect();
                Some(Struck::Element)
            }
            ([Step::Item(number), rest @ ..], DeValue::Array(list)) => {
                match list.get_mut(*number)?.get_mut() {
                    DeValue::Table(table) => inner(table, rest, stand_in),
                    _ => None,
                }
            }
            (_, DeValue::Table(table)) => inner(table, rest, stand_in),
            _ => None,
        }
    }
    let steps = find(table, span)?;
    inner(table, &steps, stand_in)
}
