use std::ops::Range;

use rayon::prelude::*;

use super::smooth::{Part, Smoother, Strip};
use super::strip::{self, Work};
use super::window::Window;
use crate::glare::events::slab;
use crate::glare::events::slab::{Place, Slab};
use crate::glare::settings::Connectivity;
use crate::glare::year::counts::Counts;

/// Rows that one thread filters at a time: enough that the rows above and below, which are
/// filtered in time twice, don't matter.
pub(in crate::glare) const STRIP_ROWS: usize = 32;

/// Neighbouring strips of the picture, at the timesteps of some parts.
pub(in crate::glare) struct Wave<'a> {
    pub smoother: &'a Smoother,
    pub window: &'a Window,
    pub parts: &'a [Part],
    /// The rows; they begin where a strip does.
    pub rows: Range<usize>,
    /// Timesteps that are filtered together.
    pub batch: usize,
    pub connectivity: Connectivity,
}

/// Buffers for one strip of a wave, used again in the next wave.
#[derive(Default)]
pub(in crate::glare) struct Scratch {
    strip: strip::Scratch,
    slab: slab::Scratch,
}

impl Wave<'_> {
    /// Filters the strips and finds what lies above the threshold: for each strip a slab for each
    /// part. `keep` takes the filtered slices of all parts, of which only these rows are written.
    /// There is a scratch for each strip, or more.
    pub fn run(
        &self,
        counts: &mut Counts,
        keep: Option<&mut [f32]>,
        scratch: &mut [Scratch],
    ) -> Vec<Vec<Slab>> {
        if self.parts.is_empty() {
            return Vec::new();
        }
        let strips = self.rows.len().div_ceil(STRIP_ROWS);
        let (rows, columns) = (self.window.rows, self.window.columns);
        let mut kept: Vec<Vec<&mut [f32]>> = (0..strips).map(|_| Vec::new()).collect();
        for slice in keep.into_iter().flat_map(|all| all.chunks_mut(rows * columns)) {
            let here = &mut slice[self.rows.start * columns..self.rows.end * columns];
            for (strip, part) in kept.iter_mut().zip(here.chunks_mut(STRIP_ROWS * columns)) {
                strip.push(part);
            }
        }
        let counts = counts.strips(self.rows.clone(), STRIP_ROWS);
        let work = counts.into_par_iter().zip(kept).zip(scratch).enumerate().with_max_len(1);
        work.map(|(number, ((mut counts, mut kept), scratch))| {
            let first = self.rows.start + number * STRIP_ROWS;
            let rows = first..(first + STRIP_ROWS).min(self.rows.end);
            let slab = |part: &Part| {
                let mut found = Strip::new();
                for batch in part.batches(self.batch) {
                    let here = kept.drain(..batch.steps.len().min(kept.len())).collect();
                    let scratch = &mut scratch.strip;
                    let (smoother, window) = (self.smoother, self.window);
                    found.extend(
                        Work::new(smoother, window, &batch, rows.clone(), here, scratch).run(),
                    );
                }
                let place = Place {
                    part,
                    rows: rows.clone(),
                    picture: [self.window.rows, self.window.columns],
                    connectivity: self.connectivity,
                };
                Slab::new(found, &place, &mut counts, &mut scratch.slab)
            };
            self.parts.iter().map(slab).collect()
        })
        .collect()
    }
}
