//! Damaged files: an error or a scene, never a panic or a hang; what is read is finite.
//!
//! `GLINTMAP_FUZZ=1000000 cargo test --release --test all damaged -- --nocapture` is the long run:
//! so many executions for each seed of each reader, from memory.

use super::*;

/// How often each seed is damaged: `GLINTMAP_FUZZ` sets it.
pub fn executions() -> Option<u64> {
    std::env::var("GLINTMAP_FUZZ").ok().and_then(|n| n.parse().ok())
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
            _ => swap_words(bytes, below(bytes.len()), below(bytes.len())),
        }
    }
}

/// The words at two places change places.
fn swap_words(bytes: &mut Vec<u8>, a: usize, b: usize) {
    let word = |at: usize| {
        let end = |b: &u8| b" ,\n[]".contains(b);
        let from = bytes[..at].iter().rposition(end).map_or(0, |i| i + 1);
        let to = bytes[at..].iter().position(end).map_or(bytes.len(), |i| at + i);
        from..to.max(from)
    };
    let (first, second) = if a < b { (word(a), word(b)) } else { (word(b), word(a)) };
    if first.end > second.start {
        return;
    }
    let (one, two) = (bytes[first.clone()].to_vec(), bytes[second.clone()].to_vec());
    bytes.splice(second, one);
    bytes.splice(first, two);
}

/// Peak of the process's memory, bytes.
fn peak_bytes() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().split(' ').next()?.parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

/// Damages each seed and reads it, with the files beside it.
fn torture(seeds: &[(&str, Vec<u8>)], beside: &[(&str, &str)], usual: u64) {
    if seeds.is_empty() {
        return;
    }
    let before = peak_bytes();
    let (mut read, mut refused) = (0, 0);
    for (seed, (name, bytes)) in seeds.iter().enumerate() {
        let beside = beside.iter().map(|(name, text)| (*name, text.as_bytes().to_vec()));
        let mut spec = SceneSpec::of([*name]);
        stated(&mut spec.files[0]);
        let mut slowest = (Duration::ZERO, 0);
        let start = Instant::now();
        let count = executions().unwrap_or(usual);
        let beside: Vec<_> = beside.collect();
        for case in 0..count {
            let mut random = Stream::new(11 + seed as u64, Purpose::Survey, case);
            let mut bytes = bytes.clone();
            damage(&mut bytes, &mut random);
            let files = SceneFiles::in_memory(beside.iter().cloned().chain([(*name, bytes)]));
            let one = cpu_time();
            match load_from(&files, &spec, &[]) {
                Ok(Loaded { site, .. }) => {
                    read += 1;
                    assert!(site.triangles.iter().all(|t| t.corners.iter().all(|c| c.is_finite())));
                    assert!(site.pv.iter().all(|p| p.normal.is_finite() && p.area_m2 > 0.0));
                }
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().len() > 20);
                }
            }
            slowest = slowest.max((cpu_time() - one, case));
            assert!(slowest.0 < Duration::from_secs(30), "case {case} of {name}: {slowest:?}");
        }
        if executions().is_some() {
            let rate = count as f64 / start.elapsed().as_secs_f64();
            eprintln!("{name}: {count} executions, {rate:.0}/s, slowest {slowest:?}");
        }
    }
    eprintln!("{read} read, {refused} refused, peak {} MiB", peak_bytes() >> 20);
    assert!(read > usual / 20 && refused > usual / 20, "{read} read, {refused} refused");
    // By itself, so that nothing else counts.
    if executions().is_some() {
        assert!(peak_bytes() - before < 2 << 30, "{} bytes", peak_bytes());
    }
}

const COMMANDS: &str = "\
void plastic red 0 0 5 .5 .1 .1 0 0
!xform -n b -a 3 -t 1 2 3 -rz 30 -i 2 -mx part.rad
!cat part.rad | xform -f args
x mesh m 3 m.obj -rx 5 0 0
red instance i 3 part.rad -s 2 0 0
";

#[test]
fn damaged_radiance_files() {
    // A small tree: most of the time would go into its triangles.
    let scene = super::super::site::SCENE.replace("-8 0 3 2\n", "-8 0 3 .3\n");
    let seeds = [("f.rad", COMMANDS.as_bytes().to_vec()), ("s.rad", scene.into_bytes())];
    let part = "void plastic leaf 0 0 5 .1 .3 .1 0 0\nleaf ring top 0 0 8 0 0 2 0 0 1 1 .5\n";
    let beside = [("part.rad", part), ("m.obj", OBJ), ("args", "-t 1 0 0\n-mx -a 2 -rz 90\n")];
    torture(&seeds, &beside, 400);
}

#[test]
fn damaged_city_models() {
    let house = super::super::site::house(super::super::site::ROOF_AND_GROUND);
    let line = house.replace('\n', "");
    let feature = line.replace("\"CityJSON\"", "\"CityJSONFeature\"");
    let feature = feature.replace("\"B\"", "\"C\"").replace("\"P\"", "\"Q\"");
    let lines = format!("{line}\n{feature}\n");
    let seeds = [
        ("f.city.json", house.into_bytes()),
        ("f.city.jsonl", lines.into_bytes()),
        ("t.city.json", super::super::site::TEMPLATES.as_bytes().to_vec()),
    ];
    torture(&seeds, &[], 300);
    // Real ones are too long for the long run.
    let mut real = Vec::new();
    for name in ["3dbag_b2.city.json", "3dbag_b2.city.jsonl"] {
        if let Some(path) = support::data(&format!("city/{name}")) {
            real.push((name, fs::read(path).unwrap()));
        }
    }
    if executions().is_none() {
        torture(&real, &[], 100);
    }
}

#[test]
fn damaged_meshes() {
    let seeds = [
        ("f.obj", OBJ.as_bytes().to_vec()),
        ("f.stl", stl(&SQUARE)),
        ("t.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid".to_vec()),
        ("f.ply", ply("ascii")),
        ("l.ply", ply("binary_little_endian")),
        ("b.ply", ply("binary_big_endian")),
        ("f.gltf", gltf([0, 1, 2, 3, 4, 5], false)),
        ("f.glb", gltf([0, 1, 2, 3, 4, 5], true)),
        ("q.gltf", quantised(true)),
    ];
    let library = "newmtl brick\nKd 0.6 0.3 0.2\nnewmtl glazed\nKd 0.1\n";
    torture(&seeds, &[("house.mtl", library)], 300);
}

#[test]
fn damaged_terrain() {
    let asc = asc(9, 7, [10.0, 20.0], 2.0, |x, y| x * y * 0.01).into_bytes();
    let [tiles, strips] = geotiff::seeds();
    torture(&[("f.asc", asc), ("t.tif", tiles), ("s.tif", strips)], &[], 300);
    let mut real = Vec::new();
    for name in ["tie_point_and_pixel_scale_pixel_is_point", "transformation_pixel_is_area"] {
        let name = format!("terrain/geotags/austrian_capitals_model_{name}.tif");
        if let Some(path) = support::data(&name) {
            real.push(("f.tif", fs::read(path).unwrap()));
        }
    }
    if executions().is_none() {
        torture(&real, &[], 50);
    }
}
