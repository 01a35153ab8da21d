//! New projects: the built-in case study, and one for a site of one's own.

use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};

use glam::DVec3;
use glintmap_formats::seal;
use serde::Serialize;

use super::artifacts::SITE_PLAN;
use super::error::Error;
use super::places::Mistakes;
use super::set;
use crate::site::{Loaded, PvSpec, SceneFile, SceneSpec, Select, Site};
use crate::sky::Place;

/// How carefully the case study is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// 200 thousand photons a material: minutes, to look around.
    Draft,
    /// 16 million photons a material.
    Standard,
    /// 250 million photons a material, as in the paper: hours.
    Paper,
}

impl Quality {
    /// All qualities with their names on the command line.
    pub const ALL: [(&'static str, Self); 3] =
        [("draft", Self::Draft), ("standard", Self::Standard), ("paper", Self::Paper)];
}

/// The case study's files by name, as the generator in tools/ wrote them.
const CASE_STUDY: &[(&str, &str)] = &[
    ("church.rad", include_str!("../../fixtures/projects/case-study/church.rad")),
    ("houses.rad", include_str!("../../fixtures/projects/case-study/houses.rad")),
    ("pv.rad", include_str!("../../fixtures/projects/case-study/pv.rad")),
    ("terrain.rad", include_str!("../../fixtures/projects/case-study/terrain.rad")),
    ("trees.rad", include_str!("../../fixtures/projects/case-study/trees.rad")),
];
const CASE_STUDY_PROJECT: &str = include_str!("../../fixtures/projects/case-study/project.toml");

/// The case study in a folder.
#[derive(Clone, Debug)]
pub struct Demo {
    /// The project's folder.
    pub folder: PathBuf,
}

/// Writes the built-in case study into `folder` as an ordinary project. Where the same files
/// already lie there, nothing changes, so that a run of it resumes.
///
/// # Errors
/// [`Error::InTheWay`] when the folder holds something else.
pub fn demo(folder: &Path, quality: Quality) -> Result<Demo, Error> {
    let settings: &[&str] = match quality {
        Quality::Draft => &[
            "photons.stored=200000",
            "view.plan.size=[250, 250]",
            "view.plan.bandwidth=50",
            "view.plan.series_bandwidth=1000",
            "view.panorama.size=[500, 125]",
            "view.panorama.bandwidth=50",
            "view.panorama.series_bandwidth=1000",
        ],
        Quality::Standard => &["photons.stored=16000000"],
        Quality::Paper => &["photons.stored=250000000"],
    };
    let assignments: Vec<set::Assignment> = settings
        .iter()
        .map(|text| text.parse().map_err(|e| Error::Unsupported(format!("built-in {text}: {e}"))))
        .collect::<Result<_, _>>()?;
    let file = folder.join("project.toml");
    let (project, _) = set::apply(&file, CASE_STUDY_PROJECT, &assignments)?;
    let mut all: Vec<(&str, &str)> = CASE_STUDY.to_vec();
    all.push(("project.toml", &project));
    let foreign = || Error::InTheWay { path: folder.to_owned() };
    if folder.exists() {
        let strangers =
            fs::read_dir(folder).map_err(|_| foreign())?.filter_map(Result::ok).any(|e| {
                e.file_name() != "run"
                    && e.file_name() != SITE_PLAN
                    && !all.iter().any(|(n, _)| e.file_name() == **n)
            });
        if strangers {
            return Err(foreign());
        }
    }
    fs::create_dir_all(folder)
        .map_err(|source| Error::Write { path: folder.to_owned(), source })?;
    for (name, text) in all {
        let path = folder.join(name);
        if fs::read(&path).is_ok_and(|found| found == text.as_bytes()) {
            continue;
        }
        if path.exists() && name != "project.toml" {
            return Err(foreign());
        }
        seal::write_bytes(&path, text.as_bytes())
            .map_err(|source| Error::Write { path, source })?;
    }
    Ok(Demo { folder: folder.to_owned() })
}

/// Where a new project's site lies.
#[derive(Clone, Debug)]
pub struct SiteAt {
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// Degrees east, of the zone's standard time.
    pub meridian: f64,
}

impl SiteAt {
    fn check(&self, path: &Path) -> Result<(), Error> {
        let place = Place {
            latitude_deg: self.latitude,
            longitude_deg: self.longitude,
            meridian_deg: self.meridian,
            elevation_m: 0.0,
        };
        match place.mistakes().first() {
            None => Ok(()),
            Some(wrong) => Err(Mistakes::nowhere(path.to_owned(), wrong.to_string()).into()),
        }
    }
}

/// What a new project's scene is.
#[derive(Clone, Debug)]
pub struct NewScene {
    /// Its files, with unit and up axis where their format doesn't say them.
    pub files: Vec<SceneFile>,
    /// True north, clockwise from the files' y axis, degrees, where it is stated.
    pub north_deg: Option<f64>,
    /// Which faces are PV.
    pub select: Select,
}

/// Writes a project for a site of one's own, with a plan view and a panorama that fit, and
/// returns the scene that it read for that.
///
/// # Errors
/// When the scene can't be read, the selector selects nothing, or the folder holds a project.
pub fn create(folder: &Path, new: &NewScene, at: &SiteAt) -> Result<Loaded, Error> {
    let path = folder.join("project.toml");
    if path.exists() {
        return Err(Error::InTheWay { path });
    }
    at.check(&path)?;
    let scene = SceneSpec {
        files: new.files.clone(),
        north_deg: new.north_deg.unwrap_or(0.0),
        convergence_at: new.north_deg.is_none().then_some([at.latitude, at.longitude]),
        ..SceneSpec::of(Vec::<PathBuf>::new())
    };
    let pv = PvSpec { name: "pv".into(), select: new.select.clone(), two_sided: false };
    let loaded = crate::site::load(&scene, &[pv])?;
    fs::create_dir_all(folder)
        .map_err(|source| Error::Write { path: folder.to_owned(), source })?;
    let text = project_text(folder, new, at, &loaded.site)?;
    seal::write_bytes(&path, text.as_bytes()).map_err(|source| Error::Write { path, source })?;
    Ok(loaded)
}

fn project_text(folder: &Path, new: &NewScene, at: &SiteAt, site: &Site) -> Result<String, Error> {
    let fit = Fit::around(site);
    let list =
        new.files.iter().map(|f| entry(f, folder)).collect::<Result<Vec<_>, _>>()?.join(", ");
    let north = match new.north_deg {
        Some(deg) => format!("north_deg = {deg:?}   # true north, clockwise from the y axis\n"),
        None => String::new(),
    };
    let name =
        folder.file_name().map_or_else(|| "site".to_owned(), |n| n.to_string_lossy().into_owned());
    let c = fit.center;
    let mut text = String::new();
    // Writing into a String can't fail.
    let _ = write!(
        text,
        r#"# A glintmap project. `glintmap check .` says what was understood, `glintmap plan .` what
# a run will cost, `glintmap run .` runs it.

[site]
name = {name:?}
latitude = {lat}    # degrees north
longitude = {lon}   # degrees east
meridian = {mer}    # degrees east, of the zone's standard time
# timezone = "Europe/Zurich"   # for every time that people read

[scene]
files = [{list}]
default_reflectance = 0.25
{north}
[[pv]]
name = "pv"
select = {{ {select} }}

# The candidates. Replace them by what is planned; each gets its own folder under run/.
[[material]]
name = "standard"     # smooth glass over dark cells
model = {{ kind = "pv-glass", index = 1.52, ggx_alpha = 0.05, cell_reflectance = 0.04 }}

[[material]]
name = "satinated"    # deeply textured glass
model = {{ kind = "pv-glass", index = 1.52, ggx_alpha = 0.3, cell_reflectance = 0.04 }}

[[material]]
name = "tile"         # today's roof
model = {{ kind = "lambertian", reflectance = 0.25 }}

[reference]
material = "tile"     # the ratio maps divide by it

[time]
year = 2025
# Every 7th day; durations per day are right, hours per year are good to a few per cent.
# step = 1 computes every day: about 7 times the suns, and as many more photons to be as smooth.
days = {{ from = 0, to = 364, step = 7 }}
hours = {{ from = 0.0, to = 23.75, step = 0.25 }}
sun = "spa"
irradiance = "clear-sky"

[photons]
stored = 16_000_000   # per material; 200_000 gives a draft in a minute or two
max_path_m = {path}     # the extent of the scene; 100 is the usual limit of dwelling zones

[[view]]
name = "plan"
view = "-vtl -vp {x} {y} {top} -vd 0 0 -1 -vu 0 1 0 -vh {width} -vv {width}"
size = [1000, 1000]

[[view]]
name = "panorama"     # from above the PV; south in the centre, west to the right
view = "-vtc -vp {x} {y} {eye} -vd 0 -1 0 -vu 0 0 1 -vh 360 -vv 76 -vo {fore}"
size = [2000, 500]

# Who is concerned: points and façades, told of one by one in the report.
# [[observer]]
# name = "Bedroom window"
# point = [20.0, 5.0, 6.5]        # metres from the local origin
# direction = [-1.0, 0.0, 0.0]    # where it looks; left out: to the PV
# class = "dwelling"
#
# [receivers]
# estimator = "direct"            # integrated, without noise; left out: as the first view

[glare]
thresholds_w_m2 = [10.0, 30.0]
rules = ["paper-2018"]
"#,
        lat = at.latitude,
        lon = at.longitude,
        mer = at.meridian,
        select = select_text(&new.select),
        path = fit.max_path_m,
        x = c.x.round(),
        y = c.y.round(),
        top = fit.top_m,
        width = fit.width_m,
        eye = fit.eye_m,
        fore = fit.fore_m,
    );
    Ok(text)
}

/// A scene file as the project names it.
fn entry(file: &SceneFile, folder: &Path) -> Result<String, Error> {
    let path = format!("{:?}", relative(&file.path, folder)?.to_string_lossy());
    if file.unit.is_none() && file.up.is_none() {
        return Ok(path);
    }
    let said = [("unit", &file.unit), ("up", &file.up)].into_iter();
    let said = said.filter_map(|(key, word)| Some(format!(", {key} = {:?}", word.as_ref()?)));
    Ok(format!("{{ path = {path}{} }}", said.collect::<String>()))
}

fn select_text(select: &Select) -> String {
    let mut parts = Vec::new();
    let texts = [
        ("modifier", &select.modifier),
        ("material", &select.material),
        ("object", &select.object),
        ("surface", &select.surface),
    ];
    for (key, value) in texts {
        if let Some(value) = value {
            parts.push(format!("{key} = {value:?}"));
        }
    }
    for (key, value) in
        [("min_tilt_deg", select.min_tilt_deg), ("max_tilt_deg", select.max_tilt_deg)]
    {
        if let Some(value) = value {
            parts.push(format!("{key} = {value:?}"));
        }
    }
    if let Some([from, to]) = select.azimuth_deg {
        parts.push(format!("azimuth_deg = [{from:?}, {to:?}]"));
    }
    parts.join(", ")
}

/// Views that fit a scene.
struct Fit {
    center: DVec3,
    width_m: f64,
    top_m: f64,
    eye_m: f64,
    fore_m: f64,
    max_path_m: f64,
}

/// A plan wider than this shows less than two pixels a metre.
const WIDEST_PLAN_M: f64 = 400.0;

impl Fit {
    fn around(site: &Site) -> Self {
        let corners = || {
            site.pv
                .iter()
                .flat_map(|s| &s.triangles)
                .flat_map(|&t| site.triangles[t as usize].corners)
                .map(glam::Vec3::as_dvec3)
        };
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let center = (low + high) * 0.5;
        let (min, max) = (site.bounds.min.as_dvec3(), site.bounds.max.as_dvec3());
        let reach = (max - center).max(center - min);
        let pv_radius = (high - low).truncate().length() * 0.5;
        Self {
            center,
            width_m: (2.0 * reach.x.max(reach.y)).ceil().min(WIDEST_PLAN_M),
            top_m: (max.z + 20.0).ceil(),
            eye_m: (high.z + 2.0).ceil(),
            fore_m: (pv_radius * 1.2).ceil().max(1.0),
            max_path_m: reach.length().ceil(),
        }
    }
}

/// `path` as seen from `folder`, so that a project can be moved together with its scene.
fn relative(path: &Path, folder: &Path) -> Result<PathBuf, Error> {
    let absolute =
        |p: &Path| fs::canonicalize(p).map_err(|source| Error::Read { path: p.to_owned(), source });
    let (path, folder) = (absolute(path)?, absolute(folder)?);
    let from: Vec<Component<'_>> = folder.components().collect();
    let to: Vec<Component<'_>> = path.components().collect();
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let mut out = PathBuf::new();
    for _ in shared..from.len() {
        out.push("..");
    }
    out.extend(&to[shared..]);
    Ok(out)
}
