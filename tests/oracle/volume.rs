//! Volumes and arrays against zarr-python, xarray and numpy, and against dense arrays in memory.

use std::path::Path;
use std::time::Instant;

use glintmap::base::Irradiance;
use glintmap::base::{Silent, TileRect, TileSink, Timeline};
use glintmap::volume::{self, Volume, Writer};
use glintmap_formats::npy;

use crate::support::series::{Dense, files, provenance, run_python, timeline};

const SHAPES: [[usize; 3]; 7] =
    [[1, 1, 1], [16, 32, 32], [17, 33, 31], [3, 1, 70], [40, 70, 1], [1, 65, 64], [130, 40, 72]];

fn read_all(volume: &Volume) -> Vec<f32> {
    let [timesteps, rows, columns] = volume.shape();
    let mut out = vec![f32::NAN; timesteps * rows * columns];
    volume.read(0..timesteps, &mut out).expect("reads");
    out
}

#[test]
fn slices_and_pixels_are_those_of_a_dense_array() {
    let folder = tempfile::tempdir().expect("folder");
    for (i, shape) in SHAPES.into_iter().enumerate() {
        for (j, lit) in [0.0, 0.1, 1.0].into_iter().enumerate() {
            let dense = Dense::random(shape, lit, 7);
            let path = folder.path().join(format!("{i}-{j}.zarr"));
            let summary = dense.write(&path);
            assert_eq!(summary.nonzero, dense.nonzero(), "{shape:?}");
            assert_eq!(summary.dense_bytes, dense.numbers.len() as u64 * 4);
            assert_eq!(summary.tiles, dense.tiles().len());
            let dark = dense.tiles().into_iter().filter(|t| dense.entries(*t).is_empty()).count();
            assert_eq!(summary.empty_tiles, dark);
            let volume = Volume::open(&path).expect("opens");
            assert_eq!(volume.shape(), shape);
            assert_eq!(read_all(&volume), dense.numbers, "{shape:?}");
            assert_eq!(volume.summary(), Some(summary));
            let [timesteps, rows, columns] = shape;
            let pixels = rows * columns;
            for from in (0..timesteps).step_by(7) {
                for to in [from, from + 1, from + 16, timesteps] {
                    let range = from..to.min(timesteps);
                    let mut out = vec![f32::NAN; range.len() * pixels];
                    volume.read(range.clone(), &mut out).expect("reads");
                    let expected = &dense.numbers[range.start * pixels..range.end * pixels];
                    assert!(out == expected, "{shape:?} {range:?}");
                }
            }
            for (column, row) in [(0, 0), (columns - 1, rows - 1), (columns / 2, rows / 3)] {
                let expected: Vec<f32> = (0..timesteps).map(|t| dense.at(t, row, column)).collect();
                assert_eq!(volume.pixel(column, row).expect("reads"), expected);
            }
            let survey = volume.survey(&Silent).expect("reads");
            let most = dense.numbers.iter().copied().fold(0.0, f32::max);
            assert_eq!((survey.nonzero, survey.max_w_m2), (dense.nonzero(), most));
            let peak = volume.peak(&Silent).expect("reads");
            for row in 0..rows {
                for column in 0..columns {
                    let all = (0..timesteps).map(|t| dense.at(t, row, column));
                    assert_eq!(peak[(column, row)], all.fold(0.0, f32::max));
                }
            }
            assert_eq!(volume.verify(&Silent).expect("reads"), Vec::<String>::new());
        }
    }
}

#[test]
fn a_small_cache_of_indexes_changes_nothing() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("series.zarr");
    let dense = Dense::random([16 * 21 + 3, 33, 65], 0.05, 9);
    dense.write(&path);
    let tiles = dense.tiles().len();
    // One entry for each tile, then windows that do and don't divide the 22 chunks.
    for entries in [0, 1, 2, 5, 11, 21, 22, 1000] {
        let volume = Volume::open_with(&path, entries * tiles * 24).expect("opens");
        assert!(read_all(&volume) == dense.numbers);
        // Backwards, and by pixel.
        let mut out = vec![0.0; 33 * 65];
        for timestep in (0..dense.timesteps).rev().step_by(5) {
            volume.read(timestep..timestep + 1, &mut out).expect("reads");
            assert!(out == dense.numbers[timestep * out.len()..(timestep + 1) * out.len()]);
        }
        let pixel: Vec<f32> = (0..dense.timesteps).map(|t| dense.at(t, 32, 64)).collect();
        assert_eq!(volume.pixel(64, 32).expect("reads"), pixel);
    }
}

#[test]
fn the_time_axis_comes_back() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("series.zarr");
    Dense::random([130, 2, 3], 0.5, 1).write(&path);
    let volume = Volume::open(&path).expect("opens");
    let timeline = timeline(130);
    assert_eq!(volume.axis(), Some(&volume::TimeAxis::from(&timeline)));
    assert_eq!(volume.segments(), timeline.segments());
    assert_eq!(volume.quantity(), Some(Irradiance::Surface));
    // A step that a careless reader of JSON takes for its neighbour.
    let timeline = Timeline { step_h: 1.0 / 11.0, ..timeline };
    let path = folder.path().join("eleventh.zarr");
    let quantity = Irradiance::FacingBeam;
    let writer = Writer::create_or_resume(&path, &timeline, 1, 1, quantity, &provenance());
    let writer = writer.expect("begins");
    writer.put(TileRect { column: 0, row: 0, columns: 1, rows: 1 }, &[]).expect("writes");
    writer.finish().expect("finishes");
    let volume = Volume::open(&path).expect("opens");
    assert_eq!(volume.axis(), Some(&volume::TimeAxis::from(&timeline)));
}

#[test]
fn an_npy_file_is_a_volume_and_becomes_a_zarr_and_back() {
    let folder = tempfile::tempdir().expect("folder");
    for (i, shape) in SHAPES.into_iter().enumerate() {
        let dense = Dense::random(shape, 0.3, 3);
        let first = folder.path().join(format!("{i}.npy"));
        npy::write(&first, &shape, &dense.numbers).expect("writes");
        let volume = Volume::open(&first).expect("opens");
        assert_eq!(read_all(&volume), dense.numbers);
        let [timesteps, rows, columns] = shape;
        assert_eq!(volume.segments(), std::slice::from_ref(&(0..timesteps)));
        let pixel = volume.pixel(columns - 1, rows - 1).expect("reads");
        let expected: Vec<f32> =
            (0..timesteps).map(|t| dense.at(t, rows - 1, columns - 1)).collect();
        assert_eq!(pixel, expected);

        let numbers: Vec<i64> =
            (0..timesteps as i64).map(|t| [5, -2, 5][t as usize / 7 % 3]).collect();
        let zarr = folder.path().join(format!("{i}.zarr"));
        let quantity = Irradiance::FacingBeam;
        let summary =
            volume::import_npy(&volume, Some(&numbers), quantity, &zarr, &Silent).expect("imports");
        assert_eq!(summary.nonzero, dense.nonzero());
        let imported = Volume::open(&zarr).expect("opens");
        assert_eq!(read_all(&imported), dense.numbers);
        assert_eq!(imported.segments(), volume::segments_from_numbers(&numbers));
        assert_eq!((imported.axis(), imported.quantity()), (None, Some(quantity)));
        // The tile-wise writer makes the same shards.
        let put = folder.path().join(format!("{i}-put.zarr"));
        dense.write(&put);
        let shards = |path: &Path| files(&path.join("irradiance/c"));
        assert_eq!(shards(&zarr), shards(&put));

        let back = folder.path().join("back.npy");
        volume::export_npy(&imported, 0..timesteps, &back, &Silent).expect("exports");
        assert!(std::fs::read(&back).expect("reads") == std::fs::read(&first).expect("reads"));
        volume::export_npy(&imported, timesteps / 2..timesteps, &back, &Silent).expect("exports");
        let part = npy::Reader::<f32>::open(&back).expect("opens").read_all().expect("reads");
        assert!(part == dense.numbers[timesteps / 2 * rows * columns..]);
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads_or_order() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([37, 100, 90], 0.2, 5);
    let (one, two) = (folder.path().join("one.zarr"), folder.path().join("two.zarr"));
    dense.write(&one);
    let writer = dense.writer(&two);
    let mut tiles = dense.tiles();
    tiles.reverse();
    let (writer_of, dense_of) = (&writer, &dense);
    std::thread::scope(|scope| {
        for part in tiles.chunks(3) {
            scope.spawn(move || {
                for &tile in part {
                    writer_of.put(tile, &dense_of.entries(tile)).expect("writes");
                }
            });
        }
    });
    writer.finish().expect("finishes");
    assert_eq!(files(&one), files(&two));
    assert!(!files(&one).keys().any(|name| name.extension().is_some_and(|e| e == "tmp")));
}

#[test]
fn zarr_python_and_xarray_open_it_without_options() {
    let Some(python) = crate::support::python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    for (i, shape) in SHAPES.into_iter().enumerate() {
        let dense = Dense::random(shape, 0.3, 11);
        dense.write(&folder.path().join(format!("{i}.zarr")));
        dense.write_raw(&folder.path().join(format!("{i}.raw")));
    }
    let script = r#"
import sys, json, pathlib, numpy as np, zarr, xarray as xr
folder = pathlib.Path(sys.argv[1])
for path in sorted(folder.glob("*.zarr")):
    group = zarr.open(path, mode="r")
    a = group["irradiance"]
    expected = np.fromfile(path.with_suffix(".raw"), "<f4").reshape(a.shape)
    assert a.dtype == np.float32 and (a[:] == expected).all(), path
    assert (zarr.open_array(path / "irradiance", mode="r")[:] == expected).all()
    assert group.attrs["provenance"]["seed"] == 2**64 - 1
    # the group's members are found without the consolidated metadata, too
    plain = zarr.open_group(path, mode="r", use_consolidated=False)
    assert sorted(k for k, _ in plain.members()) == ["day", "hour", "irradiance", "segment", "sun", "weight_h"]

    ds = xr.open_zarr(path)
    assert ds.irradiance.dims == ("timestep", "row", "column")
    assert (ds.irradiance.values == expected).all()
    assert ds.irradiance.attrs["units"] == "W m-2"
    assert set(ds.coords) == {"day", "hour", "segment", "sun", "weight_h"}, ds.coords
    n = a.shape[0]; i = np.arange(n)
    assert ds.day.dtype == np.int32 and (ds.day.values == i // 5).all()
    assert ds.segment.dtype == np.int32 and (ds.segment.values == i // 5).all()
    assert ds.hour.dtype == np.float64 and (ds.hour.values == 10 + i % 5 * 0.25).all()
    assert (ds.weight_h.values == 0.25 + i / 1024).all()
    assert ds.sun.shape == (n, 3) and np.allclose((ds.sun.values ** 2).sum(1), 1)
    assert ds.attrs["year"] == 2025 and ds.attrs["step_h"] == 0.25 and ds.attrs["spectral_basis"] == "broadband"
    # sun has an axis of its own, so it stays with the data set
    assert set(ds.irradiance.coords) == {"day", "hour", "segment", "weight_h"}
    # what a user does with it
    days = ds.irradiance.groupby("day").sum("timestep")
    assert days.sizes["day"] == (n + 4) // 5
print("done")
"#;
    assert_eq!(run_python(&python, script, &[folder.path()]).trim(), "done");
}

#[test]
fn what_zarr_python_writes_is_read() {
    let Some(python) = crate::support::python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    let script = r#"
import sys, pathlib, numpy as np, zarr
folder = pathlib.Path(sys.argv[1])
a = np.random.default_rng(1).random((20, 40, 33), dtype=np.float32)
a[:, 32:] = 0
a[:16, :, 32:] = 0
a.tofile(folder / "a.raw")
group = zarr.create_group(folder / "a.zarr", zarr_format=3)
codecs = [zarr.codecs.ZstdCodec(level=3), zarr.codecs.Crc32cCodec()]
z = group.create_array("irradiance", shape=a.shape, dtype="float32", chunks=(16, 32, 32), shards=(32, 32, 32), compressors=codecs, fill_value=0)
z[:] = a
s = group.create_array("segment", shape=(20,), dtype="int32", chunks=(7,), compressors=codecs)
s[:] = np.repeat([4, 2, 4, 9], 5)
group.create_array("other", shape=(20, 40, 33), dtype="float32", chunks=(16, 32, 32))
"#;
    run_python(&python, script, &[folder.path()]);
    let raw = std::fs::read(folder.path().join("a.raw")).expect("reads");
    let expected: Vec<f32> =
        raw.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let volume = Volume::open(&folder.path().join("a.zarr")).expect("opens");
    assert!(read_all(&volume) == expected);
    assert_eq!(volume.segments(), [0..5, 5..10, 10..15, 15..20]);
    assert_eq!(volume.verify(&Silent).expect("reads"), Vec::<String>::new());
}

#[test]
fn npy_files_are_numpys_own_byte_for_byte() {
    let Some(python) = crate::support::python() else { return };
    let folder = tempfile::tempdir().expect("folder");
    let path = |name: &str| folder.path().join(name);
    let shapes: [&[usize]; 6] = [&[], &[5], &[2, 3], &[1, 1, 1], &[4, 0, 2], &[100, 3, 7]];
    for (i, shape) in shapes.into_iter().enumerate() {
        let numbers = 0..shape.iter().product::<usize>();
        let f: Vec<f32> = numbers.clone().map(|n| n as f32 * 0.1).collect();
        let d: Vec<f64> = numbers.clone().map(|n| n as f64 * 0.1).collect();
        let w: Vec<i32> = numbers.map(|n| n as i32 - 3).collect();
        npy::write(&path(&format!("{i}-f4.npy")), shape, &f).expect("writes");
        npy::write(&path(&format!("{i}-f8.npy")), shape, &d).expect("writes");
        npy::write(&path(&format!("{i}-i4.npy")), shape, &w).expect("writes");
    }
    let script = r#"
import sys, pathlib, io, numpy as np
folder = pathlib.Path(sys.argv[1])
shapes = [(), (5,), (2, 3), (1, 1, 1), (4, 0, 2), (100, 3, 7)]
for i, shape in enumerate(shapes):
    n = np.arange(int(np.prod(shape)))
    for kind, values in [("f4", n.astype("f4") * np.float32(0.1)), ("f8", n * 0.1), ("i4", (n - 3).astype("i4"))]:
        out = io.BytesIO()
        np.save(out, values.reshape(shape))
        assert out.getvalue() == (folder / f"{i}-{kind}.npy").read_bytes(), (shape, kind)
a = np.arange(24, dtype="f4").reshape(2, 3, 4)
for version in [(1, 0), (2, 0), (3, 0)]:
    with open(folder / f"v{version[0]}.npy", "wb") as f:
        np.lib.format.write_array(f, a, version=version)
np.save(folder / "big.npy", a.astype(">f4"))
np.save(folder / "double.npy", a.astype("f8"))
np.save(folder / "fortran.npy", np.asfortranarray(a))
np.save(folder / "flat.npy", a.ravel())
np.save(folder / "record.npy", np.zeros(3, dtype=[("a", "f4")]))
for kind in ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"]:
    np.save(folder / f"segments-{kind.replace('?', 'b')}.npy", np.array([1, 1, 0, 1]).astype(kind))
np.save(folder / "segments-float.npy", np.array([1.0, 2.0]))
"#;
    run_python(&python, script, &[folder.path()]);
    let expected: Vec<f32> = (0u8..24).map(f32::from).collect();
    for version in ["v1.npy", "v2.npy", "v3.npy"] {
        let reader = npy::Reader::<f32>::open(&path(version)).expect("opens");
        assert_eq!(reader.shape(), [2, 3, 4]);
        assert_eq!(reader.read_all().expect("reads"), expected);
        let mut part = [0.0; 5];
        reader.read_at(19, &mut part).expect("reads");
        assert_eq!(part, expected[19..]);
        assert!(reader.read_at(20, &mut part).is_err(), "beyond the end");
    }
    for (name, words) in [
        ("big.npy", ["<f4", ">f4"]),
        ("double.npy", ["<f4", "<f8"]),
        ("fortran.npy", ["C order", "Fortran order"]),
        ("flat.npy", ["3 dimensions", "(24,)"]),
        ("record.npy", ["<f4", "[('a', '<f4')]"]),
    ] {
        let error = Volume::open(&path(name)).expect_err(name);
        let text = std::error::Error::source(&error).expect("has a cause").to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{name}: {text}");
        assert_eq!(error.kind(), glintmap::base::FaultKind::Input);
    }
    for kind in ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "b"] {
        let numbers = volume::read_segments(&path(&format!("segments-{kind}.npy")), 4);
        assert_eq!(numbers.expect(kind), [1, 1, 0, 1]);
    }
    assert!(volume::read_segments(&path("segments-float.npy"), 2).is_err());
    assert!(volume::read_segments(&path("segments-i4.npy"), 5).is_err(), "another length");
}

/// Prints how fast a volume of 1,280 x 250 x 250 with 10 % lit is written and read:
/// `cargo test --release --test all volume::speed -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn speed() {
    let folder = tempfile::tempdir().expect("folder");
    let shape = [1280, 250, 250];
    let voxels = shape.iter().product::<usize>() as f64;
    for (name, lit, spread) in [("scattered", 0.1, false), ("in every third chunk", 0.25, true)] {
        let mut dense = Dense::random(shape, lit, 1);
        if !spread {
            // No dark tiles or chunks: one number in ten, everywhere.
            for (i, value) in dense.numbers.iter_mut().enumerate() {
                let lit = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60 == 0 || i % 27 == 0;
                *value = if lit { (i % 1000) as f32 * 0.37 + 1.0 } else { 0.0 };
            }
        }
        let path = folder.path().join(name);
        let entries: Vec<_> = dense.tiles().into_iter().map(|t| (t, dense.entries(t))).collect();
        let writer = dense.try_writer(&path, &provenance()).expect("begins");
        let start = Instant::now();
        entries.iter().for_each(|(tile, entries)| writer.put(*tile, entries).expect("writes"));
        let summary = writer.finish().expect("finishes");
        let write_s = start.elapsed().as_secs_f64();
        let volume = Volume::open(&path).expect("opens");
        let mut out = vec![0.0; 16 * 250 * 250];
        let start = Instant::now();
        for first in (0..1280).step_by(16) {
            volume.read(first..first + 16, &mut out).expect("reads");
        }
        let read_s = start.elapsed().as_secs_f64();
        println!(
            "{name}: {:.1} % lit, {:.1} MB of {:.1}; write {write_s:.2} s ({:.0} Mvoxel/s), read {read_s:.3} s ({:.0} Mvoxel/s)",
            100.0 * dense.nonzero() as f64 / voxels,
            summary.bytes as f64 / 1e6,
            summary.dense_bytes as f64 / 1e6,
            voxels / write_s / 1e6,
            voxels / read_s / 1e6,
        );
    }
}
