use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::log::Log;
use super::{SceneSpec, cityjson};
use crate::base::Place;

/// Which levels of detail the city models have.
#[derive(Default)]
pub(super) struct Levels {
    known: BTreeMap<String, usize>,
    found: bool,
    file: PathBuf,
}

impl Levels {
    pub fn add(&mut self, file: &Path, read: &cityjson::Read, wanted: Option<&str>, log: &mut Log) {
        for (lod, count) in &read.lods {
            *self.known.entry(lod.clone()).or_default() += count;
            let same = |w: &str| w == lod || (w.parse().ok() == lod.parse::<f64>().ok());
            self.found |= wanted.is_some_and(same);
        }
        self.file = file.to_owned();
        let place = Place { file: file.to_owned(), ..Place::default() };
        if read.other_lod > 0 {
            let message = format!(
                "{} objects lack the level of detail {}; the next lower one was taken, or the lowest",
                read.other_lod,
                wanted.unwrap_or_default()
            );
            log.warn("files without the level of detail", place.clone(), message);
        }
        if read.unread > 0 {
            let message = format!("{} geometries of points or lines are left out", read.unread);
            log.warn("files with points or lines", place, message);
        }
    }

    /// A level that no object has is a mistake.
    pub fn check(&self, scene: &SceneSpec, log: &mut Log) {
        let Some(wanted) = &scene.lod else { return };
        if self.found || self.known.is_empty() || !log.faults.is_empty() {
            return;
        }
        let there: Vec<String> =
            self.known.iter().map(|(lod, n)| format!("\"{lod}\" ({n} objects)")).collect();
        let message = format!(
            "lod = \"{wanted}\" is in no object; there are {}: choose one, or leave lod out for the highest",
            there.join(", ")
        );
        log.fault(Place { file: self.file.clone(), ..Place::default() }, message);
    }
}
