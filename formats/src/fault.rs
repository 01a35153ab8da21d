//! Ends the program, or holds it, at a counted step of its work: so that tests kill it anywhere,
//! whatever the load of the machine. A test that kills by the clock kills nothing on a fast
//! machine and too early on a busy one.
//!
//! The environment variable `GLINTMAP_FAULT` holds an action, a number N and maybe words:
//!
//! - `abort 7`: the program ends at its seventh step, as by SIGKILL: nothing is cleaned up.
//! - `abort 2 photons.gmp`: at the second step whose name holds the words.
//! - `hold 1 tracing`: whoever takes that step waits until standard input ends.
//!
//! Steps are what [`crate::seal`] does to a file, named by the file's path (it begins, it is
//! complete, it carries its name), and what a run reports as progress, named by the work. Without
//! the variable a step costs a look at a word in memory.

use std::io::Read;
use std::path::Path;
use std::str::FromStr;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

const VARIABLE: &str = "GLINTMAP_FAULT";

static FAULT: LazyLock<Option<Fault>> = LazyLock::new(|| {
    let text = std::env::var(VARIABLE).ok()?;
    let fault = text.parse();
    Some(fault.unwrap_or_else(|()| {
        eprintln!("{VARIABLE}: expected `abort N [WORDS]` or `hold N [WORDS]`, found `{text}`");
        std::process::exit(2);
    }))
});

/// A step is done, or about to be.
pub fn step(name: impl AsRef<Path>) {
    if let Some(fault) = FAULT.as_ref()
        && fault.is_due(name.as_ref())
    {
        fault.action.act();
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Abort,
    Hold,
}

impl Action {
    fn act(self) {
        match self {
            Self::Abort => std::process::abort(),
            Self::Hold => {
                // It is the end that is waited for; an error is one.
                let _ = std::io::stdin().read_to_end(&mut Vec::new());
            }
        }
    }
}

#[derive(Debug)]
struct Fault {
    action: Action,
    at: u64,
    words: String,
    steps: AtomicU64,
}

impl FromStr for Fault {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.splitn(3, ' ');
        let action = match parts.next() {
            Some("abort") => Action::Abort,
            Some("hold") => Action::Hold,
            _ => return Err(()),
        };
        let at = parts.next().and_then(|n| n.parse().ok()).filter(|n| *n > 0).ok_or(())?;
        let words = parts.next().unwrap_or_default().to_owned();
        Ok(Self { action, at, words, steps: AtomicU64::new(0) })
    }
}

impl Fault {
    /// Counts a step; whether it is the one.
    fn is_due(&self, name: &Path) -> bool {
        name.to_string_lossy().contains(&self.words)
            && self.steps.fetch_add(1, Ordering::Relaxed) + 1 == self.at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_that_was_asked_for_and_no_other() {
        let due = |text: &str, names: &[&str]| -> Vec<bool> {
            let fault: Fault = text.parse().expect("a fault");
            names.iter().map(|name| fault.is_due(Path::new(name))).collect()
        };
        assert_eq!(due("abort 2", &["a", "b", "c"]), [false, true, false]);
        assert_eq!(due("hold 2 x y", &["x y", "x", "x y z", "x y"]), [false, false, true, false]);
        for wrong in ["", "abort", "abort 0", "abort x", "stop 1", "abort -1"] {
            assert!(wrong.parse::<Fault>().is_err(), "{wrong}");
        }
    }
}
