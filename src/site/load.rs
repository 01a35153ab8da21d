//! Reads a whole scene: the order in which everything about a site happens.
//!
//! Files are read into a draft, then the coordinate system, the origin and true north are settled,
//! the draft is moved, rows of modules are added, polygons are cut into triangles, and the PV is
//! picked. Faults of all files are collected before anything is refused.

use super::build::Builder;
use super::draft::{Draft, Full, SourceFile};
use super::format::{Axes, Format, format_of};
use super::levels::Levels;
use super::log::Log;
use super::mesh::{Mesh, Owner};
use super::placement::{LOCAL_REACH_M, extents, north, place, reference_system};
use super::source::Source;
use super::surroundings::terrains;
use super::{
    Crowns, Error, Files, Material, North, Origin, PvSpec, SceneSpec, Season, Site, array,
    cityjson, mesh, rad, select,
};
use crate::base::{Place, limits};

/// A scene and what its files were.
#[derive(Debug)]
pub struct Loaded {
    /// The scene.
    pub site: Site,
    /// The files, in the order of the project.
    pub sources: Vec<Source>,
    /// Coordinate reference system of map coordinates: the project's, else the first file's.
    pub crs: Option<String>,
    /// Where true north lies in the files' coordinates.
    pub north: North,
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
    load_from(&Files::on_disk(), scene, pv)
}

/// [`load`] with files that may lie in memory.
///
/// # Errors
/// See [`Error`].
pub fn load_from(files: &Files, scene: &SceneSpec, pv: &[PvSpec]) -> Result<Loaded, Error> {
    check(scene)?;
    let mut draft = Draft::default();
    let mut log = Log::default();
    let mut sources = read_all(files, scene, pv, &mut draft, &mut log)?;
    for (source, extent) in sources.iter_mut().zip(extents(&draft, scene.files.len())) {
        source.extent_m = extent;
    }
    if draft.surfaces.is_empty() {
        return Err(empty(scene, &draft));
    }
    let crs = reference_system(scene, &sources, &mut log)?;
    let north = north(scene, crs.as_deref(), &sources);
    let placement = place(scene, &sources, north.deg, &mut draft)?;
    for entry in &scene.arrays {
        let number = sources.len() as u32;
        sources.push(array::add(entry, &placement, (number, PLAIN), &mut draft)?);
    }
    reflectances(scene, &mut draft);
    let cuts = select::cuts(&draft, pv, &placement)?;
    let mut builder = Builder::new(&draft, &mut log, &mut sources, cuts);
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
    let origin = placement.origin;
    let mut site =
        Site::from_parts(triangles, faces, objects, materials, surfaces, origin, findings);
    for season in &scene.seasons {
        if !site.materials.iter().any(|m| m.name == season.modifier) {
            return Err(unknown_season(&site, season));
        }
    }
    site.crowns = Crowns::of(&site, &scene.seasons);
    Ok(Loaded { site, sources, crs, north })
}

fn unknown_season(site: &Site, season: &Season) -> Error {
    let mut names: Vec<&str> = site.materials.iter().map(|m| m.name.as_str()).collect();
    names.sort_by_key(|n| (strsim::damerau_levenshtein(n, &season.modifier), *n));
    names.truncate(5);
    Error::NoSuchMaterial { found: season.modifier.clone(), nearest: names.join(", ") }
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
    if let Some((name, value)) = scene.reflectance.iter().find(|(_, v)| !(0.0..=1.0).contains(*v)) {
        return Err(Error::Value {
            key: "reflectance",
            found: format!("{{ {name} = {value} }}"),
            expected: "reflectances from 0 to 1",
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

/// Index of the material of surfaces that nothing is said about.
const PLAIN: u32 = 0;

/// Materials whose reflectance the project states.
fn reflectances(scene: &SceneSpec, draft: &mut Draft) {
    for material in &mut draft.materials {
        if let Some(&value) = scene.reflectance.get(&material.name) {
            material.reflectance = [value as f32; 3];
        }
    }
}

fn read_all(
    files: &Files,
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
    let plain = PLAIN;
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
        let bytes = files.scene_file(&file.path)?;
        let at = SourceFile { number: i as u32, path: &file.path };
        let (first_object, first_surface) = (draft.objects.len(), draft.surfaces.len());
        if format == Format::Radiance {
            let text = String::from_utf8_lossy(&bytes);
            rad::read(at, &text, files, &mut names, draft, log).map_err(too_many)?;
            source.objects = draft.objects.len() - first_object;
        } else if format.is_mesh() {
            let read = match format {
                Format::Obj => mesh::obj(files, &file.path, &bytes, log),
                Format::Gltf => mesh::gltf(files, &file.path, &bytes, log),
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
            let how = cityjson::How { wanted: scene.lod.as_deref(), material: plain };
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
        terrains(files, scene, &formats, plain, &mut sources, draft, log)?;
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
    file: SourceFile<'_>,
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
    let owner = Owner {
        source: file.number,
        line: 0,
        object: None,
        materials: &materials,
        mirrored: false,
    };
    mesh.add(|p| axes.metres(p), &owner, draft, log, file.path)
}

fn empty(scene: &SceneSpec, draft: &Draft) -> Error {
    let files: Vec<String> = scene.files.iter().map(|f| f.path.display().to_string()).collect();
    Error::Empty {
        files: files.join(", "),
        objects: draft.objects.len(),
        expected: "at least one polygon or solid with an area",
    }
}
