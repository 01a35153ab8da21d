use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::build::Builder;
use super::draft::{Draft, Full};
use super::log::Log;
use super::placement::{extents, place, reference_system};
use super::{Error, Material, Origin, PvSpec, SceneFile, SceneSpec, Site, cityjson, rad, select};
use crate::base::{Place, limits};

/// A file of the scene, as it was read.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Source {
    /// The file, as the project names it.
    pub file: PathBuf,
    /// `Radiance scene`, `CityJSON 2.0`.
    pub format: String,
    /// Coordinate reference system, where it says.
    pub crs: Option<String>,
    /// Objects that have each level of detail (CityJSON).
    pub levels_of_detail: BTreeMap<String, usize>,
    /// Named things in it.
    pub objects: usize,
    /// Surfaces that are part of the scene.
    pub faces: usize,
    /// Their triangles.
    pub triangles: usize,
    /// Surfaces without area, which are left out.
    pub degenerate: usize,
    /// Smallest and largest coordinates in the file, m.
    pub extent_m: Option<[DVec3; 2]>,
    /// Whether its coordinates are those of a map.
    #[serde(skip)]
    pub(super) is_city: bool,
}

/// A scene and what its files were.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub site: Site,
    /// The files, in the order of the project.
    pub sources: Vec<Source>,
    /// Coordinate reference system of map coordinates: the project's, else the first file's.
    pub crs: Option<String>,
}

impl Site {
    /// Reads all files, moves the scene to its local origin, turns it to true north, and picks the
    /// PV. What was noticed lies in [`Site::findings`].
    ///
    /// # Errors
    /// See [`Error`]; faults in the files are collected.
    pub fn load(scene: &SceneSpec, pv: &[PvSpec]) -> Result<Self, Error> {
        load(scene, pv).map(|loaded| loaded.site)
    }
}

/// [`Site::load`], and what the files were.
///
/// # Errors
/// See [`Error`].
pub fn load(scene: &SceneSpec, pv: &[PvSpec]) -> Result<Loaded, Error> {
    check(scene)?;
    let mut draft = Draft::default();
    let mut log = Log::default();
    let mut sources = read_all(scene, pv, &mut draft, &mut log)?;
    for (source, extent) in sources.iter_mut().zip(extents(&draft, scene.files.len())) {
        source.extent_m = extent;
    }
    if draft.surfaces.is_empty() {
        return Err(empty(scene, &draft));
    }
    let crs = reference_system(scene, &sources, &mut log)?;
    let origin = place(scene, &sources, &mut draft)?;
    let mut builder = Builder::new(&draft, &mut log, &mut sources);
    builder.build()?;
    let Builder { triangles, mut faces, candidates, .. } = builder;
    if faces.is_empty() {
        return Err(empty(scene, &draft));
    }
    let mut surfaces = Vec::new();
    for (number, (face, surface)) in
        select::select(&draft, &candidates, pv)?.into_iter().enumerate()
    {
        faces[face].pv = u16::try_from(number).ok();
        surfaces.push(surface);
    }
    for source in &sources {
        log.note(&source.file, source.spelt());
    }
    let (objects, materials) = (draft.objects, draft.materials);
    let findings = log.finish();
    let site = Site::from_parts(triangles, faces, objects, materials, surfaces, origin, findings);
    Ok(Loaded { site, sources, crs })
}

fn check(scene: &SceneSpec) -> Result<(), Error> {
    if scene.files.is_empty() {
        return Err(Error::NoFiles);
    }
    if !(0.0..=1.0).contains(&scene.default_reflectance) {
        return Err(Error::Value {
            key: "default_reflectance",
            found: scene.default_reflectance.to_string(),
            expected: "a reflectance from 0 to 1",
        });
    }
    if !(-360.0..=360.0).contains(&scene.north_deg) {
        return Err(Error::Value {
            key: "north_deg",
            found: scene.north_deg.to_string(),
            expected: "degrees clockwise from the y axis, from -360 to 360",
        });
    }
    if let Origin::At(p) = scene.origin
        && !p.is_finite()
    {
        let expected = "three finite numbers";
        return Err(Error::Value { key: "origin", found: p.to_string(), expected });
    }
    Ok(())
}

/// The formats that are read.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Radiance,
    CityJson,
    CityJsonSequence,
}

fn format_of(file: &SceneFile) -> Result<Format, Error> {
    for (key, value, expected) in [("unit", &file.unit, "m"), ("up", &file.up, "z")] {
        if let Some(found) = value.clone().filter(|v| !v.eq_ignore_ascii_case(expected)) {
            return Err(Error::Setting { path: file.path.clone(), key, found, expected });
        }
    }
    let extension =
        file.path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "rad" => Ok(Format::Radiance),
        "json" => Ok(Format::CityJson),
        "jsonl" => Ok(Format::CityJsonSequence),
        other => Err(Error::Format {
            path: file.path.clone(),
            extension: other.to_owned(),
            hint: match other {
                "obj" | "gltf" | "glb" | "ply" | "stl" | "asc" | "tif" | "tiff" => {
                    "; this format comes with a later version: convert the model until then (Radiance's obj2rad for .obj)"
                }
                "gml" | "xml" => "; convert CityGML with citygml-tools",
                "oct" => "; give the scene files that the octree was made of",
                _ => "",
            },
        }),
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |source| Error::Read { path: path.to_owned(), source };
    let meta = fs::metadata(path).map_err(failed)?;
    if meta.is_dir() {
        return Err(failed(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    let limit = limits::MAX_TEXT_FILE_BYTES;
    if meta.len() > limit {
        return Err(Error::FileTooLarge { path: path.to_owned(), bytes: meta.len(), limit });
    }
    fs::read(path).map_err(failed)
}

fn read_all(
    scene: &SceneSpec,
    pv: &[PvSpec],
    draft: &mut Draft,
    log: &mut Log,
) -> Result<Vec<Source>, Error> {
    let too_many = |Full| Error::TooManyTriangles { limit: limits::MAX_TRIANGLES };
    let formats: Vec<Format> = scene.files.iter().map(format_of).collect::<Result<_, _>>()?;
    let selected = pv.iter().flat_map(|p| [&p.select.modifier, &p.select.material]);
    let mut names = rad::Names::new(scene.default_reflectance, selected.flatten().cloned());
    // City models say nothing about reflectances here: one material for all.
    let plain = draft.materials.len() as u32;
    draft.materials.push(Material {
        name: "default".to_owned(),
        reflectance: [scene.default_reflectance as f32; 3],
        diffuse: true,
    });
    let mut sources = Vec::new();
    let mut levels = Levels::default();
    for (i, (file, &format)) in scene.files.iter().zip(&formats).enumerate() {
        let bytes = bytes_of(&file.path)?;
        let at = (i as u32, file.path.as_path());
        let (first_object, first_surface) = (draft.objects.len(), draft.surfaces.len());
        let mut source = Source::new(&file.path, format != Format::Radiance);
        if format == Format::Radiance {
            let text = String::from_utf8_lossy(&bytes);
            rad::read(at, &text, &mut names, draft, log).map_err(too_many)?;
            source.objects = draft.objects.len() - first_object;
        } else {
            let how = (scene.lod.as_deref(), plain);
            let read = match format {
                Format::CityJson => cityjson::read(at, &bytes, how, draft, log),
                _ => cityjson::read_sequence(at, &bytes, how, draft, log),
            }
            .map_err(too_many)?;
            levels.add(&file.path, &read, scene.lod.as_deref(), log);
            if draft.surfaces.len() == first_surface && log.faults.is_empty() {
                let message = format!(
                    "no geometry: {} city objects, none with surfaces; expected at least one MultiSurface or Solid",
                    read.objects
                );
                log.fault(Place { file: file.path.clone(), ..Place::default() }, message);
            }
            source.format = read.format;
            source.crs = read.crs;
            source.objects = read.objects;
            source.levels_of_detail = read.lods;
        }
        sources.push(source);
        if log.full() {
            break;
        }
    }
    levels.check(scene, log);
    if !log.faults.is_empty() {
        let stopped = log.full();
        return Err(Error::Faults { findings: std::mem::take(&mut log.faults), stopped });
    }
    names.finish(draft, log);
    Ok(sources)
}

/// Which levels of detail the city models have.
#[derive(Default)]
struct Levels {
    known: BTreeMap<String, usize>,
    found: bool,
    file: PathBuf,
}

impl Levels {
    fn add(&mut self, file: &Path, read: &cityjson::Read, wanted: Option<&str>, log: &mut Log) {
        for (lod, count) in &read.lods {
            *self.known.entry(lod.clone()).or_default() += count;
            let same = |w: &str| w == lod || (w.parse().ok() == lod.parse::<f64>().ok());
            self.found |= wanted.is_some_and(same);
        }
        self.file = file.to_owned();
        let place = Place { file: file.to_owned(), ..Place::default() };
        if read.other_lod > 0 {
            let message = format!(
                "{} objects lack the level of detail {}; the next lower one was taken, or the lowest",
                read.other_lod,
                wanted.unwrap_or_default()
            );
            log.warn("files without the level of detail", place.clone(), message);
        }
        if read.unread > 0 {
            let message = format!("{} geometries of points or lines are left out", read.unread);
            log.warn("files with points or lines", place, message);
        }
    }

    /// A level that no object has is a mistake.
    fn check(&self, scene: &SceneSpec, log: &mut Log) {
        let Some(wanted) = &scene.lod else { return };
        if self.found || self.known.is_empty() || !log.faults.is_empty() {
            return;
        }
        let there: Vec<String> =
            self.known.iter().map(|(lod, n)| format!("\"{lod}\" ({n} objects)")).collect();
        let message = format!(
            "lod = \"{wanted}\" is in no object; there are {}: choose one, or leave lod out for the highest",
            there.join(", ")
        );
        log.fault(Place { file: self.file.clone(), ..Place::default() }, message);
    }
}

impl Source {
    fn new(file: &Path, is_city: bool) -> Self {
        Self {
            file: file.to_owned(),
            format: if is_city { "CityJSON" } else { "Radiance scene" }.to_owned(),
            crs: None,
            levels_of_detail: BTreeMap::new(),
            objects: 0,
            faces: 0,
            triangles: 0,
            degenerate: 0,
            extent_m: None,
            is_city,
        }
    }

    fn spelt(&self) -> String {
        let extent = self.extent_m.map_or_else(String::new, |[min, max]| {
            let size = max - min;
            format!(", {:.1} x {:.1} x {:.1} m", size.x, size.y, size.z)
        });
        let crs = self.crs.as_ref().map_or_else(String::new, |c| format!(", {c}"));
        format!(
            "{}: {} objects, {} faces, {} triangles{extent}{crs}",
            self.format, self.objects, self.faces, self.triangles
        )
    }
}

fn empty(scene: &SceneSpec, draft: &Draft) -> Error {
    let files: Vec<String> = scene.files.iter().map(|f| f.path.display().to_string()).collect();
    Error::Empty {
        files: files.join(", "),
        objects: draft.objects.len(),
        expected: "at least one polygon or solid with an area",
    }
}
