//! Pictures against OpenEXR's and Radiance's own programs.

use std::path::Path;
use std::process::{Command, Output};

use glintmap::base::{Grid, Purpose, Stream};
use glintmap::picture::{Channels, Rgb, exr, files, hdr, png, tif};
use glintmap_formats::npy;

use crate::support::{cpu_time, data, python, series::run_python};

const OPENEXR: &str = r#"
import sys, numpy, OpenEXR
exr, out = sys.argv[1:3]
with OpenEXR.File(exr, separate_channels=True) as f:
    h = f.header()
    assert h['compression'] == OpenEXR.ZIP_COMPRESSION, h
    assert h['lineOrder'] == OpenEXR.INCREASING_Y, h
    for key in ('program', 'settings', 'unit'):
        print(key, '=', h[key])
    for name, channel in sorted(f.channels().items()):
        assert channel.pixels.dtype == numpy.float32
        print('channel', name)
        numpy.save(out + '/' + name + '.npy', channel.pixels)
"#;

#[test]
fn openexr_reads_what_is_written_to_the_bit() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("annual.exr");
    let mut random = Stream::new(3, Purpose::Survey, 0);
    let mut grid = |scale: f64| {
        let values = (0..131 * 57).map(|_| {
            (random.uniform() * scale) as f32 * f32::from(!random.bits().is_multiple_of(3))
        });
        Grid::from_vec(131, 57, values.collect())
    };
    let (annual, peak) = (grid(3000.0), grid(1e-20));
    let attributes = [("settings", "3f2a91"), ("program", "glintmap 0.1.0"), ("unit", "Wh/m²")]
        .map(|(name, value)| (name.to_owned(), value.to_owned()));
    exr::write(&path, &[("peak.w_m2", &peak), ("annual.wh_m2", &annual)], &attributes)
        .expect("writes");
    let said = run_python(&python, OPENEXR, &[&path, folder.path()]);
    assert!(said.contains("channel annual.wh_m2") && said.contains("unit = Wh/m²"), "{said}");
    for (name, grid) in [("annual.wh_m2", &annual), ("peak.w_m2", &peak)] {
        let array =
            npy::Reader::<f32>::open(&folder.path().join(format!("{name}.npy"))).expect("opens");
        assert_eq!(array.shape(), [57, 131]);
        let bits = |v: &[f32]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&array.read_all().expect("reads")), bits(grid.data()), "{name}");
    }
}

const SAMPLES: &str = r#"
import sys, numpy, OpenEXR
exr, out = sys.argv[1:3]
with OpenEXR.File(exr, separate_channels=True) as f:
    h = f.header()
    (dx, dy), (px, py) = h['dataWindow'][0], h['displayWindow'][0]
    width, height = (h['displayWindow'][1] - h['displayWindow'][0] + 1)
    for name, channel in f.channels().items():
        whole = numpy.zeros((height, width), numpy.float32)
        rows, columns = channel.pixels.shape
        whole[dy - py:dy - py + rows, dx - px:dx - px + columns] = channel.pixels.astype(numpy.float32)
        numpy.save(out + '/' + name + '.npy', whole)
"#;

#[test]
fn openexr_s_own_samples_are_read_as_openexr_reads_them() {
    let Some(python) = python() else { return };
    for (name, channels) in [
        ("oexr_Chromaticities_Rec709.exr", 3),
        ("oexr_DisplayWindow_t08.exr", 3),
        ("oexr_TestImages_WideFloatRange.exr", 1),
    ] {
        let Some(path) = data(&format!("image/{name}")) else { return };
        let folder = tempfile::tempdir().expect("folder");
        run_python(&python, SAMPLES, &[&path, folder.path()]);
        let read = exr::read(&path).expect("reads");
        assert_eq!(read.list().len(), channels);
        for (channel, grid) in read.list() {
            let file = folder.path().join(format!("{channel}.npy"));
            let array = npy::Reader::<f32>::open(&file).expect("opens");
            assert_eq!(array.shape(), [grid.rows(), grid.columns()]);
            let expected = array.read_all().expect("reads");
            let same =
                |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            assert!(expected.iter().zip(grid.data()).all(same), "{name} {channel}");
        }
    }
}

const RADIANCE: &str = r#"
import os, subprocess, sys, pyradiance
tool, picture, out = sys.argv[1:4]
bin = os.path.join(os.path.dirname(pyradiance.__file__), 'bin')
if tool == 'pvalue':
    command = ['pvalue', '-o', '-h', '-H', '-df', picture]
elif tool == 'getinfo':
    command = ['getinfo', picture]
else:
    command = ['pfilt', '-1', '-e', tool, picture]
with open(out, 'wb') as f:
    subprocess.run([os.path.join(bin, command[0])] + command[1:], stdout=f, check=True)
"#;

fn radiance(python: &Path, tool: &str, picture: &Path, out: &Path) -> Vec<u8> {
    run_python(python, RADIANCE, &[Path::new(tool), picture, out]);
    std::fs::read(out).expect("Radiance wrote")
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

#[test]
fn radiance_and_we_read_the_same_pictures() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    let out = folder.path().join("values");
    for name in ["evalglare_testimage", "imagers_old-rle", "imagers_rgbr4x4", "rad_false"] {
        let Some(path) = data(&format!("image/{name}.hdr")) else { return };
        let (ours, _) = hdr::read(&path).expect(name);
        let theirs = floats(&radiance(&python, "pvalue", &path, &out));
        let ours: Vec<f32> = ours.data().iter().flatten().copied().collect();
        assert!(ours == theirs, "{name} differs");
        // The same picture after an exposure of 3 and of 2.5 stops: two EXPOSURE lines.
        let (once, twice) = (folder.path().join("once.hdr"), folder.path().join("twice.hdr"));
        radiance(&python, "3", &path, &once);
        radiance(&python, "+2.5", &once, &twice);
        let (exposed, header) = hdr::read(&twice).expect(name);
        assert!((header.exposure - 3.0 * 2f64.powf(2.5)).abs() < 1e-3, "{}", header.exposure);
        let theirs = floats(&radiance(&python, "pvalue", &twice, &out));
        for (a, b) in exposed.data().iter().flatten().zip(theirs) {
            assert!((a - b).abs() <= 1e-5 * b.abs(), "{name}: {a} {b}");
        }
    }
}

#[test]
fn radiance_reads_what_is_written() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    let (path, out) = (folder.path().join("ours.hdr"), folder.path().join("out"));
    let mut random = Stream::new(5, Purpose::Survey, 1);
    for (columns, rows) in [(5, 3), (8, 2), (300, 40), (40_000, 2)] {
        let values = (0..columns * rows).map(|at| {
            let level = (at / 37 % 5) as f32 * 12.5;
            [level, level * random.uniform() as f32, if at % 11 == 0 { 0.0 } else { 1e-3 }]
        });
        let picture: Rgb = Grid::from_vec(columns, rows, values.collect());
        let lines =
            ["SOFTWARE= glintmap".to_owned(), "VIEW= -vtl -vp 0 0 200 -vh 200 -vv 200".into()];
        hdr::write(&path, &picture, &lines).expect("writes");
        let theirs = floats(&radiance(&python, "pvalue", &path, &out));
        let expected = picture.map(|&c| hdr::color_from_rgbe(hdr::rgbe_from_color(c)));
        let expected: Vec<f32> = expected.data().iter().flatten().copied().collect();
        assert!(theirs == expected, "{columns} x {rows}");
        let (back, header) = hdr::read(&path).expect("reads");
        assert!(back.data().iter().flatten().copied().eq(expected));
        assert_eq!(header.views, ["-vtl -vp 0 0 200 -vh 200 -vv 200"]);
        let info = String::from_utf8(radiance(&python, "getinfo", &path, &out)).expect("text");
        assert!(info.contains("VIEW= -vtl -vp 0 0 200") && info.contains("FORMAT=32-bit_rle_rgbe"));
    }
}

fn glintmap(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_glintmap"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("starts")
}

fn sample(folder: &Path) -> (Grid<f32>, Rgb) {
    let values = Grid::from_vec(40, 30, (0..1200).map(|i| (i / 7) as f32 * 0.25).collect());
    let rgb = values.map(|&v| [v, v * 0.5, 1.0]);
    exr::write(&folder.join("map.exr"), &[("annual.wh_m2", &values)], &[]).expect("writes");
    exr::write_channels(&folder.join("colors.exr"), &Channels::from_rgb(&rgb)).expect("writes");
    let two = [("annual.wh_m2", &values), ("peak.w_m2", &values)];
    exr::write(&folder.join("two.exr"), &two, &[]).expect("writes");
    (values, rgb)
}

#[test]
fn conversions_keep_the_numbers_or_say_why_not() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    let (values, rgb) = sample(at);
    for kind in ["npy", "tif", "exr"] {
        let (there, back) = (format!("map.{kind}"), "back.exr");
        assert!(glintmap(&["convert", "map.exr", &there], at).status.success(), "{kind}");
        assert!(glintmap(&["convert", &there, back], at).status.success(), "{kind}");
        let read = files::read(&at.join(back)).expect("reads");
        assert_eq!(read.list()[0].1, values, "{kind}");
        let there = format!("colors.{kind}");
        assert!(glintmap(&["convert", "colors.exr", &there], at).status.success(), "{kind}");
        assert_eq!(files::read(&at.join(there)).expect("reads").rgb(), Some(rgb.clone()), "{kind}");
    }
    assert!(glintmap(&["convert", "map.exr", "map.hdr"], at).status.success());
    let (grey, _) = hdr::read(&at.join("map.hdr")).expect("reads");
    for (a, b) in grey.data().iter().zip(values.data()) {
        assert!(a[0] == a[2] && (a[0] - b).abs() <= b / 255.9);
    }
    let counts: Vec<i32> = (0..12).collect();
    npy::write(&at.join("counts.npy"), &[3, 4], &counts).expect("writes");
    assert!(glintmap(&["convert", "counts.npy", "counts.exr"], at).status.success());
    assert_eq!(exr::read(&at.join("counts.exr")).expect("reads").list()[0].1[(3, 2)], 11.0);

    for (arguments, word) in [
        (["two.exr", "two.npy", ""], "--channel"),
        (["two.exr", "x.hdr", "none.h"], "annual.wh_m2, peak.w_m2"),
        (["map.exr", "map.png", ""], "falsecolor"),
        (["map.exr", "map.gif", ""], ".exr, .hdr"),
        (["missing.exr", "x.npy", ""], "missing.exr"),
    ] {
        let mut line = vec!["convert", arguments[0], arguments[1]];
        if !arguments[2].is_empty() {
            line.extend(["--channel", arguments[2]]);
        }
        let output = glintmap(&line, at);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{line:?}: {said}");
        assert!(said.contains(word), "{line:?}: {said}");
    }
    let chosen = ["convert", "two.exr", "two.npy", "--channel", "peak.w_m2"];
    assert!(glintmap(&chosen, at).status.success());
}

#[test]
fn radiance_s_options_are_understood() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    sample(at);
    for line in [
        "falsecolor map.exr a.png",
        "falsecolor map.exr b.png -s 40 -log 2 -n 4 -pal spec -m 2 -e -l Irradiation",
        "falsecolor map.exr c.png -s auto -cb -lw 30 -lh 200",
        "composite map.exr d.png -p colors.exr -cl",
        "ratio map.exr map.exr e.png -p colors.exr",
        "tonemap colors.exr f.png --grey",
    ] {
        let words: Vec<&str> = std::iter::once("picture").chain(line.split(' ')).collect();
        let output = glintmap(&words, at);
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        let (picture, _) =
            png::read(&at.join(words[if line.starts_with("ratio") { 4 } else { 3 }])).expect(line);
        assert!(picture.columns() >= 40);
    }
    let json = glintmap(&["--json", "picture", "falsecolor", "map.exr", "a.png", "-s", "42"], at);
    let document: serde_json::Value = serde_json::from_slice(&json.stdout).expect("one document");
    assert_eq!((&document["max"], &document["unit"]), (&42.0.into(), &"Wh/m²".into()));
    for line in [
        "falsecolor map.exr a.png -s many",
        "falsecolor map.exr a.png -s -3",
        "falsecolor map.exr a.png -pal rainbow",
        "falsecolor map.exr a.hdr",
        "falsecolor two.exr a.png",
        "composite map.exr a.png",
        "falsecolor map.exr a.png -n 0",
    ] {
        let words: Vec<&str> = std::iter::once("picture").chain(line.split(' ')).collect();
        assert_eq!(glintmap(&words, at).status.code(), Some(2), "{line}");
    }
}

/// Bytes broken in every way that a disk or a rival's program breaks them.
fn broken(bytes: &[u8], random: &mut Stream, count: usize) -> Vec<Vec<u8>> {
    let mut out = Vec::new();
    for at in 0..count {
        let mut copy = bytes.to_vec();
        let place = |random: &mut Stream, length: usize| random.bits() as usize % length.max(1);
        match at % 4 {
            0 => copy.truncate(place(random, bytes.len())),
            1 => {
                let place = place(random, bytes.len());
                copy[place] ^= 1 << (random.bits() % 8);
            }
            2 => {
                let from = place(random, bytes.len());
                let end = (from + 4).min(copy.len());
                copy[from..end].fill([0, 0xff, 0x7f, 0x80][place(random, 4)]);
            }
            _ => {
                // In the header, where sizes are claimed.
                let place = place(random, bytes.len().min(400));
                copy[place] = random.bits() as u8;
            }
        }
        out.push(copy);
    }
    out
}

#[test]
fn broken_pictures_are_errors_or_pictures_never_more() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    let (values, rgb) = sample(at);
    hdr::write(&at.join("a.hdr"), &rgb, &[]).expect("writes");
    tif::write(&at.join("a.tif"), &values).expect("writes");
    png::write(&at.join("a.png"), &rgb.map(|c| c.map(|v| v as u8)), &[]).expect("writes");
    let mut random = Stream::new(11, Purpose::Survey, 2);
    let started = cpu_time();
    let mut refused = [0; 4];
    type Refuses = fn(&Path, &[u8]) -> bool;
    let decoders: [(&str, Refuses); 4] = [
        ("colors.exr", |p, b| exr::decode(p, b).is_err()),
        ("a.hdr", |p, b| hdr::decode(p, b).is_err()),
        ("a.png", |p, b| png::decode(p, b).is_err()),
        ("a.tif", |p, b| tif::decode(p, b).is_err()),
    ];
    for (kind, (name, decode)) in decoders.into_iter().enumerate() {
        let bytes = std::fs::read(at.join(name)).expect("reads");
        assert!(!decode(Path::new(name), &bytes));
        for copy in broken(&bytes, &mut random, 1500) {
            refused[kind] += u32::from(decode(Path::new(name), &copy));
        }
        assert!(refused[kind] > 375, "{name}: only {} refused", refused[kind]);
    }
    assert!(
        (cpu_time() - started).as_secs() < 30,
        "hangs or allocates without bounds: {refused:?}"
    );
}
