use std::ops::Range;

use super::error::{Error, ReadFailure};
use crate::base::limits::{MAX_TIMESTEPS, MAX_VIEW_PIXELS};
use crate::volume::Volume;

/// What a volume knows of its timesteps' place in the year.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calendar {
    /// Day of year of each timestep, 0 is 1 January; the days of one day follow each other.
    pub day: Vec<u32>,
    /// How many hours of the year each timestep stands for, h.
    pub weight_h: Vec<f64>,
}

/// A time series that is read slice by slice: irradiance in W/m2, `[timestep, row, column]`,
/// chronological, row 0 at the top.
pub trait Slices: Sync {
    /// Timesteps, rows and columns.
    fn shape(&self) -> [usize; 3];

    /// Fills `out`, `[timestep, row, column]`, with the picked `rows` of the slices of `range`.
    /// Rows begin at a multiple of 32 and end at one, or at the bottom.
    ///
    /// The room may have been used before. `lit` has an entry for each slice and each tile of
    /// 32 x 32 pixels of those rows, `[slice, tile row, tile column]`: on
    /// entry `false` says that `out` is all +0 there, on return that the volume is. A volume that
    /// can't tell says `true` everywhere.
    ///
    /// # Errors
    /// Whatever keeps the volume from being read.
    fn read_lit(
        &self,
        range: Range<usize>,
        rows: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure>;

    /// How many timesteps are best read at once, beginning at a multiple of that number.
    fn chunk_timesteps(&self) -> usize {
        1
    }

    /// Days and weights of the timesteps, where the volume knows them.
    fn calendar(&self) -> Option<Calendar> {
        None
    }
}

/// A shape that numbers of the analysis can count.
pub(super) fn checked(shape: [usize; 3]) -> Result<[usize; 3], Error> {
    let [timesteps, rows, columns] = shape;
    let pixels = rows.checked_mul(columns);
    let fits = pixels.is_some_and(|p| (1..=MAX_VIEW_PIXELS).contains(&p))
        && (1..=MAX_TIMESTEPS).contains(&timesteps);
    if fits { Ok(shape) } else { Err(Error::Shape(timesteps, rows, columns)) }
}

impl Slices for Volume {
    fn shape(&self) -> [usize; 3] {
        Volume::shape(self)
    }

    fn read_lit(
        &self,
        range: Range<usize>,
        rows: Range<usize>,
        out: &mut [f32],
        lit: &mut [bool],
    ) -> Result<(), ReadFailure> {
        Ok(self.read_rows(range, rows, out, lit)?)
    }

    fn chunk_timesteps(&self) -> usize {
        Volume::chunk_timesteps(self)
    }

    fn calendar(&self) -> Option<Calendar> {
        let axis = self.axis()?;
        Some(Calendar { day: axis.day.clone(), weight_h: axis.weight_h.clone() })
    }
}
