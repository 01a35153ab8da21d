use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::base::{Interrupted, Progress};

/// Work that takes less is not worth a line in a log.
const WORTH_A_LINE: Duration = Duration::from_secs(5);

/// Prints a line; standard error may be closed, then nobody listens.
pub(super) fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Progress on standard error, with a rate and the time left.
pub(super) struct Bar {
    quiet: bool,
    stop: Arc<AtomicBool>,
    current: Mutex<Option<ProgressBar>>,
    /// Without a terminal nothing moves: long work is told in one line once it is done.
    moves: bool,
}

impl Bar {
    pub(super) fn new(quiet: bool, stop: Arc<AtomicBool>) -> Self {
        Self { quiet, stop, current: Mutex::new(None), moves: std::io::stderr().is_terminal() }
    }

    fn current(&self) -> std::sync::MutexGuard<'_, Option<ProgressBar>> {
        // A poisoned lock means that a thread died while drawing: the bar itself is still whole.
        self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Progress for Bar {
    fn begin(&self, what: &str, total: u64, unit: &str) {
        let target = if self.quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(5)
        };
        let template = format!(
            "{{msg:34!}} {{bar:24}} {{percent:>3}} % {{human_pos}}/{{human_len}} {unit}, {{rate}}, {{eta}} left"
        );
        let style = ProgressStyle::with_template(&template)
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .with_key("rate", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                // Drawn again in a moment: what can't be written now doesn't matter.
                let _ = write!(out, "{}/s", HumanCount(state.per_sec() as u64));
            });
        let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style);
        bar.set_message(what.to_owned());
        bar.enable_steady_tick(Duration::from_millis(500));
        *self.current() = Some(bar);
    }

    fn advance(&self, units: u64) {
        if let Some(bar) = self.current().as_ref() {
            bar.inc(units);
        }
    }

    fn finish(&self) {
        if let Some(bar) = self.current().take() {
            let (took, done) = (bar.elapsed(), bar.position());
            bar.finish_and_clear();
            if !self.quiet && !self.moves && took >= WORTH_A_LINE {
                let rate = done as f64 / took.as_secs_f64();
                line(&format!(
                    "{}: {done} in {:.0} s, {rate:.0}/s",
                    bar.message(),
                    took.as_secs_f64()
                ));
            }
        }
    }

    fn say(&self, message: &str) {
        if self.quiet {
            return;
        }
        match self.current().as_ref() {
            Some(bar) => bar.suspend(|| line(message)),
            None => line(message),
        }
    }

    fn check(&self) -> Result<(), Interrupted> {
        if self.stop.load(Ordering::Relaxed) { Err(Interrupted) } else { Ok(()) }
    }
}
