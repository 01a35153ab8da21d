use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::build::Builder;
use super::draft::{Draft, Full, Shape, Surface};
use super::format::{Axes, Format, format_of};
use super::log::Log;
use super::mesh::{Mesh, Owner};
use super::placement::{LOCAL_REACH_M, extents, place, reference_system};
use super::{
    Error, Material, Object, Origin, PvSpec, SceneSpec, Site, cityjson, mesh, rad, select, terrain,
};
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
    let formats: Vec<(Format, Axes)> =
        scene.files.iter().map(format_of).collect::<Result<_, _>>()?;
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
    for (i, (file, &(format, axes))) in scene.files.iter().zip(&formats).enumerate() {
        let mut source = Source::new(&file.path, format);
        // Terrain is cut to what the other files hold.
        if format.is_terrain() {
            sources.push(source);
            continue;
        }
        let bytes = bytes_of(&file.path)?;
        let at = (i as u32, file.path.as_path());
        let (first_object, first_surface) = (draft.objects.len(), draft.surfaces.len());
        if format == Format::Radiance {
            let text = String::from_utf8_lossy(&bytes);
            rad::read(at, &text, &mut names, draft, log).map_err(too_many)?;
            source.objects = draft.objects.len() - first_object;
        } else if format.is_mesh() {
            let read = match format {
                Format::Obj => mesh::obj(&file.path, &bytes, log),
                Format::Gltf => mesh::gltf(&file.path, &bytes, log),
                Format::Ply => mesh::ply(&file.path, &bytes, log),
                _ => mesh::stl(&file.path, &bytes, log),
            };
            drop(bytes);
            if let Some(read) = read {
                source.is_city = is_on_a_map(&read, axes);
                add_mesh(read, at, axes, plain, draft, log).map_err(too_many)?;
            }
            source.objects = draft.objects.len() - first_object;
            if draft.surfaces.len() == first_surface && log.faults.is_empty() {
                let message = "no geometry: expected at least one face of three vertices";
                log.fault(Place { file: file.path.clone(), ..Place::default() }, message);
            }
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
    if log.faults.is_empty() {
        terrains(scene, &formats, plain, &mut sources, draft, log)?;
    }
    levels.check(scene, log);
    if !log.faults.is_empty() {
        let stopped = log.full();
        return Err(Error::Faults { findings: std::mem::take(&mut log.faults), stopped });
    }
    names.finish(draft, log);
    Ok(sources)
}

/// Whether a mesh has map coordinates: no local model reaches that far.
fn is_on_a_map(mesh: &Mesh, axes: Axes) -> bool {
    mesh.points.iter().any(|&p| axes.metres(p).truncate().abs().max_element() > LOCAL_REACH_M)
}

/// Adds a mesh and its materials; those without a colour are as the project's default.
fn add_mesh(
    mesh: Mesh,
    (source, file): (u32, &Path),
    axes: Axes,
    plain: u32,
    draft: &mut Draft,
    log: &mut Log,
) -> Result<(), Full> {
    let default = draft.materials[plain as usize].reflectance;
    let materials: Vec<(u32, Option<u32>)> = mesh
        .materials
        .iter()
        .map(|m| {
            let reflectance = m.reflectance.unwrap_or(default);
            draft.materials.push(Material { name: m.name.clone(), reflectance, diffuse: true });
            (draft.materials.len() as u32 - 1, None)
        })
        .collect();
    let owner = Owner { source, line: 0, object: None, materials: &materials, mirrored: false };
    mesh.add(|p| axes.metres(p), &owner, draft, log, file)
}

/// How far beyond the other files terrain is kept, m: further than light is followed by default.
const SURROUNDINGS_M: f64 = 300.0;
/// Half of the edge of a terrain that stands alone, m: positions are exact enough within.
const ALONE_M: f64 = 90_000.0;

/// Reads the terrains, each cut to the surroundings of everything else.
fn terrains(
    scene: &SceneSpec,
    formats: &[(Format, Axes)],
    plain: u32,
    sources: &mut [Source],
    draft: &mut Draft,
    log: &mut Log,
) -> Result<(), Error> {
    if !formats.iter().any(|(format, _)| format.is_terrain()) {
        return Ok(());
    }
    let shift = match scene.origin {
        Origin::At(origin) => origin,
        Origin::Auto => DVec3::ZERO,
    };
    let mut known: Option<terrain::Region> = None;
    for (source, extent) in sources.iter().zip(extents(draft, sources.len())) {
        let Some([min, max]) = extent else { continue };
        let shift = if source.is_city { DVec3::ZERO } else { shift };
        let [low, high] = [min, max].map(|p| (p + shift).truncate());
        known = Some(known.map_or([low, high], |[a, b]| [a.min(low), b.max(high)]));
    }
    let region = known.map(|[a, b]| [a - SURROUNDINGS_M, b + SURROUNDINGS_M]);
    for (i, (file, &(format, _))) in scene.files.iter().zip(formats).enumerate() {
        if !format.is_terrain() {
            continue;
        }
        let place = |line| Place { file: file.path.clone(), line, ..Place::default() };
        let bytes = bytes_of(&file.path)?;
        let read = |region| match format {
            Format::AsciiGrid => terrain::ascii(&bytes, region),
            _ => terrain::geotiff(&bytes, region).map_err(|message| (0, message)),
        };
        let whole = || read(region);
        let grid = match whole() {
            Ok(grid) => grid,
            Err((line, message)) => {
                log.fault(place(line), message);
                continue;
            }
        };
        let grid = match region.is_none().then(|| alone(&grid)).flatten() {
            Some(middle) => match read(Some(middle)) {
                Ok(grid) => grid,
                Err((line, message)) => {
                    log.fault(place(line), message);
                    continue;
                }
            },
            None => grid,
        };
        let corners = terrain::triangles(&grid);
        let [columns, rows] = grid.whole;
        let message = format!(
            "{columns} x {rows} heights, {} x {} around the scene kept; {} triangles within {} m of them",
            grid.layout.columns,
            grid.layout.rows,
            corners.len() / 3,
            terrain::ERROR_M
        );
        log.note(&file.path, message);
        if corners.is_empty() {
            log.fault(
                place(0),
                "no height lies around the other files: do they have the same map coordinates?",
            );
            continue;
        }
        let object = draft.objects.len() as u32;
        let id = file.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        draft.objects.push(Object { id, kind: "terrain".to_owned() });
        let full = |Full| Error::TooManyTriangles { limit: limits::MAX_TRIANGLES };
        let shape: Shape = draft.add_curved(&corners).map_err(full)?;
        let surface =
            Surface { shape, object, material: plain, modifier: None, source: i as u32, line: 0 };
        draft.add_surface(surface).map_err(full)?;
        sources[i].objects = 1;
        sources[i].crs = grid.crs;
    }
    Ok(())
}

/// The middle of a grid that is larger than positions are exact.
fn alone(grid: &terrain::Grid) -> Option<terrain::Region> {
    let l = &grid.layout;
    let corner = |c: usize, r: usize| l.origin + l.axes * glam::DVec2::new(c as f64, r as f64);
    let (last, bottom) = (l.columns.saturating_sub(1), l.rows.saturating_sub(1));
    let corners = [corner(0, 0), corner(last, 0), corner(0, bottom), corner(last, bottom)];
    let low = corners.into_iter().reduce(glam::DVec2::min)?;
    let high = corners.into_iter().reduce(glam::DVec2::max)?;
    let middle = (low + high) * 0.5;
    ((high - low).max_element() > 2.0 * ALONE_M).then_some([middle - ALONE_M, middle + ALONE_M])
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
    fn new(file: &Path, format: Format) -> Self {
        Self {
            file: file.to_owned(),
            format: format.name().to_owned(),
            crs: None,
            levels_of_detail: BTreeMap::new(),
            objects: 0,
            faces: 0,
            triangles: 0,
            degenerate: 0,
            extent_m: None,
            is_city: format.is_city() || format.is_terrain(),
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
