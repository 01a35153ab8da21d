//! `run/log/`: commands, times, threads, cache figures. The only place for what differs from run
//! to run.

use std::fs::OpenOptions;
use std::io::Write;
use std::time::Instant;

use serde_json::{Value, json};

use super::error::Error;
use super::folder::Folder;

/// The log of one command: one JSON object a line in `run/log/run.jsonl`.
pub struct Log {
    folder: Folder,
    began: Instant,
}

impl Log {
    /// A log for a command that begins now.
    pub fn begin(folder: &Folder) -> Self {
        Self { folder: folder.clone(), began: Instant::now() }
    }

    /// Adds a line about a unit of work.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn note(&self, unit: &str, facts: &Value) -> Result<(), Error> {
        let line = json!({
            "at": jiff::Timestamp::now().to_string(),
            "since_start_s": self.began.elapsed().as_secs_f64(),
            "threads": rayon::current_num_threads(),
            "unit": unit,
            "facts": facts,
        });
        let path = self.folder.prepare(std::path::Path::new("log/run.jsonl"))?;
        let write = || -> std::io::Result<()> {
            let mut file = OpenOptions::new().create(true).append(true).open(&path)?;
            writeln!(file, "{line}")
        };
        write().map_err(|source| Error::Write { path: path.clone(), source })
    }
}
