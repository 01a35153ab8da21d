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
const SHAPES: [(&str, &str, f64); 12] = [
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
];

/// Ways to include them.
const WAYS: [&str; 6] = [
    "!cat part.rad\n",
    "!xform -n moved -t 3 -2 1 -rx 30 -ry -50 -rz 200 part.rad\n",
    "!xform -s 1.7 -mx -rz 15 part.rad\n",
    "!xform -I -m blue -my -mz part.rad\n",
    "!xform -rx 20 -a 3 -t 0 0 5 -a 2 -t 7 0 0 -i 1 -rz 45 part.rad\n",
    "!cat part.rad | xform -t 2 0 0 -i 3 -rz 25 -i 1 -s -0.8\n!xform -n deep -t 0 9 0 nest/inner.rad\n",
];

const MATERIALS: &str = "void plastic red 0 0 5 .5 .1 .1 0 0\nvoid metal blue 0 0 5 .1 .1 .5 .5 0\n\
void alias green red\nvoid mirror sheen 0 0 3 .9 .9 .9\n";

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

fn rtrace(bin: &Path, folder: &Path, rays: &[[DVec3; 2]]) -> Vec<Theirs> {
    let octree = Command::new(bin.join("oconv"))
        .args(["-f", "scene.rad"])
        .current_dir(folder)
        .env("PATH", format!("{}:/usr/bin:/bin", bin.display()))
        .output()
        .expect("oconv starts");
    assert!(octree.status.success(), "{}", String::from_utf8_lossy(&octree.stderr));
    fs::write(folder.join("scene.oct"), octree.stdout).unwrap();
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
    let (mut scenes, mut hits, mut edges) = (0, 0, 0);
    for (s, (name, shape, chord_m)) in SHAPES.iter().enumerate() {
        // Each shape in half of the ways, so that every pair of ways meets planar and curved ones.
        for w in (0..WAYS.len()).filter(|w| (w + s) % 2 == 0) {
            let folder = tempfile::tempdir().unwrap();
            let at = |file: &str| folder.path().join(file);
            fs::create_dir(at("nest")).unwrap();
            fs::write(at("part.rad"), shape).unwrap();
            fs::write(at("nest/inner.rad"), "!xform -n in -rz 90 more.rad\n").unwrap();
            fs::write(at("nest/more.rad"), shape).unwrap();
            fs::write(at("scene.rad"), format!("{MATERIALS}{}", WAYS[w])).unwrap();
            let site = Site::load(&SceneSpec::of([at("scene.rad")]), &[]).expect(name);
            let rays = rays(&site, (10 * s + w) as u64);
            let theirs = rtrace(&bin, folder.path(), &rays);
            let label = format!("{name}, {}", WAYS[w].trim());
            let (mut both, mut apart) = (0, 0);
            for ([origin, direction], theirs) in rays.iter().zip(&theirs) {
                let ours =
                    site.bvh.closest(origin.as_vec3(), direction.as_vec3(), 0.0, f32::INFINITY);
                let (Some(ours), true) = (ours, theirs.hit) else {
                    apart += usize::from(ours.is_some() != theirs.hit);
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
                    apart += 1;
                }
            }
            // Rays past the edge of a curved surface may miss its chords; past a planar one's edge
            // only those within rounding.
            // A ring is flat with a round rim: chords a centimetre inside a rim of 4 m leave out a
            // third of a per cent of its area.
            let round_rim = matches!(*name, "ring" | "disc");
            let allowed = match (*chord_m > 0.0, round_rim) {
                (true, _) => RAYS / 40,
                (false, true) => RAYS / 100,
                (false, false) => 2,
            };
            assert!(apart <= allowed, "{label}: {apart} of {RAYS} differ");
            assert!(both > 50, "{label}: only {both} hits");
            scenes += 1;
            hits += both;
            edges += apart;
        }
    }
    assert!(scenes >= 30, "{scenes} scenes");
    eprintln!("{scenes} scenes, {hits} hits, {edges} rays at edges differ");
}

/// The names that `xform` writes, and the sense of fronts.
#[test]
fn names_and_fronts_are_those_of_xform() {
    let Some(bin) = binaries() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |file: &str| folder.path().join(file);
    fs::write(at("part.rad"), SHAPES[2].1).unwrap();
    let commands = [
        "xform -n b -a 2 -t 0 0 5 -a 3 -t 4 0 0 part.rad",
        "xform -a 2 -mx part.rad",
        "xform -I -n x -n y -ry 30 part.rad",
        "xform -m green -mz -s 2 part.rad",
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
