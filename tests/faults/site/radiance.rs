//! Radiance scenes.

use super::*;

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
