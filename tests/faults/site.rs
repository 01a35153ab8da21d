//! Scenes: what is read of real files, and what broken ones are told.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use glintmap::base::{FaultKind, Purpose, Severity, Stream};
use glintmap::site::check::{summarise, summarise_loaded};
use glintmap::site::{
    Error, Loaded, Origin, PvSpec, SceneFile, SceneSpec, Select, Site, load, local_from_map,
    tilt_deg,
};

use crate::support;

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

const SCENE: &str = "\
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

#[test]
fn a_radiance_scene_is_read_as_it_stands() {
    let files = Files::new();
    let site = files.load("scene.rad", SCENE, Some(modifier("pv"))).unwrap();
    assert_eq!(warnings(&site), "");
    assert_eq!(site.origin, DVec3::ZERO);
    assert_eq!(site.faces.len(), 7);
    assert_eq!(site.objects[1].id, "roof.1");
    assert_eq!(site.pv.len(), 1);
    let roof = &site.pv[0];
    assert_eq!(roof.name, "roof");
    assert!((roof.area_m2 - 6.0 * 68f64.sqrt()).abs() < 1e-4);
    assert!((roof.normal - DVec3::new(0.0, -2.0, 8.0).normalize()).length() < 1e-12);
    assert_eq!(site.face_of(roof.triangles[0]).pv, Some(0));
    // The alias is the wall; pv has no definition and needs none.
    let material = |face: usize| &site.materials[site.faces[face].material as usize];
    assert_eq!(material(2).name, "wall");
    assert_eq!(material(2).reflectance, [0.4; 3]);
    assert_eq!(material(1).name, "pv");
    assert_eq!(material(1).reflectance, [0.25; 3]);
    let ring: f32 = site.triangles.iter().filter(|t| t.face == 6).map(|t| t.area_m2()).sum();
    assert!((f64::from(ring) - 3.0 * std::f64::consts::PI).abs() < 0.2, "{ring}");
    // The ball faces outward: a ray from outside meets its front.
    let hit = site
        .bvh
        .closest(glam::vec3(-30.0, 0.0, 3.0), glam::Vec3::X, 0.0, 100.0)
        .expect("the tree is there");
    assert!((hit.distance_m - 20.0).abs() < 0.05);
    assert!(site.triangles[hit.triangle as usize].normal().x < -0.9);
}

#[test]
fn materials_of_one_file_are_known_in_the_next() {
    let files = Files::new();
    let first = files.write("materials.rad", "void metal tin 0 0 5 .7 .6 .5 .2 .1\n");
    let second = files.write("shapes.rad", "tin polygon a 0 0 9 0 0 0 9 0 0 0 9 0\n");
    let site = Site::load(&SceneSpec::of([&first, &second]), &[]).unwrap();
    assert_eq!(site.materials[site.faces[0].material as usize].name, "tin");
    assert_eq!(warnings(&site), "");
    // The other way round the definition comes too late: taken, and said.
    let site = Site::load(&SceneSpec::of([&second, &first]), &[]).unwrap();
    assert_eq!(site.materials[site.faces[0].material as usize].name, "tin");
    says(&warnings(&site), &["shapes.rad:1:1", "`tin` is defined only later", "materials.rad:1:1"]);
}

#[test]
fn what_radiance_has_and_we_do_not_is_said_once_with_its_line() {
    let files = Files::new();
    let text = "\
void colorpict bricks 7 red green blue bricks.hdr . frac(U) frac(V) 0 1 2
bricks plastic wall 0 0 5 .4 .4 .4 0 0
void ashik2 satin 4 1 0 0 . 0 8 .1 .1 .1 .1 .1 .1 10 10
void light lamp 0 0 3 100 100 100
wall polygon a 0 0 9 0 0 0 9 0 0 0 9 0
wall polygon b 0 0 9 0 0 1 9 0 1 0 9 1
satin polygon c 0 0 9 0 0 2 9 0 2 0 9 2
lost polygon d 0 0 9 0 0 3 9 0 3 0 9 3
lamp source sun 0 0 4 0 0 1 .5
void polygon e 0 0 9 0 0 4 9 0 4 0 9 4
wall polygon line 0 0 9 0 0 4 1 0 4 2 0 4
";
    let site = files.load("scene.rad", text, None).unwrap();
    let said = warnings(&site);
    says(
        &said,
        &[
            "scene.rad:2:1 (wall): what `bricks` does",
            "scene.rad:3:1 (satin): material type `ashik2`",
            "scene.rad:8:1 (d): modifier `lost` is defined nowhere",
            "scene.rad:9:1 (sun): source is ignored",
            "scene.rad:10:1 (e): polygon of `void` is left out",
            "1 polygon faces have no area",
            "line (line 11)",
        ],
    );
    assert!(!said.contains("lamp"), "nothing is lit by it: {said}");
    assert_eq!(said.matches("bricks").count(), 1);
    assert_eq!(site.faces.len(), 4);
    // What the scene says about a modifier that is PV doesn't matter.
    let site = files.load("pv.rad", text, Some(modifier("satin"))).unwrap();
    assert!(!warnings(&site).contains("ashik2"));
}

#[test]
fn a_polygon_with_two_vertices() {
    let files = Files::new();
    let text =
        "wall polygon good 0 0 9 0 0 0 1 0 0 0 1 0\n\n  wall polygon bad\n0 0 6 0 0 0 1 0 0\n";
    let message = files.refusal("scene.rad", text, None);
    says(
        &message,
        &[
            "scene.rad:3:3 (bad)",
            "polygon needs at least 3 vertices (9 numbers), found 6 (2 vertices)",
        ],
    );
}

#[test]
fn faults_are_collected_with_line_and_column() {
    let files = Files::new();
    let text = "\
void plastic wall 0 0 3 .4 .4 .4
wall polygon short 0 0 12 0 0 0 1 0 0
wall polygon word 0 0 9 0 0 0 1 0 0 0 l 0
wall polgyon typo 0 0 9 0 0 0 1 0 0 0 1 0
wall polygon count 0 zero 9 0 0 0 1 0 0 0 1 0
wall polygon more 0 0 9 0 0 0 1 0 0 0 1 0 7 8 9
wall polygon odd 0 0 10 0 0 0 1 0 0 0 1 0 5
wall sphere big 0 0 4 0 0 0 inf
wall sphere none 0 0 4 0 0 0 0
wall cylinder far 0 0 7 0 0 0 1e308 0 0 1
wall instance tree 1 tree.oct 0 0
!xform -n tree -t 1 2 3 tree.rad
wall polygon last 0 0 9 0 0 0 1 0 0
";
    let message = files.refusal("scene.rad", text, None);
    says(
        &message,
        &[
            "scene.rad:1:1 (wall): plastic needs 5 numbers",
            "scene.rad:3:1 (short): polygon says it has 12 numbers; expected the 7th of them, found `wall`",
            "scene.rad:3:39 (word): polygon says it has 9 numbers; expected the 8th of them, found `l`",
            "scene.rad:4:6 (typo): unknown type `polgyon`; did you mean `polygon`?",
            "scene.rad:5:22 (count): expected how many integer arguments there are, found `zero`",
            "scene.rad:6:43: expected a modifier's name, found the number `7`",
            "scene.rad:7:1 (odd): a polygon's numbers come in threes",
            "scene.rad:8:29 (big)",
            "scene.rad:9:1 (none): sphere `none`: radius is 0",
            "scene.rad:10:1 (far): 1000000000000",
            "scene.rad:11:1 (tree): instance `tree` refers to `tree.oct`; octrees aren't read",
            "scene.rad:12:1: can't read `",
            "the file ends after 6",
        ],
    );
    assert_eq!(message.lines().count(), 13, "{message}");
    // Not more than a person reads.
    let many = "wall polygon p 0 0 3 0 0 0\n".repeat(100);
    let message = files.refusal("many.rad", &many, None);
    assert_eq!(message.lines().count(), 21);
    says(&message, &["reading stopped after 20 faults"]);
}

#[test]
fn claims_about_counts_cost_nothing() {
    let files = Files::new();
    for text in [
        "wall polygon p 0 0 18446744073709551615 0 0 0",
        "wall polygon p 18446744073709551615 a b",
        "wall polygon",
        "wall",
        "wall polygon p 0 0",
        "wall alias a",
    ] {
        says(&files.refusal("scene.rad", text, None), &["scene.rad:1", "the file ends after"]);
    }
}

#[test]
fn scenes_without_anything() {
    let files = Files::new();
    says(&files.refusal("empty.rad", "# nothing\n", None), &["empty.rad", "no geometry"]);
    let error = Site::load(&SceneSpec::of(Vec::<PathBuf>::new()), &[]).unwrap_err();
    says(&error.to_string(), &["no files"]);
    let error = Site::load(&SceneSpec::of(["/no/such/church.rad"]), &[]).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Input);
    says(&error.to_string(), &["church.rad", "No such file", "[scene] files"]);
    let error = Site::load(&SceneSpec::of([files.write("x.dxf", "v 0 0 0")]), &[]).unwrap_err();
    says(&error.to_string(), &["x.dxf", ".rad", ".city.json", "glTF"]);
    let mut scene = SceneSpec::of([files.write("a.rad", SCENE)]);
    scene.files[0].unit = Some("ft".into());
    says(&Site::load(&scene, &[]).unwrap_err().to_string(), &["unit = \"ft\"", "expected m"]);
    scene.files = vec![SceneFile::new(files.folder.path())];
    says(&Site::load(&scene, &[]).unwrap_err().to_string(), &["can't tell the format"]);
}

fn city_text(objects: &str, vertices: &str) -> String {
    format!(
        r#"{{"type":"CityJSON","version":"2.0","transform":{{"scale":[1,1,1],"translate":[0,0,0]}},"CityObjects":{objects},"vertices":{vertices}}}"#
    )
}

/// A 10 x 10 m roof with a hole of 2 x 2 m, over a ground 5 m below.
const VERTICES: &str = "[[0,0,5],[10,0,5],[10,10,5],[0,10,5],[4,4,5],[6,4,5],[6,6,5],[4,6,5],[0,0,0],[10,0,0],[10,10,0],[0,10,0]]";

fn house(semantics: &str) -> String {
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

const ROOF_AND_GROUND: &str =
    r#"{"surfaces":[{"type":"RoofSurface"},{"type":"GroundSurface"}],"values":[[0,1]]}"#;

#[test]
fn holes_semantics_and_parts_of_a_city_object() {
    let files = Files::new();
    let text = house(ROOF_AND_GROUND);
    let parent = Select {
        object: Some("B".into()),
        surface: Some("RoofSurface".into()),
        ..Select::default()
    };
    let site = files.load("a.city.json", &text, Some(parent)).unwrap();
    assert_eq!(site.pv.len(), 1);
    assert!((site.pv[0].area_m2 - 96.0).abs() < 1e-4);
    assert_eq!(site.objects[0].id, "P");
    // Through the hole to the ground.
    let down = |x, y| {
        let hit = site.bvh.closest(glam::vec3(x, y, 9.0), glam::Vec3::NEG_Z, 0.0, 50.0).unwrap();
        hit.distance_m
    };
    assert_eq!(down(5.0, 5.1), 9.0);
    assert_eq!(down(3.0, 5.1), 4.0);
    // Semantics may be null, for one surface or for a whole shell.
    for null in [
        r#"{"surfaces":[],"values":null}"#,
        r#"{"surfaces":[],"values":[null]}"#,
        r#"{"surfaces":[],"values":[[null,null]]}"#,
    ] {
        let site = files.load("n.city.json", &house(null), None).unwrap();
        assert_eq!(count(&site, "BuildingPart"), 2);
    }
}

#[test]
fn broken_city_models_name_the_object_and_the_path() {
    let files = Files::new();
    let ask = |text: &str| files.refusal("a.city.json", text, None);
    let good = house(ROOF_AND_GROUND);
    says(
        &ask(&good.replace("[11,10,9,8]", "[11,10,9,99]")),
        &[
            "a.city.json (P)",
            "CityObjects/P/geometry[0]/boundaries[0][1][0][3]",
            "vertex index 99",
            "below 12",
        ],
    );
    says(&ask(&good.replace("[11,10,9,8]", "[11,10,-9,8]")), &["a.city.json:1:", "indices"]);
    says(&ask(&good.replace("Solid", "MultiSurface")), &["expected a ring"]);
    says(&ask(&good.replace("Solid", "Slab")), &["geometry[0]/type", "Slab"]);
    says(&ask(&good[..good.len() / 2]), &["a.city.json:1:", "EOF"]);
    says(&ask("{}"), &["expected \"type\": \"CityJSON\""]);
    says(&ask(""), &["EOF"]);
    says(&ask(&good.replace("\"2.0\"", "\"3.0\"")), &["version \"3.0\"", "1.0, 1.1 and 2.0"]);
    says(&ask(&good.replace("transform", "transfrom")), &["no `transform`"]);
    says(&ask(&good.replace("[1,1,1]", "[1,0,1]")), &["transform/scale"]);
    says(&ask(&good.replace("[1,1,1]", "[1e308,1,1]")), &["vertices[1]: too large"]);
    says(&ask(&good.replace("[1,1,1]", "[1e400,1,1]")), &["out of range"]);
    says(&ask(&good.replace("\"P\":{", "\"B\":{")), &["CityObjects/B: the id occurs twice"]);
    says(&ask(&good.replace("[1,1,1]", "[1e6,1,1]")), &["origin"]);
    let no_geometry = city_text(r#"{"B":{"type":"Building"}}"#, "[]");
    says(&ask(&no_geometry), &["a.city.json: no geometry", "1 city objects", "MultiSurface"]);
    says(&ask(&city_text("{}", "[]")), &["no geometry: 0 city objects"]);
    let flat = good.replace("[10,10,5]", "[10,0,5]").replace("[0,10,5]", "[5,0,5]");
    let flat = flat.replace("[11,10,9,8]", "[11,11,9,9]");
    says(&ask(&flat), &["no geometry"]);
    let degrees = good.replace(
        "\"CityObjects\"",
        r#""metadata":{"referenceSystem":"https://www.opengis.net/def/crs/EPSG/0/4326"},"CityObjects""#,
    );
    says(&ask(&degrees), &["degrees", "metres"]);
}

#[test]
fn templates_stand_where_their_instances_say() {
    let files = Files::new();
    let text = r#"{"type":"CityJSON","version":"1.0","CityObjects":{
      "tree":{"type":"SolitaryVegetationObject","geometry":[{"type":"GeometryInstance","template":0,"boundaries":[1],
        "transformationMatrix":[2,0,0,1, 0,2,0,0, 0,0,2,0, 0,0,0,1]}]}},
      "vertices":[[0,0,0],[100,50,3]],
      "geometry-templates":{"templates":[{"type":"MultiSurface","lod":2,"boundaries":[[[0,1,2]]]}],
        "vertices-templates":[[0,0,0],[1,0,0],[0,1,0]]}}"#;
    let site = files.load("t.city.json", text, None).unwrap();
    assert_eq!(site.triangles[0].corners[0], glam::vec3(101.0, 50.0, 3.0));
    assert_eq!(site.triangles[0].corners[1], glam::vec3(103.0, 50.0, 3.0));
    let message =
        files.refusal("t.city.json", &text.replace("\"template\":0", "\"template\":1"), None);
    says(&message, &["geometry[0]/template", "below 1"]);
    files.refusal("t.city.json", &text.replace("0,0,0,1]", "0,0,1]"), None);
    files.refusal("t.city.json", &text.replace("[[[0,1,2]]]", "[[[0,1,3]]]"), None);
}

#[test]
fn selections_that_select_nothing_say_what_there_is() {
    let files = Files::new();
    let ask = |select| files.refusal("scene.rad", SCENE, Some(select));
    says(
        &ask(modifier("wal")),
        &["[[pv]] roof", "did you mean `wall`?", "wall (4 faces,", "pv (1 faces,"],
    );
    says(
        &ask(Select { material: Some("brick".into()), ..Select::default() }),
        &["the materials are: wall"],
    );
    says(
        &ask(Select { object: Some("roof.2".into()), ..Select::default() }),
        &["did you mean `roof.1`", "7 objects"],
    );
    says(&ask(surface("RoofSurface")), &["the surface types are: polygon (3 faces"]);
    says(&ask(Select { min_tilt_deg: Some(40.0), ..modifier("pv") }), &["tilt 14 azimuth 180"]);
    says(
        &ask(Select { azimuth_deg: Some([0.0, 90.0]), ..modifier("pv") }),
        &["tilt 14 azimuth 180"],
    );
    says(
        &ask(Select { object: Some("yard".into()), ..modifier("pv") }),
        &["no face has all of them"],
    );
    says(&ask(Select::default()), &["select has no keys", "modifier"]);
    says(&ask(Select { min_tilt_deg: Some(f64::NAN), ..modifier("pv") }), &["min_tilt_deg = NaN"]);
    says(&ask(surface("sphere")), &["curved", "tree", "planar"]);
    let text = house(ROOF_AND_GROUND);
    let message = files.refusal("a.city.json", &text, Some(modifier("pv")));
    says(&message, &["no modifiers at all", "Radiance"]);
}

#[test]
fn a_pv_that_looks_down() {
    let files = Files::new();
    let down = "pv polygon roof.1 0 0 12 0 8 7  6 8 7  6 0 5  0 0 5\nw polygon g 0 0 9 0 0 0 9 0 0 0 9 0\n";
    let message = files.refusal("scene.rad", down, Some(modifier("pv")));
    says(
        &message,
        &["[[pv]] roof", "`roof.1`", "line 1", "tilt 166.0 degrees", "two_sided", "vertices"],
    );
    let path = files.write("two.rad", down);
    let mut entries = pv(modifier("pv"));
    entries[0].two_sided = true;
    let site = Site::load(&SceneSpec::of([path]), &entries).unwrap();
    assert!(site.pv[0].two_sided && site.pv[0].normal.z < 0.0);
    // A wall is neither.
    let wall = "pv polygon w 0 0 12 0 0 0 5 0 0 5 0 3 0 0 3\n";
    let site = files.load("wall.rad", wall, Some(modifier("pv"))).unwrap();
    assert_eq!(tilt_deg(site.pv[0].normal), 90.0);
}

#[test]
fn a_face_belongs_to_one_entry_and_entries_number_their_faces() {
    let files = Files::new();
    let path = files.write("scene.rad", SCENE);
    let entry = |name: &str, select| PvSpec { name: name.into(), select, two_sided: false };
    let both = [
        entry("a", modifier("pv")),
        entry(
            "b",
            Select { min_tilt_deg: Some(10.0), max_tilt_deg: Some(20.0), ..surface("polygon") },
        ),
    ];
    let message = Site::load(&SceneSpec::of([&path]), &both).unwrap_err().to_string();
    says(&message, &["`roof.1`", "[[pv]] a", "[[pv]] b"]);
    let polygons =
        Site::load(&SceneSpec::of([&path]), &[entry("all", surface("polygon"))]).unwrap();
    let names: Vec<&str> = polygons.pv.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["all/1", "all/2", "all/3"]);
}

#[test]
fn north_and_origin_place_the_scene() {
    let files = Files::new();
    let path = files.write("scene.rad", SCENE);
    let mut scene = SceneSpec::of([&path]);
    scene.north_deg = 90.0;
    let site = Site::load(&scene, &pv(modifier("pv"))).unwrap();
    // The roof faces the file's -y; with north on the file's +x that is the west... of +y: east.
    let expected = local_from_map(DVec3::new(0.0, -2.0, 8.0).normalize(), DVec3::ZERO, 90.0);
    assert!((site.pv[0].normal - expected).length() < 1e-9);
    assert!((glintmap::site::azimuth_deg(site.pv[0].normal).unwrap() - 90.0).abs() < 1e-9);

    // Map coordinates: moved, and a Radiance file beside them needs a stated origin.
    let map = house(ROOF_AND_GROUND)
        .replace("\"translate\":[0,0,0]", "\"translate\":[85000.25,446000.5,-3.5]");
    let map = files.write("map.city.json", map);
    let site = Site::load(&SceneSpec::of([&map]), &[]).unwrap();
    assert_eq!(site.origin, DVec3::new(85005.0, 446006.0, -4.0));
    assert_eq!(site.bounds.min, glam::vec3(-4.75, -5.5, 0.5));
    let mut scene = SceneSpec::of([&map, &path]);
    let message = Site::load(&scene, &[]).unwrap_err().to_string();
    says(&message, &["map.city.json", "scene.rad", "origin = [x, y, z]"]);
    scene.origin = Origin::At(DVec3::new(85000.0, 446000.0, 0.0));
    let site = Site::load(&scene, &[]).unwrap();
    assert_eq!(site.bounds.min, glam::vec3(-20.0, -20.0, -3.5));
    scene.origin = Origin::At(DVec3::ZERO);
    says(
        &Site::load(&scene, &[]).unwrap_err().to_string(),
        &["local origin", "check [scene] origin"],
    );
    scene.origin = Origin::At(DVec3::NAN);
    says(&Site::load(&scene, &[]).unwrap_err().to_string(), &["origin"]);
}

#[test]
fn rotterdam_as_the_index_describes_it() {
    let Some(path) = real("rotterdam_delfshaven.city.json") else { return };
    let started = std::time::Instant::now();
    let select = Select { max_tilt_deg: Some(90.0), ..surface("RoofSurface") };
    let loaded = city(&path, None, Some(select)).unwrap();
    let took = started.elapsed();
    let site = &loaded.site;
    let source = &loaded.sources[0];
    assert_eq!(source.objects, 853);
    assert_eq!(source.format, "CityJSON 2.0");
    assert!(loaded.crs.as_deref().unwrap().ends_with("28992"));
    // 2,998 roof faces: 105 without area, 3 slivers that look downward.
    assert_eq!(count(site, "RoofSurface"), 2998 - 105 - 3);
    assert_eq!(count(site, "GroundSurface"), 853);
    assert_eq!(count(site, "WallSurface"), 11631 - 537);
    let said = warnings(site);
    says(
        &said,
        &[
            "105 RoofSurface faces have no area",
            "537 WallSurface faces have no area",
            "3 RoofSurface faces look downward",
            "{78771238-F3E2-42C5-9AF3-BC9F27EA7130}",
        ],
    );
    let roof_m2: f64 = site.pv.iter().map(|p| p.area_m2).sum();
    assert!((roof_m2 - 145_002.0).abs() < 1.0, "{roof_m2}");
    let pitched = site.pv.iter().filter(|p| tilt_deg(p.normal) > 5.0).count();
    assert!((1170..=1176).contains(&pitched), "{pitched}");
    let size = site.bounds.size();
    assert!((size.x - 1044.559).abs() < 0.01 && (size.y - 649.506).abs() < 0.01);
    assert_eq!(site.origin.fract(), DVec3::ZERO);
    for triangle in &site.triangles {
        let normal = triangle.normal();
        assert!(normal.is_finite() && (normal.length() - 1.0).abs() < 1e-4);
    }
    // 0.1 s on an idle machine; a quadratic reader would take minutes.
    assert!(took.as_secs_f64() < 10.0, "{took:?}");
    eprintln!("read in {took:?}");

    let summary = summarise_loaded(&loaded);
    assert_eq!(summary.pv.len(), site.pv.len());
    let text = summary.to_string();
    says(
        &text,
        &["RoofSurface", "local origin = map (90932.000, 435765.000, 0.000)", "no surface"],
    );
    assert!(serde_json::to_string(&summary).unwrap().contains("\"kind\":\"RoofSurface\""));
}

#[test]
fn a_selection_in_rotterdam_follows_tilt_and_azimuth() {
    let Some(path) = real("rotterdam_delfshaven.city.json") else { return };
    let select = Select {
        object: Some("{FA625111-F80F-4617-9613-A60489C6E4ED}".into()),
        surface: Some("RoofSurface".into()),
        min_tilt_deg: Some(10.0),
        max_tilt_deg: Some(50.0),
        azimuth_deg: Some([200.0, 300.0]),
        ..Select::default()
    };
    let loaded = city(&path, None, Some(select)).unwrap();
    for surface in &loaded.site.pv {
        let azimuth = glintmap::site::azimuth_deg(surface.normal).unwrap();
        assert!((azimuth - 247.0).abs() < 1.5 && (tilt_deg(surface.normal) - 27.0).abs() < 1.0);
    }
    assert!(loaded.site.pv.iter().map(|p| p.area_m2).sum::<f64>() > 200.0);
}

#[test]
fn the_same_two_buildings_in_both_encodings() {
    let (Some(json), Some(lines)) = (real("3dbag_b2.city.json"), real("3dbag_b2.city.jsonl"))
    else {
        return;
    };
    let a = city(&json, None, Some(surface("RoofSurface"))).unwrap().site;
    let b = city(&lines, None, Some(surface("RoofSurface"))).unwrap();
    assert_eq!(b.sources[0].format, "CityJSONSeq 2.0");
    let b = b.site;
    assert_eq!((a.pv.len(), b.pv.len()), (10, 10));
    assert_eq!(a.origin, b.origin);
    assert_eq!(a.bounds, b.bounds);
    assert_eq!(a.triangles.len(), b.triangles.len());
    // The files order their objects differently: compare as sets.
    let set = |site: &Site| {
        let mut rows: Vec<_> = site
            .triangles
            .iter()
            .map(|t| {
                let object = &site.objects[site.faces[t.face as usize].object as usize];
                let mut corners = t.corners.map(|c| c.to_array().map(f32::to_bits));
                corners.sort_unstable();
                (corners, object.id.clone(), object.kind.clone())
            })
            .collect();
        rows.sort();
        rows
    };
    assert!(set(&a) == set(&b));
    // The building's id means its part.
    let parent =
        Select { object: Some("NL.IMBAG.Pand.0503100000028341".into()), ..surface("RoofSurface") };
    let part = city(&json, None, Some(parent)).unwrap().site;
    assert!(!part.pv.is_empty() && part.pv.len() < 10);
}

#[test]
fn one_level_of_detail_not_all_three() {
    let Some(path) = real("multi_lod.city.json") else { return };
    let highest = city(&path, None, Some(surface("RoofSurface"))).unwrap();
    assert_eq!(highest.site.pv.len(), 84);
    assert_eq!(highest.site.faces.len(), 204 + 84 + 60);
    assert_eq!(highest.sources[0].levels_of_detail.len(), 3);
    let low = city(&path, Some("1.2"), None).unwrap().site;
    assert!(low.faces.len() < highest.site.faces.len() + 1000 && count(&low, "RoofSurface") == 0);
    let same = city(&path, Some("2.2"), None).unwrap().site;
    assert_eq!(same.triangles.len(), highest.site.triangles.len());
    // Three coincident buildings would show.
    let doubts = glintmap::site::check::doubts(&highest.site, 100.0);
    assert!(!doubts.iter().any(|d| d.message.contains("same place")), "{doubts:?}");
    let error = city(&path, Some("7"), None).unwrap_err().to_string();
    says(&error, &["lod = \"7\"", "\"1.2\" (10 objects)", "\"2.2\" (10 objects)"]);
}

#[test]
fn delft_has_no_roof_surfaces_and_says_what_it_has() {
    let Some(path) = real("delft_lod1_terrain.city.json") else { return };
    let error = city(&path, None, Some(surface("RoofSurface"))).unwrap_err();
    assert_eq!(error.kind(), FaultKind::Input);
    says(&error.to_string(), &["surface types are", "Building (", "LandUse (", "Road ("]);
    let loaded = city(&path, None, None).unwrap();
    assert_eq!(loaded.sources[0].objects, 570);
    let Some(path) = real("denhaag_small.city.json") else { return };
    let loaded = city(&path, None, Some(surface("RoofSurface"))).unwrap();
    assert_eq!(loaded.site.pv.len(), 13);
    assert_eq!(loaded.sources[0].format, "CityJSON 1.1");
}

/// The example project's scene, as its project.toml and README describe it.
#[test]
fn the_building_of_the_example_project() {
    let Some(path) = real("rotterdam_delfshaven.city.json") else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/projects/rotterdam");
    let text = fs::read_to_string(folder.join("project.toml")).unwrap();
    let project: toml::Table = text.parse().unwrap();
    let files = project["scene"]["files"].as_array().unwrap();
    assert!(Path::new(files[0].as_str().unwrap()).ends_with("city/rotterdam_delfshaven.city.json"));
    let origin: Vec<f64> = project["scene"]["origin"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_float().unwrap())
        .collect();
    let select = &project["pv"][0]["select"];
    let mut scene = SceneSpec::of([path, folder.join("ground.rad")]);
    scene.origin = Origin::At(DVec3::from_slice(&origin));
    let select = Select {
        object: Some(select["object"].as_str().unwrap().into()),
        surface: Some(select["surface"].as_str().unwrap().into()),
        min_tilt_deg: select["min_tilt_deg"].as_float(),
        max_tilt_deg: select["max_tilt_deg"].as_float(),
        ..Select::default()
    };
    let loaded = load(&scene, &pv(select)).unwrap();
    let site = &loaded.site;
    assert_eq!(site.pv.len(), 8);
    let area: f64 = site.pv.iter().map(|p| p.area_m2).sum();
    assert!((area - 747.0).abs() < 1.0, "{area}");
    for surface in &summarise_loaded(&loaded).pv {
        assert!(surface.centre_m.truncate().length() < 30.0, "{surface:?}");
        assert!((surface.tilt_deg - 26.57).abs() < 0.1);
    }
    // The surroundings are there: street or roof under every point.
    assert_eq!(glintmap::site::check::missing_ground(site, 100.0), 0.0);
}

#[test]
fn what_looks_wrong_is_said() {
    let files = Files::new();
    let doubts = |name: &str, text: &str| -> String {
        let site = files.load(name, text, Some(modifier("pv"))).unwrap();
        summarise(&site).doubts.iter().map(|d| format!("{d}\n")).collect()
    };
    let ground = "w polygon g 0 0 12 -200 -200 0 200 -200 0 200 200 0 -200 200 0\n";
    let roof = "pv polygon roof 0 0 12 0 0 5 6 0 5 6 8 7 0 8 7\n";
    assert_eq!(doubts("good.rad", &format!("{ground}{roof}")), "");
    // Half of the surroundings are missing.
    let half = "w polygon g 0 0 12 0 -200 0 200 -200 0 200 200 0 0 200 0\n";
    let said = doubts("half.rad", &format!("{half}{roof}"));
    says(&said, &["% of the ground within 100 m", "ground polygon"]);
    let share: f64 =
        said.split("[scene]: ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // The roof's centre lies 3 m inside the half that is there.
    assert!((44.0..=49.0).contains(&share), "{said}");
    let double = format!("{ground}{roof}{}", roof.replace("pv", "w").replace("roof", "old"));
    says(
        &doubts("double.rad", &double),
        &["2 triangles lie in the same place", "(roof): another surface"],
    );
    let far = format!("w polygon g 0 0 9 3000 0 0 3100 0 0 3000 100 0\n{roof}");
    says(&doubts("far.rad", &far), &["(roof): lies more than 1000 m"]);
    says(
        &doubts("small.rad", "pv polygon a 0 0 9 0 0 0 1 0 0 0 1 0\n"),
        &["is its unit the metre"],
    );
}

/// A polygon like a comb makes nested slivers, and those a hierarchy of hundreds of levels, where
/// the library's traversal panics.
#[test]
fn a_comb_is_an_ordinary_polygon() {
    use std::fmt::Write;
    let files = Files::new();
    let comb = |teeth: usize| {
        let mut text = format!(
            "void plastic w 0 0 5 .4 .4 .4 0 0\nw polygon comb 0 0 {} ",
            (2 * teeth + 2) * 3
        );
        for i in 0..teeth {
            write!(text, "{} 1 0 {} 90 0 ", i as f64 * 0.02, i as f64 * 0.02 + 0.01).unwrap();
        }
        text + &format!("{} -1 0 -5 -1 0", teeth as f64 * 0.02)
    };
    let site = files.load("comb.rad", &comb(1000), None).unwrap();
    assert_eq!(warnings(&site), "");
    let down =
        |x: f32, y: f32| site.bvh.occluded(glam::vec3(x, y, 5.0), glam::Vec3::NEG_Z, 0.0, 9.0);
    assert!(down(4.0, 0.0) && down(10.01, 20.0) && !down(10.0, 80.0) && !down(25.0, 0.0));
    says(&files.refusal("comb.rad", &comb(10_000), None), &["20002 vertices", "divide it"]);
}

/// Broken bytes give an error or a scene, never a panic or a hang; what is read is finite.
#[test]
fn mutated_files_never_panic() {
    let files = Files::new();
    let mut seeds: Vec<(&str, Vec<u8>)> = vec![
        ("m.rad", SCENE.as_bytes().to_vec()),
        ("m.city.json", house(ROOF_AND_GROUND).into_bytes()),
    ];
    for name in ["3dbag_b2.city.json", "3dbag_b2.city.jsonl", "denhaag_small.city.json"] {
        if let Some(path) = real(name) {
            seeds.push((name, fs::read(path).unwrap()));
        }
    }
    let (mut read, mut refused) = (0, 0);
    for case in 0..600_u64 {
        let mut random = Stream::new(7, Purpose::Survey, case);
        let (name, bytes) = &seeds[case as usize % seeds.len()];
        let mut bytes = bytes.clone();
        let mut below = |n: usize| (random.uniform() * n as f64) as usize;
        for _ in 0..1 + below(6) {
            let at = below(bytes.len());
            match below(5) {
                0 => bytes[at] ^= 1 << below(8),
                // Another digit changes a number and keeps the syntax.
                1 | 2 => {
                    let digit = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit());
                    bytes[digit.unwrap_or(at)] = b'0' + below(10) as u8;
                }
                3 => {
                    bytes.remove(at);
                }
                _ if below(4) == 0 => bytes.truncate(at.max(1)),
                _ => bytes.insert(at, b"0-9e[]{},\"#!\n"[below(13)]),
            }
        }
        let path = files.write(name, &bytes);
        let select = if name.ends_with("rad") { modifier("pv") } else { surface("RoofSurface") };
        match load(&SceneSpec::of([path]), &pv(select)) {
            Ok(loaded) => {
                read += 1;
                assert!(
                    loaded.site.triangles.iter().all(|t| t.corners.iter().all(|c| c.is_finite()))
                );
                assert!(loaded.site.pv.iter().all(|p| p.normal.is_finite() && p.area_m2 > 0.0));
                let _ = summarise(&loaded.site).to_string();
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().len() > 20);
            }
        }
    }
    assert!(read > 50 && refused > 50, "{read} read, {refused} refused");
}
