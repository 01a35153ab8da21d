//! The project file as it is written: every key, its default, and where a mistake is.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::Error;
use super::set::{Assignment, apply};
use crate::glare::rules::Class;
use crate::site::{PvArray, Select};

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
#[serde(untagged)]
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
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged)]
pub enum FileEntry {
    /// `"church.rad"`
    Path(PathBuf),
    /// `{ path = "terrain.obj", unit = "m", up = "z" }`
    Table {
        /// The file.
        path: PathBuf,
        /// `"m"`, `"mm"`, …
        unit: Option<String>,
        /// `"z"` or `"y"`.
        up: Option<String>,
    },
}

impl FileEntry {
    /// The file's path as written.
    pub fn path(&self) -> &Path {
        match self {
            Self::Path(path) | Self::Table { path, .. } => path,
        }
    }
}

/// Where the local origin lies.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(untagged)]
pub enum OriginEntry {
    /// `"auto"`
    Word(String),
    /// Map coordinates, m.
    At([f64; 3]),
}

impl Default for OriginEntry {
    fn default() -> Self {
        Self::Word("auto".into())
    }
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
    pub side: Option<crate::site::bsdf::Side>,
    /// Which light of the file: `"visible"` or `"solar"`; visible if it has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<crate::site::bsdf::Spectrum>,
    /// A model, where nothing was measured, or a preset: `"satinated"`, `{ preset = "tile" }`.
    #[serde(default, deserialize_with = "model")]
    pub model: Option<crate::site::bsdf::Model>,
}

fn model<'de, D: serde::Deserializer<'de>>(
    from: D,
) -> Result<Option<crate::site::bsdf::Model>, D::Error> {
    crate::site::bsdf::preset_or_model(from).map(Some)
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
    /// `"spa"`, `"gensky"`, `"gensky-2018"`.
    pub sun: String,
    /// `"clear-sky"`, `"gensky"`, `{ constant = 1000 }`, `{ model = "ineichen", linke = [...] }`.
    pub irradiance: toml::Value,
    /// Equation (1): half a year stands for the year.
    pub half_year: bool,
}

impl Default for TimeTable {
    fn default() -> Self {
        Self {
            year: 2025,
            days: DaysTable { from: DayEntry::Number(0), to: DayEntry::Number(364), step: 7 },
            hours: HoursTable { from: 0.0, to: 23.75, step: 0.25 },
            sun: "spa".into(),
            irradiance: toml::Value::String("clear-sky".into()),
            half_year: false,
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
#[serde(untagged)]
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
    /// `"all"` or `"diffuse"`.
    pub receivers: String,
}

impl Default for PhotonsTable {
    fn default() -> Self {
        Self {
            stored: 16_000_000,
            max_path_m: 100.0,
            bounces: 1,
            seed: 1,
            sun_visibility: true,
            receivers: "all".into(),
        }
    }
}

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
    pub coordinates: Option<String>,
    /// `[columns, rows]`; sensors need none.
    pub size: Option<[usize; 2]>,
    /// `"photons"`, `"radiance"` or `"direct"`.
    #[serde(default = "photons")]
    pub estimator: String,
    /// Nearest photons of the annual map.
    #[serde(default = "four_hundred")]
    pub bandwidth: usize,
    /// Nearest photons of the time series; `max(4000, 3 * timesteps)` if left out.
    pub series_bandwidth: Option<usize>,
    /// Largest search radius, m; chosen from the store if left out.
    pub max_radius_m: Option<f32>,
    /// `"flat"` or `"epanechnikov"`: how the photons around a pixel are weighed.
    #[serde(default = "flat")]
    pub kernel: String,
    /// Largest angle between the normals of pixel and photon, degrees.
    #[serde(default = "sixty")]
    pub normal_tolerance_deg: f32,
    /// How far a photon may lie off the pixel's plane, m; 0 for any distance.
    #[serde(default = "quarter_m")]
    pub plane_tolerance_m: f32,
    /// Whether the disc around a pixel ends at the edges of its surface and at walls.
    #[serde(default = "yes")]
    pub edges: bool,
    /// Whether `edges` and `plane_tolerance_m` hold for the time series, too: slower.
    #[serde(default)]
    pub series_edges: bool,
    /// Analyse as rendered, keep no series.
    #[serde(default)]
    pub fuse: bool,
    /// Bits of mantissa that the series keeps, 1 to 23 (exact).
    #[serde(default = "exact")]
    pub series_mantissa_bits: u32,
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
    pub coordinates: Option<String>,
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
    pub coordinates: Option<String>,
    /// Distance between its points, m; 1 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// `dwelling`, `office`, `outdoor`, `road`, …; every limit applies if left out.
    pub class: Option<Class>,
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
#[serde(untagged)]
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

/// `[glare]`
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct GlareTable {
    /// W/m2.
    pub thresholds_w_m2: Vec<f64>,
    /// `"surface"` (E) or `"normal"` (E_n, what an eye receives).
    pub quantity: String,
    /// Timesteps, rows, columns.
    pub sigma: [f64; 3],
    /// Of the Gaussian, in sigmas.
    pub truncate: f64,
    /// 6, 18 or 26.
    pub connectivity: u32,
    /// Profiles to judge by: ids of those that come with the program, or files that end in `.toml`,
    /// relative to the project's folder.
    pub rules: Vec<String>,
}

impl Default for GlareTable {
    fn default() -> Self {
        Self {
            thresholds_w_m2: vec![10.0, 30.0],
            quantity: "surface".into(),
            sigma: [1.0; 3],
            truncate: 4.0,
            connectivity: 6,
            rules: vec!["paper-2018".into()],
        }
    }
}

fn quarter() -> f64 {
    0.25
}

fn photons() -> String {
    "photons".into()
}

fn flat() -> String {
    "flat".into()
}

fn sixty() -> f32 {
    60.0
}

fn quarter_m() -> f32 {
    0.25
}

fn exact() -> u32 {
    crate::render::EXACT_BITS
}

fn yes() -> bool {
    true
}

fn four_hundred() -> usize {
    400
}

/// Reads a project. `path` is its folder or its `project.toml`; `set` overrides single keys.
///
/// # Errors
/// A missing file, text that isn't TOML, an unknown key (the nearest known one is named), a value
/// of the wrong kind: with line and column.
pub fn read(path: &Path, set: &[Assignment]) -> Result<(PathBuf, Project), Error> {
    let file = if path.is_dir() { path.join("project.toml") } else { path.to_owned() };
    let text = fs::read_to_string(&file).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => Error::NoProject { path: file.clone() },
        _ => Error::Read { path: file.clone(), source },
    })?;
    // The text as it stands first, so that line numbers in errors are those of the file.
    let mut project = parse(&file, &text)?;
    if !set.is_empty() {
        let changed = apply(&file, &text, set)?;
        // Lines of the changed text are nobody's lines.
        project = parse(&file, &changed).map_err(|error| match error {
            Error::Project { path, message, .. } => {
                let message = format!("with --set: {message}");
                Error::Project { path, line: 0, column: 0, message }
            }
            other => other,
        })?;
    }
    Ok((file, project))
}

fn parse(file: &Path, text: &str) -> Result<Project, Error> {
    toml::from_str(text).map_err(|e| {
        let (line, column) = e.span().map_or((0, 0), |span| place(text, span.start));
        Error::Project { path: file.to_owned(), line, column, message: with_nearest(e.message()) }
    })
}

fn place(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
    (line, column)
}

/// Serde says "unknown field `x`, expected one of `a`, `b`"; a user wants the nearest one first.
fn with_nearest(message: &str) -> String {
    let names: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if !message.starts_with("unknown ") {
        return message.to_owned();
    }
    let Some((found, known)) = names.split_first() else { return message.to_owned() };
    let nearest = known.iter().min_by_key(|k| strsim::damerau_levenshtein(found, k));
    match nearest {
        Some(nearest) => {
            format!(
                "unknown key `{found}`; did you mean `{nearest}`? (known: {})",
                known.join(", ")
            )
        }
        None => message.to_owned(),
    }
}
