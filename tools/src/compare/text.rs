//! How text differs: JSON by its values, tables by their columns, all else by its lines.

use std::collections::BTreeMap;

use serde_json::Value;

/// Findings that are listed of one file before "and N more".
const SHOWN: usize = 8;

/// A hash is 64 hexadecimal digits; all of them become the same word.
pub fn without_hashes(text: &str) -> String {
    const DIGITS: usize = 64;
    let mut out = String::with_capacity(text.len());
    let mut run = String::new();
    for c in text.chars().chain(['\n']) {
        if c.is_ascii_digit() || ('a'..='f').contains(&c) {
            run.push(c);
            continue;
        }
        out += if run.len() == DIGITS { "HASH" } else { &run };
        run.clear();
        out.push(c);
    }
    out.pop();
    out
}

/// What differs between two JSON documents, value by value; `None` where one isn't JSON.
pub fn json(old: &str, new: &str) -> Option<Vec<String>> {
    let leaves = |text: &str| {
        let mut out = BTreeMap::new();
        gather(&serde_json::from_str(text).ok()?, String::new(), &mut out);
        Some(out)
    };
    let (old, new) = (leaves(old)?, leaves(new)?);
    let nothing = "nothing".to_owned();
    let mut paths: Vec<&String> = old.keys().chain(new.keys()).collect();
    paths.sort();
    paths.dedup();
    let differ = paths.iter().filter(|p| old.get(**p) != new.get(**p)).map(|path| {
        let side =
            |leaves: &BTreeMap<String, String>| shortened(leaves.get(*path).unwrap_or(&nothing));
        format!("{path}: {} -> {}", side(&old), side(&new))
    });
    Some(few(differ.collect(), &format!("of {} values", paths.len())))
}

fn gather(value: &Value, path: String, out: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, value)| gather(value, format!("{path}/{key}"), out));
        }
        Value::Array(list) => {
            list.iter()
                .enumerate()
                .for_each(|(i, value)| gather(value, format!("{path}/{i}"), out));
        }
        leaf => {
            out.insert(path, leaf.to_string());
        }
    }
}

/// What differs between two tables, column by column; `None` where they don't have the same rows
/// and columns.
pub fn table(old: &str, new: &str) -> Option<Vec<String>> {
    let rows = |text: &str| -> Vec<Vec<String>> {
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
    };
    let (old, new) = (rows(old), rows(new));
    let head = old.first().filter(|head| new.first() == Some(*head))?;
    let whole = |rows: &[Vec<String>]| rows.iter().all(|row| row.len() == head.len());
    if old.len() != new.len() || !whole(&old) || !whole(&new) {
        return None;
    }
    let mut out = Vec::new();
    for (column, name) in head.iter().enumerate() {
        let pairs: Vec<(&str, &str)> = old
            .iter()
            .zip(&new)
            .skip(1)
            .map(|(old, new)| (old[column].as_str(), new[column].as_str()))
            .collect();
        let differ = |(old, new): &&(&str, &str)| old != new;
        let count = pairs.iter().filter(differ).count();
        let Some(first) = pairs.iter().position(|pair| differ(&pair)) else { continue };
        let numbers = pairs
            .iter()
            .filter(differ)
            .map(|(old, new)| Some((old.parse::<f64>().ok()?, new.parse::<f64>().ok()?)));
        let most = numbers.map(|pair| pair.map(|(old, new)| (new - old).abs()));
        let most: Option<f64> = most.reduce(|a, b| Some(a?.max(b?))).flatten();
        let by = most.map(|most| format!(" by up to {most:.6}")).unwrap_or_default();
        let (of, line, (old, new)) = (pairs.len(), first + 2, pairs[first]);
        out.push(format!(
            "column {name}: {count} of {of} rows differ{by} (line {line}: {} -> {})",
            shortened(old),
            shortened(new)
        ));
    }
    Some(few(out, &format!("of {} columns", head.len())))
}

/// What differs between two texts, line by line.
pub fn lines(old: &str, new: &str) -> Vec<String> {
    let (old, new): (Vec<&str>, Vec<&str>) = (old.lines().collect(), new.lines().collect());
    let all = old.len().max(new.len());
    let side =
        |lines: &[&str], i: usize| lines.get(i).map_or("nothing".to_owned(), |l| (*l).into());
    let differ = (0..all).filter(|&i| old.get(i) != new.get(i));
    let said = differ.map(|i| {
        let (old, new) = around(&side(&old, i), &side(&new, i));
        format!("line {}: {old} -> {new}", i + 1)
    });
    few(said.collect(), &format!("of {all} lines"))
}

/// The first findings, and how many there are in all.
fn few(mut all: Vec<String>, of: &str) -> Vec<String> {
    let count = all.len();
    if count > SHOWN {
        all.truncate(SHOWN);
        all.push(format!("... and {} more: {count} {of} differ", count - SHOWN));
    }
    all
}

/// Long lines (a report is one) from shortly before the first letter that differs.
fn around(old: &str, new: &str) -> (String, String) {
    const BEFORE: usize = 30;
    let same = old.chars().zip(new.chars()).take_while(|(a, b)| a == b).count();
    let from =
        |text: &str| shortened(&text.chars().skip(same.saturating_sub(BEFORE)).collect::<String>());
    (from(old), from(new))
}

fn shortened(text: &str) -> String {
    const LETTERS: usize = 100;
    match text.char_indices().nth(LETTERS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_told_by_its_values() {
        let old = r#"{"a": [1.0, {"b": "x"}], "c": null}"#;
        let new = r#"{"a": [1.5, {"b": "x"}], "d": 1}"#;
        let said = json(old, new).expect("JSON");
        assert_eq!(said, ["/a/0: 1.0 -> 1.5", "/c: null -> nothing", "/d: nothing -> 1"]);
        assert!(json(old, "{").is_none());
    }

    #[test]
    fn tables_are_told_by_their_columns() {
        let old = "name,e\nwall,1.0\nroof,2.0\n";
        let said = table(old, "name,e\nwall,1.25\nroof,2.5\n").expect("a table");
        assert_eq!(said, ["column e: 2 of 2 rows differ by up to 0.500000 (line 2: 1.0 -> 1.25)"]);
        let said = table(old, "name,e\nwall,none\nroof,2.0\n").expect("a table");
        assert_eq!(said, ["column e: 1 of 2 rows differ (line 2: 1.0 -> none)"]);
        assert!(table(old, "name,e\nwall,1.0\n").is_none());
    }

    #[test]
    fn lines_are_told_from_where_they_differ() {
        let old = format!("{}old{}", "a".repeat(500), "b".repeat(500));
        let said = lines(&format!("same\n{old}"), &format!("same\n{}", old.replace("old", "new")));
        assert_eq!(said.len(), 1);
        assert!(said[0].starts_with("line 2: aaa") && said[0].contains("old"), "{said:?}");
        assert!(said[0].len() < 260, "{said:?}");
    }

    #[test]
    fn hashes_become_a_word_and_other_numbers_stay() {
        let hash = "0123456789abcdef".repeat(4);
        assert_eq!(
            without_hashes(&format!("made from {hash}, {hash}0 12.5")),
            format!("made from HASH, {hash}0 12.5")
        );
    }
}
