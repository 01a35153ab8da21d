//! From the project file to what the rooms take: parse, then resolve into a plan, then act.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::error::Error;
use super::manifest::{hash_path, key_of};
use super::project::{self, DayEntry, FileEntry, OriginEntry, Project, ViewTable};
use super::set::Assignment;
use crate::base::limits;
use crate::glare;
use crate::render::{Estimator, Gather, Quantity, View};
use crate::site::bsdf::{Bsdf, BsdfFile, Model, Side, Spectrum};
use crate::site::{Origin, PvSpec, SceneFile, SceneSpec, Select};
use crate::sky::{DayRange, HourRange, Irradiance, Place, SunModel, TimeSpec, Weather};
use crate::trace::{self, Receivers};

/// Below this many stored photons verdicts and pictures are marked as a draft.
pub const DRAFT_BELOW_PHOTONS: u64 = 4_000_000;

/// What a material is made from: all that decides how it scatters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Made {
    /// A model.
    Model(Model),
    /// A side of a file.
    File {
        /// Hash of the file.
        bsdf: String,
        /// The side.
        side: Side,
        /// The light that was asked for.
        spectrum: Option<Spectrum>,
    },
}

/// A candidate: what each PV entry is made of.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Names the folder of its results.
    pub name: String,
    /// Model or file of each `[[pv]]` entry, in the order of the project file.
    pub models: Vec<Made>,
    /// The same, ready to scatter.
    pub bsdfs: Vec<Bsdf>,
    /// What its files leave to be desired, for people.
    pub notes: Vec<String>,
}

/// A view and how it is rendered.
#[derive(Clone, Debug)]
pub struct PlannedView {
    /// Names the folder of its results.
    pub name: String,
    /// As written.
    pub options: String,
    /// The camera.
    pub view: View,
    /// How the annual map is gathered.
    pub annual: Gather,
    /// How the series is gathered; its bandwidth is fixed once the timesteps are known.
    pub series_bandwidth: Option<usize>,
}

/// A project, checked, with all defaults filled in.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// `project.toml`.
    pub file: PathBuf,
    /// The folder it lies in.
    pub folder: PathBuf,
    /// As written, with defaults.
    pub project: Project,
    /// Where on Earth.
    pub place: Place,
    /// Which instants.
    pub times: TimeSpec,
    /// Which files.
    pub scene: SceneSpec,
    /// Which PV.
    pub pv: Vec<PvSpec>,
    /// Materials and cases.
    pub candidates: Vec<Candidate>,
    /// Index of the reference among the candidates.
    pub reference: Option<usize>,
    /// The pictures.
    pub views: Vec<PlannedView>,
    /// How photons are traced.
    pub trace: trace::Settings,
    /// What is compared with the thresholds.
    pub quantity: Quantity,
    /// How glare is found; the threshold is filled in for each.
    pub glare: glare::Settings,
    /// Hash of each input file by its name.
    pub inputs: BTreeMap<String, String>,
    /// Hash of the weather file, where there is one.
    pub weather: Option<String>,
}

impl Resolved {
    /// Reads and checks a project; `memory_bytes` bounds the analysis.
    ///
    /// # Errors
    /// Any mistake in the project file, with its key; missing input files.
    pub fn read(path: &Path, set: &[Assignment], memory_bytes: u64) -> Result<Self, Error> {
        let (file, project) = project::read(path, set)?;
        let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
        let r = Reader { file: &file, project: &project };
        r.names()?;
        let candidates = r.candidates()?;
        let reference = r.reference(&candidates)?;
        let inputs = r.inputs(&folder)?;
        Ok(Self {
            place: r.place()?,
            times: r.times()?,
            scene: r.scene(&folder)?,
            pv: r.pv(),
            views: project.view.iter().map(|v| r.view(v)).collect::<Result<_, _>>()?,
            trace: r.trace()?,
            quantity: r.quantity()?,
            glare: r.glare(memory_bytes)?,
            weather: r.weather()?,
            candidates,
            reference,
            inputs,
            folder: folder.clone(),
            file: file.clone(),
            project,
        })
    }

    /// Where results lie.
    pub fn run_folder(&self) -> PathBuf {
        self.folder.join("run")
    }

    /// Whether verdicts and pictures are marked as a draft.
    pub fn is_draft(&self) -> bool {
        self.trace.stored < DRAFT_BELOW_PHOTONS
    }

    /// Number of thresholds that glare is analysed at.
    pub fn glare_thresholds(&self) -> usize {
        self.project.glare.thresholds_w_m2.len()
    }

    /// What decides the scene.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn scene_key(&self) -> Result<String, Error> {
        key_of("scene", &(&self.project.scene, &self.project.pv, &self.inputs))
    }

    /// What decides the timesteps.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn suns_key(&self) -> Result<String, Error> {
        let s = &self.project.site;
        let place = (s.latitude, s.longitude, s.meridian, s.elevation_m);
        match &self.weather {
            None => key_of("suns", &(place, &self.project.time)),
            Some(hash) => key_of("suns", &(place, &self.project.time, hash)),
        }
    }

    /// What decides a candidate's photons.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn photons_key(&self, candidate: &Candidate) -> Result<String, Error> {
        let upstream = (self.scene_key()?, self.suns_key()?);
        key_of("photons", &(upstream, &candidate.models, &self.project.photons))
    }

    /// What decides a view's hits.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn hits_key(&self, view: &PlannedView) -> Result<String, Error> {
        #[derive(Serialize)]
        struct Facts<'a> {
            scene: String,
            view: &'a str,
            size: (usize, usize),
            max_path_m: f64,
            seed: u64,
        }
        key_of(
            "hits",
            &Facts {
                scene: self.scene_key()?,
                view: &view.options,
                size: (view.view.columns(), view.view.rows()),
                max_path_m: self.trace.max_path_m,
                seed: self.trace.seed,
            },
        )
    }

    /// What decides a candidate's maps and series in a view.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn render_key(&self, candidate: &Candidate, view: &PlannedView) -> Result<String, Error> {
        let g = &view.annual;
        let upstream = (self.photons_key(candidate)?, self.hits_key(view)?);
        let estimator = format!("{:?}", g.estimator);
        let how = (estimator, g.bandwidth, view.series_bandwidth, g.max_radius_m);
        key_of("render", &(upstream, how, &self.project.glare.quantity))
    }

    /// What decides a glare analysis.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn glare_key(&self, render_key: &str, threshold: f64) -> Result<String, Error> {
        let g = &self.project.glare;
        key_of("glare", &(render_key, threshold, g.sigma, g.truncate, g.connectivity))
    }
}

struct Reader<'a> {
    file: &'a Path,
    project: &'a Project,
}

impl Reader<'_> {
    fn wrong(&self, message: impl Into<String>) -> Error {
        Error::Project { path: self.file.to_owned(), line: 0, column: 0, message: message.into() }
    }

    /// Names become folders, so they are checked together: what differs must not collide.
    fn names(&self) -> Result<(), Error> {
        let p = self.project;
        let mut folders = BTreeSet::from(["log".to_owned()]);
        let lists = [
            ("[[material]]", p.material.iter().map(|t| &t.name).collect::<Vec<_>>()),
            ("[[case]]", p.case.iter().map(|t| &t.name).collect()),
            ("[[view]]", p.view.iter().map(|t| &t.name).collect()),
        ];
        for (table, names) in lists {
            for name in names {
                self.check_name(table, name)?;
                if !folders.insert(name.clone()) {
                    return Err(self.wrong(format!(
                        "{table} \"{name}\": the name is taken; materials, cases and views share one folder, and `log` is ours"
                    )));
                }
            }
        }
        let mut entries = BTreeSet::new();
        for t in &p.pv {
            self.check_name("[[pv]]", &t.name)?;
            if !entries.insert(&t.name) {
                return Err(self.wrong(format!("[[pv]] \"{}\": the name is taken", t.name)));
            }
        }
        if p.pv.is_empty() {
            return Err(self.wrong("expected at least one [[pv]], found none"));
        }
        if p.material.is_empty() {
            return Err(self.wrong("expected at least one [[material]], found none"));
        }
        Ok(())
    }

    fn check_name(&self, table: &str, name: &str) -> Result<(), Error> {
        let good = !name.is_empty()
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if good {
            return Ok(());
        }
        Err(self.wrong(format!(
            "{table} \"{name}\": expected a name of letters, digits, `_` and `-`; it becomes a folder"
        )))
    }

    fn place(&self) -> Result<Place, Error> {
        let s = &self.project.site;
        for (key, value, bound) in [
            ("latitude", s.latitude, 90.0),
            ("longitude", s.longitude, 180.0),
            ("meridian", s.meridian, 180.0),
        ] {
            if value.is_nan() || value.abs() > bound {
                return Err(self.wrong(format!(
                    "site.{key}: expected degrees from -{bound} to {bound} (north and east are positive), found {value}"
                )));
            }
        }
        if let Some(zone) = &s.timezone {
            jiff::tz::TimeZone::get(zone).map_err(|_| {
                self.wrong(format!(
                    "site.timezone: expected an IANA name such as \"Europe/Zurich\", found \"{zone}\""
                ))
            })?;
        }
        Ok(Place {
            latitude_deg: s.latitude,
            longitude_deg: s.longitude,
            meridian_deg: s.meridian,
            elevation_m: s.elevation_m,
        })
    }

    fn times(&self) -> Result<TimeSpec, Error> {
        let t = &self.project.time;
        let sun = match t.sun.as_str() {
            "spa" => SunModel::Spa,
            "gensky" => SunModel::Gensky,
            "gensky-2018" => SunModel::Gensky2018,
            other => {
                return Err(self.wrong(format!(
                    "time.sun: expected \"spa\", \"gensky\" or \"gensky-2018\", found \"{other}\""
                )));
            }
        };
        let day = |entry: &DayEntry, key: &str| match entry {
            DayEntry::Number(n) => Ok(*n),
            DayEntry::Date(text) => crate::sky::parse_day(text, t.year)
                .map_err(|e| self.wrong(format!("time.days.{key}: {e}"))),
        };
        Ok(TimeSpec {
            year: t.year,
            days: DayRange {
                from: day(&t.days.from, "from")?,
                to: day(&t.days.to, "to")?,
                step: t.days.step,
            },
            hours: HourRange { from: t.hours.from, to: t.hours.to, step: t.hours.step },
            sun,
            irradiance: self.irradiance()?,
            half_year: t.half_year,
        })
    }

    fn irradiance(&self) -> Result<Irradiance, Error> {
        const KNOWN: &str = "expected \"clear-sky\", \"gensky\", { epw = \"site.epw\" }, { constant = 1000 } or { model = \"ineichen\", linke = [12 values] }";
        let value = &self.project.time.irradiance;
        if let Some(word) = value.as_str() {
            return match word {
                "clear-sky" => Ok(Irradiance::ClearSky),
                "gensky" => Ok(Irradiance::Gensky),
                _ => Err(self.wrong(format!("time.irradiance: {KNOWN}, found \"{word}\""))),
            };
        }
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
        let Some(table) = value.as_table() else {
            return Err(self.wrong(format!("time.irradiance: {KNOWN}, found {value}")));
        };
        if let Some(path) = self.weather_file() {
            return Ok(Irradiance::Epw(Weather::read(&path)?));
        }
        if let Some(constant) = table.get("constant").and_then(number)
            && table.len() == 1
        {
            return Ok(Irradiance::Constant(constant));
        }
        let linke: Option<Vec<f64>> = table
            .get("linke")
            .and_then(toml::Value::as_array)
            .map(|list| list.iter().filter_map(number).collect());
        match (table.get("model").and_then(toml::Value::as_str), linke) {
            (Some("ineichen"), Some(linke)) if table.len() == 2 => {
                let found = linke.len();
                let linke = <[f64; 12]>::try_from(linke).map_err(|_| {
                    self.wrong(format!(
                        "time.irradiance.linke: expected 12 numbers, one a month, found {found}"
                    ))
                })?;
                Ok(Irradiance::Ineichen { linke })
            }
            _ => Err(self.wrong(format!("time.irradiance: {KNOWN}, found {value}"))),
        }
    }

    /// `irradiance = { epw = "site.epw" }`, beside the project file.
    fn weather_file(&self) -> Option<PathBuf> {
        let table = self.project.time.irradiance.as_table().filter(|t| t.len() == 1)?;
        let path = table.get("epw").and_then(toml::Value::as_str)?;
        Some(self.file.parent().unwrap_or(Path::new("")).join(path))
    }

    fn weather(&self) -> Result<Option<String>, Error> {
        let hash = |path: PathBuf| hash_path(&path).map_err(|source| Error::Read { path, source });
        self.weather_file().map(hash).transpose()
    }

    fn scene(&self, folder: &Path) -> Result<SceneSpec, Error> {
        let s = &self.project.scene;
        if !(0.0..=1.0).contains(&s.default_reflectance) {
            return Err(self.wrong(format!(
                "scene.default_reflectance: expected 0 to 1, found {}",
                s.default_reflectance
            )));
        }
        if s.files.is_empty() {
            return Err(self.wrong("scene.files: expected at least one file, found none"));
        }
        let origin = match &s.origin {
            OriginEntry::At([x, y, z]) => Origin::At(DVec3::new(*x, *y, *z)),
            OriginEntry::Word(word) if word == "auto" => Origin::Auto,
            OriginEntry::Word(word) => {
                return Err(self.wrong(format!(
                    "scene.origin: expected \"auto\" or [x, y, z], found \"{word}\""
                )));
            }
        };
        let files = s
            .files
            .iter()
            .map(|entry| match entry {
                FileEntry::Path(path) => {
                    SceneFile { path: folder.join(path), unit: None, up: None }
                }
                FileEntry::Table { path, unit, up } => {
                    SceneFile { path: folder.join(path), unit: unit.clone(), up: up.clone() }
                }
            })
            .collect();
        Ok(SceneSpec {
            files,
            default_reflectance: s.default_reflectance,
            lod: s.lod.clone(),
            crs: s.crs.clone(),
            north_deg: s.north_deg,
            origin,
        })
    }

    fn inputs(&self, folder: &Path) -> Result<BTreeMap<String, String>, Error> {
        let mut inputs = BTreeMap::new();
        for entry in &self.project.scene.files {
            let path = folder.join(entry.path());
            if fs::metadata(&path).is_ok_and(|m| m.len() > limits::MAX_TEXT_FILE_BYTES) {
                return Err(self.wrong(format!(
                    "scene.files: {} is larger than {} bytes",
                    path.display(),
                    limits::MAX_TEXT_FILE_BYTES
                )));
            }
            let hash = hash_path(&path).map_err(|source| Error::Read { path, source })?;
            // The name alone: where a file lies must not change what a run writes.
            let name = entry.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
            inputs.insert(name, hash);
        }
        Ok(inputs)
    }

    fn pv(&self) -> Vec<PvSpec> {
        let spec = |t: &project::PvTable| PvSpec {
            name: t.name.clone(),
            select: Select {
                modifier: t.select.modifier.clone(),
                material: t.select.material.clone(),
                object: t.select.object.clone(),
                surface: t.select.surface.clone(),
                min_tilt_deg: t.select.min_tilt_deg,
                max_tilt_deg: t.select.max_tilt_deg,
                azimuth_deg: t.select.azimuth_deg,
            },
            two_sided: t.two_sided,
        };
        self.project.pv.iter().map(spec).collect()
    }

    fn candidates(&self) -> Result<Vec<Candidate>, Error> {
        let p = self.project;
        let mut models: BTreeMap<&str, Material> = BTreeMap::new();
        let mut out = Vec::new();
        for t in &p.material {
            let model = match (&t.model, &t.bsdf) {
                (Some(model), None) if t.side.is_none() && t.spectrum.is_none() => {
                    let bsdf = Bsdf::from_model(model)
                        .map_err(|source| Error::Material { name: t.name.clone(), source })?;
                    Material { made: Made::Model(*model), bsdf, notes: Vec::new() }
                }
                (None, Some(path)) => self.measured(t, path)?,
                (Some(_), None) => {
                    return Err(self.wrong(format!(
                        "[[material]] \"{}\": `side` and `spectrum` go with `bsdf`, not with `model`",
                        t.name
                    )));
                }
                _ => {
                    return Err(self.wrong(format!(
                        "[[material]] \"{}\": expected either `model` or `bsdf`",
                        t.name
                    )));
                }
            };
            out.push(candidate(&t.name, &vec![&model; p.pv.len()]));
            models.insert(&t.name, model);
        }
        for case in &p.case {
            let known = || models.keys().copied().collect::<Vec<_>>().join(", ");
            for entry in case.assign.keys() {
                if !p.pv.iter().any(|t| &t.name == entry) {
                    return Err(self.wrong(format!(
                        "[[case]] \"{}\": assign names the PV \"{entry}\", which no [[pv]] has",
                        case.name
                    )));
                }
            }
            let mut chosen = Vec::new();
            for t in &p.pv {
                let name = case.assign.get(&t.name).ok_or_else(|| {
                    self.wrong(format!(
                        "[[case]] \"{}\": assign says nothing about the PV \"{}\"",
                        case.name, t.name
                    ))
                })?;
                let model = models.get(name.as_str()).ok_or_else(|| {
                    self.wrong(format!(
                        "[[case]] \"{}\": no [[material]] is named \"{name}\" (there are: {})",
                        case.name,
                        known()
                    ))
                })?;
                chosen.push(model);
            }
            out.push(candidate(&case.name, &chosen));
        }
        Ok(out)
    }

    fn measured(&self, t: &project::MaterialTable, path: &Path) -> Result<Material, Error> {
        let path = self.file.parent().unwrap_or(Path::new("")).join(path);
        let wrong = |source| Error::Material { name: t.name.clone(), source };
        let file = BsdfFile::read(&path).map_err(wrong)?;
        let side = t.side.unwrap_or_default();
        let measured = file.reflection(side, t.spectrum).map_err(wrong)?;
        let hash = hash_path(&path).map_err(|source| Error::Read { path, source })?;
        let notes = file.notes.iter().cloned().chain(measured.notes()).collect();
        let made = Made::File { bsdf: hash, side, spectrum: t.spectrum };
        Ok(Material { made, bsdf: Bsdf::Measured(measured), notes })
    }

    fn reference(&self, candidates: &[Candidate]) -> Result<Option<usize>, Error> {
        let Some(table) = &self.project.reference else { return Ok(None) };
        let at = candidates.iter().position(|c| c.name == table.material);
        let known = || candidates.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
        at.map(Some).ok_or_else(|| {
            self.wrong(format!(
                "reference.material: no [[material]] is named \"{}\" (there are: {})",
                table.material,
                known()
            ))
        })
    }

    fn view(&self, t: &ViewTable) -> Result<PlannedView, Error> {
        let later = |key: &str, instead: &str| {
            Error::Unsupported(format!(
                "{}: view.{}.{key}: this version can't do that yet; {instead}",
                self.file.display(),
                t.name
            ))
        };
        if t.fuse {
            return Err(later("fuse", "leave it out: the series is kept"));
        }
        if t.view_file.is_some() {
            return Err(later("view_file", "write its options into `view`"));
        }
        if t.sensors.is_some() {
            return Err(later("sensors", "use a picture"));
        }
        let Some(options) = &t.view else {
            return Err(self.wrong(format!("[[view]] \"{}\": expected `view`, found none", t.name)));
        };
        let [columns, rows] = t.size;
        let edge = 1..=limits::MAX_VIEW_EDGE;
        if !edge.contains(&columns)
            || !edge.contains(&rows)
            || columns.saturating_mul(rows) > limits::MAX_VIEW_PIXELS
        {
            return Err(self.wrong(format!(
                "view.{}.size: expected 1 to {} pixels along each edge and at most {} in all, found {columns} x {rows}",
                t.name,
                limits::MAX_VIEW_EDGE,
                limits::MAX_VIEW_PIXELS
            )));
        }
        let estimator = match t.estimator.as_str() {
            "photons" => Estimator::Photons,
            "radiance" => Estimator::Radiance,
            "direct" => return Err(later("estimator", "\"direct\" comes later, use \"photons\"")),
            other => {
                return Err(self.wrong(format!(
                    "view.{}.estimator: expected \"photons\" or \"radiance\", found \"{other}\"",
                    t.name
                )));
            }
        };
        for (key, value) in
            [("bandwidth", Some(t.bandwidth)), ("series_bandwidth", t.series_bandwidth)]
        {
            if value.is_some_and(|v| !(2..=1_000_000).contains(&v)) {
                return Err(self.wrong(format!(
                    "view.{}.{key}: expected 2 to 1000000 photons, found {}",
                    t.name,
                    value.unwrap_or(0)
                )));
            }
        }
        if t.max_radius_m.is_some_and(|r| !(r > 0.0 && r.is_finite())) {
            return Err(
                self.wrong(format!("view.{}.max_radius_m: expected metres above 0", t.name))
            );
        }
        let view = View::parse(options, columns, rows)
            .map_err(|e| self.wrong(format!("view.{}.view: {e}", t.name)))?;
        Ok(PlannedView {
            name: t.name.clone(),
            options: options.clone(),
            view,
            annual: Gather { bandwidth: t.bandwidth, max_radius_m: t.max_radius_m, estimator },
            series_bandwidth: t.series_bandwidth,
        })
    }

    fn trace(&self) -> Result<trace::Settings, Error> {
        let p = &self.project.photons;
        if p.bounces != 1 {
            return Err(Error::Unsupported(format!(
                "{}: photons.bounces: this version follows one scattering, by the PV; expected 1, found {}",
                self.file.display(),
                p.bounces
            )));
        }
        if !(1..=limits::MAX_PHOTONS).contains(&p.stored) {
            return Err(self.wrong(format!(
                "photons.stored: expected 1 to {}, found {}",
                limits::MAX_PHOTONS,
                p.stored
            )));
        }
        if !(p.max_path_m > 0.0 && p.max_path_m.is_finite()) {
            return Err(self.wrong(format!(
                "photons.max_path_m: expected metres above 0, found {}",
                p.max_path_m
            )));
        }
        let receivers = match p.receivers.as_str() {
            "all" => Receivers::All,
            "diffuse" => Receivers::Diffuse,
            other => {
                return Err(self.wrong(format!(
                    "photons.receivers: expected \"all\" or \"diffuse\", found \"{other}\""
                )));
            }
        };
        Ok(trace::Settings {
            stored: p.stored,
            max_path_m: p.max_path_m,
            seed: p.seed,
            sun_visibility: p.sun_visibility,
            receivers,
        })
    }

    fn quantity(&self) -> Result<Quantity, Error> {
        match self.project.glare.quantity.as_str() {
            "surface" => Ok(Quantity::Surface),
            "normal" => Ok(Quantity::Normal),
            other => Err(self.wrong(format!(
                "glare.quantity: expected \"surface\" or \"normal\", found \"{other}\""
            ))),
        }
    }

    fn glare(&self, memory_bytes: u64) -> Result<glare::Settings, Error> {
        let g = &self.project.glare;
        let mut seen = Vec::new();
        for &t in &g.thresholds_w_m2 {
            if !(t >= 0.0 && t.is_finite()) || seen.contains(&t) {
                return Err(self.wrong(format!(
                    "glare.thresholds_w_m2: expected different finite numbers from 0, found {t}"
                )));
            }
            seen.push(t);
        }
        let connectivity =
            glare::Connectivity::from_neighbours(g.connectivity).ok_or_else(|| {
                self.wrong(format!(
                    "glare.connectivity: expected 6, 18 or 26, found {}",
                    g.connectivity
                ))
            })?;
        if g.sigma.iter().any(|s| !(0.0..=1000.0).contains(s))
            || g.truncate.is_nan()
            || g.truncate < 0.0
        {
            return Err(self.wrong(format!(
                "glare.sigma and glare.truncate: expected numbers from 0, found {:?} and {}",
                g.sigma, g.truncate
            )));
        }
        for rule in &g.rules {
            glare::rules::built_in(rule).map_err(|e| self.wrong(format!("glare.rules: {e}")))?;
        }
        Ok(glare::Settings {
            threshold: 0.0,
            sigma: g.sigma,
            truncate: g.truncate,
            connectivity,
            allow_nonfinite: false,
            memory_bytes,
        })
    }
}

/// A `[[material]]`, ready to scatter.
#[derive(Clone)]
struct Material {
    made: Made,
    bsdf: Bsdf,
    notes: Vec<String>,
}

fn candidate(name: &str, materials: &[&Material]) -> Candidate {
    let mut notes: Vec<String> = Vec::new();
    for note in materials.iter().flat_map(|m| &m.notes) {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    Candidate {
        name: name.to_owned(),
        models: materials.iter().map(|m| m.made.clone()).collect(),
        bsdfs: materials.iter().map(|m| m.bsdf.clone()).collect(),
        notes,
    }
}
