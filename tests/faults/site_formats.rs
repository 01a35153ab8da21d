//! Meshes, terrain and Radiance's commands: what is read, what is refused, what damage does.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3, vec3};
use glintmap::base::{Purpose, Severity, Stream};
use glintmap::site::{
    Error, Loaded, Origin, PvSpec, SceneFile, SceneSpec, Select, Site, load, tilt_deg,
};

use crate::support;

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

    fn spec(&self, name: &str, bytes: impl AsRef<[u8]>) -> SceneSpec {
        let mut spec = SceneSpec::of([self.write(name, bytes)]);
        stated(&mut spec.files[0]);
        spec
    }

    fn site(&self, name: &str, bytes: impl AsRef<[u8]>, select: Option<Select>) -> Site {
        Site::load(&self.spec(name, bytes), &select.map_or_else(Vec::new, pv)).expect(name)
    }

    fn refusal(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let error = load(&self.spec(name, bytes), &[]).expect_err("the scene can't be used");
        assert_eq!(error.kind().exit_code(), 2);
        error.to_string()
    }
}

/// Says unit and axis where the format doesn't.
fn stated(file: &mut SceneFile) {
    let extension = file.path.extension().unwrap().to_str().unwrap();
    if ["obj", "ply", "stl"].contains(&extension) {
        (file.unit, file.up) = (Some("m".into()), Some("z".into()));
    }
}

fn pv(select: Select) -> Vec<PvSpec> {
    vec![PvSpec { name: "roof".into(), select, two_sided: false }]
}

fn object(id: &str) -> Select {
    Select { object: Some(id.into()), ..Select::default() }
}

fn material(name: &str) -> Select {
    Select { material: Some(name.into()), ..Select::default() }
}

#[track_caller]
fn says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "expected {word:?} in: {message}");
    }
}

fn said(site: &Site) -> String {
    site.findings.iter().map(|f| format!("{f}\n")).collect()
}

/// Height of the ground below a point.
fn ground(site: &Site, x: f32, y: f32) -> Option<f32> {
    let top = site.bounds.max.z + 10.0;
    site.bvh.closest(vec3(x, y, top), Vec3::NEG_Z, 0.0, 1e6).map(|hit| top - hit.distance_m)
}

const OBJ: &str = "\
mtllib house.mtl missing.mtl
o House
v 0 0 0
v 8 0 0
v 8 6 0
v 0 6 0
v 0 0 3
v 8 0 3
v 8 6 5
v 0 6 5
g walls
usemtl brick
f 1/1/1 2/2/1 6/3/1 5//2
f 2 3 7 6
g roof
usemtl glazed
f 5 6 7
f -4 -2 -1
o Yard
usemtl lawn
f 1 \\
  4 3 2
l 1 2 3
";

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

fn stl(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut out = b"solid looks like text".to_vec();
    out.resize(80, b' ');
    out.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        out.extend([0; 12]);
        t.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend([0, 0]);
    }
    out
}

const SQUARE: [[[f32; 3]; 3]; 2] =
    [[[0., 0., 1.], [4., 0., 1.], [4., 4., 1.]], [[0., 0., 1.], [4., 4., 1.], [0., 4., 1.]]];

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

fn ply(encoding: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {encoding} 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty double y\n\
         property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let corners = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]];
    match encoding {
        "ascii" => {
            for [x, y] in corners {
                out.extend(format!("{x} {y} 7 255\n").bytes());
            }
            out.extend(b"4 0 1 2 3\n");
        }
        _ => {
            let big = encoding.contains("big");
            let mut push = |bytes: &[u8]| {
                if big { out.extend(bytes.iter().rev()) } else { out.extend(bytes) }
            };
            for [x, y] in corners {
                push(&(x as f32).to_le_bytes());
                push(&f64::to_le_bytes(y));
                push(&7f32.to_le_bytes());
                push(&[255]);
            }
            push(&[4]);
            (0..4_i32).for_each(|i| push(&i.to_le_bytes()));
        }
    }
    out
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

/// A square of two triangles that share no vertices, under a node that lifts and doubles it.
fn gltf(indices: [u16; 6], binary: bool) -> Vec<u8> {
    let mut data = Vec::new();
    for t in SQUARE {
        for [x, y, z] in t {
            // y is up.
            [x, z, -y].iter().for_each(|v: &f32| data.extend(v.to_le_bytes()));
        }
    }
    indices.iter().for_each(|i| data.extend(i.to_le_bytes()));
    let uri = if binary {
        String::new()
    } else {
        let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let text: String = data
            .chunks(3)
            .flat_map(|c| {
                let n = c.iter().fold(0_usize, |n, &b| n << 8 | usize::from(b));
                (0..4).map(move |i| char::from(alphabet[n >> (18 - 6 * i) & 63]))
            })
            .collect();
        format!(r#","uri":"data:application/octet-stream;base64,{text}""#)
    };
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"name":"lift","translation":[10,5,0],"scale":[2,2,2],"children":[1]}},{{"name":"deck","mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
"materials":[{{"name":"panel","pbrMetallicRoughness":{{"baseColorFactor":[0.1,0.2,0.3,1]}}}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3","min":[0,1,-4],"max":[4,1,0]}},
{{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":72}},{{"buffer":0,"byteOffset":72,"byteLength":12}}],
"buffers":[{{"byteLength":84{uri}}}]}}"#
    );
    if !binary {
        return json.into_bytes();
    }
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    out.extend(2_u32.to_le_bytes());
    out.extend((12 + 8 + json.len() as u32 + 8 + 84).to_le_bytes());
    out.extend((json.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(json);
    out.extend(84_u32.to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(data);
    out
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
    let circle =
        String::from_utf8(gltf([0; 6], false)).unwrap().replace("\"mesh\":0", "\"children\":[0]");
    says(&files.refusal("circle.gltf", circle), &["node 0 has two parents or is its own"]);
}

fn asc(
    columns: usize,
    rows: usize,
    origin: [f64; 2],
    cell: f64,
    z: impl Fn(f64, f64) -> f64,
) -> String {
    let mut out = format!(
        "ncols {columns}\nnrows {rows}\nxllcorner {}\nyllcorner {}\ncellsize {cell}\nNODATA_value -9999\n",
        origin[0], origin[1]
    );
    for row in 0..rows {
        for column in 0..columns {
            let x = origin[0] + (column as f64 + 0.5) * cell;
            let y = origin[1] + ((rows - row) as f64 - 0.5) * cell;
            out.push_str(&format!("{:.4} ", z(x, y)));
        }
        out.push('\n');
    }
    out
}

#[test]
fn a_hill_in_map_coordinates_keeps_its_heights() {
    let files = Files::new();
    let (ox, oy) = (2_600_000.25, 1_200_000.75);
    let hill = |x: f64, y: f64| {
        let (dx, dy) = (x - ox - 400.0, y - oy - 260.0);
        500.0 + 40.0 * libm::exp(-(dx * dx + dy * dy) / 20_000.0) + 0.01 * dx
    };
    let text = asc(401, 263, [ox, oy], 2.0, hill);
    let loaded = load(&files.spec("hill.asc", &text), &[]).unwrap();
    let site = &loaded.site;
    assert!(site.triangles.len() < 30_000, "{} of 209,600 triangles", site.triangles.len());
    for t in &site.triangles {
        assert!(t.normal().z > 0.0);
    }
    let mut random = Stream::new(3, Purpose::Survey, 0);
    for _ in 0..2000 {
        let (x, y) = (ox + 2.0 + random.uniform() * 796.0, oy + 2.0 + random.uniform() * 520.0);
        let local = DVec3::new(x, y, 0.0) - site.origin;
        let z = f64::from(ground(site, local.x as f32, local.y as f32).expect("no gap"))
            + site.origin.z;
        // The bound, the curvature between heights and rounding.
        assert!((z - hill(x, y)).abs() < 0.1 + 0.02 + 0.005, "at {x}, {y}: {z}");
    }
}

#[test]
fn terrain_is_cut_to_the_surroundings_of_the_model() {
    let files = Files::new();
    let text = asc(1001, 1001, [100_000.0, 400_000.0], 5.0, |x, _| (x - 100_000.0) * 0.1);
    let terrain = files.write("ground.asc", text);
    let house = files.write("house.obj", OBJ.replace("v ", "v 10300").replace("mtllib", "#"));
    let moved: String = fs::read_to_string(&house).unwrap();
    let moved = moved
        .lines()
        .map(|line| match line.strip_prefix("v 10300") {
            Some(rest) => {
                let n: Vec<f64> = rest.split(' ').map(|w| w.parse().unwrap()).collect();
                format!("v {} {} {}\n", n[0] + 103_000.0, n[1] + 402_000.0, n[2] + 300.0)
            }
            None => format!("{line}\n"),
        })
        .collect::<String>();
    fs::write(&house, moved).unwrap();
    let mut spec = SceneSpec::of([terrain, house]);
    spec.files.iter_mut().for_each(stated);
    let loaded = load(&spec, &pv(object("roof"))).unwrap();
    let size = loaded.site.bounds.size();
    assert!(size.x < 640.0 && size.x > 600.0 && size.y < 640.0, "{size}");
    assert!(loaded.site.triangles.len() < 2000, "of {} cells", 126 * 126);
    let centre = DVec3::new(103_100.0, 402_100.0, 0.0) - loaded.site.origin;
    let z = ground(&loaded.site, centre.x as f32, centre.y as f32).unwrap();
    assert!((f64::from(z) + loaded.site.origin.z - 310.0).abs() < 0.01);
    // Elsewhere there is nothing to cut out.
    spec.files[0].path = files.write("far.asc", asc(3, 3, [0.0, 0.0], 1.0, |_, _| 0.0));
    says(&load(&spec, &[]).unwrap_err().to_string(), &["no height lies around the other files"]);
}

#[test]
fn the_gully_as_it_was_measured() {
    let Some(path) = support::data("terrain/west_bijou_gully.asc") else { return };
    let loaded = load(&SceneSpec::of([&path]), &[]).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(6)
        .map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect())
        .collect();
    let (mut asked, mut there) = (0, 0);
    for (r, row) in rows.iter().enumerate() {
        for (c, &z) in row.iter().enumerate() {
            let at =
                DVec3::new(559_706.5 + 3.0 * c as f64, 4_380_221.5 + 3.0 * (88 - r) as f64, 0.0);
            let local = at - loaded.site.origin;
            // A ray down the very rim may miss.
            let found = ground(&loaded.site, local.x as f32, local.y as f32);
            there += usize::from(z != 0.0);
            if let (Some(found), true) = (found, z != 0.0) {
                asked += 1;
                let off = f64::from(found) + loaded.site.origin.z - z;
                assert!(off.abs() < 0.101, "row {r}, column {c}: {off}");
            }
        }
    }
    assert!(there > 1000 && asked > there * 9 / 10, "{asked} of {there}");
}

#[test]
fn the_same_place_from_three_ways_to_say_it() {
    let mut centres = Vec::new();
    for (kind, way) in [
        ("tie_point_and_pixel_scale", "area"),
        ("tie_point_and_pixel_scale", "point"),
        ("transformation", "area"),
    ] {
        let name = format!("terrain/geotags/austrian_capitals_model_{kind}_pixel_is_{way}.tif");
        let Some(path) = support::data(&name) else { return };
        let loaded = load(&SceneSpec::of([path]), &[]).unwrap();
        assert_eq!(loaded.crs.as_deref(), Some("EPSG:3035"));
        let t = &loaded.site.triangles[0];
        let middle: DVec3 = t.corners.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / 3.0;
        centres.push((middle + loaded.site.origin, loaded.site.triangles.len()));
    }
    assert_eq!(centres[0], centres[2]);
    // Where pixels are points the same tie point names a middle, not a corner: half a cell of 1 km.
    let off = centres[0].0 - centres[1].0;
    assert!((off - DVec3::new(500.0, -500.0, 0.0)).length() < 0.1, "{off}");
}

#[test]
fn commands_are_executed_or_refused_by_name() {
    let files = Files::new();
    files.write(
        "tree.rad",
        "void plastic leaf 0 0 5 .1 .3 .1 0 0\nleaf polygon top 0 0 9 0 0 2 1 0 2 0 1 2\n",
    );
    files.write("house.obj", OBJ.replace("mtllib", "#"));
    let text = "\
void plastic red 0 0 5 .5 .1 .1 0 0
!xform -n wood -a 10 -t 3 0 0 -a 5 -t 0 3 0 tree.rad   # fifty
!xform -n more -t 100 0 0 \\
  -rz 90 tree.rad | xform -m red
red mesh block 8 house.obj -t 0 0 20 -s 2 -mx 0 0
void mesh plain 1 house.obj 0 0
";
    let site = files.site("scene.rad", text, None);
    assert_eq!(site.faces.len(), 50 + 1 + 4 + 4);
    assert_eq!(site.objects[49].id, "wood.9.4.top");
    let modifier = |face: usize| &site.materials[site.faces[face].material as usize].name;
    assert_eq!((modifier(0).as_str(), modifier(50).as_str()), ("leaf", "red"));
    assert_eq!(modifier(51), "red");
    assert_eq!(modifier(58), "glazed");
    assert_eq!(site.bounds.max.z, 50.0);
    for (text, words) in [
        (
            "!xform -a 1000 -a 1000 -t 1 0 0 tree.rad\n",
            &["s.rad:1:1", "1000000 copies", "100000 at most"][..],
        ),
        ("\n!genbox red b 1 2 3\n", &["s.rad:2:1", "`genbox` isn't run"]),
        ("!cat s.rad\n", &["include each other", "24 deep"]),
        ("!xform -t 1 2 nothing.rad\n", &["s.rad:1:1", "expected a number after -t"]),
        ("!cat /dev/zero\n", &["no ordinary file"]),
        ("!rm -rf x; true\n", &["`;` needs a shell"]),
        ("x mesh m 1 m.rtm 0 0\n", &["s.rad:1:1 (m)", "`m.rtm`", "name the .obj"]),
        ("x instance i 1 i.oct 0 0\n", &["`i.oct`", "octrees aren't read"]),
    ] {
        says(&files.refusal("s.rad", text), words);
    }
    // Copies of copies of copies end by their number, not by the clock.
    let start = Instant::now();
    files.write("a.rad", "!xform -a 100000 -t 0 0 0 b.rad\n");
    files.write("b.rad", "!xform -a 100000 -t 0 0 0 tree.rad\n");
    says(&files.refusal("s.rad", "!cat a.rad\n"), &["bytes of text"]);
    assert!(start.elapsed() < Duration::from_secs(60));
}

/// How often each reader is fed with damaged files: `GLINTMAP_FUZZ` sets it.
pub fn executions() -> u64 {
    std::env::var("GLINTMAP_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(400)
}

/// Damages bytes: bits, digits, cuts, repeats, words swapped.
pub fn damage(bytes: &mut Vec<u8>, random: &mut Stream) {
    let mut below = |n: usize| (random.uniform() * n as f64) as usize;
    for _ in 0..1 + below(5) {
        if bytes.is_empty() {
            return;
        }
        let at = below(bytes.len());
        match below(8) {
            0 => bytes[at] ^= 1 << below(8),
            1 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][below(5)],
            2 | 3 => {
                let digit = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit());
                bytes[digit.unwrap_or(at)] = b"0123456789-e."[below(13)];
            }
            4 => {
                bytes.remove(at);
            }
            5 if below(3) == 0 => bytes.truncate(at),
            6 => {
                let end = (at + 1 + below(40)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                let to = below(bytes.len());
                bytes.splice(to..to, copy);
            }
            _ => {
                // Two words change places.
                let mut words: Vec<Vec<u8>> =
                    bytes.split(|b| *b == b' ').map(<[u8]>::to_vec).collect();
                let (a, b) = (below(words.len()), below(words.len()));
                words.swap(a, b);
                *bytes = words.join(&b' ');
            }
        }
    }
}

#[test]
fn damaged_files_of_every_format_never_panic() {
    let files = Files::new();
    files
        .write("part.rad", "void plastic leaf 0 0 5 .1 .3 .1 0 0\nleaf sphere top 0 0 4 0 0 2 1\n");
    let commands = "!xform -n b -a 3 -t 1 2 3 -rz 30 -i 2 -mx part.rad\n!cat part.rad | xform -s 2\nx mesh m 3 m.obj -rx 5 0 0\n";
    files.write("m.obj", OBJ);
    let mut seeds: Vec<(&str, Vec<u8>)> = vec![
        ("f.rad", commands.as_bytes().to_vec()),
        ("f.obj", OBJ.as_bytes().to_vec()),
        ("f.stl", stl(&SQUARE)),
        ("t.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid".to_vec()),
        ("f.ply", ply("ascii")),
        ("l.ply", ply("binary_little_endian")),
        ("b.ply", ply("binary_big_endian")),
        ("f.gltf", gltf([0, 1, 2, 3, 4, 5], false)),
        ("f.glb", gltf([0, 1, 2, 3, 4, 5], true)),
        ("f.asc", asc(9, 7, [10.0, 20.0], 2.0, |x, y| x * y * 0.01).into_bytes()),
    ];
    for name in ["tie_point_and_pixel_scale_pixel_is_point", "transformation_pixel_is_area"] {
        let name = format!("terrain/geotags/austrian_capitals_model_{name}.tif");
        if let Some(path) = support::data(&name) {
            seeds.push(("f.tif", fs::read(path).unwrap()));
        }
    }
    let (mut read, mut refused) = (0, 0);
    for case in 0..executions() * seeds.len() as u64 {
        let mut random = Stream::new(11, Purpose::Survey, case);
        let (name, bytes) = &seeds[case as usize % seeds.len()];
        let mut bytes = bytes.clone();
        damage(&mut bytes, &mut random);
        let start = Instant::now();
        match load(&files.spec(name, &bytes), &[]) {
            Ok(Loaded { site, .. }) => {
                read += 1;
                assert!(site.triangles.iter().all(|t| t.corners.iter().all(|c| c.is_finite())));
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().len() > 20);
            }
        }
        assert!(start.elapsed() < Duration::from_secs(20), "case {case} of {name}");
    }
    assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
}

/// A million triangles: run by hand, in release (`cargo test --release -- --ignored million`).
#[test]
#[ignore = "a measurement"]
fn a_million_triangles() {
    let files = Files::new();
    let edge = 708;
    let mut text = String::new();
    for y in 0..=edge {
        for x in 0..=edge {
            text.push_str(&format!("v {x} {y} {:.3}\n", f64::from((x * 7 + y * 13) % 19) * 0.1));
        }
    }
    for y in 0..edge {
        for x in 0..edge {
            let a = y * (edge + 1) + x + 1;
            let (b, c, d) = (a + 1, a + edge + 2, a + edge + 1);
            text.push_str(&format!("f {a} {b} {c}\nf {a} {c} {d}\n"));
        }
    }
    let spec = files.spec("million.obj", text);
    let start = Instant::now();
    let site = Site::load(&spec, &[]).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or_default();
    eprintln!(
        "{} triangles, {} faces: {seconds:.2} s, {peak}",
        site.triangles.len(),
        site.faces.len()
    );
    assert!(site.triangles.len() > 1_000_000);
    assert!(site.findings.iter().all(|f| f.severity != Severity::Error));
}

/// What a scene with local and map coordinates is asked for.
#[test]
fn terrain_beside_local_files_needs_an_origin() {
    let files = Files::new();
    let ground = files.write("ground.asc", asc(9, 9, [50_000.0, 60_000.0], 10.0, |_, _| 7.0));
    let local = files.write("yard.rad", "a polygon p 0 0 9 0 0 8 1 0 8 0 1 8\n");
    let mut spec = SceneSpec::of([local, ground]);
    assert!(matches!(load(&spec, &[]), Err(Error::MixedCoordinates { .. } | Error::Faults { .. })));
    spec.origin = Origin::At(DVec3::new(50_045.0, 60_045.0, 0.0));
    let site = load(&spec, &[]).unwrap().site;
    assert_eq!(ground_at(&site), Some(7.0));
}

fn ground_at(site: &Site) -> Option<f32> {
    ground(site, -5.0, 3.0)
}
