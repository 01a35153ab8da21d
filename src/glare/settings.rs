use std::path::PathBuf;

use super::error::Error;
use super::filter::kernel::{Gaussian, Kernel};

/// Which voxels are neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub enum Connectivity {
    /// Those that share a face.
    #[default]
    Faces,
    /// Those that share a face or an edge.
    Edges,
    /// Those that share a face, an edge or a corner.
    Corners,
}

impl TryFrom<u32> for Connectivity {
    type Error = String;

    fn try_from(neighbours: u32) -> Result<Self, String> {
        let known = Self::from_neighbours(neighbours);
        known.ok_or_else(|| format!("expected 6, 18 or 26, found {neighbours}"))
    }
}

impl From<Connectivity> for u32 {
    fn from(connectivity: Connectivity) -> Self {
        connectivity.neighbours()
    }
}

impl Connectivity {
    /// From the number of neighbours that a voxel has: 6, 18 or 26.
    pub fn from_neighbours(neighbours: u32) -> Option<Self> {
        match neighbours {
            6 => Some(Self::Faces),
            18 => Some(Self::Edges),
            26 => Some(Self::Corners),
            _ => None,
        }
    }

    /// How far apart runs of voxels may lie along a row and still touch (0: they share a column): in
    /// neighbouring rows of one timestep, in the same row of neighbouring timesteps, and in
    /// neighbouring rows of neighbouring timesteps, where those can touch at all.
    pub(super) fn gaps(self) -> (u32, u32, Option<u32>) {
        match self {
            Self::Faces => (0, 0, None),
            Self::Edges => (1, 1, Some(0)),
            Self::Corners => (1, 1, Some(1)),
        }
    }

    /// Number of neighbours of a voxel.
    pub fn neighbours(self) -> u32 {
        match self {
            Self::Faces => 6,
            Self::Edges => 18,
            Self::Corners => 26,
        }
    }
}

/// What the analysis is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Glare is what lies strictly above it, after the filter, W/m2; rounded to float32.
    pub threshold: f64,
    /// Standard deviations of the Gaussian along t, y and x, voxels; 0 leaves an axis alone.
    pub sigma: [f64; 3],
    /// Where the Gaussian ends, in standard deviations.
    pub truncate: f64,
    /// Which voxels above the threshold belong to one event.
    pub connectivity: Connectivity,
    /// Analyse NaN and infinities as they are instead of refusing them.
    pub allow_nonfinite: bool,
    /// What the analysis may keep in memory, bytes.
    pub memory_bytes: u64,
    /// The folder for temporary files without a name, should the events not fit into memory.
    pub spill: PathBuf,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            threshold: 10.0,
            sigma: [1.0; 3],
            truncate: 4.0,
            connectivity: Connectivity::Faces,
            allow_nonfinite: false,
            memory_bytes: 1 << 30,
            spill: std::env::temp_dir(),
        }
    }
}

impl Settings {
    /// The threshold as it is compared.
    pub(super) fn threshold_f32(&self) -> Result<f32, Error> {
        comparable(self.threshold)
    }

    /// The filter along t, y and x.
    pub(super) fn gaussian(&self) -> Result<Gaussian, Error> {
        if !(self.truncate.is_finite() && self.truncate >= 0.0) {
            return Err(Error::Truncate(self.truncate));
        }
        let kernel = |axis, value| Kernel::gaussian(axis, value, self.truncate);
        let [t, y, x] = self.sigma;
        Ok(Gaussian { t: kernel('t', t)?, y: kernel('y', y)?, x: kernel('x', x)? })
    }
}

/// A threshold, W/m2, rounded to what it is compared with.
pub(super) fn comparable(threshold_w_m2: f64) -> Result<f32, Error> {
    let rounded = threshold_w_m2 as f32;
    let usable = threshold_w_m2 >= 0.0 && rounded.is_finite();
    if usable { Ok(rounded) } else { Err(Error::Threshold(threshold_w_m2)) }
}
