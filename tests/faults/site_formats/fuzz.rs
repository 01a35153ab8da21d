//! Damaged files.

use super::*;

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
pub fn damaged_files_of_every_format_never_panic() {
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
