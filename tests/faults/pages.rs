//! Photon stores that were damaged, cut short, or lie; disks that are full.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::Vec3;
use glintmap::base::{
    Aabb, FaultKind, Photon, PhotonSink, Provenance, Purpose, Silent, SpectralBasis, Stream, Tally,
};
use glintmap::pages::{self, About, Access, Error, Neighbours, OpenOptions, Query, Spill, Store};
use glintmap_formats::{gmp, header};

const BOUNDS: Aabb = Aabb { min: Vec3::new(-50.0, -50.0, 0.0), max: Vec3::new(50.0, 50.0, 20.0) };
const PHOTONS: u32 = 20_000;

fn photons() -> Vec<Photon> {
    let mut random = Stream::new(1, Purpose::Survey, 0);
    let mut uniform = || random.uniform() as f32;
    (0..PHOTONS)
        .map(|i| {
            let (x, y) = (100.0 * uniform() - 50.0, 100.0 * uniform() - 50.0);
            Photon {
                position: Vec3::new(x, y, 0.1 * x + 5.0),
                normal: Vec3::Z,
                direction: Vec3::new(uniform() - 0.5, uniform() - 0.5, 0.7).normalize(),
                flux_w: 0.5 + uniform(),
                timestep: i % 100,
                surface: (i % 3) as u16,
            }
        })
        .collect()
}

fn about() -> About {
    About {
        provenance: Provenance { program: "glintmap test".to_owned(), ..Provenance::default() },
        timesteps: 100,
        surfaces: vec!["a".to_owned(), "b".to_owned(), "c".to_owned()],
        basis: SpectralBasis::Visible,
        tally: Tally::default(),
    }
}

fn spill(dir: &Path) -> PathBuf {
    let at = dir.join("spill");
    let mut spill = Spill::create(&at, BOUNDS, PHOTONS.into(), 1 << 24).expect("creates");
    spill.accept(&photons()).expect("accepts");
    spill.finish().expect("finishes");
    at
}

fn store(dir: &Path) -> PathBuf {
    let path = dir.join("photons.gmp");
    pages::build(&spill(dir), &path, &about(), 1 << 26, &Silent).expect("builds");
    path
}

fn options(access: Access) -> OpenOptions {
    OpenOptions { cache_bytes: 1 << 20, access }
}

/// Opens the store and reads all of it, in every way.
fn read(path: &Path, access: Access) -> Result<(), Error> {
    let store = Store::open(path, &options(access))?;
    let query = Query {
        point: Vec3::new(1.0, 2.0, 5.0),
        normal: Vec3::Z,
        count: 100_000,
        max_radius_m: f32::INFINITY,
    };
    store.nearest(&query, &mut Neighbours::default())?;
    store.in_box(BOUNDS, |_, _| ())?;
    store.scan(|_, _| ())
}

/// Where the parts of a store begin: header, pages, directory, end.
fn parts(bytes: &[u8]) -> [usize; 4] {
    let (facts, head): (serde_json::Value, usize) =
        header::read(&mut &bytes[..], gmp::NAME, gmp::VERSION).expect("reads");
    let pages = facts["layout"]["pages_bytes"].as_u64().expect("a number") as usize;
    [0, head, head + pages, bytes.len()]
}

#[test]
fn every_flipped_bit_is_found_and_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    read(&path, Access::Mapped).expect("a sound store");
    let [_, pages, directory, end] = parts(&sound);
    let all = (0..pages).step_by(7).chain(directory..end);
    let sample = (pages..directory).step_by(397).chain(pages..pages + gmp::PAGE_HEAD_BYTES);
    let broken = dir.path().join("broken.gmp");
    std::fs::write(&broken, &sound).expect("writes");
    let file = std::fs::OpenOptions::new().write(true).open(&broken).expect("opens");
    use std::os::unix::fs::FileExt;
    for (n, at) in all.chain(sample).chain(pages - 64..pages).enumerate() {
        file.write_all_at(&[sound[at] ^ 1 << (n % 8)], at as u64).expect("writes");
        let error = read(&broken, Access::Pread).expect_err("a flipped bit went unnoticed");
        let message = error.to_string();
        let expected = match at {
            // In the first line it may be another format, or version, instead.
            at if at < 80 => error.kind(),
            _ => FaultKind::Damaged,
        };
        assert_eq!(error.kind(), expected, "byte {at}: {message}");
        assert!(matches!(error.kind(), FaultKind::Damaged | FaultKind::Input), "{message}");
        let place = match at {
            at if at < pages => "header",
            at if at < directory => "page ",
            _ => "directory",
        };
        assert!(at < 80 || message.contains(place), "byte {at}: {message}");
        if n % 50 == 0 && at >= 80 {
            assert!(!pages::verify(&broken).expect("verifies").is_empty(), "byte {at}");
        }
        file.write_all_at(&[sound[at]], at as u64).expect("writes");
    }
    read(&broken, Access::Mapped).expect("all is as it was");
}

#[test]
fn a_bit_flipped_anywhere_is_found_and_named_with_page_and_byte() {
    use std::os::unix::fs::FileExt;
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    let [_, pages, directory, end] = parts(&sound);
    let (facts, _): (serde_json::Value, usize) =
        header::read(&mut &sound[..], gmp::NAME, gmp::VERSION).expect("reads");
    let count = |name: &str| facts["layout"][name].as_u64().expect("a number");
    let (_, entries) =
        gmp::decode_directory(&sound[directory..], count("nodes"), count("pages")).expect("reads");
    let broken = dir.path().join("broken.gmp");
    std::fs::write(&broken, &sound).expect("writes");
    let file = std::fs::OpenOptions::new().write(true).open(&broken).expect("opens");
    let mut random = Stream::new(2, Purpose::Survey, 0);
    let mut within = |from: usize, to: usize| {
        let at = from + (random.uniform() * (to - from) as f64) as usize;
        (at, 1u8 << (random.bits() % 8))
    };
    // Anywhere in the file, and as often in the parts that are small.
    let mut places: Vec<(usize, u8)> = (0..200).map(|_| within(80, end)).collect();
    places.extend((0..60).map(|_| within(80, pages)));
    places.extend((0..60).map(|_| within(directory, end)));
    for (at, bit) in places {
        file.write_all_at(&[sound[at] ^ bit], at as u64).expect("writes");
        let findings = pages::verify(&broken).expect("verifies").join("; ");
        let (place, byte) = match at {
            at if at < pages => ("header".to_owned(), None),
            at if at >= directory => ("directory".to_owned(), Some(directory)),
            _ => {
                let offset = (at - pages) as u64;
                let number = entries.partition_point(|e| e.offset <= offset) - 1;
                let named = format!("page {number} of {}", entries.len());
                (named, Some(pages + entries[number].offset as usize))
            }
        };
        assert!(findings.contains(&place), "byte {at}, {place}: {findings}");
        let byte = byte.map_or(String::new(), |byte| format!("byte {byte}"));
        assert!(findings.contains(&byte), "byte {at}, {byte}: {findings}");
        file.write_all_at(&[sound[at]], at as u64).expect("writes");
    }
    assert!(pages::verify(&broken).expect("verifies").is_empty());
}

#[test]
fn a_store_cut_short_or_too_long_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    let broken = dir.path().join("broken.gmp");
    let [_, pages, directory, end] = parts(&sound);
    let mut lengths: Vec<usize> = (0..end).step_by(4001).collect();
    lengths.extend([0, 1, 79, 80, pages - 1, pages, pages + 1, directory, directory + 1, end - 1]);
    for length in lengths {
        std::fs::write(&broken, &sound[..length]).expect("writes");
        for access in [Access::Mapped, Access::Pread] {
            let error = read(&broken, access).expect_err("a cut file went unnoticed");
            let expected = if length < 19 { FaultKind::Input } else { FaultKind::Damaged };
            assert_eq!(error.kind(), expected, "{length}: {error}");
        }
    }
    std::fs::write(&broken, [&sound[..], b"x"].concat()).expect("writes");
    let error = read(&broken, Access::Mapped).expect_err("a longer file went unnoticed");
    assert_eq!(error.kind(), FaultKind::Damaged);
}

/// A store whose header says something else, with checksums that hold.
fn lie(sound: &[u8], change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let (mut facts, head): (serde_json::Value, usize) =
        header::read(&mut &sound[..], gmp::NAME, gmp::VERSION).expect("reads");
    change(&mut facts);
    let mut out = Vec::new();
    header::write_padded(&mut out, gmp::NAME, gmp::VERSION, &facts, head).expect("writes");
    out.extend_from_slice(&sound[head..]);
    out
}

#[test]
fn a_header_that_lies_allocates_nothing_and_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    let broken = dir.path().join("broken.gmp");
    std::fs::write(&broken, lie(&sound, |_| ())).expect("writes");
    read(&broken, Access::Mapped).expect("nothing was changed");
    for huge in [u64::MAX, 1 << 62, 1 << 40, 0, 1] {
        for name in ["pages", "nodes", "pages_bytes", "directory_bytes", "directory_crc32c"] {
            let lying = lie(&sound, |f| f["layout"][name] = huge.into());
            std::fs::write(&broken, lying).expect("writes");
            let error = read(&broken, Access::Mapped).expect_err("a lie went unnoticed");
            assert_eq!(error.kind(), FaultKind::Damaged, "{name} {huge}: {error}");
        }
        for (name, value) in [("photons", huge), ("timesteps", huge.min(u32::MAX.into()))] {
            std::fs::write(&broken, lie(&sound, |f| f[name] = value.into())).expect("writes");
            let error = read(&broken, Access::Mapped).expect_err("a lie went unnoticed");
            assert_eq!(error.kind(), FaultKind::Damaged, "{name} {huge}: {error}");
        }
    }
    for (name, value) in [("page_photons", 10u64), ("page_photons", 1 << 20)] {
        let lying = lie(&sound, |f| f["layout"][name] = value.into());
        std::fs::write(&broken, lying).expect("writes");
        assert!(read(&broken, Access::Mapped).is_err(), "{name} {value}");
    }
    let lying = lie(&sound, |f| f["flux_w"] = 1.0.into());
    std::fs::write(&broken, lying).expect("writes");
    assert!(pages::verify(&broken).expect("verifies")[0].contains("flux"));
    let lying = lie(&sound, |f| f["novelty"] = 1.into());
    std::fs::write(&broken, lying).expect("writes");
    let error = read(&broken, Access::Mapped).expect_err("an unknown fact went unnoticed");
    assert!(error.to_string().contains("novelty"), "{error}");
}

/// A directory that lies, with a checksum that holds.
fn lying_directory(
    sound: &[u8],
    change: impl FnOnce(&mut Vec<gmp::Node>, &mut Vec<gmp::PageEntry>),
) -> Vec<u8> {
    let [_, _, directory, _] = parts(sound);
    let (facts, _): (serde_json::Value, usize) =
        header::read(&mut &sound[..], gmp::NAME, gmp::VERSION).expect("reads");
    let count = |name: &str| facts["layout"][name].as_u64().expect("a number");
    let (mut nodes, mut pages) =
        gmp::decode_directory(&sound[directory..], count("nodes"), count("pages")).expect("reads");
    change(&mut nodes, &mut pages);
    let bytes = gmp::encode_directory(&nodes, &pages).expect("encodes");
    let sum = glintmap_formats::checksum::crc32c(&bytes);
    lie(&[&sound[..directory], &bytes].concat(), |f| f["layout"]["directory_crc32c"] = sum.into())
}

#[test]
fn a_directory_that_lies_is_refused_and_never_walked_in_circles() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    let broken = dir.path().join("broken.gmp");
    type Change = fn(&mut Vec<gmp::Node>, &mut Vec<gmp::PageEntry>);
    let changes: [(&str, Change); 14] = [
        ("a circle", |n, _| n[0].first_child = 0),
        ("children beyond the end", |n, _| n[0].children += 1),
        ("a child less", |n, _| n[0].children -= 1),
        ("more children than there are", |n, _| n[0].children = u32::MAX),
        ("more pages than there are", |n, _| n[1].pages = u32::MAX),
        ("a leaf that points back", |n, _| n.last_mut().expect("one").first_child = 1),
        ("a smaller box", |n, _| n[0].max[0] = 0.0),
        ("a NaN box", |_, p| p[0].min[1] = f32::NAN),
        ("an offset", |_, p| p[1].offset += 1),
        ("a length", |_, p| p[0].length = u32::MAX),
        ("no photons", |_, p| p[0].photons = 0),
        ("many photons", |_, p| p[0].photons = u32::MAX),
        ("cells in disorder", |_, p| p[1].first_cell = 0),
        ("a reserved field", |_, p| p[0].reserved = 1),
    ];
    std::fs::write(&broken, lying_directory(&sound, |_, _| ())).expect("writes");
    read(&broken, Access::Mapped).expect("nothing was changed");
    for (what, change) in changes {
        std::fs::write(&broken, lying_directory(&sound, change)).expect("writes");
        let error = read(&broken, Access::Mapped).expect_err(what);
        assert_eq!(error.kind(), FaultKind::Damaged, "{what}: {error}");
        assert!(error.to_string().contains("directory"), "{what}: {error}");
    }
    // Two pages exchanged: each is sound by itself, and neither is where it belongs.
    let swapped = lying_directory(&sound, |_, p| {
        let (a, b) = (p[0].checksum, p[1].checksum);
        (p[0].checksum, p[1].checksum) = (b, a);
    });
    std::fs::write(&broken, swapped).expect("writes");
    let error = read(&broken, Access::Mapped).expect_err("exchanged pages");
    assert!(error.to_string().contains("checksum"), "{error}");
}

#[test]
fn a_full_disk_is_said_and_loses_nothing() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let sound = std::fs::read(&path).expect("reads");
    let at = spill(dir.path());

    // What the store grows in is a device that is always full.
    let growing = dir.path().join("photons.gmp.tmp");
    std::os::unix::fs::symlink("/dev/full", &growing).expect("links");
    let error = pages::build(&at, &path, &about(), 1 << 26, &Silent).expect_err("a full disk");
    assert_eq!(error.kind(), FaultKind::Failed, "{error}");
    let message = error.to_string();
    assert!(message.contains("photons.gmp.tmp") && message.contains("bytes"), "{message}");
    assert_eq!(std::fs::read(&path).expect("reads"), sound);
    assert!(!growing.exists());

    // So are the partitions.
    let names: Vec<_> = std::fs::read_dir(&at)
        .expect("lists")
        .map(|e| e.expect("an entry").file_name())
        .filter(|n| n.to_string_lossy().ends_with(".photons"))
        .collect();
    let mut full = Spill::create(&at, BOUNDS, PHOTONS.into(), 1 << 24).expect("creates");
    for name in &names {
        std::os::unix::fs::symlink("/dev/full", at.join(name)).expect("links");
    }
    let result = full.accept(&photons()).map_err(|e| e.to_string());
    let message = match result {
        Err(message) => message,
        Ok(()) => full.finish().expect_err("a full disk").to_string(),
    };
    assert!(message.contains(".photons") && message.contains("bytes in all"), "{message}");
    assert!(matches!(
        pages::build(&at, &path, &about(), 1 << 26, &Silent),
        Err(Error::Unfinished { .. })
    ));
    assert_eq!(std::fs::read(&path).expect("reads"), sound);
}

#[test]
fn partitions_that_changed_are_noticed() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = spill(dir.path());
    let path = dir.path().join("photons.gmp");
    let mut partitions: Vec<PathBuf> = std::fs::read_dir(&at)
        .expect("lists")
        .map(|e| e.expect("an entry").path())
        .filter(|p| p.extension().is_some_and(|e| e == "photons"))
        .collect();
    partitions.sort();
    let sound = std::fs::read(&partitions[3]).expect("reads");
    let mut flipped = sound.clone();
    flipped[9] ^= 4;
    for broken in [&flipped[..], &sound[1..], &[]] {
        std::fs::write(&partitions[3], broken).expect("writes");
        let error = pages::build(&at, &path, &about(), 1 << 26, &Silent).expect_err("a change");
        assert_eq!(error.kind(), FaultKind::Damaged, "{error}");
    }
    std::fs::remove_file(&partitions[3]).expect("removes");
    let error = pages::build(&at, &path, &about(), 1 << 26, &Silent).expect_err("a missing file");
    assert_eq!(error.kind(), FaultKind::Damaged, "{error}");
    assert!(!path.exists());
}

fn glintmap(arguments: &[&str], file: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_glintmap")).args(arguments).arg(file).output().expect("starts")
}

#[test]
fn the_command_line_looks_and_judges() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = store(dir.path());
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text");

    let output = glintmap(&["inspect"], &path);
    assert!(output.status.success());
    let shown = text(&output.stdout);
    assert!(shown.contains("photons              20000") && shown.contains("level"), "{shown}");

    let output = glintmap(&["inspect", "--json"], &path);
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(document["info"]["photons"], PHOTONS);

    let output = glintmap(&["inspect", "--per-timestep"], &path);
    let csv = text(&output.stdout);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines.len(), lines[0]), (101, "index,photons,flux_w"));
    let flux_w: f64 = photons().iter().step_by(100).map(|p| f64::from(p.flux_w)).sum();
    let words: Vec<&str> = lines[1].split(',').collect();
    assert_eq!(words[..2], ["0", "200"]);
    assert!((words[2].parse::<f64>().expect("a number") / flux_w - 1.0).abs() < 1e-4);

    let output = glintmap(&["inspect", "--per-surface"], &path);
    let csv = text(&output.stdout);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines.len(), lines[0]), (4, "surface,photons,flux_w"));
    assert!(lines[1].starts_with("\"a\",6667,"), "{csv}");
    cloud_and_page(&path);

    let output = glintmap(&["verify"], &path);
    assert!(output.status.success() && text(&output.stdout).contains("sound"));

    let mut bytes = std::fs::read(&path).expect("reads");
    let [_, pages, directory, _] = parts(&bytes);
    bytes[(pages + directory) / 2] ^= 1;
    let broken = dir.path().join("broken.gmp");
    std::fs::write(&broken, &bytes).expect("writes");
    let output = glintmap(&["verify"], &broken);
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stdout).contains("page "), "{}", text(&output.stdout));
    assert_eq!(glintmap(&["inspect", "--per-timestep"], &broken).status.code(), Some(3));

    assert_eq!(glintmap(&["inspect"], &dir.path().join("nothing")).status.code(), Some(2));
    std::fs::write(&broken, b"something else\n").expect("writes");
    let output = glintmap(&["verify"], &broken);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("something else"));
}

/// One page in full, and a sample as a point cloud, read back byte by byte.
fn cloud_and_page(path: &Path) {
    let store = Store::open(path, &options(Access::Mapped)).expect("opens");
    let mut all = Vec::new();
    store.scan(|_, p| all.push(*p)).expect("scans");

    let output = glintmap(&["inspect", "--page", "1"], path);
    let csv = String::from_utf8(output.stdout).expect("text");
    let mut lines = csv.lines();
    let columns = lines.next().expect("a head").split(',').count();
    let rows: Vec<Vec<f64>> =
        lines.map(|l| l.split(',').map(|w| w.parse().expect("a number")).collect()).collect();
    assert!(columns == 13 && rows.len() > 1000, "{columns} columns, {} rows", rows.len());
    for row in &rows {
        let p = &all[row[0] as usize];
        assert_eq!(Vec3::new(row[1] as f32, row[2] as f32, row[3] as f32), p.position);
        assert_eq!(
            (row[10] as f32, row[11] as u32, row[12] as u16),
            (p.flux_w, p.timestep, p.surface)
        );
    }
    let output = glintmap(&["inspect", "--page", "99"], path);
    assert_eq!(output.status.code(), Some(2));

    let cloud = path.with_file_name("sample.ply");
    let name = cloud.to_str().expect("a plain path");
    let output = glintmap(&["inspect", "--ply", name, "--sample", "777", "--json"], path);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bytes = std::fs::read(&cloud).expect("reads");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").expect("a head") + 11;
    let head = String::from_utf8_lossy(&bytes[..end]);
    assert!(head.starts_with("ply\nformat binary_little_endian 1.0\n"), "{head}");
    assert!(head.contains("element vertex 777\n"), "{head}");
    assert_eq!(bytes.len() - end, 777 * 34);
    for (i, point) in bytes[end..].chunks_exact(34).enumerate() {
        let p = &all[i * all.len() / 777];
        let float = |at: usize| f32::from_le_bytes(point[at..at + 4].try_into().expect("four"));
        assert_eq!(Vec3::new(float(0), float(4), float(8)), p.position);
        assert_eq!(Vec3::new(float(12), float(16), float(20)), p.normal);
        assert_eq!((float(24), float(28).to_bits()), (p.flux_w, p.timestep));
        assert_eq!(point[32..], p.surface.to_le_bytes());
    }
}
