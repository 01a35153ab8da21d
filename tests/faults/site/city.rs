//! City models.

use super::*;

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
    let text = TEMPLATES;
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
fn rotterdam_as_the_index_describes_it() {
    let Some(path) = real("rotterdam_delfshaven.city.json") else { return };
    let started = cpu_time();
    let select = Select { max_tilt_deg: Some(90.0), ..surface("RoofSurface") };
    let loaded = city(&path, None, Some(select)).unwrap();
    let took = cpu_time() - started;
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
