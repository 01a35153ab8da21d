//! From the project file to what the rooms take; every mistake is named with its key. Here: the
//! site, its times and its scene. [`settings`]: what is done with them.

mod moments;
mod receivers;
mod settings;
mod view_file;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::{fs, io};

use super::error::Error;
use super::manifest::hash_path;
use super::project::{self, DayEntry, FileEntry, HorizonEntry, HoursTable, OriginEntry, Project};
use super::resolve::{MOMENTS, RECEIVERS};
use crate::base::limits;
use crate::site::{Files, Origin, PvArray, PvSpec, SceneFile, SceneSpec, Season};
use crate::sky::{DayRange, FarHorizon, HourRange, Irradiance, Place, SunModel, TimeSpec, Weather};

/// Reads a plan off a project file, table by table.
pub(super) struct Reader<'a> {
    pub file: &'a Path,
    pub project: &'a Project,
}

impl Reader<'_> {
    pub fn wrong(&self, message: impl Into<String>) -> Error {
        Error::Project { path: self.file.to_owned(), line: 0, column: 0, message: message.into() }
    }

    /// Names become folders, so they are checked together: what differs must not collide.
    pub fn names(&self) -> Result<(), Error> {
        let p = self.project;
        let mut folders = BTreeSet::from(["log", RECEIVERS, MOMENTS].map(str::to_owned));
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
                        "{table} \"{name}\": the name is taken; materials, cases and views share one folder, and `log`, `receivers` and `moments` are ours"
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
        self.numbers()?;
        if p.pv.is_empty() {
            return Err(self.wrong("expected at least one [[pv]], found none"));
        }
        if p.material.is_empty() {
            return Err(self.wrong("expected at least one [[material]], found none"));
        }
        Ok(())
    }

    /// TOML knows nan and inf; nothing selects by them and nobody stands there.
    fn numbers(&self) -> Result<(), Error> {
        for t in &self.project.pv {
            let Some(s) = &t.select else { continue };
            let azimuth = s.azimuth_deg.unwrap_or_default();
            let all = [s.min_tilt_deg, s.max_tilt_deg, Some(azimuth[0]), Some(azimuth[1])];
            if let Some(found) = all.into_iter().flatten().find(|v| !v.is_finite()) {
                return Err(self.wrong(format!(
                    "[[pv]] \"{}\": select: expected degrees, found {found}",
                    t.name
                )));
            }
        }
        for o in &self.project.observer {
            let direction = o.direction.unwrap_or_default();
            // Nobody stands farther off; squares of more would overflow.
            let known = |v: &f64| v.abs() < 1e9;
            if let Some(found) = o.point.iter().chain(&direction).find(|v| !known(v)) {
                return Err(self.wrong(format!(
                    "[[observer]] \"{}\": expected numbers of metres below 1e9, found {found}",
                    o.name
                )));
            }
        }
        Ok(())
    }

    pub fn day(&self, entry: &DayEntry, key: &str) -> Result<u32, Error> {
        match entry {
            DayEntry::Number(n) => Ok(*n),
            DayEntry::Date(text) => crate::sky::parse_day(text, self.project.time.year)
                .map_err(|e| self.wrong(format!("{key}: {e}"))),
        }
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

    pub fn place(&self) -> Result<Place, Error> {
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

    pub fn horizon(&self) -> Result<Option<FarHorizon>, Error> {
        let horizon = match &self.project.site.horizon {
            None => return Ok(None),
            Some(HorizonEntry::Points(points)) => FarHorizon::from_points(points),
            Some(HorizonEntry::File(path)) => {
                FarHorizon::read(&self.file.parent().unwrap_or(Path::new("")).join(path))
            }
        };
        horizon.map(Some).map_err(|e| self.wrong(format!("site.horizon: {e}")))
    }

    pub fn times(&self) -> Result<TimeSpec, Error> {
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
        let range = |h: &HoursTable| HourRange { from: h.from, to: h.to, step: h.step };
        Ok(TimeSpec {
            year: t.year,
            days: DayRange {
                from: self.day(&t.days.from, "time.days.from")?,
                to: self.day(&t.days.to, "time.days.to")?,
                step: t.days.step,
            },
            hours: range(&t.hours),
            finer: t.finer.iter().map(range).collect(),
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

    pub fn weather(&self) -> Result<Option<String>, Error> {
        let hash = |path: PathBuf| hash_path(&path).map_err(|source| Error::Read { path, source });
        self.weather_file().map(hash).transpose()
    }

    pub fn scene(&self, folder: &Path) -> Result<SceneSpec, Error> {
        let Project { scene: s, site, .. } = self.project;
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
            OriginEntry::At(at) if at.iter().all(|v| v.abs() < 1e9) => Origin::At((*at).into()),
            OriginEntry::At(at) => {
                return Err(self.wrong(format!(
                    "scene.origin: expected map coordinates below 1e9 m, found {at:?}"
                )));
            }
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
            north_deg: s.north_deg.unwrap_or(0.0),
            convergence_at: s.north_deg.is_none().then_some([site.latitude, site.longitude]),
            reflectance: s.reflectance.clone(),
            arrays: self.arrays(),
            seasons: self.seasons()?,
            origin,
        })
    }

    fn seasons(&self) -> Result<Vec<Season>, Error> {
        let mut out: Vec<Season> = Vec::new();
        for t in &self.project.season {
            let name = &t.modifier;
            let wrong = |what: String| self.wrong(format!("[[season]] \"{name}\": {what}"));
            let found = t.transmittance.len();
            let transmittance =
                <[f64; 12]>::try_from(t.transmittance.as_slice()).map_err(|_| {
                    wrong(format!("transmittance: expected 12 numbers, one a month, found {found}"))
                })?;
            if let Some(found) = transmittance.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                return Err(wrong(format!("transmittance: expected 0 to 1, found {found}")));
            }
            if out.iter().any(|s| s.modifier == *name) {
                return Err(wrong("the material is there twice".into()));
            }
            if self.project.time.half_year {
                return Err(wrong(
                    "time.half_year lets spring stand for autumn, whose leaves are others; compute the whole year".into(),
                ));
            }
            out.push(Season { modifier: name.clone(), transmittance });
        }
        Ok(out)
    }

    fn arrays(&self) -> Vec<(String, PvArray)> {
        let array = |t: &project::PvTable| t.array.clone().map(|array| (t.name.clone(), array));
        self.project.pv.iter().filter_map(array).collect()
    }

    pub fn inputs(&self, folder: &Path) -> Result<BTreeMap<String, String>, Error> {
        let mut inputs = BTreeMap::new();
        // Each with the scene file that it is part of.
        let own = self.project.scene.files.iter().rev().map(|entry| folder.join(entry.path()));
        let mut waiting: Vec<(PathBuf, PathBuf)> = own.map(|path| (path.clone(), path)).collect();
        let mut seen = BTreeSet::new();
        let files = Files::on_disk();
        while let Some((path, scene)) = waiting.pop() {
            if !seen.insert(path.clone()) {
                continue;
            }
            if fs::metadata(&path).is_ok_and(|m| m.len() > limits::MAX_TEXT_FILE_BYTES) {
                return Err(self.wrong(format!(
                    "scene.files: {} is larger than {} bytes",
                    path.display(),
                    limits::MAX_TEXT_FILE_BYTES
                )));
            }
            let read = |source| Error::Read { path: path.clone(), source };
            let hash = hash_path(&path).map_err(read)?;
            let named = named_files(&files, &path, &scene).map_err(read)?;
            waiting.extend(named.into_iter().map(|path| (path, scene.clone())));
            // The name alone: where a file lies must not change what a run writes.
            let plain = path.file_name().unwrap_or_default().to_string_lossy();
            // Files of the same name from different folders each count.
            let mut name = plain.clone().into_owned();
            let mut number = 1;
            while inputs.contains_key(&name) {
                number += 1;
                name = format!("{plain} ({number})");
            }
            inputs.insert(name, hash);
        }
        Ok(inputs)
    }

    pub fn pv(&self) -> Result<Vec<PvSpec>, Error> {
        let spec = |t: &project::PvTable| {
            match (&t.select, &t.array) {
            (Some(select), None) => {
                let (name, select) = (t.name.clone(), select.clone());
                Ok(PvSpec { name, select, two_sided: t.two_sided })
            }
            (None, Some(_)) => Ok(PvSpec::of_array(&t.name, t.two_sided)),
            (found, _) => Err(self.wrong(format!(
                "[[pv]] \"{}\": expected either `select` (surfaces of the scene) or `array` (rows of modules that the scene doesn't hold), found {}",
                t.name,
                if found.is_some() { "both" } else { "neither" }
            ))),
        }
        };
        self.project.pv.iter().map(spec).collect()
    }
}

/// Files that a scene file pulls in (`!xform`, `mtllib`, buffers of glTF): every word of its text
/// that names a file, where the reader would look for it. One word too many only makes a run more
/// careful.
fn named_files(files: &Files, path: &Path, scene: &Path) -> io::Result<Vec<PathBuf>> {
    const READERS: [&str; 3] = ["rad", "obj", "gltf"];
    const NAMED: [&str; 4] = ["rad", "obj", "mtl", "bin"];
    let kind = |p: &Path| p.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let is = |p: &Path, known: &[&str]| kind(p).is_some_and(|k| known.contains(&k.as_str()));
    if !is(path, &READERS) {
        return Ok(Vec::new());
    }
    let text = fs::read(path)?;
    let words = text.split(|b| b.is_ascii_whitespace() || b"\"';|,".contains(b));
    let mut out = BTreeSet::new();
    let mut last = "";
    for word in words.filter_map(|w| std::str::from_utf8(w).ok()) {
        if is(Path::new(word), &NAMED) || last == "-f" {
            let found = files.find(path, scene, word);
            if files.is_file(&found) {
                out.insert(found);
            }
        }
        last = word;
    }
    Ok(out.into_iter().collect())
}
