//! Scenes: what is read of real files, and what broken ones are told.

mod city;
mod index;
mod pv;
mod radiance;
mod selection;

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use glintmap::base::{FaultKind, Severity};
use glintmap::site::check::{summarise, summarise_loaded};
use glintmap::site::{
    Error, Loaded, Origin, PvSpec, SceneFile, SceneSpec, Select, Site, load, local_from_map,
    tilt_deg,
};

use crate::support::{self, cpu_time};

fn pv(select: Select) -> Vec<PvSpec> {
    vec![PvSpec { name: "roof".into(), select, two_sided: false }]
}

fn surface(kind: &str) -> Select {
    Select { surface: Some(kind.into()), ..Select::default() }
}

fn modifier(name: &str) -> Select {
    Select { modifier: Some(name.into()), ..Select::default() }
}

struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    fn load(&self, name: &str, text: &str, select: Option<Select>) -> Result<Site, Error> {
        let path = self.write(name, text);
        Site::load(&SceneSpec::of([path]), &select.map_or_else(Vec::new, pv))
    }

    /// The message of a scene that can't be used.
    fn refusal(&self, name: &str, text: &str, select: Option<Select>) -> String {
        let error = self.load(name, text, select).expect_err("the scene can't be used");
        assert_eq!(error.kind(), FaultKind::Input);
        assert_eq!(error.kind().exit_code(), 2);
        error.to_string()
    }
}

#[track_caller]
fn says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "expected {word:?} in: {message}");
    }
}

fn real(name: &str) -> Option<PathBuf> {
    support::data(&format!("city/{name}"))
}

fn city(path: &Path, lod: Option<&str>, select: Option<Select>) -> Result<Loaded, Error> {
    let mut scene = SceneSpec::of([path]);
    scene.lod = lod.map(str::to_owned);
    load(&scene, &select.map_or_else(Vec::new, pv))
}

/// Faces of a kind.
fn count(site: &Site, kind: &str) -> usize {
    site.faces.iter().filter(|f| site.objects[f.object as usize].kind == kind).count()
}

fn warnings(site: &Site) -> String {
    let warnings = site.findings.iter().filter(|f| f.severity == Severity::Warning);
    warnings.map(|f| format!("{f}\n")).collect()
}

pub(super) const SCENE: &str = "\
# a roof over a yard
void plastic wall 0 0 5 .4 .4 .4 0 0
void alias brick wall
wall polygon yard
0 0 12 -20 -20 0  20 -20 0  20 20 0  -20 20 0
pv polygon roof.1
0 0 12 0 0 5  6 0 5  6 8 7  0 8 7
brick polygon front
0
0
12
  0 0 0   6 0 0
  6 0 5   0 0 5
wall sphere tree 0 0 4 -8 0 3 2
brick cylinder mast 0 0 7 -4 -4 0 -4 -4 9 .1
wall cone spire 0 0 8 10 10 0 10 10 5 2 0
wall ring disc 0 0 8 10 -10 3 0 0 1 1 2
";

fn city_text(objects: &str, vertices: &str) -> String {
    format!(
        r#"{{"type":"CityJSON","version":"2.0","transform":{{"scale":[1,1,1],"translate":[0,0,0]}},"CityObjects":{objects},"vertices":{vertices}}}"#
    )
}

/// A 10 x 10 m roof with a hole of 2 x 2 m, over a ground 5 m below.
const VERTICES: &str = "[[0,0,5],[10,0,5],[10,10,5],[0,10,5],[4,4,5],[6,4,5],[6,6,5],[4,6,5],[0,0,0],[10,0,0],[10,10,0],[0,10,0]]";

pub(super) fn house(semantics: &str) -> String {
    let geometry = format!(
        r#"{{"type":"Solid","lod":"2","boundaries":[[[[0,1,2,3],[4,5,6,7]],[[11,10,9,8]]]],"semantics":{semantics}}}"#
    );
    city_text(
        &format!(
            r#"{{"B":{{"type":"Building","children":["P"]}},"P":{{"type":"BuildingPart","parents":["B"],"geometry":[{geometry}]}}}}"#
        ),
        VERTICES,
    )
}

pub(super) const ROOF_AND_GROUND: &str =
    r#"{"surfaces":[{"type":"RoofSurface"},{"type":"GroundSurface"}],"values":[[0,1]]}"#;

/// A tree that stands where its template is put.
pub(super) const TEMPLATES: &str = r#"{"type":"CityJSON","version":"1.0","CityObjects":{
      "tree":{"type":"SolitaryVegetationObject","geometry":[{"type":"GeometryInstance","template":0,"boundaries":[1],
        "transformationMatrix":[2,0,0,1, 0,2,0,0, 0,0,2,0, 0,0,0,1]}]}},
      "vertices":[[0,0,0],[100,50,3]],
      "geometry-templates":{"templates":[{"type":"MultiSurface","lod":2,"boundaries":[[[0,1,2]]]}],
        "vertices-templates":[[0,0,0],[1,0,0],[0,1,0]]}}"#;
