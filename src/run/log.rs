//! `run/log/`: commands, times, threads, cache figures. The only place for what differs from run
//! to run.

use std::fs::OpenOptions;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use glintmap_formats::fault;
use serde_json::{Value, json};

use super::error::Error;
use super::stage::Options;
use crate::base::{Interrupted, Progress, Provenance};
use crate::project::Folder;
use crate::project::artifacts::LOG;

/// The log of one command: one JSON object a line in `run/log/run.jsonl`.
#[derive(Clone)]
pub struct Log {
    folder: Folder,
    began: Instant,
}

impl Log {
    /// A log for a command that begins now: notes the command, the program and its means.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn begin(folder: &Folder, options: &Options) -> Result<Self, Error> {
        let log = Self { folder: folder.clone(), began: Instant::now() };
        let command: Vec<String> =
            std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
        log.write(json!({
            "command": command,
            "program": Provenance::PROGRAM,
            "system": format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            "cores": std::thread::available_parallelism().ok(),
            "memory_bytes": options.memory_bytes,
            "page_cache_bytes": options.page_cache_bytes,
            "until": options.until,
            "force": options.force,
        }))?;
        Ok(log)
    }

    /// Adds a line about a unit of work.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn note(&self, unit: &str, facts: &Value) -> Result<(), Error> {
        self.write(json!({ "unit": unit, "facts": facts }))
    }

    /// Adds what the user was told.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn said(&self, message: &str) -> Result<(), Error> {
        self.write(json!({ "said": message }))
    }

    /// Adds the last line of a command.
    ///
    /// # Errors
    /// Whatever the file system says; nothing where the command failed anyway.
    pub fn end(&self, failed: Option<&Error>) -> Result<(), Error> {
        match failed {
            None => self.write(json!({ "ended": "done" })),
            Some(error) => {
                // The disk may be full: the error that matters is the command's.
                let _ = self.write(json!({ "ended": error.to_string() }));
                Ok(())
            }
        }
    }

    fn write(&self, mut line: Value) -> Result<(), Error> {
        line["at"] = jiff::Timestamp::now().to_string().into();
        line["since_start_s"] = self.began.elapsed().as_secs_f64().into();
        line["threads"] = rayon::current_num_threads().into();
        let path = self.folder.prepare(LOG.as_ref())?;
        let write = || -> std::io::Result<()> {
            let mut file = OpenOptions::new().create(true).append(true).open(&path)?;
            writeln!(file, "{line}")
        };
        write().map_err(|source| Error::Write { path: path.clone(), source })
    }
}

/// Progress whose words go to the log as well.
pub struct Logged<'a> {
    /// Who is told.
    pub progress: &'a dyn Progress,
    /// Where it is noted.
    pub log: Log,
    /// Name of the work at hand.
    work: Mutex<String>,
}

impl<'a> Logged<'a> {
    /// Progress for `progress`, noted in `log`.
    pub fn new(progress: &'a dyn Progress, log: Log) -> Self {
        Self { progress, log, work: Mutex::default() }
    }

    fn work(&self) -> MutexGuard<'_, String> {
        // A name is set in one go: it is whole even after a panic elsewhere.
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Logged<'_> {
    fn begin(&self, what: &str, total: u64, unit: &str) {
        self.work().replace_range(.., what);
        self.progress.begin(what, total, unit);
    }

    fn advance(&self, units: u64) {
        self.progress.advance(units);
        fault::step(self.work().as_str());
    }

    fn finish(&self) {
        self.progress.finish();
    }

    fn say(&self, message: &str) {
        self.progress.say(message);
        // What can't be noted (a full disk) fails with the next unit of work.
        let _ = self.log.said(message);
    }

    fn check(&self) -> Result<(), Interrupted> {
        self.progress.check()
    }
}
