//! Our first hits against those of Radiance's `rtrace`: every surface type under every transform.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use glam::DVec3;
use glintmap::base::{Purpose, Stream};
use glintmap::site::{SceneSpec, Site};

use crate::support;

const RAYS: usize = 1000;

fn binaries() -> Option<PathBuf> {
    let python = support::python()?;
    let script = "import os, pyradiance; print(os.path.dirname(pyradiance.__file__))";
    let out = Command::new(python).args(["-c", script]).output().expect("python starts");
    let folder = PathBuf::from(String::from_utf8(out.stdout).expect("a path").trim()).join("bin");
    if !folder.join("rtrace").exists() {
        support::skip("pyradiance has no rtrace");
        return None;
    }
    Some(folder)
}

/// Shapes: name, primitive, and how far a chord may lie from the curve, m (0: planar).
const SHAPES: [(&str, &str, f64); 15] = [
    ("polygon", "red polygon p 0 0 15 0 0 0 4 0 0 5 2 0 2 1 0 0 3 0\n", 0.0),
    (
        "hole",
        "red polygon p 0 0 30 -4 -4 1 4 -4 1 4 4 1 -4 4 1 -4 -4 1 -2 -2 1 -2 2 1 2 2 1 2 -2 1 -2 -2 1\n",
        0.0,
    ),
    (
        "box",
        "red polygon a 0 0 12 0 0 0 0 2 0 3 2 0 3 0 0\nblue polygon b 0 0 12 0 0 2 3 0 2 3 2 2 0 2 2\n\
         red polygon c 0 0 12 0 0 0 3 0 0 3 0 2 0 0 2\nblue polygon d 0 0 12 0 2 0 0 2 2 3 2 2 3 2 0\n\
         green polygon e 0 0 12 0 0 0 0 0 2 0 2 2 0 2 0\ngreen polygon f 0 0 12 3 0 0 3 2 0 3 2 2 3 0 2\n",
        0.0,
    ),
    ("sphere", "red sphere s 0 0 4 1 0 1 2\n", 0.01),
    ("bubble", "red bubble s 0 0 4 0 1 0 2.5\n", 0.01),
    ("cylinder", "blue cylinder c 0 0 7 0 0 -1 1 1 3 1.5\n", 0.01),
    ("tube", "blue tube c 0 0 7 0 0 -1 0 0 3 2\n", 0.01),
    ("cone", "green cone k 0 0 8 0 0 0 0 1 4 2.5 0.5\n", 0.01),
    ("cup", "green cup k 0 0 8 0 0 0 0 0 4 0.5 3\n", 0.01),
    ("tip", "green cone k 0 0 8 0 0 0 1 0 4 2.5 0\n", 0.01),
    ("ring", "red ring r 0 0 8 0 0 1 1 0.5 2 1 4\n", 0.0),
    ("disc", "red ring r 0 0 8 0 0 1 1 0.5 -2 0 3\n", 0.0),
    ("mesh", "blue mesh m 4 block.obj -rz 20 -mx 0 0\n", 0.0),
    ("source", "lamp source s 0 0 4 0 0 1 40\nred polygon p 0 0 9 0 0 0 9 0 2 0 9 4\n", 0.0),
    ("instance", "void instance i 3 block.rad -ry 25 0 0\n", 0.0),
];

/// What `mesh` and `instance` name; Radiance wants both compiled.
const BLOCK_OBJ: &str = "v 0 0 0\nv 5 0 0\nv 5 4 0\nv 0 4 0\nv 1 1 3\nv 4 1 3\nv 2 3 4\nf 4 3 2 1\nf 1 2 6 5\nf 3 4 7\nf 5 6 7\n";
const BLOCK_RAD: &str = "blue polygon a 0 0 12 0 0 0 5 0 0 5 4 1 0 4 1\nred ring b 0 0 8 2 2 3 0 .2 1 0 2\n!xform -t 0 6 0 -a 2 -t 0 3 0 slab.rad\n";
const SLAB_RAD: &str = "green polygon c 0 0 9 0 0 2 4 0 2 0 2 3\n";

/// Ways to include them.
const WAYS: [&str; 6] = [
    "!cat part.rad\n",
    "!xform -n moved -t 3 -2 1 -rx 30 -ry -50 -rz 200 part.rad\n",
    "!xform -s 1.7 -mx -rz 15 part.rad\n!xform -f args -t 0 20 0 part.rad\n",
    "!xform -I -m blue -my -mz part.rad\n",
    "!xform -rx 20 -a 3 -t 0 0 5 -a 2 -t 7 0 0 -i 1 -rz 45 part.rad\n",
    "!cat part.rad | xform -t 2 0 0 -i 3 -rz 25 -i 1 -s -0.8\n!xform -n deep -t 0 9 0 nest/inner.rad\n",
];

const MATERIALS: &str = "void plastic red 0 0 5 .5 .1 .1 0 0\nvoid metal blue 0 0 5 .1 .1 .5 .5 0\n\
void alias green red\nvoid mirror sheen 0 0 3 .9 .9 .9\nvoid glow lamp 0 0 4 1 1 1 0\n";

struct Theirs {
    hit: bool,
    point: DVec3,
    normal: DVec3,
    modifier: String,
}

/// Rays around the scene, aimed at its inside.
fn rays(site: &Site, seed: u64) -> Vec<[DVec3; 2]> {
    let centre = site.bounds.center().as_dvec3();
    let size = site.bounds.size().as_dvec3();
    let mut random = Stream::new(seed, Purpose::Survey, 1);
    (0..RAYS)
        .map(|_| {
            let mut about = || {
                let mut one = || random.uniform() * 2.0 - 1.0;
                DVec3::new(one(), one(), one())
            };
            let origin = centre + about() * (size.length() + 1.0);
            let target = centre + about() * size * 0.55;
            [origin, (target - origin).normalize()]
        })
        .collect()
}

/// Runs one of Radiance's programs in a folder; what it wrote.
fn run(bin: &Path, folder: &Path, program: &str, arguments: &[&str]) -> Vec<u8> {
    let out = Command::new(bin.join(program))
        .args(arguments)
        .current_dir(folder)
        .env("PATH", format!("{}:/usr/bin:/bin", bin.display()))
        .output()
        .expect(program);
    assert!(out.status.success(), "{program}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

/// A ring or disc as Radiance's `xform` writes it after all transforms.
struct Ring {
    centre: DVec3,
    normal: DVec3,
    radii_m: [f64; 2],
}

fn rings(bin: &Path, folder: &Path) -> Vec<Ring> {
    let text = String::from_utf8(run(bin, folder, "xform", &["scene.rad"])).unwrap();
    let words: Vec<&str> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(str::split_ascii_whitespace)
        .collect();
    let found = (0..words.len()).filter(|&i| words[i] == "ring" && words[i + 4] == "8");
    found
        .map(|i| {
            let r: Vec<f64> = words[i + 5..i + 13].iter().map(|w| w.parse().unwrap()).collect();
            let v = DVec3::from_slice;
            Ring {
                centre: v(&r),
                normal: v(&r[3..]).normalize(),
                radii_m: [r[6].abs(), r[7].abs()],
            }
        })
        .collect()
}

/// Distance of the point where a ray meets the nearest ring's plane from that ring's rim, m.
fn from_rim(rings: &[Ring], [origin, direction]: &[DVec3; 2]) -> f64 {
    let distances = rings.iter().map(|ring| {
        let t = (ring.centre - *origin).dot(ring.normal) / direction.dot(ring.normal);
        let off = (*origin + *direction * t - ring.centre).length();
        ring.radii_m.iter().map(|r| (off - r).abs()).fold(f64::INFINITY, f64::min)
    });
    distances.fold(f64::INFINITY, f64::min)
}

fn rtrace(bin: &Path, folder: &Path, rays: &[[DVec3; 2]]) -> Vec<Theirs> {
    fs::write(folder.join("scene.oct"), run(bin, folder, "oconv", &["-f", "scene.rad"])).unwrap();
    let mut child = Command::new(bin.join("rtrace"))
        .args(["-h", "-w", "-ab", "0", "-lr", "0", "-oLpNm", "scene.oct"])
        .current_dir(folder)
        .env("RAYPATH", format!(".:{}", bin.parent().unwrap().join("lib").display()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("rtrace starts");
    let text: String = rays
        .iter()
        .map(|[o, d]| {
            format!(
                "{:.17e} {:.17e} {:.17e} {:.17e} {:.17e} {:.17e}\n",
                o.x, o.y, o.z, d.x, d.y, d.z
            )
        })
        .collect();
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let out = child.wait_with_output().unwrap();
    // rtrace stops reading where it fails; its message says more than the broken pipe.
    let fed = feeder.join().unwrap();
    assert!(fed.is_ok(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).unwrap();
    let lines: Vec<Theirs> = text
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let v = |i: usize| words[i].parse::<f64>().unwrap();
            Theirs {
                hit: v(0) < 1e9,
                point: DVec3::new(v(1), v(2), v(3)),
                normal: DVec3::new(v(4), v(5), v(6)),
                modifier: words[7].to_owned(),
            }
        })
        .collect();
    assert_eq!(lines.len(), rays.len(), "{}", String::from_utf8_lossy(&out.stderr));
    lines
}

#[test]
fn first_hits_are_those_of_rtrace() {
    let Some(bin) = binaries() else { return };
    let (mut scenes, mut hits, mut edges, mut strays) = (0, 0, 0, 0);
    for (s, (name, shape, chord_m)) in SHAPES.iter().enumerate() {
        // Each shape in half of the ways, so that every pair of ways meets planar and curved ones.
        for w in (0..WAYS.len()).filter(|w| (w + s) % 2 == 0) {
            let folder = tempfile::tempdir().unwrap();
            let at = |file: &str| folder.path().join(file);
            fs::create_dir(at("nest")).unwrap();
            fs::write(at("part.rad"), shape).unwrap();
            fs::write(at("args"), "-t 1 0 0 -rx 10\n# a comment\n-n far -s 2 -a 2 -t 0 0 9\n")
                .unwrap();
            fs::write(at("nest/inner.rad"), "!xform -n in -rz 90 more.rad\n").unwrap();
            fs::write(at("nest/more.rad"), shape).unwrap();
            fs::write(at("scene.rad"), format!("{MATERIALS}{}", WAYS[w])).unwrap();
            fs::write(at("block.obj"), BLOCK_OBJ).unwrap();
            fs::write(at("slab.rad"), SLAB_RAD).unwrap();
            fs::write(at("block.rad"), BLOCK_RAD).unwrap();
            let site = Site::load(&SceneSpec::of([at("scene.rad")]), &[]).expect(name);
            let rays = rays(&site, (10 * s + w) as u64);
            if ["mesh", "instance"].contains(name) {
                run(&bin, folder.path(), "obj2mesh", &["block.obj", "block.rtm"]);
                fs::write(at("with.rad"), format!("{MATERIALS}!cat block.rad\n")).unwrap();
                let octree = run(&bin, folder.path(), "oconv", &["-f", "with.rad"]);
                fs::write(at("block.oct"), octree).unwrap();
                let theirs = shape.replace(".obj", ".rtm").replace(".rad", ".oct");
                fs::write(at("part.rad"), &theirs).unwrap();
                fs::write(at("nest/more.rad"), &theirs).unwrap();
            }
            let rims = if ["ring", "disc"].contains(name) {
                rings(&bin, folder.path())
            } else {
                Vec::new()
            };
            let theirs = rtrace(&bin, folder.path(), &rays);
            let label = format!("{name}, {}", WAYS[w].trim());
            let (mut both, mut apart) = (0, 0);
            for ([origin, direction], theirs) in rays.iter().zip(&theirs) {
                let ours =
                    site.bvh.closest(origin.as_vec3(), direction.as_vec3(), 0.0, f32::INFINITY);
                // A ring is flat, its rim a chord within a centimetre of the circle.
                let at_rim = || from_rim(&rims, &[*origin, *direction]) < 0.0101;
                let (Some(ours), true) = (ours, theirs.hit) else {
                    if ours.is_some() != theirs.hit {
                        if at_rim() { edges += 1 } else { apart += 1 }
                    }
                    continue;
                };
                both += 1;
                let face = site.face_of(ours.triangle);
                let point = *origin + *direction * f64::from(ours.distance_m);
                let normal = site.triangles[ours.triangle as usize].normal().as_dvec3();
                // Along a grazing ray a chord's distance grows by the angle. Chords are a
                // centimetre from the curve at most, or 2 % of a small radius; diagonals twice.
                let grazing = theirs.normal.dot(*direction).abs().max(0.02);
                let bound_m = if *chord_m > 0.0 { 0.001 + 4.0 * chord_m / grazing } else { 0.001 };
                let material = &site.materials[face.material as usize].name;
                let same_modifier = theirs.modifier == *material
                    || (theirs.modifier == "green" && material == "red");
                let turned = normal.dot(theirs.normal);
                // rtrace turns normals to the ray.
                let near = (point - theirs.point).length() <= bound_m;
                let alike = turned.abs() > if *chord_m > 0.0 { 0.95 } else { 0.99999 };
                if !(near && same_modifier && alike) {
                    if at_rim() { edges += 1 } else { apart += 1 }
                }
            }
            // Rays past the edge of a curved surface may miss its chords; past a planar one's edge
            // only those within rounding.
            let allowed = if *chord_m > 0.0 { RAYS / 40 } else { 2 };
            assert!(apart <= allowed, "{label}: {apart} of {RAYS} differ");
            assert!(both > 50, "{label}: only {both} hits");
            scenes += 1;
            hits += both;
            strays += apart;
        }
    }
    assert!(scenes >= 30, "{scenes} scenes");
    eprintln!(
        "{scenes} scenes, {hits} hits, {edges} rays at round rims and {strays} others differ"
    );
}

/// The names that `xform` writes, and the sense of fronts.
#[test]
fn names_and_fronts_are_those_of_xform() {
    let Some(bin) = binaries() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |file: &str| folder.path().join(file);
    fs::write(at("part.rad"), SHAPES[2].1).unwrap();
    fs::write(at("args"), "-t 1 2 0 -rx 10\n\n# no\n-s 2 -a 2 -t 0 0 9\n").unwrap();
    let commands = [
        "xform -n b -a 2 -t 0 0 5 -a 3 -t 4 0 0 part.rad",
        "xform -a 2 -mx part.rad",
        "xform -I -n x -n y -ry 30 part.rad",
        "xform -m green -mz -s 2 part.rad",
        "xform -n k -f args -a 2 -t 0 0 5 part.rad",
        "xform -t 1 1 1 -f args -i 1 -f args -mx part.rad",
    ];
    for command in commands {
        let words: Vec<&str> = command.split(' ').collect();
        let out = Command::new(bin.join("xform"))
            .args(&words[1..])
            .current_dir(folder.path())
            .output()
            .expect("xform starts");
        let theirs = String::from_utf8(out.stdout).unwrap();
        fs::write(at("theirs.rad"), format!("{MATERIALS}{theirs}")).unwrap();
        fs::write(at("ours.rad"), format!("{MATERIALS}!{command}\n")).unwrap();
        let [a, b] = ["theirs.rad", "ours.rad"]
            .map(|f| Site::load(&SceneSpec::of([at(f)]), &[]).expect(command));
        assert_eq!(a.objects, b.objects, "{command}");
        assert_eq!(a.faces, b.faces, "{command}");
        assert_eq!(a.triangles.len(), b.triangles.len(), "{command}");
        for (p, q) in a.triangles.iter().zip(&b.triangles) {
            assert!(p.normal().dot(q.normal()) > 0.999_99, "{command}");
            let centre = |t: &glintmap::site::Triangle| t.corners.iter().sum::<glam::Vec3>();
            assert!((centre(p) - centre(q)).length() < 1e-4, "{command}");
        }
    }
}
