//! What is looked at, and who looks.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::tables::DayEntry;
use super::words::{ReceiversBy, ViewBy};
use crate::render::Kernel;
use crate::rules::Class;
use crate::site::Coordinates;

/// `[[view]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ViewTable {
    /// Names the folder of its results.
    pub name: String,
    /// Radiance's view options.
    pub view: Option<String>,
    /// A file that holds them.
    pub view_file: Option<PathBuf>,
    /// Points with normals instead of pixels, as `rtrace -I` takes them.
    pub sensors: Option<PathBuf>,
    /// `"map"` where the sensors' points are map coordinates; local if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<Coordinates>,
    /// `[columns, rows]`; sensors need none.
    pub size: Option<[usize; 2]>,
    /// How it is computed.
    #[serde(default)]
    pub estimator: ViewBy,
    /// Nearest photons of the annual map; 400 if left out.
    pub bandwidth: Option<usize>,
    /// Nearest photons of the time series; `max(4000, 3 * timesteps)` if left out.
    pub series_bandwidth: Option<usize>,
    /// Largest search radius, m; chosen from the store if left out.
    pub max_radius_m: Option<f32>,
    /// `"flat"` or `"epanechnikov"`: how the photons around a pixel are weighed; flat if left out.
    pub kernel: Option<Kernel>,
    /// Largest angle between the normals of pixel and photon, degrees; 60 if left out.
    pub normal_tolerance_deg: Option<f32>,
    /// How far a photon may lie off the pixel's plane, m; 0 for any distance; 0.25 if left out.
    pub plane_tolerance_m: Option<f32>,
    /// Whether the disc around a pixel ends at the edges of its surface and at walls; it does if
    /// left out.
    pub edges: Option<bool>,
    /// Whether `edges` and `plane_tolerance_m` hold for the time series, too: slower; they don't if
    /// left out.
    pub series_edges: Option<bool>,
    /// Analyse as rendered, keep no series.
    #[serde(default)]
    pub fuse: bool,
    /// Bits of mantissa that the series keeps, 1 to 23 (exact, if left out).
    pub series_mantissa_bits: Option<u32>,
    /// Whether the other irradiance (E_n beside E, or E beside E_n) gets a series and a peak, too.
    #[serde(default)]
    pub both_quantities: bool,
}

/// `[[observer]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ObserverTable {
    /// For tables and pictures.
    pub name: String,
    /// The eye, m.
    pub point: [f64; 3],
    /// Where it looks.
    pub direction: Option<[f64; 3]>,
    /// `"map"` where the point is in map coordinates; local if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<Coordinates>,
    /// `dwelling`, `office`, `outdoor`, `road`, …; every limit applies if left out.
    pub class: Option<Class>,
}

/// `[[region]]`: the faces of objects, a polygon in plan, or a polygon in a picture.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RegionTable {
    /// For tables and pictures.
    pub name: String,
    /// One object id or several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<Ids>,
    /// `[x, y]` in metres; with `view`: `[column, row]` in its pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polygon: Option<Vec<[f64; 2]>>,
    /// How high above the ground the polygon lies, m; on the ground if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// The picture in which the polygon is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
    /// `"map"` where the polygon is in map coordinates; local if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<Coordinates>,
    /// Distance between its points, m; 1 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// `dwelling`, `office`, `outdoor`, `road`, …; every limit applies if left out.
    pub class: Option<Class>,
}

/// `[receivers]`: how observers and regions are computed.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ReceiversTable {
    /// How they are computed.
    pub estimator: ReceiversBy,
}

/// `[[season]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SeasonTable {
    /// Name of the crowns' material.
    pub modifier: String,
    /// Share of the light that passes a crown, for each month from January.
    pub transmittance: Vec<f64>,
}

/// `[[moment]]`: a picture of luminances at an instant, for each material.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MomentTable {
    /// Names its files; made of date, time and view if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// `"06-11"`, or a day of the year from 0.
    pub date: DayEntry,
    /// `"08:30"`, local standard time, as all times of the project file.
    pub time: String,
    /// The name of a view, or Radiance's view options.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
    /// An observer's eye instead: a picture along its direction, and a fisheye for evalglare.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observer: Option<String>,
    /// `[columns, rows]`; that of the named view if left out. An observer's fisheye is a square of the
    /// longer edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[usize; 2]>,
}

/// `"ID"` or `["ID", "ID"]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected an object's id or a list of them")]
pub enum Ids {
    /// One.
    One(String),
    /// Several.
    Many(Vec<String>),
}

impl Ids {
    /// All of them.
    pub fn list(&self) -> &[String] {
        match self {
            Self::One(id) => std::slice::from_ref(id),
            Self::Many(ids) => ids,
        }
    }
}
