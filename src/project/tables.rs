//! The project file as it is written: every key, its default, and where a mistake is.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::view_tables::{
    MomentTable, ObserverTable, ReceiversTable, RegionTable, SeasonTable, ViewTable,
};
use super::words::{SunStrength, SunStrengthTable, Unit, Up, WordOr};
use crate::base::Irradiance;
use crate::glare::{self, Connectivity};
use crate::site::{PvArray, Select};
use crate::sky::SunModel;
use crate::trace::Receivers;

/// `project.toml`, key by key. See the example projects under `fixtures/projects`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Project {
    /// Where the site lies.
    pub site: SiteTable,
    /// What stands there.
    pub scene: SceneTable,
    /// Which of it is PV.
    pub pv: Vec<PvTable>,
    /// The candidates: one run for each, on all PV.
    #[serde(default)]
    pub material: Vec<MaterialTable>,
    /// Candidates that mix materials.
    #[serde(default)]
    pub case: Vec<CaseTable>,
    /// What the ratio maps divide by.
    pub reference: Option<ReferenceTable>,
    /// Which instants of the year.
    #[serde(default)]
    pub time: TimeTable,
    /// How many photons, how far.
    #[serde(default)]
    pub photons: PhotonsTable,
    /// The pictures.
    #[serde(default)]
    pub view: Vec<ViewTable>,
    /// People.
    #[serde(default)]
    pub observer: Vec<ObserverTable>,
    /// Façades, roads, plots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub region: Vec<RegionTable>,
    /// How observers and regions are computed; as the first picture if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub receivers: Option<ReceiversTable>,
    /// Crowns that let light through in some months.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub season: Vec<SeasonTable>,
    /// Luminance pictures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moment: Vec<MomentTable>,
    /// How glare is judged.
    #[serde(default)]
    pub glare: GlareTable,
}

/// `[site]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SiteTable {
    /// For titles.
    pub name: String,
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// Degrees east, of the zone's standard time.
    pub meridian: f64,
    /// IANA name, for every time that people read; the standard time of the meridian if left out.
    pub timezone: Option<String>,
    /// Above the sea, m.
    #[serde(default)]
    pub elevation_m: f64,
    /// Ridges beyond the scene: a file of azimuths and altitudes, or pairs of them, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizon: Option<HorizonEntry>,
}

/// Where the far horizon comes from.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected a file or [[azimuth, altitude], …]")]
pub enum HorizonEntry {
    /// `"horizon.csv"`, beside the project file.
    File(PathBuf),
    /// `[[0, 2.5], [90, 4], …]`: azimuth clockwise from north and altitude, degrees.
    Points(Vec<[f64; 2]>),
}

/// `[scene]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SceneTable {
    /// The files, relative to the project's folder.
    pub files: Vec<FileEntry>,
    /// Of whatever has no material of its own.
    #[serde(default = "quarter")]
    pub default_reflectance: f64,
    /// CityJSON: which level of detail; the highest if left out.
    pub lod: Option<String>,
    /// Of map coordinates; taken from the files where they say.
    pub crs: Option<String>,
    /// True north, clockwise from the y axis, degrees. Left out, the projection of the map says it,
    /// where the scene has one.
    pub north_deg: Option<f64>,
    /// Diffuse reflectance by material; city models name theirs after the surface type.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub reflectance: BTreeMap<String, f64>,
    /// `"auto"` or `[x, y, z]`.
    #[serde(default)]
    pub origin: OriginEntry,
}

/// A scene file: its path, or a table with its unit and up axis.
pub type FileEntry = WordOr<PathBuf, FileTable>;

/// `{ path = "terrain.obj", unit = "m", up = "z" }`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FileTable {
    /// The file.
    pub path: PathBuf,
    /// Of its coordinates.
    pub unit: Option<Unit>,
    /// Which axis points up.
    pub up: Option<Up>,
}

impl FileEntry {
    /// The file's path as written.
    pub fn path(&self) -> &Path {
        let (Self::Word(path) | Self::Table(FileTable { path, .. })) = self;
        path
    }

    /// The same file, called by its name wherever it lies.
    pub fn without_folder(&self) -> Self {
        let mut entry = self.clone();
        let (Self::Word(path) | Self::Table(FileTable { path, .. })) = &mut entry;
        *path = path.file_name().unwrap_or_default().into();
        entry
    }
}

/// Where the local origin lies.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected \"auto\" or [x, y, z]")]
pub enum OriginEntry {
    /// `"auto"`
    Word(Auto),
    /// Map coordinates, m.
    At([f64; 3]),
}

impl Default for OriginEntry {
    fn default() -> Self {
        Self::Word(Auto::Auto)
    }
}

/// `"auto"`
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Auto {
    /// From the scene.
    Auto,
}

/// `[[pv]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PvTable {
    /// Its name in tables and reports.
    pub name: String,
    /// Which surfaces of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub select: Option<Select>,
    /// Rows of modules that no file of the scene holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<PvArray>,
    /// Whether the back reflects as well.
    #[serde(default)]
    pub two_sided: bool,
}

/// `[[material]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    /// Names the folder of its results.
    pub name: String,
    /// A measured BSDF.
    pub bsdf: Option<PathBuf>,
    /// Which side of the file is PV: `"front"` (Radiance's, WINDOW's `Reflection Back`; the
    /// default) or `"back"`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub side: Option<crate::bsdf::Side>,
    /// Which light of the file: `"visible"` or `"solar"`; visible if it has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<crate::bsdf::Spectrum>,
    /// A model, where nothing was measured, or a preset: `"satinated"`, `{ preset = "tile" }`.
    #[serde(default, deserialize_with = "model")]
    pub model: Option<crate::bsdf::Model>,
}

fn model<'de, D: serde::Deserializer<'de>>(
    from: D,
) -> Result<Option<crate::bsdf::Model>, D::Error> {
    crate::bsdf::preset_or_model(from).map(Some)
}

/// `[[case]]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CaseTable {
    /// Names the folder of its results.
    pub name: String,
    /// Material by `[[pv]]` name.
    pub assign: BTreeMap<String, String>,
}

/// `[reference]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceTable {
    /// One of the materials.
    pub material: String,
}

/// `[time]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimeTable {
    /// Never today's: results must not change overnight.
    pub year: i32,
    /// Days of the year; 0 is 1 January.
    pub days: DaysTable,
    /// Hours of the day, local standard time.
    pub hours: HoursTable,
    /// Which formulas say where the sun stands.
    pub sun: SunModel,
    /// How strong it is.
    pub irradiance: WordOr<SunStrength, SunStrengthTable>,
    /// Equation (1): half a year stands for the year.
    pub half_year: bool,
    /// Stretches of `hours` with finer steps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub finer: Vec<HoursTable>,
}

impl Default for TimeTable {
    fn default() -> Self {
        Self {
            year: 2025,
            days: DaysTable { from: DayEntry::Number(0), to: DayEntry::Number(364), step: 7 },
            hours: HoursTable { from: 0.0, to: 23.75, step: 0.25 },
            sun: SunModel::Spa,
            irradiance: WordOr::Word(SunStrength::ClearSky),
            half_year: false,
            finer: Vec::new(),
        }
    }
}

/// `days = { from = 0, to = 364, step = 7 }`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DaysTable {
    /// First day.
    pub from: DayEntry,
    /// Last day, included.
    pub to: DayEntry,
    /// In days.
    pub step: u32,
}

/// A day as a number from 0 or as a date `"06-11"`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected a day of the year (0 is 1 January) or a date \"MM-DD\"")]
pub enum DayEntry {
    /// 0 is 1 January.
    Number(u32),
    /// Month and day.
    Date(String),
}

/// `hours = { from = 4.5, to = 20.5, step = 0.25 }`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HoursTable {
    /// First hour.
    pub from: f64,
    /// Last hour, included.
    pub to: f64,
    /// In hours.
    pub step: f64,
}

/// `[photons]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhotonsTable {
    /// Target number of stored photons, per material.
    pub stored: u64,
    /// Longest flight from the PV, m.
    pub max_path_m: f64,
    /// 1: the PV's scattering only.
    pub bounces: u32,
    /// Of the counter-based sampling.
    pub seed: u64,
    /// `false` lets the sun through everything on its way to the PV, for comparison.
    pub sun_visibility: bool,
    /// Which surfaces keep photons.
    pub receivers: Receivers,
}

impl Default for PhotonsTable {
    fn default() -> Self {
        Self {
            stored: 16_000_000,
            max_path_m: 100.0,
            bounces: 1,
            seed: 1,
            sun_visibility: true,
            receivers: Receivers::All,
        }
    }
}

/// `[glare]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlareTable {
    /// W/m2.
    pub thresholds_w_m2: Vec<f64>,
    /// On the surface (E) or facing the beam (E_n, what an eye receives).
    pub quantity: Irradiance,
    /// Timesteps, rows, columns.
    pub sigma: [f64; 3],
    /// Of the Gaussian, in sigmas.
    pub truncate: f64,
    /// 6, 18 or 26 neighbours.
    pub connectivity: Connectivity,
    /// Profiles to judge by: ids of those that come with the program, or files that end in `.toml`,
    /// relative to the project's folder.
    pub rules: Vec<String>,
}

impl Default for GlareTable {
    fn default() -> Self {
        let glare::Settings { sigma, truncate, connectivity, .. } = glare::Settings::default();
        Self {
            thresholds_w_m2: vec![10.0, 30.0],
            quantity: Irradiance::Surface,
            sigma,
            truncate,
            connectivity,
            rules: vec!["paper-2018".into()],
        }
    }
}

fn quarter() -> f64 {
    0.25
}
