//! Why a volume can't be analysed, and what that means for the process.

use std::error::Error as StdError;
use std::io;

use crate::base::{FaultKind, Interrupted};
use crate::volume;

/// Why a volume's slices could not be read.
#[derive(Debug, thiserror::Error)]
#[error("the volume can't be read")]
pub struct ReadFailure {
    /// What it means for the process.
    pub kind: FaultKind,
    /// The volume's own error.
    #[source]
    pub source: Box<dyn StdError + Send + Sync>,
}

impl From<volume::Error> for ReadFailure {
    fn from(source: volume::Error) -> Self {
        Self { kind: source.kind(), source: Box::new(source) }
    }
}

/// Why a volume could not be analysed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The threshold isn't a number that irradiance can be held against.
    #[error(
        "the threshold {0} W/m2 is not a finite number >= 0 that fits into float32: give one, such as 10"
    )]
    Threshold(f64),
    /// A sigma isn't usable.
    #[error(
        "sigma {value} along {axis} is not a finite number >= 0: give one, or 0 to leave the axis as it is"
    )]
    Sigma {
        /// Which axis: `t`, `y` or `x`.
        axis: char,
        /// What was given.
        value: f64,
    },
    /// Truncation isn't usable.
    #[error("truncate {0} is not a finite number >= 0: give one, such as 4")]
    Truncate(f64),
    /// A filter that reaches farther than any use has.
    #[error(
        "sigma {sigma} along {axis}, cut at {truncate} sigma, reaches over {radius} voxels, more than {limit}: give a smaller sigma or truncate"
    )]
    Radius {
        /// Which axis: `t`, `y` or `x`.
        axis: char,
        /// Standard deviation, voxels.
        sigma: f64,
        /// Where the filter ends, in sigmas.
        truncate: f64,
        /// The radius that follows, voxels.
        radius: f64,
        /// The largest that is allowed, voxels.
        limit: usize,
    },
    /// There is nothing to analyse, or more than numbers of the analysis can count.
    #[error(
        "the volume has {0} timesteps, {1} rows and {2} columns: at least 1 of each is needed, and at most {max_t} timesteps and {max_p} pixels",
        max_t = crate::base::limits::MAX_TIMESTEPS,
        max_p = crate::base::limits::MAX_VIEW_PIXELS
    )]
    Shape(usize, usize, usize),
    /// Segments must follow each other without gaps.
    #[error(
        "segment {index} covers timesteps {start} to {end} (exclusive), expected it to begin at {expected} and end after that within {timesteps} timesteps"
    )]
    Segments {
        /// Which segment, from 0; the number of segments if the last ones don't reach the end.
        index: usize,
        /// Its first timestep.
        start: usize,
        /// One past its last timestep.
        end: usize,
        /// Where it should begin.
        expected: usize,
        /// Timesteps of the volume.
        timesteps: usize,
    },
    /// A piece of another year than the session was begun with.
    #[error(
        "slices of a volume of {found:?} were handed to an analysis of {expected:?} (timesteps, rows, columns)"
    )]
    Source {
        /// The year's shape.
        expected: [usize; 3],
        /// The source's shape.
        found: [usize; 3],
    },
    /// A calendar that doesn't fit the volume.
    #[error("the volume's calendar has {found} entries for {timesteps} timesteps")]
    Calendar {
        /// How many there are.
        found: usize,
        /// How many are needed.
        timesteps: usize,
    },
    /// A voxel isn't a number.
    #[error(
        "voxel at timestep {timestep}, row {row}, column {column} is {value}, expected a finite irradiance: mend the volume, or analyse it as it is with --allow-nonfinite"
    )]
    NonFinite {
        /// Timestep, from 0.
        timestep: usize,
        /// Row, from 0 at the top.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// What was found.
        value: f32,
    },
    /// The memory limit doesn't even hold one step's window.
    #[error(
        "analysing {pixels} pixels with a window of {window} timesteps needs {needed_mib} MiB, the limit is {given_mib} MiB: raise --memory or lower sigma along t"
    )]
    Memory {
        /// Pixels of a slice.
        pixels: usize,
        /// Slices that the filter needs at once.
        window: usize,
        /// What would be enough, MiB.
        needed_mib: u64,
        /// The limit, MiB.
        given_mib: u64,
    },
    /// More glare events are alive at once, or were found, than the memory limit holds.
    #[error(
        "at timestep {timestep} the glare events take {found_mib} MiB, {allowed_mib} MiB are left for them: raise --memory, or the threshold"
    )]
    Events {
        /// Timestep, from 0.
        timestep: usize,
        /// What they take, MiB.
        found_mib: u64,
        /// What is left for them, MiB.
        allowed_mib: u64,
    },
    /// The volume can't be read.
    #[error(transparent)]
    Read(#[from] ReadFailure),
    /// The filtered volume can't be written.
    #[error("the filtered volume can't be written")]
    Filtered(#[source] io::Error),
    /// What doesn't fit into memory can't be put aside.
    #[error("glare events that don't fit into memory can't be written into a temporary file")]
    Spill(#[source] io::Error),
    /// The length of a timestep can't be right.
    #[error("the volume's time step is {0} h, expected more than 0 and at least a second")]
    Step(f64),
    /// The maps of the year can't be written.
    #[error("the maps of the year can't be written")]
    Maps(#[source] io::Error),
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl Error {
    /// What the error means for the process.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::Read(failure) => failure.kind,
            Self::Filtered(_) | Self::Spill(_) | Self::Events { .. } => FaultKind::Failed,
            Self::Interrupted(_) => FaultKind::Interrupted,
            _ => FaultKind::Input,
        }
    }
}
