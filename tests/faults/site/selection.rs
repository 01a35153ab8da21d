//! Which faces are PV, where the scene stands, and what looks wrong with it.

use super::*;

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
    // A scene that lies on its side: up is y.
    let side = format!("{roof}w polygon g 0 0 12 -90 -9 -90 90 -9 -90 90 -9 90 -90 -9 90\n");
    says(&doubts("side.rad", &side), &["faces along y", "up = \"y\""]);
    let far = format!("w polygon g 0 0 9 3000 0 0 3100 0 0 3000 100 0\n{roof}");
    says(&doubts("far.rad", &far), &["(roof): lies more than 1000 m"]);
    says(
        &doubts("small.rad", "pv polygon a 0 0 9 0 0 0 1 0 0 0 1 0\n"),
        &["is its unit the metre"],
    );
}
