//! Words that every room uses: plain data without the behaviour of a room, and the seams
//! (small traits) through which rooms deliver to others that they don't know.

mod external_sort;
mod fault;
mod finding;
mod grid;
mod header;
mod irradiance;
pub mod limits;
pub mod morton;
mod photon;
mod progress;
mod rng;
mod seam;
mod space;
pub mod table;
mod tally;
mod time;
mod virtual_sensor;

pub use external_sort::{ExternalSort, Merged, Record};
pub use fault::FaultKind;
pub use finding::{Finding, Place, Severity};
pub use grid::{Grid, TileRect, Tiles, tiles};
pub use header::Provenance;
pub use irradiance::{Irradiance, MIN_COS};
pub use photon::Photon;
pub use progress::{Interrupted, Progress, Silent};
pub use rng::{Purpose, Stream};
pub use seam::{PhotonSink, SeriesEntry, SinkError, TileSink, checked_tile};
pub use space::{Aabb, Frame};
pub use tally::{Account, Fate, Tally};
pub use time::{MONTHS, SpectralBasis, Timeline, Timestep};
pub use virtual_sensor::{SensorSheet, VirtualSensor};
