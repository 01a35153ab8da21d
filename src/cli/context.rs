use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use serde::Serialize;

use super::bar::{self, Bar};
use crate::base::Progress;

/// What every command takes.
#[derive(Clone, Debug, Args)]
pub struct Common {
    /// Print exactly one JSON document on standard output; an error is one on the last line of
    /// standard error
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress, no notes: only results and errors
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Threads to use [default: one for each core]
    #[arg(long, global = true, value_name = "N")]
    pub threads: Option<std::num::NonZeroUsize>,
}

/// What a command knows of the outside: how to print, how to report progress.
pub struct Context {
    /// The options that every command takes.
    pub common: Common,
    progress: Bar,
}

impl Context {
    pub(super) fn new(common: Common) -> anyhow::Result<Self> {
        if let Some(threads) = common.threads {
            rayon::ThreadPoolBuilder::new().num_threads(threads.get()).build_global()?;
        }
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, quiet) = (Arc::clone(&stop), common.quiet);
        ctrlc::set_handler(move || {
            // The second time the user means it: leave at once. Nothing sealed is lost.
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            if !quiet {
                bar::line(
                    "stopping as soon as what is begun can be left; Ctrl-C again leaves at once",
                );
            }
        })?;
        let progress = Bar::new(common.quiet, stop);
        Ok(Self { common, progress })
    }

    /// Where long work reports to.
    pub fn progress(&self) -> &dyn Progress {
        &self.progress
    }

    /// Prints a result: the JSON document with `--json`, else the text.
    ///
    /// # Errors
    /// When standard output is closed.
    pub fn print(&self, document: &impl Serialize, text: &str) -> anyhow::Result<()> {
        let mut out = std::io::stdout().lock();
        if self.common.json {
            // As an io::Error a closed pipe is known for what it is.
            serde_json::to_writer_pretty(&mut out, document).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            writeln!(out, "{}", text.trim_end_matches('\n'))?;
        }
        Ok(())
    }
}
