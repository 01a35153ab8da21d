use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use super::draft::{Draft, Full, Shape};
use super::log::Log;
use super::select::{self, Candidate};
use super::triangulate::{Flaw, MIN_AREA_M2, Triangulator};
use super::{
    Error, Face, Material, Origin, PvSpec, SceneFile, SceneSpec, Site, Triangle, cityjson,
    placement, rad,
};
use crate::base::{Place, limits};

/// Coordinates up to here are taken as local where nothing else is said, m.
const LOCAL_REACH_M: f64 = 10_000.0;
/// Largest coordinate: f32 steps are 8 mm there, m.
const MAX_REACH_M: f64 = 100_000.0;
/// Roof faces that look down are broken up to this area, m2; larger ones may be undersides.
const SMALL_DOWNWARD_M2: f64 = 0.1;
/// Points further than this from their polygon's plane are worth a warning, m.
const WARP_M: f64 = 0.05;

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
    is_city: bool,
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

/// Smallest and largest coordinates of each file.
fn extents(draft: &Draft, files: usize) -> Vec<Option<[DVec3; 2]>> {
    let mut out = vec![None; files];
    for surface in &draft.surfaces {
        let mut grow = |points: &[DVec3]| {
            for &p in points {
                let [min, max] = out[surface.source as usize].get_or_insert([p, p]);
                *min = min.min(p);
                *max = max.max(p);
            }
        };
        match &surface.shape {
            Shape::Planar(rings) => rings.clone().for_each(|r| grow(draft.ring(r))),
            Shape::Curved(points) => {
                grow(&draft.points[points.start as usize..points.end as usize]);
            }
        }
    }
    out
}

/// The coordinate reference system of the scene; warns where files disagree.
fn reference_system(
    scene: &SceneSpec,
    sources: &[Source],
    log: &mut Log,
) -> Result<Option<String>, Error> {
    let mut crs = scene.crs.clone();
    for source in sources {
        let Some(found) = &source.crs else { continue };
        if is_geographic(found) {
            return Err(Error::Geographic { path: source.file.clone(), crs: found.clone() });
        }
        match &crs {
            None => crs = Some(found.clone()),
            Some(first) if !same_plane(first, found) => {
                let message = format!(
                    "its coordinate reference system is {found}, the scene's is {first}: check that they lie to each other as they should"
                );
                let place = Place { file: source.file.clone(), ..Place::default() };
                log.warn("files in another reference system", place, message);
            }
            Some(_) => {}
        }
    }
    Ok(crs)
}

/// The last number in a name such as `EPSG:28992` or `https://…/EPSG/0/7415`.
fn epsg(crs: &str) -> Option<u32> {
    crs.rsplit(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty())?.parse().ok()
}

fn is_geographic(crs: &str) -> bool {
    let known = [4326, 4979, 4258, 4937, 4269, 6318];
    crs.to_ascii_uppercase().contains("EPSG") && epsg(crs).is_some_and(|code| known.contains(&code))
        || crs.to_ascii_uppercase().contains("CRS84")
}

/// Whether two names mean the same plane coordinates; compound systems count as their plane part.
fn same_plane(a: &str, b: &str) -> bool {
    let plane = |crs| match epsg(crs) {
        Some(7415) => Some(28992),
        Some(5554) => Some(25831),
        Some(5555) => Some(25832),
        Some(5556) => Some(25833),
        other => other,
    };
    a == b || (plane(a).is_some() && plane(a) == plane(b))
}

/// Moves and turns the draft's points; returns the map coordinates of the local origin.
fn place(scene: &SceneSpec, sources: &[Source], draft: &mut Draft) -> Result<DVec3, Error> {
    let origin = match scene.origin {
        Origin::At(origin) => origin,
        Origin::Auto => auto_origin(sources)?,
    };
    let turn = placement::turn(scene.north_deg);
    let shift: Vec<DVec3> =
        sources.iter().map(|s| if s.is_city { origin } else { DVec3::ZERO }).collect();
    for (source, shift) in sources.iter().zip(&shift) {
        let Some([min, max]) = source.extent_m else { continue };
        let reach_m = (min - shift).abs().max((max - shift).abs()).max_element();
        if reach_m > MAX_REACH_M {
            return Err(Error::FarFromOrigin {
                path: source.file.clone(),
                reach_m,
                limit_m: MAX_REACH_M,
                hint: if source.is_city {
                    "check [scene] origin, and that all files lie in one place"
                } else {
                    "Radiance files are local; move the scene near the origin (xform -t)"
                },
            });
        }
    }
    // Points lie in the order of the files, but rings of dropped surfaces lie among them: every
    // surface moves its own.
    let Draft { points, rings, surfaces, .. } = draft;
    for surface in surfaces.iter() {
        let shift = shift[surface.source as usize];
        let mut local = |range: &std::ops::Range<u32>| {
            for p in &mut points[range.start as usize..range.end as usize] {
                *p = turn * (*p - shift);
            }
        };
        match &surface.shape {
            Shape::Planar(range) => {
                rings[range.start as usize..range.end as usize].iter().for_each(&mut local);
            }
            Shape::Curved(range) => local(range),
        }
    }
    Ok(origin)
}

fn auto_origin(sources: &[Source]) -> Result<DVec3, Error> {
    let cities = || sources.iter().filter(|s| s.is_city && s.extent_m.is_some());
    let extent = cities()
        .filter_map(|s| s.extent_m)
        .reduce(|[min, max], [low, high]| [min.min(low), max.max(high)]);
    let Some([min, max]) = extent else { return Ok(DVec3::ZERO) };
    let plane = |p: DVec3| p.x.abs().max(p.y.abs());
    if plane(min).max(plane(max)) <= LOCAL_REACH_M {
        return Ok(DVec3::ZERO);
    }
    let middle = (min + max) * 0.5;
    let locals = || sources.iter().find(|s| !s.is_city && s.extent_m.is_some());
    if let (Some(city), Some(local)) = (cities().next(), locals()) {
        return Err(Error::MixedCoordinates {
            city: city.file.clone(),
            local: local.file.clone(),
            x: middle.x,
            y: middle.y,
        });
    }
    Ok(DVec3::new(middle.x.round(), middle.y.round(), min.z.floor()))
}

/// Cuts the draft's surfaces into the scene's faces and triangles.
struct Builder<'a> {
    draft: &'a Draft,
    log: &'a mut Log,
    sources: &'a mut [Source],
    triangles: Vec<Triangle>,
    faces: Vec<Face>,
    candidates: Vec<Candidate>,
    cutter: Triangulator,
    cut: Vec<[DVec3; 3]>,
    /// Faces that were left out for want of area, by source and kind.
    flat: BTreeMap<(u32, String), Vec<u32>>,
    /// Small roof faces that look down, and large ones, by source.
    down: BTreeMap<(u32, bool), Vec<u32>>,
}

impl<'a> Builder<'a> {
    fn new(draft: &'a Draft, log: &'a mut Log, sources: &'a mut [Source]) -> Self {
        Self {
            draft,
            log,
            sources,
            triangles: Vec::new(),
            faces: Vec::new(),
            candidates: Vec::new(),
            cutter: Triangulator::default(),
            cut: Vec::new(),
            flat: BTreeMap::new(),
            down: BTreeMap::new(),
        }
    }

    fn build(&mut self) -> Result<(), Error> {
        for i in 0..self.draft.surfaces.len() as u32 {
            self.surface(i);
            if self.triangles.len() > limits::MAX_TRIANGLES {
                return Err(Error::TooManyTriangles { limit: limits::MAX_TRIANGLES });
            }
        }
        self.report();
        Ok(())
    }

    fn surface(&mut self, i: u32) {
        let draft = self.draft;
        let surface = &draft.surfaces[i as usize];
        self.cut.clear();
        let kind = &draft.objects[surface.object as usize].kind;
        let normal = match &surface.shape {
            Shape::Curved(points) => {
                let points = &draft.points[points.start as usize..points.end as usize];
                self.cut.extend(points.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
                self.cut.retain(|t| as_f32(t).area_m2() > 0.0);
                DVec3::ZERO
            }
            Shape::Planar(rings) => {
                let rings: Vec<&[DVec3]> = rings.clone().map(|r| draft.ring(r)).collect();
                let plane = match self.cutter.cut(&rings, &mut self.cut) {
                    Ok(plane) => plane,
                    Err(Flaw::Points | Flaw::Area) => {
                        self.flat.entry((surface.source, kind.clone())).or_default().push(i);
                        return;
                    }
                };
                let looks_down = kind == "RoofSurface" && plane.normal.z < -1e-3;
                if looks_down {
                    let small = plane.area_m2 < SMALL_DOWNWARD_M2;
                    self.down.entry((surface.source, small)).or_default().push(i);
                    if small {
                        return;
                    }
                }
                if (plane.covered_m2 - plane.area_m2).abs() > 1e-3 * plane.area_m2 + 1e-4 {
                    let message = format!(
                        "its edges cross: {:.3} m2 by its outline, {:.3} m2 in triangles",
                        plane.area_m2, plane.covered_m2
                    );
                    let place = self.place_of(i);
                    self.log.warn("polygons whose edges cross", place, message);
                }
                if plane.warp_m > WARP_M {
                    let message = format!(
                        "not flat: points lie up to {:.2} m beside its plane",
                        plane.warp_m
                    );
                    let place = self.place_of(i);
                    self.log.warn("polygons that aren't flat", place, message);
                }
                plane.normal
            }
        };
        self.push(i, normal);
    }

    fn push(&mut self, i: u32, normal: DVec3) {
        let surface = &self.draft.surfaces[i as usize];
        let kind = &self.draft.objects[surface.object as usize].kind;
        let first_triangle = self.triangles.len() as u32;
        let face = self.faces.len() as u32;
        let mut area_m2 = 0.0;
        for corners in &self.cut {
            let triangle = Triangle { face, ..as_f32(corners) };
            area_m2 += f64::from(triangle.area_m2());
            self.triangles.push(triangle);
        }
        let triangles = self.triangles.len() as u32 - first_triangle;
        if triangles == 0 {
            self.flat.entry((surface.source, kind.clone())).or_default().push(i);
            return;
        }
        let source = &mut self.sources[surface.source as usize];
        source.faces += 1;
        source.triangles += triangles as usize;
        self.faces.push(Face { object: surface.object, material: surface.material, pv: None });
        self.candidates.push(Candidate { surface: i, normal, area_m2, first_triangle, triangles });
    }

    fn place_of(&self, i: u32) -> Place {
        let surface = &self.draft.surfaces[i as usize];
        Place {
            file: self.sources[surface.source as usize].file.clone(),
            line: surface.line as usize,
            column: 0,
            item: self.draft.objects[surface.object as usize].id.clone(),
        }
    }

    /// Says what was left out: one line for each file and kind, with the first few names.
    fn report(&mut self) {
        for ((source, kind), faces) in std::mem::take(&mut self.flat) {
            self.sources[source as usize].degenerate += faces.len();
            let message = format!(
                "{} {kind} faces have no area (below {MIN_AREA_M2} m2) and are left out: {}",
                faces.len(),
                self.named(&faces)
            );
            self.warn_file(source, message);
        }
        for ((source, small), faces) in std::mem::take(&mut self.down) {
            let message = if small {
                format!(
                    "{} RoofSurface faces look downward, have less than {SMALL_DOWNWARD_M2} m2 and are left out: {}",
                    faces.len(),
                    self.named(&faces)
                )
            } else {
                format!(
                    "{} RoofSurface faces look downward; kept as obstacles (undersides, or vertices in the wrong order): {}",
                    faces.len(),
                    self.named(&faces)
                )
            };
            self.warn_file(source, message);
        }
    }

    fn warn_file(&mut self, source: u32, message: String) {
        let file = self.sources[source as usize].file.clone();
        self.log.warn_each(Place { file, ..Place::default() }, message);
    }

    fn named(&self, faces: &[u32]) -> String {
        let mut names: Vec<String> = Vec::new();
        for &i in faces {
            let surface = &self.draft.surfaces[i as usize];
            let mut name = self.draft.objects[surface.object as usize].id.clone();
            if surface.line > 0 {
                name = format!("{name} (line {})", surface.line);
            }
            if !names.contains(&name) {
                names.push(name);
            }
            if names.len() == 4 {
                names[3] = "…".to_owned();
                break;
            }
        }
        names.join(", ")
    }
}

fn as_f32(corners: &[DVec3; 3]) -> Triangle {
    Triangle { corners: corners.map(|c| -> Vec3 { c.as_vec3() }), face: 0 }
}
