//! Damaged, lost, cut-off and lying volumes.

use std::fs;
use std::path::{Path, PathBuf};

use glintmap::base::Irradiance;
use glintmap::base::{FaultKind, Provenance, SeriesEntry, Silent, TileRect, TileSink};
use glintmap::volume::{self, Error, Volume};
use glintmap_formats::npy;

use crate::support::series::{Dense, files, provenance};

fn written(folder: &Path, dense: &Dense) -> PathBuf {
    let path = folder.join("series.zarr");
    dense.write(&path);
    path
}

fn read_all(path: &Path) -> Result<Vec<f32>, Error> {
    let volume = Volume::open(path)?;
    let [timesteps, rows, columns] = volume.shape();
    let mut out = vec![0.0; timesteps * rows * columns];
    volume.read(0..timesteps, &mut out)?;
    Ok(out)
}

#[test]
fn every_flipped_byte_of_a_shard_is_found_and_named() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([33, 40, 40], 0.05, 2);
    let path = written(folder.path(), &dense);
    let shard = path.join("irradiance/c/0/1/0");
    let good = fs::read(&shard).expect("reads");
    // Sampled, but with every byte of the index.
    let index = good.len() - (3 * 16 + 4);
    for at in (0..index).step_by(97).chain(index..good.len()) {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        fs::write(&shard, &bad).expect("writes");
        let error = read_all(&path).expect_err("a flipped byte went unnoticed");
        assert_eq!(error.kind(), FaultKind::Damaged, "{error}");
        let text = error.to_string();
        assert!(text.contains("columns 0..32, rows 32..40"), "{text}");
        assert_eq!(text.contains("timesteps"), at < index, "{text}");
        let found = Volume::open(&path).expect("opens").verify(&Silent).expect("reads");
        assert!(!found.is_empty() && found.iter().all(|f| f.contains("rows 32..40")), "{found:?}");
    }
    for length in [0, 3, index, good.len() - 1] {
        fs::write(&shard, &good[..length]).expect("writes");
        let error = read_all(&path).expect_err("a cut shard went unnoticed");
        assert_eq!(error.kind(), FaultKind::Damaged, "{error}");
    }
    fs::write(&shard, &good).expect("writes");
    assert_eq!(read_all(&path).expect("reads"), dense.numbers);
}

#[test]
fn a_damaged_chunk_is_told_by_its_timesteps_and_the_others_are_still_read() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([40, 8, 40], 0.5, 2);
    let path = written(folder.path(), &dense);
    let shard = path.join("irradiance/c/0/0/0");
    let mut bytes = fs::read(&shard).expect("reads");
    bytes[100] ^= 1;
    fs::write(&shard, bytes).expect("writes");
    let volume = Volume::open(&path).expect("opens");
    let mut out = vec![0.0; 16 * 320];
    let error = volume.read(0..16, &mut out).expect_err("damaged").to_string();
    assert!(error.contains("timesteps 0..16, columns 0..32, rows 0..8"), "{error}");
    volume.read(16..32, &mut out).expect("reads");
    assert!(out == dense.numbers[16 * 320..32 * 320]);
    assert!(volume.pixel(0, 0).is_err());
    volume.pixel(39, 0).expect("another tile");
}

#[test]
fn a_dark_tile_has_no_shard_but_a_lost_one_is_an_error() {
    let folder = tempfile::tempdir().expect("folder");
    let mut dense = Dense::random([20, 32, 96], 0.5, 2);
    for (i, value) in dense.numbers.iter_mut().enumerate() {
        if (32..64).contains(&(i % 96)) {
            *value = 0.0;
        }
    }
    let path = written(folder.path(), &dense);
    let shard = |column: u32| path.join(format!("irradiance/c/0/0/{column}"));
    assert!(shard(0).exists() && !shard(1).exists() && shard(2).exists());
    assert_eq!(read_all(&path).expect("reads"), dense.numbers);
    let kept = fs::read(shard(0)).expect("reads");
    fs::remove_file(shard(0)).expect("removes");
    let error = read_all(&path).expect_err("a lost shard went unnoticed");
    assert_eq!(error.kind(), FaultKind::Damaged);
    assert!(error.to_string().contains("is missing"), "{error}");
    // The shard of another tile in its place is found as well.
    fs::copy(shard(2), shard(0)).expect("copies");
    assert_eq!(read_all(&path).expect_err("a wrong shard").kind(), FaultKind::Damaged);
    fs::write(shard(0), kept).expect("writes");
    assert_eq!(read_all(&path).expect("reads"), dense.numbers);
}

#[test]
fn a_shard_of_the_right_length_but_of_another_volume_is_found() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([16, 32, 32], 0.3, 2);
    let darker = Dense::random([16, 32, 32], 0.1, 2);
    let of = |first: &Dense, second: &Dense, name: &str| {
        let numbers = [first.numbers.as_slice(), second.numbers.as_slice()].concat();
        let path = folder.path().join(name);
        Dense { timesteps: 32, numbers, ..*first }.write(&path);
        path
    };
    let (path, other) = (of(&dense, &darker, "a.zarr"), of(&darker, &dense, "b.zarr"));
    let shard = |path: &Path| path.join("irradiance/c/0/0/0");
    let length = |path: &Path| fs::metadata(shard(path)).expect("is there").len();
    assert_eq!(length(&path), length(&other));
    fs::copy(shard(&other), shard(&path)).expect("copies");
    let error = read_all(&path).expect_err("a wrong shard went unnoticed").to_string();
    assert!(error.contains("the shard of something else"), "{error}");
}

#[test]
fn killed_in_the_middle_it_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([37, 70, 100], 0.2, 5);
    let whole = written(folder.path(), &dense);
    let path = folder.path().join("half.zarr");
    let tiles = dense.tiles();
    for stop in [0, 1, tiles.len() / 2, tiles.len()] {
        let writer = dense.writer(&path);
        for &tile in tiles.iter().rev().take(stop) {
            writer.put(tile, &dense.entries(tile)).expect("writes");
        }
        drop(writer);
        let journal = path.join("irradiance/tiles.growing");
        let mut torn = fs::read(&journal).expect("reads");
        torn.extend_from_slice(&[1, 2, 3]);
        fs::write(&journal, torn).expect("writes");
        if stop < tiles.len() {
            // The first tile is the last of those that are put in reverse.
            let growing = path.join("irradiance/c/0/0/0.tmp");
            fs::write(growing, b"half a shard").expect("writes");
        }
        // Nobody takes it for finished.
        assert!(matches!(Volume::open(&path), Err(Error::Unfinished { .. })));
        let writer = dense.writer(&path);
        assert_eq!(writer.done(), stop);
        // Killed once more: what followed on the torn record counts.
        if let Some(&tile) = tiles.iter().rev().nth(stop) {
            writer.put(tile, &dense.entries(tile)).expect("writes");
        }
        drop(writer);
        let writer = dense.writer(&path);
        assert_eq!(writer.done(), (stop + 1).min(tiles.len()));
        for tile in tiles.iter().copied() {
            if !writer.has(tile) {
                writer.put(tile, &dense.entries(tile)).expect("writes");
            }
        }
        writer.finish().expect("finishes");
        assert_eq!(files(&path), files(&whole), "killed after {stop} tiles");
        // A finished one is known as finished, and finishing it again changes nothing.
        let again = dense.writer(&path);
        assert_eq!(again.done(), tiles.len());
        again.finish().expect("finishes");
        assert_eq!(files(&path), files(&whole));
        fs::remove_dir_all(&path).expect("removes");
    }
}

#[test]
fn killed_before_the_ledger_had_a_header_or_while_finishing() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let whole = written(folder.path(), &dense);
    let path = folder.path().join("half.zarr");
    fs::create_dir_all(path.join("irradiance")).expect("creates");
    assert_eq!(dense.writer(&path).done(), 0);
    fs::remove_dir_all(path.join("irradiance/c")).expect("removes");
    fs::write(path.join("irradiance/tiles.growing"), b"glintmap zarr-ti").expect("writes");
    assert_eq!(dense.writer(&path).done(), 0);
    dense.write(&path);
    // Between the ledger and the group's metadata.
    fs::remove_file(path.join("zarr.json")).expect("removes");
    let writer = dense.writer(&path);
    assert_eq!(writer.done(), dense.tiles().len());
    writer.finish().expect("finishes");
    assert_eq!(files(&path), files(&whole));
}

#[test]
fn a_tile_whose_shard_is_gone_is_written_again() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.5, 5);
    let path = written(folder.path(), &dense);
    let before = files(&path);
    fs::remove_file(path.join("irradiance/c/0/0/1")).expect("removes");
    let writer = dense.writer(&path);
    let missing: Vec<TileRect> = dense.tiles().into_iter().filter(|t| !writer.has(*t)).collect();
    assert_eq!(missing, [dense.tiles()[1]]);
    writer.put(missing[0], &dense.entries(missing[0])).expect("writes");
    writer.finish().expect("finishes");
    assert_eq!(files(&path), before);
}

#[test]
fn missing_tiles_are_counted_and_the_volume_stays_unfinished() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let path = folder.path().join("series.zarr");
    let writer = dense.writer(&path);
    writer.put(dense.tiles()[2], &dense.entries(dense.tiles()[2])).expect("writes");
    let error = writer.finish().expect_err("3 tiles are missing");
    assert!(error.to_string().contains("3 of 4 tiles are missing"), "{error}");
    assert!(!path.join("zarr.json").exists());
}

#[test]
fn another_volume_at_the_same_place_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let path = written(folder.path(), &dense);
    let before = files(&path);
    let other = Provenance { seed: 3, ..provenance() };
    let error = dense.try_writer(&path, &other).expect_err("another seed");
    assert!(matches!(error, Error::Different { what: "seed", .. }), "{error}");
    for shape in [[6, 40, 40], [5, 40, 41]] {
        let error = Dense::random(shape, 0.2, 5).try_writer(&path, &provenance());
        assert!(matches!(error, Err(Error::Different { what: "shape", .. })));
    }
    assert_eq!(files(&path), before);
    let unfinished = folder.path().join("unfinished.zarr");
    drop(dense.writer(&unfinished));
    assert!(matches!(dense.try_writer(&unfinished, &other), Err(Error::Different { .. })));

    let mine = folder.path().join("mine");
    fs::create_dir(&mine).expect("creates");
    fs::write(mine.join("thesis.tex"), "years of work").expect("writes");
    for path in [&mine, &mine.join("thesis.tex")] {
        let error = dense.try_writer(path, &provenance()).expect_err("occupied");
        assert_eq!(error.kind(), FaultKind::Input, "{error}");
    }
    assert_eq!(files(&mine).len(), 1);
}

#[test]
fn two_writers_do_not_write_at_once() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let path = folder.path().join("series.zarr");
    let first = dense.writer(&path);
    assert!(matches!(dense.try_writer(&path, &provenance()), Err(Error::Busy { .. })));
    drop(first);
    dense.writer(&path);
}

#[test]
fn a_tile_that_makes_no_sense_is_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let writer = dense.writer(&folder.path().join("series.zarr"));
    let tile = dense.tiles()[3];
    let entry = |timestep, pixel| SeriesEntry { timestep, pixel, irradiance_w_m2: 1.0 };
    for entries in [
        vec![entry(5, 0)],
        vec![entry(0, 64)],
        vec![entry(1, 0), entry(0, 0)],
        vec![entry(1, 1), entry(1, 0)],
        vec![entry(1, 1), entry(1, 1)],
    ] {
        assert!(writer.put(tile, &entries).is_err(), "{entries:?}");
    }
    for wrong in [
        TileRect { column: 1, ..tile },
        TileRect { columns: 32, ..tile },
        TileRect { row: 64, ..tile },
    ] {
        assert!(writer.put(wrong, &[]).is_err() && !writer.has(wrong), "{wrong:?}");
    }
    assert!(!writer.has(tile));
}

#[test]
fn a_tile_that_could_not_be_written_is_not_noted() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let path = folder.path().join("series.zarr");
    let writer = dense.writer(&path);
    let tile = dense.tiles()[0];
    let shards = path.join("irradiance/c/0/0");
    fs::remove_dir(&shards).expect("removes");
    let error = writer.put(tile, &dense.entries(tile)).expect_err("no folder").to_string();
    assert!(error.contains("irradiance/c/0/0/0.tmp: No such file"), "{error}");
    assert!(!writer.has(tile));
    fs::create_dir(&shards).expect("creates");
    writer.put(tile, &dense.entries(tile)).expect("writes");
    assert!(writer.has(tile));
}

#[test]
fn a_damaged_or_missing_ledger_is_found() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 40, 40], 0.2, 5);
    let path = written(folder.path(), &dense);
    let ledger = path.join("irradiance/tiles");
    let good = fs::read(&ledger).expect("reads");
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 1;
        fs::write(&ledger, bad).expect("writes");
        let error = Volume::open(&path).expect_err("a flipped byte went unnoticed");
        assert_eq!(error.kind(), FaultKind::Damaged, "byte {at}: {error}");
    }
    fs::write(&ledger, &good[..good.len() - 32]).expect("writes");
    assert!(Volume::open(&path).is_err());
    fs::remove_file(&ledger).expect("removes");
    assert!(Volume::open(&path).is_err());
}

#[test]
fn broken_metadata_and_coordinates_are_errors_and_never_a_panic() {
    let folder = tempfile::tempdir().expect("folder");
    let dense = Dense::random([5, 4, 4], 0.5, 5);
    let path = written(folder.path(), &dense);
    let axis = Volume::open(&path).expect("opens").axis().cloned();
    for name in ["zarr.json", "irradiance/zarr.json", "sun/zarr.json", "day/c/0", "sun/c/0/0"] {
        let file = path.join(name);
        let good = fs::read(&file).expect("reads");
        let is_text = name.ends_with("zarr.json");
        for at in (0..good.len()).step_by(7) {
            let mut bad = good.clone();
            bad[at] ^= 1;
            fs::write(&file, &bad).expect("writes");
            match Volume::open(&path) {
                Err(error) if !is_text => assert_eq!(error.kind(), FaultKind::Damaged, "{error}"),
                Err(_) => {}
                Ok(volume) => {
                    // Text without a checksum may be changed where it decides nothing.
                    assert!(is_text, "a flipped byte of {name} went unnoticed");
                    assert_eq!(volume.axis(), axis.as_ref(), "byte {at} of {name}");
                    assert_eq!(volume.quantity(), Some(Irradiance::Surface));
                    if let Ok(numbers) = read_all(&path) {
                        assert_eq!(numbers, dense.numbers, "byte {at} of {name}");
                    }
                }
            }
            // All that a JSON document can lose unnoticed is the end of its last line.
            if at + 1 < good.len() {
                fs::write(&file, &good[..at]).expect("writes");
                Volume::open(&path).expect_err("a cut file went unnoticed");
            }
        }
        fs::write(&file, &good).expect("writes");
    }
    let file = path.join("zarr.json");
    let good = fs::read_to_string(&file).expect("reads");
    fs::write(&file, good.replace("\"year\": 2025", "\"year\": 2024")).expect("writes");
    let error = Volume::open(&path).expect_err("another year went unnoticed");
    assert!(matches!(error, Error::Metadata { .. }), "{error}");
    fs::write(&file, &good).expect("writes");
    // Sizes that no memory holds.
    let file = path.join("irradiance/zarr.json");
    let good = fs::read_to_string(&file).expect("reads");
    for shape in ["[99999999999,4,4]", "[5,70000,4]", "[5,0,4]", "[5,60000,60000]"] {
        let compact: serde_json::Value = serde_json::from_str(&good).expect("is JSON");
        let mut bad = compact.clone();
        bad["shape"] = serde_json::from_str(shape).expect("is JSON");
        fs::write(&file, bad.to_string()).expect("writes");
        let error = Volume::open(&path).expect_err(shape);
        assert_eq!(error.kind(), FaultKind::Input, "{error}");
    }
}

#[test]
fn npy_files_that_lie_about_their_shape_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("lie.npy");
    npy::write(&path, &[2, 3, 4], &[1.0f32; 24]).expect("writes");
    let good = fs::read(&path).expect("reads");
    let text = String::from_utf8_lossy(&good[10..128]).into_owned();
    for (shape, words) in [
        ("(2, 3, 5)", "needs 120 bytes of numbers, the file holds 96"),
        ("(2, 3, 3)", "needs 72 bytes"),
        ("(99999999999, 99999999999, 4)", "needs too many bytes"),
        ("(4611686018427387904, 1, 1)", "needs too many bytes"),
        ("(-2, 3, 4)", "expected a length"),
    ] {
        let lie = text.replacen("(2, 3, 4)", shape, 1);
        let lie = format!("{}\n", &lie[..text.len() - 1]);
        let mut bytes = good.clone();
        bytes[10..128].copy_from_slice(lie.as_bytes());
        fs::write(&path, bytes).expect("writes");
        let error = Volume::open(&path).expect_err(shape);
        let cause = std::error::Error::source(&error).expect("has a cause").to_string();
        assert!(cause.contains(words), "{shape}: {cause}");
        assert_eq!(error.kind(), FaultKind::Input);
    }
    for length in 0..good.len() {
        fs::write(&path, &good[..length]).expect("writes");
        assert!(Volume::open(&path).is_err(), "cut at {length}");
    }
    let missing = Volume::open(&folder.path().join("none.npy")).expect_err("is missing");
    assert_eq!(missing.kind(), FaultKind::Input);
    assert!(matches!(Volume::open(folder.path()), Err(Error::NotAVolume { .. })));
}

#[test]
fn an_array_that_was_not_finished_leaves_nothing() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.npy");
    let mut writer = npy::Writer::<f32>::create(&path, &[2, 2]).expect("begins");
    writer.push(&[1.0; 3]).expect("writes");
    assert!(writer.push(&[1.0; 2]).is_err(), "more than the shape has");
    assert!(writer.finish().is_err(), "fewer than the shape has");
    assert!(files(folder.path()).is_empty());
    let dense = Dense::random([20, 4, 4], 0.5, 5);
    let series = written(folder.path(), &dense);
    let mut shard = fs::read(series.join("irradiance/c/0/0/0")).expect("reads");
    shard[60] ^= 1;
    fs::write(series.join("irradiance/c/0/0/0"), shard).expect("writes");
    let volume = Volume::open(&series).expect("opens");
    assert!(volume::export_npy(&volume, 0..20, &path, &Silent).is_err());
    assert!(volume::export_npy(&volume, 0..21, &path, &Silent).is_err());
    assert!(!path.exists() && !glintmap_formats::seal::growing(&path).exists());
}
