//! From the project file to what the rooms take. Every mistake is noted with its key, and a value
//! that can't be used is passed over or taken as it is: so all mistakes are found in one reading,
//! and [`Reader::finish`] tells them together. Here: names, the site, its times and its scene.
//! [`settings`]: what is done with them.

mod moments;
mod receivers;
mod settings;
mod view_file;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::{fs, io};

use glam::DVec3;

use super::error::Error;
use super::manifest::hash_path;
use super::places::{Key, Mistake, Mistakes, Place as At, Places};
use super::read::Read;
use super::resolve::MOMENTS;
use super::tables::{DayEntry, FileTable, HorizonEntry, HoursTable, OriginEntry, Project, PvTable};
use super::views::RECEIVERS;
use super::words::{SkyModel, SunStrength, SunStrengthTable, WordOr};
use crate::base::{FaultKind, limits};
use crate::site::{Files, Origin, PvArray, PvSpec, SceneFile, SceneSpec, Season};
use crate::sky::{self, DayRange, FarHorizon, HourRange, Place, TimeSpec, Weather};

/// Reads a plan off a project file, table by table.
pub(super) struct Reader<'a> {
    pub places: &'a Places,
    pub project: &'a Project,
    struck: &'a [Key],
    mistakes: RefCell<Vec<Mistake>>,
    /// What is no mistake of the project: a disk that fails.
    failed: RefCell<Option<Error>>,
}

impl<'a> Reader<'a> {
    pub fn new(read: &'a Read) -> Self {
        let Read { places, project, mistakes, struck } = read;
        let mistakes = RefCell::new(mistakes.clone());
        Self { places, project, struck, mistakes, failed: RefCell::new(None) }
    }

    /// Notes a mistake.
    pub fn wrong(&self, key: &Key, what: impl AsRef<str>) {
        // Of what couldn't be read, its stand-in is no mistake.
        let mistake = self.places.mistake(key, what.as_ref());
        if !self.struck.contains(key) && !self.mistakes.borrow().contains(&mistake) {
            self.mistakes.borrow_mut().push(mistake);
        }
    }

    /// The value, or `None` after its mistake or failure was noted.
    fn checked<T, E>(
        &self,
        key: &Key,
        result: Result<T, E>,
        error: impl FnOnce(E) -> Error,
    ) -> Option<T> {
        match result.map_err(error) {
            Ok(value) => Some(value),
            Err(e) if e.kind() == FaultKind::Input => {
                self.wrong(key, words(&e));
                None
            }
            Err(e) => {
                self.failed.borrow_mut().get_or_insert(e);
                None
            }
        }
    }

    /// The hash of a file beside the project file.
    fn hash(&self, key: &Key, path: &Path) -> Option<String> {
        let read = |source| Error::Read { path: path.to_owned(), source };
        self.checked(key, hash_path(path), read)
    }

    /// A path of the project file.
    fn beside(&self, path: &Path) -> PathBuf {
        self.places.file.parent().unwrap_or(Path::new("")).join(path)
    }

    /// All mistakes, if there are any.
    pub fn finish(self) -> Result<(), Error> {
        if let Some(failed) = self.failed.into_inner() {
            return Err(failed);
        }
        let mut list = self.mistakes.into_inner();
        list.sort_by_key(|mistake| match mistake.place {
            Some(At::Line { line, column }) => (line, column),
            _ => (0, 0),
        });
        match list.is_empty() {
            true => Ok(()),
            false => Err(Mistakes { path: self.places.file.clone(), list }.into()),
        }
    }

    /// Names become folders, so they are checked together: what differs must not collide.
    pub fn names(&self) {
        let p = self.project;
        let mut folders = BTreeSet::from(["log", RECEIVERS, MOMENTS].map(str::to_owned));
        let lists = [
            ("material", p.material.iter().map(|t| &t.name).collect::<Vec<_>>()),
            ("case", p.case.iter().map(|t| &t.name).collect()),
            ("view", p.view.iter().map(|t| &t.name).collect()),
        ];
        for (table, names) in lists {
            for (i, name) in names.into_iter().enumerate() {
                self.check_name(&Key::item(table, i).key("name"), name);
                if !folders.insert(name.clone()) {
                    self.wrong(&Key::item(table, i).key("name"), "the name is taken; materials, cases and views share one folder, and `log`, `receivers` and `moments` are ours");
                }
            }
        }
        let mut entries = BTreeSet::new();
        for (i, t) in p.pv.iter().enumerate() {
            let key = Key::item("pv", i).key("name");
            self.check_name(&key, &t.name);
            if !entries.insert(&t.name) {
                self.wrong(&key, "the name is taken");
            }
        }
        self.numbers();
        for (list, is_empty) in [("pv", p.pv.is_empty()), ("material", p.material.is_empty())] {
            if is_empty {
                self.wrong(&Key::of(list), format!("expected at least one [[{list}]], found none"));
            }
        }
    }

    /// TOML knows nan and inf; nothing selects by them and nobody stands there.
    fn numbers(&self) {
        for (i, t) in self.project.pv.iter().enumerate() {
            let Some(s) = &t.select else { continue };
            let azimuth = s.azimuth_deg.unwrap_or_default();
            let all = [s.min_tilt_deg, s.max_tilt_deg, Some(azimuth[0]), Some(azimuth[1])];
            if let Some(found) = all.into_iter().flatten().find(|v| !v.is_finite()) {
                let key = Key::item("pv", i).key("select");
                self.wrong(&key, format!("expected degrees, found {found}"));
            }
        }
        for (i, o) in self.project.observer.iter().enumerate() {
            for (key, numbers) in [("point", Some(o.point)), ("direction", o.direction)] {
                let found = numbers.into_iter().flatten().find(|v| !v.is_finite());
                if let Some(found) = found {
                    let key = Key::item("observer", i).key(key);
                    self.wrong(&key, format!("expected finite numbers of metres, found {found}"));
                }
            }
        }
    }

    /// A day of the year; 0 where it is none.
    pub fn day(&self, entry: &DayEntry, key: &Key) -> u32 {
        match entry {
            DayEntry::Number(n) => *n,
            DayEntry::Date(text) => {
                let day = sky::parse_day(text, self.project.time.year);
                self.checked(key, day, Error::Sky).unwrap_or(0)
            }
        }
    }

    fn check_name(&self, key: &Key, name: &str) {
        let good = !name.is_empty()
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !good {
            self.wrong(key, format!("expected a name of letters, digits, `_` and `-` (it becomes a folder), found \"{name}\""));
        }
    }

    pub fn place(&self) -> Place {
        let s = &self.project.site;
        let place = Place {
            latitude_deg: s.latitude,
            longitude_deg: s.longitude,
            meridian_deg: s.meridian,
            elevation_m: s.elevation_m,
        };
        for wrong in place.mistakes() {
            let field = match wrong {
                sky::Error::Place { field, .. } => field,
                _ => "latitude",
            };
            self.wrong(&Key::of("site").key(field), wrong.to_string());
        }
        if let Some(zone) = &s.timezone
            && jiff::tz::TimeZone::get(zone).is_err()
        {
            self.wrong(
                &Key::of("site.timezone"),
                format!("expected an IANA name such as \"Europe/Zurich\", found \"{zone}\""),
            );
        }
        place
    }

    pub fn horizon(&self) -> Option<FarHorizon> {
        let horizon = match self.project.site.horizon.as_ref()? {
            HorizonEntry::Points(points) => FarHorizon::from_points(points),
            HorizonEntry::File(path) => FarHorizon::read(&self.beside(path)),
        };
        self.checked(&Key::of("site.horizon"), horizon, Error::Sky)
    }

    pub fn times(&self) -> TimeSpec {
        let t = &self.project.time;
        let range = |h: &HoursTable| HourRange { from: h.from, to: h.to, step: h.step };
        let times = TimeSpec {
            year: t.year,
            days: DayRange {
                from: self.day(&t.days.from, &Key::of("time.days.from")),
                to: self.day(&t.days.to, &Key::of("time.days.to")),
                step: t.days.step,
            },
            hours: range(&t.hours),
            finer: t.finer.iter().map(range).collect(),
            sun: t.sun,
            irradiance: self.irradiance(),
            half_year: t.half_year,
        };
        for wrong in times.mistakes() {
            let key = match wrong {
                sky::Error::Year(_) => "time.year",
                sky::Error::DayStep => "time.days.step",
                sky::Error::DaysOutside { .. } => "time.days",
                sky::Error::HourStep(_) | sky::Error::HoursOutside { .. } => "time.hours",
                sky::Error::Finer { .. } => "time.finer",
                sky::Error::HalfYear { .. } => "time.half_year",
                sky::Error::Irradiance { .. } => "time.irradiance",
                _ => "time",
            };
            self.wrong(&Key::of(key), wrong.to_string());
        }
        times
    }

    fn irradiance(&self) -> sky::SunStrength {
        let key = Key::of("time.irradiance");
        let table = match &self.project.time.irradiance {
            WordOr::Word(SunStrength::ClearSky) => return sky::SunStrength::ClearSky,
            WordOr::Word(SunStrength::Gensky) => return sky::SunStrength::Gensky,
            WordOr::Table(table) => table,
        };
        match table {
            SunStrengthTable { constant: Some(w_m2), epw: None, model: None, linke: None } => {
                sky::SunStrength::Constant(*w_m2)
            }
            SunStrengthTable { constant: None, epw: Some(path), model: None, linke: None } => {
                let weather = Weather::read(&self.beside(path));
                let weather = self.checked(&key.key("epw"), weather, Error::Sky);
                weather.map_or(sky::SunStrength::ClearSky, sky::SunStrength::Epw)
            }
            SunStrengthTable {
                constant: None,
                epw: None,
                model: Some(SkyModel::Ineichen),
                linke: Some(linke),
            } => match <[f64; 12]>::try_from(linke.as_slice()) {
                Ok(linke) => sky::SunStrength::Ineichen { linke },
                Err(_) => {
                    let found = linke.len();
                    let what = format!("expected 12 numbers, one a month, found {found}");
                    self.wrong(&key.key("linke"), what);
                    sky::SunStrength::ClearSky
                }
            },
            _ => {
                self.wrong(&key, "expected \"clear-sky\", \"gensky\", { epw = \"site.epw\" }, { constant = 1000 } or { model = \"ineichen\", linke = [12 values] }");
                sky::SunStrength::ClearSky
            }
        }
    }

    /// Hash of the weather file.
    pub fn weather(&self) -> Option<String> {
        match &self.project.time.irradiance {
            WordOr::Table(SunStrengthTable { epw: Some(path), .. }) => {
                self.hash(&Key::of("time.irradiance.epw"), &self.beside(path))
            }
            _ => None,
        }
    }

    pub fn scene(&self) -> SceneSpec {
        let Project { scene: s, site, .. } = self.project;
        let key = Key::of("scene");
        if !(0.0..=1.0).contains(&s.default_reflectance) {
            let found = s.default_reflectance;
            let what = format!("expected 0 to 1, found {found}");
            self.wrong(&key.key("default_reflectance"), what);
        }
        if s.files.is_empty() {
            self.wrong(&key.key("files"), "expected at least one file, found none");
        }
        let file = |entry: &super::tables::FileEntry| match entry {
            WordOr::Word(path) => SceneFile::new(self.beside(path)),
            WordOr::Table(FileTable { path, unit, up }) => SceneFile {
                path: self.beside(path),
                unit: unit.map(|unit| unit.name().to_owned()),
                up: up.map(|up| up.name().to_owned()),
            },
        };
        SceneSpec {
            files: s.files.iter().map(file).collect(),
            default_reflectance: s.default_reflectance,
            lod: s.lod.clone(),
            crs: s.crs.clone(),
            north_deg: s.north_deg.unwrap_or(0.0),
            convergence_at: s.north_deg.is_none().then_some([site.latitude, site.longitude]),
            reflectance: s.reflectance.clone(),
            arrays: self.arrays(),
            seasons: self.seasons(),
            origin: match &s.origin {
                OriginEntry::At([x, y, z]) => Origin::At(DVec3::new(*x, *y, *z)),
                OriginEntry::Word(_) => Origin::Auto,
            },
        }
    }

    fn seasons(&self) -> Vec<Season> {
        let mut out: Vec<Season> = Vec::new();
        for (i, t) in self.project.season.iter().enumerate() {
            let key = Key::item("season", i);
            let found = t.transmittance.len();
            let Ok(transmittance) = <[f64; 12]>::try_from(t.transmittance.as_slice()) else {
                let what = format!("expected 12 numbers, one a month, found {found}");
                self.wrong(&key.key("transmittance"), what);
                continue;
            };
            if let Some(found) = transmittance.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                self.wrong(&key.key("transmittance"), format!("expected 0 to 1, found {found}"));
            }
            if out.iter().any(|s| s.modifier == t.modifier) {
                self.wrong(&key.key("modifier"), "the material is there twice");
            }
            if self.project.time.half_year {
                self.wrong(&key, "time.half_year lets spring stand for autumn, whose leaves are others; compute the whole year");
            }
            out.push(Season { modifier: t.modifier.clone(), transmittance });
        }
        out
    }

    fn arrays(&self) -> Vec<(String, PvArray)> {
        let array = |t: &PvTable| t.array.clone().map(|array| (t.name.clone(), array));
        self.project.pv.iter().filter_map(array).collect()
    }

    /// Hash of each file of the scene, by its name.
    pub fn inputs(&self) -> BTreeMap<String, String> {
        let mut inputs = BTreeMap::new();
        // Each with the scene file that it is part of.
        let own = self.project.scene.files.iter().rev().map(|entry| self.beside(entry.path()));
        let mut waiting: Vec<(PathBuf, PathBuf)> = own.map(|path| (path.clone(), path)).collect();
        let mut seen = BTreeSet::new();
        let files = Files::on_disk();
        let key = Key::of("scene.files");
        while let Some((path, scene)) = waiting.pop() {
            if !seen.insert(path.clone()) {
                continue;
            }
            if fs::metadata(&path).is_ok_and(|m| m.len() > limits::MAX_TEXT_FILE_BYTES) {
                let most = limits::MAX_TEXT_FILE_BYTES;
                self.wrong(&key, format!("{} is larger than {most} bytes", path.display()));
                continue;
            }
            let Some(hash) = self.hash(&key, &path) else { continue };
            let read = |source| Error::Read { path: path.clone(), source };
            let named = self.checked(&key, named_files(&files, &path, &scene), read);
            let named = named.into_iter().flatten();
            waiting.extend(named.map(|path| (path, scene.clone())));
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
        inputs
    }

    pub fn pv(&self) -> Vec<PvSpec> {
        let spec = |(i, t): (usize, &PvTable)| match (&t.select, &t.array) {
            (Some(select), None) => {
                let (name, select) = (t.name.clone(), select.clone());
                Some(PvSpec { name, select, two_sided: t.two_sided })
            }
            (None, Some(_)) => Some(PvSpec::of_array(&t.name, t.two_sided)),
            (found, _) => {
                let found = if found.is_some() { "both" } else { "neither" };
                self.wrong(&Key::item("pv", i), format!("expected either `select` (surfaces of the scene) or `array` (rows of modules that the scene doesn't hold), found {found}"));
                None
            }
        };
        self.project.pv.iter().enumerate().filter_map(spec).collect()
    }
}

/// An error with all its causes.
fn words(error: &Error) -> String {
    let mut cause: Option<&dyn std::error::Error> = Some(error);
    // The key says already which material it is.
    if let Error::Material { source, .. } = error {
        cause = Some(source);
    }
    let mut all: Vec<String> = Vec::new();
    while let Some(error) = cause {
        let text = error.to_string();
        if !all.last().is_some_and(|above| above.contains(&text)) {
            all.push(text);
        }
        cause = error.source();
    }
    all.join(": ")
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
