//! Meshes.

use super::*;

#[test]
fn obj_with_groups_materials_and_a_roof_in_one_piece() {
    let files = Files::new();
    files.write("house.mtl", "newmtl brick\nKd 0.6 0.3 0.2\nnewmtl glazed\nKd 0.1\n");
    let site = files.site("house.obj", OBJ, Some(object("roof")));
    assert_eq!(site.pv.len(), 1, "two triangles, one plane, one PV surface");
    assert!((site.pv[0].area_m2 - 8.0 * 40f64.sqrt()).abs() < 1e-4);
    assert!((tilt_deg(site.pv[0].normal) - libm::atan(2.0 / 6.0).to_degrees()).abs() < 1e-6);
    assert_eq!(site.faces.len(), 4);
    let of = |name: &str| site.materials.iter().find(|m| m.name == name).unwrap().reflectance;
    assert_eq!((of("brick"), of("glazed"), of("lawn")), ([0.6, 0.3, 0.2], [0.1; 3], [0.25; 3]));
    says(&said(&site), &["house.obj:1", "missing.mtl"]);
    // The object holds its groups; a material selects as well.
    assert_eq!(files.site("house.obj", OBJ, Some(material("glazed"))).pv.len(), 1);
    let mut select = object("House");
    select.max_tilt_deg = Some(80.0);
    assert_eq!(files.site("house.obj", OBJ, Some(select)).pv.len(), 1);
}

#[test]
fn units_and_axes_are_followed_or_asked_for() {
    let files = Files::new();
    let mut spec = files.spec("house.obj", OBJ);
    spec.files[0].unit = None;
    says(
        &load(&spec, &[]).unwrap_err().to_string(),
        &["OBJ files don't say their unit;", "unit = \"m\""],
    );
    spec.files[0].up = None;
    says(&load(&spec, &[]).unwrap_err().to_string(), &["which axis points up"]);
    (spec.files[0].unit, spec.files[0].up) = (Some("furlong".into()), Some("z".into()));
    says(&load(&spec, &[]).unwrap_err().to_string(), &["unit = \"furlong\"", "m, cm, mm"]);
    (spec.files[0].unit, spec.files[0].up) = (Some("cm".into()), Some("y".into()));
    let site = Site::load(&spec, &[]).unwrap();
    let size = site.bounds.size();
    assert!((size - vec3(0.08, 0.05, 0.06)).length() < 1e-6, "{size}");
}

#[test]
fn stl_of_both_kinds() {
    let files = Files::new();
    let binary = files.site("plate.stl", stl(&SQUARE), Some(object("plate")));
    let text: String = SQUARE
        .iter()
        .map(|t| {
            let corners: String =
                t.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect();
            format!("facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n")
        })
        .collect();
    let ascii =
        files.site("text.stl", format!("solid plate\n{text}endsolid\n"), Some(object("plate")));
    for site in [binary, ascii] {
        assert_eq!((site.pv.len(), site.triangles.len()), (1, 2));
        assert_eq!(site.pv[0].area_m2, 16.0);
    }
    let mut cut = stl(&SQUARE);
    cut.truncate(150);
    says(&files.refusal("cut.stl", renamed(cut)), &["the 2 triangles that it claims"]);
}

/// Without the word that text files begin with.
fn renamed(mut stl: Vec<u8>) -> Vec<u8> {
    stl[..5].copy_from_slice(b"model");
    stl
}

#[test]
fn ply_of_every_encoding() {
    let files = Files::new();
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let site = files.site("plate.ply", ply(encoding), Some(object("plate")));
        assert_eq!(site.pv[0].area_m2, 6.0, "{encoding}");
        assert_eq!(site.bounds.min.z, 7.0);
        let mut cut = ply(encoding);
        cut.truncate(cut.len() - 3);
        says(&files.refusal("cut.ply", cut), &["face", "number 1 is cut short"]);
    }
    says(&files.refusal("x.ply", "plywood\n"), &["x.ply:1", "expected `ply`"]);
    let claim = String::from_utf8(ply("ascii")).unwrap().replace("vertex 4", "vertex 99999999999");
    says(&files.refusal("claim.ply", claim), &["claims 99999999999 times vertex"]);
}

#[test]
fn gltf_and_glb() {
    let files = Files::new();
    for (name, binary) in [("deck.gltf", false), ("deck.glb", true)] {
        let site = files.site(name, gltf([0, 1, 2, 3, 4, 5], binary), Some(material("panel")));
        assert_eq!(site.pv.len(), 1);
        assert_eq!(site.pv[0].area_m2, 64.0);
        assert!((site.pv[0].normal - DVec3::Z).length() < 1e-9);
        assert_eq!((site.bounds.min, site.bounds.max), (vec3(10., 0., 7.), vec3(18., 8., 7.)));
        assert_eq!(site.objects[0].id, "deck");
        assert_eq!(site.materials[1].reflectance, [0.1, 0.2, 0.3]);
    }
    says(&files.refusal("bad.gltf", gltf([0, 1, 2, 3, 4, 6], false)), &["index 6 of 6 vertices"]);
    // Found by the damage tests: the library subtracts its header from this.
    let mut short = gltf([0, 1, 2, 3, 4, 5], true);
    short[8..12].copy_from_slice(&3_u32.to_le_bytes());
    says(&files.refusal("short.glb", short), &["claims 3 bytes in all"]);
    let circle =
        String::from_utf8(gltf([0; 6], false)).unwrap().replace("\"mesh\":0", "\"children\":[0]");
    says(&files.refusal("circle.gltf", circle), &["node 0 has two parents or is its own"]);
}

#[test]
fn quantised_and_sparse_positions() {
    let read = |sparse| {
        let files = SceneFiles::in_memory([("q.gltf", quantised(sparse))]);
        load_from(&files, &SceneSpec::of(["q.gltf"]), &[]).unwrap().site
    };
    // 8-bit shares of 255, four bytes a vertex, under a node that makes them metres.
    let plain = read(false);
    assert_eq!((plain.bounds.min, plain.bounds.max), (vec3(0., -4., 1.), vec3(4., 0., 1.)));
    // One corner lies elsewhere.
    let sparse = read(true);
    assert_eq!(sparse.bounds.max, vec3(4., 0., 2.));
    assert_eq!(sparse.triangles.len(), 2);
    let text = |sparse| String::from_utf8(quantised(sparse)).unwrap();
    for (text, words) in [
        (text(true).replace("\"count\":1,", "\"count\":9,"), "outside its buffer"),
        (text(true).replace("\"byteOffset\":6", "\"byteOffset\":8"), "outside its buffer"),
        (text(false).replace("\"count\":4,", "\"count\":99999999,"), "claims 99999999 items"),
        (text(false).replace("\"count\":4,", "\"count\":6,"), "outside its buffer"),
        (text(false).replace("5121,\"count\":4", "5125,\"count\":4"), "positions are three"),
        (
            text(false).replace("KHR_mesh_quantization", "KHR_draco_mesh_compression"),
            "KHR_draco_mesh_compression",
        ),
    ] {
        let files = SceneFiles::in_memory([("q.gltf", text.into_bytes())]);
        let error = load_from(&files, &SceneSpec::of(["q.gltf"]), &[]).unwrap_err();
        says(&error.to_string(), &["q.gltf", words]);
    }
}
