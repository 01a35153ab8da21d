//! All numbers of a volume, gone through in bounded memory: their range, each pixel's peak, and
//! whether what lies on disk is what was written.

use std::ops::Range;

use rayon::prelude::*;

use super::Error;
use super::read::{Source, Volume, number_from};
use super::tiles::{Scratch, Tiles};
use crate::base::limits::TILE_EDGE;
use crate::base::{Grid, Progress};

/// Bytes of slices that are read at a time.
const READ_BYTES: usize = 64 << 20;

/// What one finds who reads all numbers of a volume.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Survey {
    /// Least of the finite numbers, W/m2.
    pub min_w_m2: f32,
    /// Greatest of the finite numbers, W/m2.
    pub max_w_m2: f32,
    /// Numbers that are not 0.
    pub nonzero: u64,
    /// Numbers that are not finite.
    pub nonfinite: u64,
}

impl Survey {
    const NOTHING: Self =
        Self { min_w_m2: f32::INFINITY, max_w_m2: f32::NEG_INFINITY, nonzero: 0, nonfinite: 0 };

    fn of(numbers: &[f32]) -> Self {
        numbers.iter().fold(Self::NOTHING, |mut s, &value| {
            if value.is_finite() {
                s.min_w_m2 = s.min_w_m2.min(value);
                s.max_w_m2 = s.max_w_m2.max(value);
            } else {
                s.nonfinite += 1;
            }
            s.nonzero += u64::from(value != 0.0);
            s
        })
    }

    fn and(self, other: Self) -> Self {
        Self {
            min_w_m2: self.min_w_m2.min(other.min_w_m2),
            max_w_m2: self.max_w_m2.max(other.max_w_m2),
            nonzero: self.nonzero + other.nonzero,
            nonfinite: self.nonfinite + other.nonfinite,
        }
    }
}

impl Volume {
    /// Reads all numbers, in bounded memory.
    ///
    /// # Errors
    /// Damaged or lost parts; the user's wish to stop.
    pub fn survey(&self, progress: &dyn Progress) -> Result<Survey, Error> {
        let mut all = Survey::NOTHING;
        self.for_each_part("looking through the volume", self.all(), progress, |numbers| {
            let part = numbers.par_chunks(1 << 16).map(Survey::of);
            all = all.and(part.reduce(|| Survey::NOTHING, Survey::and));
            Ok(())
        })?;
        if all.min_w_m2 > all.max_w_m2 {
            // Not one finite number.
            (all.min_w_m2, all.max_w_m2) = (0.0, 0.0);
        }
        Ok(all)
    }

    /// The greatest irradiance of each pixel over all timesteps, W/m2, in bounded memory.
    ///
    /// # Errors
    /// Damaged or lost parts; the user's wish to stop.
    pub fn peak(&self, progress: &dyn Progress) -> Result<Grid<f32>, Error> {
        let [_, rows, columns] = self.shape();
        let mut peak = Grid::filled(columns, rows, 0.0f32);
        self.for_each_part("peak of the volume", self.all(), progress, |numbers| {
            for slice in numbers.chunks_exact(rows * columns) {
                let pairs = peak.data_mut().par_iter_mut().zip(slice);
                pairs.with_min_len(1 << 16).for_each(|(peak, &value)| *peak = peak.max(value));
            }
            Ok(())
        })?;
        Ok(peak)
    }

    fn all(&self) -> Range<usize> {
        0..self.shape()[0]
    }

    /// Hands the slices of `range` on, in order and some at a time.
    pub(super) fn for_each_part(
        &self,
        what: &str,
        range: Range<usize>,
        progress: &dyn Progress,
        each: impl FnMut(&[f32]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.for_each_part_of(READ_BYTES, what, range, progress, each)
    }

    fn for_each_part_of(
        &self,
        bytes: usize,
        what: &str,
        range: Range<usize>,
        progress: &dyn Progress,
        mut each: impl FnMut(&[f32]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let [_, rows, columns] = self.shape();
        let pixels = rows * columns;
        let unit = self.chunk_timesteps();
        let step = (bytes / 4 / pixels / unit).max(1) * unit;
        let mut numbers = vec![0.0; step.min(range.len()) * pixels];
        progress.begin(what, range.len() as u64, "timesteps");
        let mut first = range.start;
        while first < range.end {
            progress.check()?;
            // Parts end where chunks end, also where the first began inside one.
            let last = (first / unit * unit + step).min(range.end);
            let part = &mut numbers[..(last - first) * pixels];
            self.read(first..last, part)?;
            each(part)?;
            progress.advance((last - first) as u64);
            first = last;
        }
        progress.finish();
        Ok(())
    }

    /// Reads everything and says what is damaged or lost; empty where nothing is. Findings don't
    /// stop it. An `.npy` file has no checksums: its length alone was checked when it was opened.
    ///
    /// # Errors
    /// The user's wish to stop.
    pub fn verify(&self, progress: &dyn Progress) -> Result<Vec<String>, Error> {
        let Source::Zarr(tiles) = &self.source else { return Ok(Vec::new()) };
        let count = tiles.tiling.tiles.count();
        progress.begin("checking the volume", count as u64, "tiles");
        let findings: Vec<Vec<String>> = (0..count)
            .into_par_iter()
            .map(|number| {
                progress.check()?;
                let found = self.verify_tile(tiles, number);
                progress.advance(1);
                found
            })
            .collect::<Result<_, Error>>()?;
        progress.finish();
        Ok(findings.into_iter().flatten().collect())
    }

    fn verify_tile(&self, tiles: &Tiles, number: usize) -> Result<Vec<String>, Error> {
        let mut findings = Vec::new();
        let mut scratch = Scratch::new(self.path())?;
        let mut nonzero = 0u64;
        let tile = tiles.tiling.tiles.rect(number);
        for chunk in 0..tiles.tiling.chunks() {
            let timesteps = tiles.tiling.chunk_timesteps(chunk);
            let seen = tiles.decode(number, chunk..chunk + 1, &mut scratch, |_, plain| {
                let slices = plain.chunks_exact(TILE_EDGE * TILE_EDGE * 4).take(timesteps.len());
                let rows = slices.flat_map(|s| s.chunks_exact(TILE_EDGE * 4).take(tile.rows));
                let numbers = rows.flat_map(|r| r.chunks_exact(4).take(tile.columns));
                nonzero += numbers.filter(|b| number_from(b) != 0.0).count() as u64;
            });
            match seen {
                Ok(()) => {}
                Err(error @ Error::Chunk { .. }) => findings.push(error.to_string()),
                Err(error) => {
                    // The whole tile can't be read: the same would be said for each chunk.
                    findings.push(chain(&error));
                    return Ok(findings);
                }
            }
        }
        let expected = tiles.records().map(|records| records[number].nonzero);
        if let Some(expected) = expected.filter(|&e| e != nonzero && findings.is_empty()) {
            findings.push(format!(
                "{}: tile {number}: expected {expected} numbers that are not 0, found {nonzero}",
                self.path().display()
            ));
        }
        Ok(findings)
    }
}

fn chain(error: &Error) -> String {
    match std::error::Error::source(error) {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use glintmap_formats::npy;

    use super::super::import_npy;
    use super::*;
    use crate::base::Irradiance;
    use crate::base::Silent;

    #[test]
    fn the_parts_are_the_whole_whatever_their_size() {
        let folder = tempfile::tempdir().expect("folder");
        let shape = [53, 3, 40];
        let numbers: Vec<f32> = (0u16..53 * 120).map(f32::from).collect();
        let path = folder.path().join("a.npy");
        npy::write(&path, &shape, &numbers).expect("writes");
        let flat = Volume::open(&path).expect("opens");
        let path = folder.path().join("a.zarr");
        import_npy(&flat, None, Irradiance::Surface, &path, &Silent).expect("imports");
        let ours = Volume::open(&path).expect("opens");
        for volume in [&flat, &ours] {
            for bytes in [1, 480, 3 * 480, 16 * 480, 40 * 480, 1 << 20] {
                for range in [0..53, 5..53, 16..17, 20..40] {
                    let mut parts = Vec::new();
                    let each = |part: &[f32]| {
                        let most = (bytes / 4).max(volume.chunk_timesteps() * 120);
                        assert!(part.len() <= most, "{} numbers, {most} allowed", part.len());
                        parts.extend_from_slice(part);
                        Ok(())
                    };
                    let result = volume.for_each_part_of(bytes, "", range.clone(), &Silent, each);
                    result.expect("reads");
                    assert!(parts == numbers[range.start * 120..range.end * 120], "{range:?}");
                }
            }
        }
    }
}
