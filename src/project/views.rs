//! What is looked at and how it is computed: a target times an estimator.
//!
//! Every view looks at something (the pixels of a [`Picture`], or [`Points`] in the scene) and is
//! computed somehow (from stored photons, or by integrating over the PV). The two are independent,
//! and each carries only what means something for it: points have no camera, direct integration has
//! no bandwidth. So there is no flag that has to be asked before a field may be read. All of it can
//! be serialised, because that is what the keys of the units hash ([`keys`](super::keys)).

use serde::Serialize;

use crate::render::sensors::Sensor;
use crate::render::{Gather, View};

pub use super::artifacts::RECEIVERS;

/// Photons of a series where nothing is said: as in the paper, 4,000 for 1,280 timesteps, so three
/// for each of more.
const SERIES_PHOTONS_PER_TIMESTEP: usize = 3;
const SERIES_PHOTONS: usize = 4000;

/// A view, or a set of points, and how it is computed.
#[derive(Clone, Debug)]
pub struct PlannedView {
    /// Names the folder of its results.
    pub name: String,
    /// What it looks at.
    pub target: Target,
    /// How irradiance is found there.
    pub estimator: Estimator,
    /// Which time series are kept.
    pub series: SeriesKept,
    /// Bits of mantissa that the numbers of its series have, kept or not.
    pub mantissa_bits: u32,
}

/// What is looked at.
#[expect(clippy::large_enum_variant, reason = "a project has a handful of views")]
#[derive(Clone, Debug, Serialize)]
pub enum Target {
    /// The pixels of a picture.
    Picture(Picture),
    /// Points in the scene; how many there are is known once they were looked up in it.
    Points(Points),
}

/// The camera of a view.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    /// Radiance's view options, as written.
    pub options: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// The same, ready to send rays.
    #[serde(skip)]
    pub view: View,
}

/// Where the points of a set come from.
#[derive(Clone, Debug, Serialize)]
pub enum Points {
    /// A file of `[[view]] sensors`.
    File {
        /// Hash of the file.
        hash: String,
        /// What it holds.
        #[serde(skip)]
        sensors: Vec<Sensor>,
        /// Whether that is in map coordinates.
        map: bool,
    },
    /// All `[[observer]]`s and `[[region]]`s.
    Receivers,
}

/// How irradiance is found.
#[derive(Clone, Copy, Debug, Serialize)]
pub enum Estimator {
    /// From the photons around each pixel or point.
    Photons(PhotonGather),
    /// By integration over the PV, without photons and without noise.
    Direct(Sight),
}

/// How photons are gathered for a view's maps and its series.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PhotonGather {
    /// For the annual map.
    pub annual: Gather,
    /// Photons for the series, where the project says how many.
    pub series_bandwidth: Option<usize>,
    /// Whether the discs of the series end where those of the annual map do.
    pub series_edges: bool,
}

/// What direct integration sees of PV and suns.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sight {
    /// Longest flight from the PV, m.
    pub max_path_m: f64,
    /// Whether the way from the PV to the sun must be free.
    pub sun_visibility: bool,
}

/// Which time series a view leaves on disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum SeriesKept {
    /// None (`fuse`): it is analysed while it is rendered.
    None,
    /// That of the quantity which is compared with the thresholds.
    One,
    /// That of the other irradiance as well (`both_quantities`).
    Both,
}

impl PlannedView {
    /// The camera; points have none.
    pub fn picture(&self) -> Option<&Picture> {
        match &self.target {
            Target::Picture(picture) => Some(picture),
            Target::Points(_) => None,
        }
    }

    /// Where its points come from; pictures have none.
    pub fn points(&self) -> Option<&Points> {
        match &self.target {
            Target::Picture(_) => None,
            Target::Points(points) => Some(points),
        }
    }

    /// How it gathers photons; `None` where it is integrated directly.
    pub fn photons(&self) -> Option<&PhotonGather> {
        match &self.estimator {
            Estimator::Photons(gather) => Some(gather),
            Estimator::Direct(_) => None,
        }
    }

    /// Whether it is integrated directly, without photons.
    pub fn is_direct(&self) -> bool {
        self.photons().is_none()
    }

    /// Whether it is analysed as it is rendered.
    pub fn is_fused(&self) -> bool {
        self.series == SeriesKept::None
    }

    /// The names that stand in its files for a material.
    pub fn about<'a>(&'a self, material: &'a str) -> [(&'static str, &'a str); 2] {
        [("material", material), ("view", &self.name)]
    }
}

impl PhotonGather {
    /// Photons for each pixel or point of a series of so many timesteps.
    pub fn series_bandwidth(&self, timesteps: usize) -> usize {
        self.series_bandwidth
            .unwrap_or_else(|| (SERIES_PHOTONS_PER_TIMESTEP * timesteps).max(SERIES_PHOTONS))
    }

    /// How a series of so many timesteps is gathered.
    pub fn series(&self, timesteps: usize) -> Gather {
        let gather = Gather { bandwidth: self.series_bandwidth(timesteps), ..self.annual };
        if self.series_edges { gather } else { gather.open() }
    }
}
