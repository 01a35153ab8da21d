//! How an analysis is cut into steps, so that it stays within the memory that it is given.

use super::error::Error;
use super::events::counts::Counts;
use super::events::duration::Durations;
use super::filter::strip::{GROUP_ROWS, PIECE_COLUMNS};
use super::filter::window::GROUP;
use super::settings::Settings;
use super::slices::checked;
use super::wave::STRIP_ROWS;
use crate::base::limits::TILE_EDGE;

/// Timesteps that are filtered together: each slice of the window is then fetched from memory
/// twice instead of nine times at sigma 1.
const BATCH: usize = 8;
/// Timesteps that are read together at least, where there is memory for them: a chunk of a volume.
const BLOCK: usize = 16;
/// Timesteps that are read together at most, where a slice is small.
const MAX_BLOCK: usize = 256;
/// Bytes that a block may have for the sake of fewer reads.
const SMALL_BLOCK_BYTES: u64 = 4 << 20;

/// Bytes for what is found in a voxel of a strip of noise: a row run has 20, and where all is
/// noise with a fifth above the threshold a sixth of the voxels begin one, in room that doubles.
const FOUND_BYTES: usize = 8;
/// Bytes that may be kept in memory at most of what could be spilled.
const MAX_SPILL_BYTES: u64 = 64 << 20;

/// How an analysis is cut into steps. Any plan gives the same result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Plan {
    /// Timesteps that are filtered together.
    pub batch: usize,
    /// Timesteps that are read together.
    pub block: usize,
    /// Anonymous memory for pixels and window, bytes.
    pub fixed_bytes: u64,
    /// What is left for glare events that are alive and for the runs of two slices, bytes.
    pub events_bytes: u64,
    /// Of what events need besides, so much is kept in memory before it is spilled, bytes.
    pub spill_bytes: u64,
}

impl Plan {
    /// The steps for a year of `shape`, `[timestep, row, column]`, whose slices are best read
    /// `chunk_timesteps` at a time; `calendar` and `keep`: whether the calendar is known and the
    /// filtered volume is wanted.
    ///
    /// # Errors
    /// Settings or a shape out of range, a memory limit that is too low.
    pub fn new(
        shape: [usize; 3],
        chunk_timesteps: usize,
        calendar: bool,
        keep: bool,
        settings: &Settings,
    ) -> Result<Self, Error> {
        let shape = checked(shape)?;
        let gaussian = settings.gaussian()?;
        settings.threshold_f32()?;
        let radius = [gaussian.t.radius(), gaussian.y.radius()];
        let threads = rayon::current_num_threads();
        Demand { shape, radius, chunk_timesteps, calendar, keep, threads }.plan(settings)
    }
}

/// What decides how much memory is needed.
#[derive(Clone, Copy, Debug)]
struct Demand {
    shape: [usize; 3],
    /// Radius of the filter along t and y.
    radius: [usize; 2],
    chunk_timesteps: usize,
    calendar: bool,
    keep: bool,
    threads: usize,
}

impl Demand {
    /// The steps that fit into the memory limit and use it best.
    fn plan(&self, settings: &Settings) -> Result<Plan, Error> {
        let slice_bytes = 4 * self.pixels();
        let small = usize::try_from(SMALL_BLOCK_BYTES / slice_bytes).unwrap_or(MAX_BLOCK);
        let block = self.chunk_timesteps.max(small).clamp(BLOCK, MAX_BLOCK);
        let steps = [(BATCH, block), (BATCH, BLOCK), (BATCH, BATCH), (4, 4), (2, 2), (1, 1)];
        let limit = settings.memory_bytes;
        let roomy = steps.iter().find(|(batch, block)| self.bytes(*batch, *block) <= limit / 4 * 3);
        let (batch, block) = *roomy.unwrap_or(&(1, 1));
        let fixed_bytes = self.bytes(batch, block);
        if fixed_bytes > limit {
            return Err(Error::Memory {
                pixels: self.shape[1] * self.shape[2],
                window: self.depth() + block,
                needed_mib: (fixed_bytes >> 20) + 16,
                given_mib: limit >> 20,
            });
        }
        let left = limit - fixed_bytes;
        let spill_bytes = (left / 2).min(MAX_SPILL_BYTES);
        Ok(Plan { batch, block, fixed_bytes, events_bytes: left - spill_bytes, spill_bytes })
    }

    fn pixels(&self) -> u64 {
        (self.shape[1] * self.shape[2]) as u64
    }

    /// Timesteps before those that are read of which the window keeps all rows.
    fn depth(&self) -> usize {
        (2 * self.radius[0]).min(self.shape[0])
    }

    fn bytes(&self, batch: usize, block: usize) -> u64 {
        let [_, rows, columns] = self.shape;
        let yearly = if self.calendar { Counts::YEARLY_BYTES_PER_PIXEL } else { 0 };
        // Three maps of 4 bytes, and three more of the calendar.
        let maps = 12 + if self.calendar { 12 } else { 0 };
        let keep = if self.keep { 4 * (block + self.radius[0]) as u64 } else { 0 };
        let past = self.depth() as u64;
        // 4 bytes and some flags for each tile and group of columns; the window is gone when the maps
        // are made.
        let window = (4 * past + past / 16).max(maps);
        let pixel = Counts::BYTES_PER_PIXEL + Durations::BYTES_PER_PIXEL + yearly + keep + window;
        // Two waves, what the filter sees above and below, and the rest of its rows of tiles.
        let strips = STRIP_ROWS * self.threads.max(2);
        let fresh = (2 * strips + 2 * self.radius[1] + 2 * TILE_EDGE).min(2 * rows);
        let ring = (2 * self.radius[1] + GROUP_ROWS).min(rows) * batch;
        let width = columns.min(PIECE_COLUMNS + GROUP);
        // What is found in a strip, twice: while it is sought and while it waits to be followed.
        let found = 2 * FOUND_BYTES * STRIP_ROWS.min(rows) * columns * block;
        let thread = 4 * width * ring + found;
        pixel * self.pixels() + (4 * columns * fresh * block + self.threads * thread) as u64
    }
}
