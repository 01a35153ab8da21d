use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::base::{Finding, Place, Severity, limits};

/// How many findings of one sort are kept; the rest is counted.
const KEPT_PER_SORT: usize = 5;

/// Collects what readers notice. Faults of the input are kept up to the number that is shown;
/// warnings of one sort in one file are kept up to a few and counted beyond.
#[derive(Debug, Default)]
pub(super) struct Log {
    /// Notes and warnings.
    pub notes: Vec<Finding>,
    /// Faults: the scene can't be used.
    pub faults: Vec<Finding>,
    counts: BTreeMap<(PathBuf, &'static str), usize>,
}

impl Log {
    /// Whether so many faults were found that reading on makes no sense.
    pub fn full(&self) -> bool {
        self.faults.len() >= limits::MAX_FINDINGS_SHOWN
    }

    /// A fault.
    pub fn fault(&mut self, place: Place, message: impl Into<String>) {
        if !self.full() {
            self.faults.push(Finding { severity: Severity::Error, place, message: message.into() });
        }
    }

    /// A warning; `sort` names those that are alike, in the plural.
    pub fn warn(&mut self, sort: &'static str, place: Place, message: impl Into<String>) {
        let count = self.counts.entry((place.file.clone(), sort)).or_default();
        *count += 1;
        if *count <= KEPT_PER_SORT {
            self.warn_each(place, message);
        }
    }

    /// A warning that sums up many and is always kept.
    pub fn warn_each(&mut self, place: Place, message: impl Into<String>) {
        let (severity, message) = (Severity::Warning, message.into());
        self.notes.push(Finding { severity, place, message });
    }

    /// A note on a file.
    pub fn note(&mut self, file: &Path, message: impl Into<String>) {
        self.notes.push(Finding {
            severity: Severity::Note,
            place: Place { file: file.to_owned(), ..Place::default() },
            message: message.into(),
        });
    }

    /// Notes and warnings, with a line for each sort that was cut short.
    pub fn finish(mut self) -> Vec<Finding> {
        for ((file, sort), count) in std::mem::take(&mut self.counts) {
            if count > KEPT_PER_SORT {
                self.notes.push(Finding {
                    severity: Severity::Warning,
                    place: Place { file, ..Place::default() },
                    message: format!("and {} more {sort}", count - KEPT_PER_SORT),
                });
            }
        }
        self.notes
    }
}
