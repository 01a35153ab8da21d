//! What a project says about a scene and its PV, before any file is opened.

use std::collections::BTreeMap;
use std::path::PathBuf;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::Season;

/// What to read, and where it lies: `[scene]` of the project file.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSpec {
    /// The files, in the order of the project; materials of one are known in those after it.
    pub files: Vec<SceneFile>,
    /// Diffuse reflectance of whatever the files say nothing about, 0..1.
    pub default_reflectance: f64,
    /// CityJSON: which level of detail; each object's highest if left out.
    pub lod: Option<String>,
    /// Coordinate reference system of map coordinates; taken from the files where they say.
    pub crs: Option<String>,
    /// True north in the files' coordinates, clockwise from the y axis, degrees. The scene is
    /// turned about the local origin so that afterwards +y is true north.
    pub north_deg: f64,
    /// Where `north_deg` isn't stated: latitude and longitude of the site, degrees, for which the
    /// map's projection says where true north lies.
    pub convergence_at: Option<[f64; 2]>,
    /// Diffuse reflectance by the name of a material; surfaces of city models have one named after
    /// what they are (`RoofSurface`).
    pub reflectance: BTreeMap<String, f64>,
    /// PV that no file has: its `[[pv]]` entry's name and where it stands.
    pub arrays: Vec<(String, PvArray)>,
    /// Crowns that let light through in some months.
    pub seasons: Vec<Season>,
    /// Which map coordinates become the local origin.
    pub origin: Origin,
}

impl SceneSpec {
    /// These files with every other setting left out.
    pub fn of(files: impl IntoIterator<Item = impl Into<PathBuf>>) -> Self {
        Self {
            files: files.into_iter().map(|path| SceneFile::new(path)).collect(),
            default_reflectance: 0.25,
            lod: None,
            crs: None,
            north_deg: 0.0,
            convergence_at: None,
            reflectance: BTreeMap::new(),
            arrays: Vec::new(),
            seasons: Vec::new(),
            origin: Origin::Auto,
        }
    }
}

/// One file of the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFile {
    /// Where it lies.
    pub path: PathBuf,
    /// Unit of its coordinates: m, cm, mm, km, in, ft. Needed for OBJ, PLY and STL, which don't
    /// say; metres for all others.
    pub unit: Option<String>,
    /// Which axis points up: z, y or x. Needed for OBJ, PLY and STL; y in glTF, z in all others.
    pub up: Option<String>,
}

impl SceneFile {
    /// A file in metres, z up.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), unit: None, up: None }
    }
}

/// Which map coordinates become the local origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// The middle of the city models' extent, in whole metres, at their lowest height rounded down;
    /// no move where coordinates are small already. Radiance files are local and stay.
    Auto,
    /// These map coordinates, m.
    At(DVec3),
}

/// One `[[pv]]` entry: which faces are PV.
#[derive(Clone, Debug, PartialEq)]
pub struct PvSpec {
    /// Its name.
    pub name: String,
    /// Which faces.
    pub select: Select,
    /// Whether the backs emit as well.
    pub two_sided: bool,
}

/// What objects of arrays are.
pub(super) const ARRAY_KIND: &str = "pv array";

/// PV on a flat roof or a field, where no panels are modelled: rows of modules.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PvArray {
    /// Outline seen from above, `[[x, y], …]`, m. Rows are cut at it.
    pub polygon: Vec<[f64; 2]>,
    /// Whether outline and height are local (the default) or the map's.
    #[serde(default, skip_serializing_if = "Coordinates::is_local")]
    pub coordinates: Coordinates,
    /// Angle between the modules' normal and the vertical, degrees.
    pub tilt_deg: f64,
    /// Compass direction that they face, degrees clockwise from true north.
    pub azimuth_deg: f64,
    /// Height of the rows' lower edge, m; in the same coordinates as the outline.
    pub height_m: f64,
    /// From the front of a row to the front of the next, seen from above, m.
    pub row_pitch_m: f64,
    /// Length of a row's modules along the slope, m.
    pub module_m: f64,
}

/// What points of the project are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Coordinates {
    /// Metres from the local origin, y to true north.
    #[default]
    Local,
    /// The map's.
    Map,
}

impl Coordinates {
    fn is_local(&self) -> bool {
        *self == Self::Local
    }
}

/// Conditions on a face; all that are given must match.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// Radiance: the modifier that the surface names.
    pub modifier: Option<String>,
    /// The material that it ends up with, through aliases and patterns.
    pub material: Option<String>,
    /// The object's id; its children count as it.
    pub object: Option<String>,
    /// What the source says it is: `RoofSurface`, `polygon`.
    pub surface: Option<String>,
    /// Least angle between the front's normal and the vertical, degrees (0 faces up, 90 is a wall).
    pub min_tilt_deg: Option<f64>,
    /// Largest such angle, degrees.
    pub max_tilt_deg: Option<f64>,
    /// Compass direction that the front faces, clockwise from north, from the first to the second
    /// value (`[315, 45]` is the north); horizontal faces have none and don't match.
    pub azimuth_deg: Option<[f64; 2]>,
    /// Drawn from above, `[[x, y], …]`, m: faces are cut at it, and what lies within is taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polygon: Option<Vec<[f64; 2]>>,
    /// Whether the polygon is local (the default) or the map's.
    #[serde(default, skip_serializing_if = "Coordinates::is_local")]
    pub coordinates: Coordinates,
}

impl PvSpec {
    /// The entry of an array: what [`SceneSpec::arrays`] adds under its name.
    pub fn of_array(name: &str, two_sided: bool) -> Self {
        let select = Select {
            object: Some(name.to_owned()),
            surface: Some(ARRAY_KIND.to_owned()),
            ..Select::default()
        };
        Self { name: name.to_owned(), select, two_sided }
    }
}

impl Select {
    /// Whether no condition is given.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}
