//! Why a scene can't be used: one variant for each mistake, with what was expected and found.

use std::fmt::Write;
use std::io;
use std::path::PathBuf;

use crate::base::{FaultKind, Finding};

/// Why a scene can't be used. All are faults of the input: exit code 2.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The project names no file.
    #[error("the scene has no files: name at least one under [scene] files")]
    NoFiles,
    /// A file can't be read.
    #[error("can't read the scene file {}: expected a readable file, found: {source}; check [scene] files (paths count from the project's folder)", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file is larger than any that is read whole.
    #[error("{}: {bytes} bytes; a scene file may have {limit} at most: cut the model down to the surroundings of the PV", path.display())]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The most that is read.
        limit: u64,
    },
    /// A kind of file that isn't read.
    #[error("{}: can't tell the format from `{extension}`; known are .rad, .city.json (.json), .city.jsonl (.jsonl), .obj, .gltf, .glb, .ply, .stl, .asc and .tif{hint}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Its extension.
        extension: String,
        /// What to do about this one.
        hint: &'static str,
    },
    /// A setting that this version can't follow.
    #[error("{}: {key} = \"{found}\" can't be followed; expected {expected}", path.display())]
    Setting {
        /// The file.
        path: PathBuf,
        /// `unit` or `up`.
        key: &'static str,
        /// What the project says.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// A file whose format says neither its unit nor which axis points up.
    #[error("{}: {format} files don't say {missing}; expected it in the project: {{ path = \"{}\", unit = \"m\", up = \"z\" }}, or of `new`: --unit m --up z (unit: m, cm, mm, km, in, ft; up: z, y, x)", path.display(), path.display())]
    Unstated {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: &'static str,
        /// `their unit`, `which axis points up`, or both.
        missing: &'static str,
    },
    /// A number of the project that makes no sense.
    #[error("{key} = {found}: expected {expected}")]
    Value {
        /// Its key.
        key: &'static str,
        /// What it is.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// A season of a material that the scene doesn't have.
    #[error(
        "season.modifier = \"{found}\": no material of the scene has this name; the nearest are {nearest}"
    )]
    NoSuchMaterial {
        /// What the project says.
        found: String,
        /// Names that there are.
        nearest: String,
    },
    /// Faults in the files, in the order in which they were met.
    #[error("{}", listed(.findings, *.stopped))]
    Faults {
        /// The faults.
        findings: Vec<Finding>,
        /// Whether reading stopped there: more may follow.
        stopped: bool,
    },
    /// Nothing to hit.
    #[error(
        "{files}: no geometry: found {objects} objects without a usable face; expected {expected}"
    )]
    Empty {
        /// The files.
        files: String,
        /// How many things there are.
        objects: usize,
        /// What would do.
        expected: &'static str,
    },
    /// Radiance files beside map coordinates.
    #[error("{} has map coordinates (around {x:.0}, {y:.0}) and {} local ones, so it isn't known how they lie to each other: set [scene] origin = [x, y, z] to the map coordinates of the Radiance file's origin", city.display(), local.display())]
    MixedCoordinates {
        /// A city model.
        city: PathBuf,
        /// A Radiance file.
        local: PathBuf,
        /// Middle of the city model, m.
        x: f64,
        /// Middle of the city model, m.
        y: f64,
    },
    /// Coordinates too far from the origin for 32-bit floats.
    #[error("{}: coordinates reach {reach_m:.0} m from the local origin; beyond {limit_m:.0} m positions are too coarse: {hint}", path.display())]
    FarFromOrigin {
        /// The file.
        path: PathBuf,
        /// Largest coordinate, m.
        reach_m: f64,
        /// Largest that is accepted, m.
        limit_m: f64,
        /// What to do.
        hint: &'static str,
    },
    /// Coordinates in degrees.
    #[error("{}: its coordinate reference system {crs} is in degrees; expected metres: reproject the model (for example with cjio or citygml-tools)", path.display())]
    Geographic {
        /// The file.
        path: PathBuf,
        /// What it says.
        crs: String,
    },
    /// More triangles than the program holds.
    #[error(
        "the scene has more than {limit} triangles: cut the model down to the surroundings of the PV"
    )]
    TooManyTriangles {
        /// The most there may be.
        limit: usize,
    },
    /// A setting of an array that makes no sense.
    #[error("[[pv]] {entry}: array: {key} = {found}; expected {expected}")]
    Array {
        /// The entry.
        entry: String,
        /// The key.
        key: &'static str,
        /// What it is.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// A polygon that encloses nothing.
    #[error(
        "[[pv]] {entry}: select: polygon of {points} points encloses no area; expected at least three points [x, y] in metres, of finite numbers, around the faces"
    )]
    Polygon {
        /// The entry.
        entry: String,
        /// How many points it has.
        points: usize,
    },
    /// `select` without a key.
    #[error(
        "[[pv]] {entry}: select has no keys; expected at least one of modifier, material, object, surface, min_tilt_deg, max_tilt_deg, azimuth_deg, polygon"
    )]
    SelectEmpty {
        /// The entry.
        entry: String,
    },
    /// No face matches.
    #[error("[[pv]] {entry}: select {select} matches no face; {found}")]
    NothingSelected {
        /// The entry.
        entry: String,
        /// The conditions.
        select: String,
        /// What there is instead, and what to do.
        found: String,
    },
    /// A front that looks down.
    #[error("[[pv]] {entry}: {count} selected {faces} down: {examples}; PV emits from its front (counter-clockwise vertices): reverse the order of the vertices, leave such faces out (max_tilt_deg = 90), or set two_sided = true", faces = if *.count == 1 { "face looks" } else { "faces look" })]
    PvFacesDown {
        /// The entry.
        entry: String,
        /// How many.
        count: usize,
        /// The first few, with their tilt.
        examples: String,
    },
    /// A curved PV.
    #[error("[[pv]] {entry}: {what} is curved; PV surfaces are planar: select polygons or rings")]
    PvCurved {
        /// The entry.
        entry: String,
        /// Which primitive.
        what: String,
    },
    /// A face claimed by two entries.
    #[error(
        "{what} is selected by [[pv]] {first} and by [[pv]] {second}; each face belongs to one: narrow one of the two selections"
    )]
    SelectedTwice {
        /// The face.
        what: String,
        /// One entry.
        first: String,
        /// The other.
        second: String,
    },
    /// More PV than photons can tell apart.
    #[error("the [[pv]] entries select {found} faces; {limit} at most: narrow the selection")]
    TooManyPv {
        /// How many.
        found: usize,
        /// The most there may be.
        limit: usize,
    },
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> FaultKind {
        FaultKind::Input
    }
}

fn listed(findings: &[Finding], stopped: bool) -> String {
    let mut out = String::new();
    for (i, finding) in findings.iter().enumerate() {
        if i > 0 {
            out.push('\n');
        }
        let _ = write!(out, "{}: {}", finding.place, finding.message);
    }
    if stopped {
        let _ = write!(out, "\n… reading stopped after {} faults", findings.len());
    }
    out
}
