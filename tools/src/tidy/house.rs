//! The files of the crate and the arrows between them: forbidden ones, and circles.

use std::collections::{BTreeMap, BTreeSet};

use super::imports::{Named, Source, read};
use super::rooms::UNITS;

/// All files of `src/`, by their paths below it.
#[derive(Debug, Default)]
pub struct House {
    files: BTreeMap<String, Source>,
    by_module: BTreeMap<Vec<String>, String>,
}

impl House {
    /// Reads the crate's files: path below `src/`, text.
    ///
    /// # Errors
    /// A file that isn't Rust, with its name.
    pub fn read<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Result<Self, String> {
        let mut house = Self::default();
        for (name, text) in files {
            if is_for_tests(name) {
                continue;
            }
            let source = read(name, text).map_err(|e| format!("src/{name}: {e}"))?;
            house.by_module.insert(source.module.clone(), name.to_owned());
            house.files.insert(name.to_owned(), source);
        }
        Ok(house)
    }

    /// What the table forbids: one line each.
    pub fn forbidden(&self) -> Vec<String> {
        let mut out = Vec::new();
        for (name, source) in &self.files {
            let Some(unit) = unit_of(name) else { continue };
            let Some((_, may)) = UNITS.iter().find(|(n, _)| *n == unit) else {
                out.push(format!("src/{name}: `{unit}` is no room of the table in rooms.rs"));
                continue;
            };
            for named in &source.named {
                let at = format!("src/{name}:{}", named.line);
                if !named.ours {
                    if named.path[0] == "glintmap_formats" && !may.contains(&"formats") {
                        out.push(format!("{at}: `{unit}` may not use `formats`"));
                    }
                    continue;
                }
                let Some(target) = self.file_of(&named.path).and_then(unit_of) else { continue };
                if !may_use(unit, may, target) {
                    out.push(format!("{at}: `{unit}` may not use `{target}`"));
                }
            }
        }
        out.sort();
        out.dedup();
        out
    }

    /// Files that import each other in a circle, each group sorted.
    pub fn circles(&self) -> Vec<BTreeSet<&str>> {
        let arrows = self.arrows();
        let reach = |from: &str| {
            let mut seen = BTreeSet::new();
            let mut next = vec![from];
            while let Some(at) = next.pop() {
                for &to in arrows.get(at).into_iter().flatten() {
                    if seen.insert(to) {
                        next.push(to);
                    }
                }
            }
            seen
        };
        let reached: BTreeMap<&str, BTreeSet<&str>> =
            self.files.keys().map(|f| (f.as_str(), reach(f))).collect();
        let mut circles = BTreeSet::new();
        for (file, to) in &reached {
            let circle: BTreeSet<&str> =
                to.iter().copied().filter(|t| reached[t].contains(file)).collect();
            if circle.len() > 1 {
                circles.insert(circle);
            }
        }
        circles.into_iter().collect()
    }

    /// The arrows inside a group of files, for people.
    pub fn ties(&self, group: &BTreeSet<&str>) -> Vec<String> {
        let arrows = self.arrows();
        let mut out = Vec::new();
        for &from in group {
            for &to in arrows.get(from).into_iter().flatten().filter(|t| group.contains(*t)) {
                out.push(format!("{from} -> {to}"));
            }
        }
        out
    }

    fn arrows(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        self.files
            .iter()
            .map(|(name, source)| {
                let to = source
                    .named
                    .iter()
                    .filter(|n: &&Named| n.ours && !n.handed_on)
                    .filter_map(|n| self.file_of(&n.path))
                    .filter(|to| to != name)
                    .collect();
                (name.as_str(), to)
            })
            .collect()
    }

    /// The file that defines what a path names: through the doors, to the room behind them.
    fn file_of(&self, path: &[String]) -> Option<&str> {
        let mut path = path.to_vec();
        // Doors hand on to doors; a handful of steps is more than any path takes.
        for _ in 0..8 {
            let depth =
                (1..=path.len()).rev().find(|n| self.by_module.contains_key(&path[..*n]))?;
            let file = self.by_module.get(&path[..depth])?;
            let handed = path.get(depth).and_then(|name| self.files[file].reexports.get(name));
            match handed {
                Some(to) if *to != path[..=depth] => {
                    path = to.iter().chain(&path[depth + 1..]).cloned().collect();
                }
                _ => return Some(file),
            }
        }
        None
    }
}

/// Whether a file holds nothing but tests.
pub fn is_for_tests(name: &str) -> bool {
    name.ends_with("tests.rs") || name.contains("/tests/")
}

/// The room or wing that a file below `src/` lies in; none for `main.rs` and `lib.rs`.
pub fn unit_of(name: &str) -> Option<&str> {
    let (room, rest) = name.split_once('/')?;
    let wing = rest.split_once('/').map(|(wing, _)| &name[..room.len() + 1 + wing.len()]);
    Some(wing.filter(|w| UNITS.iter().any(|(u, _)| u == w)).unwrap_or(room))
}

/// The room itself may use its wings; a wing may use the room's own files, but not the other way
/// round through its door: what the door hands on lies in another wing and counts as that.
fn may_use(unit: &str, may: &[&str], target: &str) -> bool {
    let room = |u: &str| u.split('/').next().map(str::to_owned);
    target == unit
        || may.contains(&target)
        || target.split_once('/').is_some_and(|(room, _)| may.contains(&room) || room == unit)
        || (unit.contains('/') && room(unit).as_deref() == Some(target))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn house(files: &[(&str, &str)]) -> House {
        House::read(files.iter().copied()).expect("reads")
    }

    #[test]
    fn what_the_table_forbids_is_found_through_doors_and_aliases() {
        let view = ("render/view/mod.rs", "pub(crate) mod hits;\npub use hits::Hit;");
        let hits = ("render/view/hits.rs", "pub struct Hit;");
        let gather = ("render/gather/mod.rs", "pub struct Photons;");
        let door = ("render/mod.rs", "pub mod view;\npub mod gather;\npub use gather::Photons;");
        let pages = ("pages/mod.rs", "pub struct Store;");
        let base = ("base/mod.rs", "pub struct Grid;");
        let of = |name: &str, text: &str| {
            house(&[view, hits, gather, door, pages, base, (name, text)]).forbidden().len()
        };
        assert_eq!(of("trace/path.rs", "use crate::pages::Store;"), 1);
        assert_eq!(of("trace/path.rs", "use crate::{base::Grid, pages};"), 1);
        assert_eq!(of("trace/path.rs", "fn f() { crate::pages::open(); }"), 1);
        assert_eq!(of("trace/path.rs", "fn f() { format!(\"{}\", crate::pages::N); }"), 1);
        assert_eq!(of("trace/path.rs", "use glintmap_formats::seal;"), 1);
        assert_eq!(of("render/view/rays.rs", "use crate::render::gather::Photons;"), 1);
        assert_eq!(of("render/view/rays.rs", "use crate::render::Photons;"), 1);
        assert_eq!(of("render/gather/sum.rs", "use crate::render::view::Hit;"), 0);
        assert_eq!(of("receivers/eyes.rs", "use crate::render::Photons;"), 0);
        assert_eq!(of("kitchen/x.rs", "fn f() {}"), 1);
        assert_eq!(of("trace/path.rs", "use crate::base::Grid;\n// crate::pages::Store"), 0);
        assert_eq!(of("trace/path.rs", "#[cfg(test)]\nmod t { use crate::pages::Store; }"), 0);
    }

    #[test]
    fn circles_are_found_and_doors_are_none() {
        let circle = house(&[
            ("base/mod.rs", "mod a;\nmod b;\nmod c;\npub use a::A;\npub use b::B;"),
            ("base/a.rs", "use super::B;\npub struct A;"),
            ("base/b.rs", "use super::c::C;\npub struct B;"),
            ("base/c.rs", "pub struct C(crate::base::a::A);"),
        ]);
        let found = circle.circles();
        assert_eq!(found, [BTreeSet::from(["base/a.rs", "base/b.rs", "base/c.rs"])]);
        let none = house(&[
            ("base/mod.rs", "mod a;\nmod b;\npub use a::A;\npub use b::B;"),
            ("base/a.rs", "use super::B;\npub struct A;"),
            ("base/b.rs", "pub struct B;\n#[cfg(test)]\nmod tests { use crate::base::A; }"),
        ]);
        assert_eq!(none.circles(), Vec::<BTreeSet<&str>>::new());
    }
}
