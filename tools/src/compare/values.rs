//! How much numbers differ.

use std::fmt;

/// Two channels of numbers, compared one by one. By their bits: what is the same is the same file.
#[derive(Clone, Debug, Default)]
pub struct Difference {
    of: usize,
    differ: usize,
    /// How many were something and are 0 now, and the other way.
    became_0: usize,
    were_0: usize,
    largest: Option<Largest>,
    peak: f64,
}

#[derive(Clone, Copy, Debug)]
struct Largest {
    at: usize,
    by: f64,
    old: f64,
    new: f64,
}

impl Difference {
    /// Takes the next pair.
    pub fn push(&mut self, old: f64, new: f64) {
        let at = self.of;
        self.of += 1;
        self.peak = self.peak.max(old.abs());
        if old.to_bits() == new.to_bits() {
            return;
        }
        self.differ += 1;
        self.became_0 += usize::from(new == 0.0 && old != 0.0);
        self.were_0 += usize::from(old == 0.0 && new != 0.0);
        // A number that is none any more is the largest difference there is.
        let by = (new - old).abs();
        let by = if by.is_nan() { f64::INFINITY } else { by };
        if self.largest.is_none_or(|largest| by > largest.by) {
            self.largest = Some(Largest { at, by, old, new });
        }
    }

    /// All pairs of two lists of the same length.
    pub fn of(old: impl IntoIterator<Item = f64>, new: impl IntoIterator<Item = f64>) -> Self {
        let mut out = Self::default();
        old.into_iter().zip(new).for_each(|(old, new)| out.push(old, new));
        out
    }

    /// In words, where anything differs: `unit` is what is counted, `place` names one of them.
    pub fn words(&self, unit: &str, place: impl Fn(usize) -> String) -> Option<String> {
        let Largest { at, by, old, new } = self.largest?;
        let mut out = format!(
            "{} of {} {unit} differ, by up to {} ({}: {old} -> {new}; the largest value is {})",
            self.differ,
            self.of,
            Short(by),
            place(at),
            Short(self.peak)
        );
        if self.became_0 + self.were_0 > 0 {
            out += &format!("; {} became 0, {} were 0", self.became_0, self.were_0);
        }
        Some(out)
    }
}

/// Four digits are enough to judge a difference by.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-3..1e6).contains(&size) {
            let digits = 3 - (size.max(1e-3).log10().floor() as i32).clamp(-3, 3);
            write!(f, "{:.*}", digits as usize, self.0)
        } else {
            write!(f, "{:.3e}", self.0)
        }
    }
}
