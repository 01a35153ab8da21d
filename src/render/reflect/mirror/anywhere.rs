use std::sync::atomic::{AtomicU64, Ordering};

use super::rule::{Lit, MirrorRule};
use super::suns::MirrorTimes;
use super::year::MirrorYear;

/// The instants at which any of many receivers is lit, by PV surface: a bit each, so that a façade
/// needs no more memory than a point. Threads may add in any order.
#[derive(Debug)]
pub struct Anywhere {
    times: MirrorTimes,
    /// By surface.
    lit: Vec<Vec<AtomicU64>>,
}

impl Anywhere {
    /// Nobody is lit yet.
    pub fn new(rule: &MirrorRule<'_>) -> Self {
        let times = rule.times().clone();
        let words = (times.instants() as usize).div_ceil(64);
        let dark = || (0..words).map(|_| AtomicU64::new(0)).collect();
        Self { lit: (0..rule.surfaces()).map(|_| dark()).collect(), times }
    }

    /// Adds a receiver's year.
    pub fn add(&self, year: &MirrorYear) {
        for lit in &year.lit {
            let word = self.lit.get(usize::from(lit.surface));
            if let Some(word) = word.and_then(|words| words.get(lit.instant as usize / 64)) {
                word.fetch_or(1 << (lit.instant % 64), Ordering::Relaxed);
            }
        }
    }

    /// The year of a receiver that is lit whenever any of those added is.
    pub fn year(self) -> MirrorYear {
        let mut lit = Vec::new();
        for (surface, words) in self.lit.into_iter().enumerate() {
            for (i, word) in words.into_iter().enumerate() {
                let word = word.into_inner();
                for bit in (0..64).filter(|bit| word >> bit & 1 != 0) {
                    lit.push(Lit { instant: 64 * i as u32 + bit, surface: surface as u16 });
                }
            }
        }
        lit.sort_unstable();
        MirrorYear::new(&self.times, lit)
    }
}
