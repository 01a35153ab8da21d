//! Meshes, terrain and Radiance's commands: what is read, what is refused, what damage does.

mod commands;
pub mod fuzz;
mod geotiff;
mod meshes;
mod speed;
mod terrain;

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3, vec3};
use glintmap::base::{Purpose, Severity, Stream};
use glintmap::site::{
    Error, Files as SceneFiles, Loaded, Origin, PvSpec, SceneFile, SceneSpec, Select, Site, load,
    load_from, tilt_deg,
};

use crate::support::{self, cpu_time};

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

fn base64(data: &[u8]) -> String {
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let four = |c: &[u8]| {
        let n = (0..3).fold(0_usize, |n, i| n << 8 | usize::from(*c.get(i).unwrap_or(&0)));
        [18, 12, 6, 0].map(|shift| char::from(alphabet[n >> shift & 63]))
    };
    data.chunks(3).flat_map(four).collect()
}

/// A square of 4 m at y = 1 (which is up), as shares of 255; sparse: its third corner at y = 2.
fn quantised(sparse: bool) -> Vec<u8> {
    let mut data: Vec<u8> = Vec::new();
    for [x, z] in [[0, 0], [0, 255], [255, 255], [255, 0]] {
        data.extend([x, 64, z, 0_u8]);
    }
    data.extend([0, 1, 2, 0, 2, 3, 2, 0]);
    data.extend([255, 128, 255, 0]);
    let replaced = r#","sparse":{"count":1,"indices":{"bufferView":1,"byteOffset":22,"componentType":5121},"values":{"bufferView":2}}"#;
    let replaced = if sparse {
        replaced.replace("\"byteOffset\":22", "\"byteOffset\":6")
    } else {
        String::new()
    };
    let uri = base64(&data);
    let step = 4.0;
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_mesh_quantization"],"extensionsRequired":["KHR_mesh_quantization"],
"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"scale":[{step},3.984375,{step}]}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5121,"count":4,"normalized":true,"type":"VEC3","min":[0,64,0],"max":[255,128,255]{replaced}}},
{{"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":16,"byteStride":4}},{{"buffer":0,"byteOffset":16,"byteLength":8}},{{"buffer":0,"byteOffset":24,"byteLength":4}}],
"buffers":[{{"byteLength":28,"uri":"data:application/octet-stream;base64,{uri}"}}]}}"#
    )
    .into_bytes()
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
        let text = base64(&data);
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
