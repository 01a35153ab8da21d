//! Volumes from and to NumPy's `.npy`, in bounded memory.
//!
//! The two lie across each other: `.npy` slice by slice, a volume tile by tile. An import reads one row of
//! tiles of each slice, which lies in one piece, for some tiles and 16 timesteps at a time.

use std::collections::BTreeMap;
use std::fs::File;
use std::ops::Range;
use std::path::Path;

use glintmap_formats::npy;
use glintmap_formats::zarr::chunk::Encoder;
use rayon::prelude::*;

use super::axis::{Axis, segments_from_numbers};
use super::layout::{CHUNK_BYTES, CHUNK_TIMESTEPS};
use super::read::Source;
use super::write::{GrowingShard, Summary, Writer};
use super::{Error, Volume};
use crate::base::Irradiance;
use crate::base::limits::TILE_EDGE;
use crate::base::{Progress, Provenance, TileRect, TileSink};

/// Shards that an import writes at a time: so many open files and chunks in memory.
const SHARDS_AT_A_TIME: usize = 64;

/// Writes the slices of `range` into an `.npy` file, in bounded memory.
///
/// # Errors
/// A range beyond the volume; damaged parts; what the file system says.
pub fn export_npy(
    volume: &Volume,
    range: Range<usize>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<(), Error> {
    let [timesteps, rows, columns] = volume.shape();
    if range.is_empty() || range.end > timesteps {
        return Err(Error::Shape {
            what: "range of timesteps",
            expected: format!("a part of 0..{timesteps}"),
            found: format!("{range:?}"),
        });
    }
    let shape = [range.len(), rows, columns];
    let mut writer = npy::Writer::<f32>::create(out, &shape).map_err(Error::npy(out))?;
    volume.for_each_part("exporting", range, progress, |numbers| {
        writer.push(numbers).map_err(Error::npy(out))
    })?;
    writer.finish().map_err(Error::npy(out))
}

/// Makes a volume of ours at `out` of an `.npy` volume, in bounded memory; killed and started
/// again, it goes on. `segments` (one number for each timestep) mark where segments start; without
/// them there is one. Days, hours and suns stay unknown.
///
/// # Errors
/// A source that isn't `.npy`; segments of another length; see [`Writer::create_or_resume`].
pub fn import_npy(
    source: &Volume,
    segments: Option<&[i64]>,
    quantity: Irradiance,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Summary, Error> {
    let Source::Npy(reader) = &source.source else {
        let path = source.path().to_owned();
        return Err(Error::NotNpy { path });
    };
    let [timesteps, rows, columns] = source.shape();
    if let Some(found) = segments.map(<[i64]>::len).filter(|&n| n != timesteps) {
        return Err(Error::Shape {
            what: "segment numbers",
            expected: format!("{timesteps}, one for each timestep"),
            found: found.to_string(),
        });
    }
    let numbers = match segments {
        None => vec![0; timesteps],
        Some(numbers) => (0u32..)
            .zip(segments_from_numbers(numbers))
            .flat_map(|(number, range)| std::iter::repeat_n(number, range.len()))
            .collect(),
    };
    let provenance = provenance(source.path())?;
    let axis = Axis::Segments(numbers);
    let writer = Writer::open(out, axis, columns, rows, quantity, &provenance)?;
    progress.begin("importing", writer.tiling().tiles.count() as u64, "tiles");
    progress.advance(writer.done() as u64);
    let missing: Vec<usize> = (0..writer.tiling().tiles.count())
        .filter(|&n| !writer.has(writer.tiling().tiles.rect(n)))
        .collect();
    // One row of tiles at a time, so that what is read of a slice lies in one piece.
    let across = writer.tiling().tiles.across();
    for row in missing.chunk_by(|a, b| a / across == b / across) {
        for numbers in row.chunks(SHARDS_AT_A_TIME) {
            import_tiles(reader, source.path(), &writer, numbers, progress)?;
        }
    }
    progress.finish();
    writer.finish()
}

/// The program, and the hash of what it imports.
fn provenance(path: &Path) -> Result<Provenance, Error> {
    let file = File::open(path).map_err(Error::io(path))?;
    let mut hash = blake3::Hasher::new();
    hash.update_reader(file).map_err(Error::io(path))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Provenance {
        program: Provenance::PROGRAM.to_owned(),
        inputs: BTreeMap::from([(name, hash.finalize().to_hex().to_string())]),
        ..Provenance::default()
    })
}

/// A tile that grows through time.
struct Column {
    tile: TileRect,
    shard: GrowingShard,
    encoder: Encoder,
    plain: Vec<u8>,
    nonzero: u64,
}

/// Imports some tiles of one row of tiles.
fn import_tiles(
    reader: &npy::Reader<f32>,
    path: &Path,
    writer: &Writer,
    numbers: &[usize],
    progress: &dyn Progress,
) -> Result<(), Error> {
    let tiling = writer.tiling();
    let mut tiles = numbers
        .iter()
        .map(|&number| {
            Ok(Column {
                tile: tiling.tiles.rect(number),
                shard: writer.shard(number),
                encoder: Encoder::new().map_err(Error::zarr(path))?,
                plain: vec![0; CHUNK_BYTES],
                nonzero: 0,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let Some((row, rows)) = tiles.first().map(|t| (t.tile.row, t.tile.rows)) else {
        return Ok(());
    };
    let pixels = (tiling.tiles.rows * tiling.tiles.columns) as u64;
    let mut band = vec![0.0f32; CHUNK_TIMESTEPS * rows * tiling.tiles.columns];
    for chunk in 0..tiling.chunks() {
        progress.check()?;
        let timesteps = tiling.chunk_timesteps(chunk);
        let count = timesteps.len();
        let slices = band.chunks_mut(rows * tiling.tiles.columns);
        for (timestep, slice) in timesteps.zip(slices) {
            let at = timestep as u64 * pixels + (row * tiling.tiles.columns) as u64;
            reader.read_at(at, slice).map_err(Error::npy(path))?;
        }
        tiles
            .par_iter_mut()
            .try_for_each(|column| column.take(chunk, count, &band, tiling.tiles.columns))?;
    }
    for column in tiles {
        writer.keep(column.shard, column.nonzero)?;
        progress.advance(1);
    }
    Ok(())
}

impl Column {
    /// Takes this tile's part of `slices` slices of a row of tiles.
    fn take(
        &mut self,
        chunk: usize,
        slices: usize,
        band: &[f32],
        columns: usize,
    ) -> Result<(), Error> {
        self.plain.fill(0);
        let before = self.nonzero;
        for slice in 0..slices {
            for row in 0..self.tile.rows {
                let from = (slice * self.tile.rows + row) * columns + self.tile.column;
                let to = (slice * TILE_EDGE + row) * TILE_EDGE * 4;
                let numbers = &band[from..from + self.tile.columns];
                let bytes = self.plain[to..].chunks_exact_mut(4);
                for (value, bytes) in numbers.iter().zip(bytes).filter(|(v, _)| **v != 0.0) {
                    bytes.copy_from_slice(&value.to_le_bytes());
                    self.nonzero += 1;
                }
            }
        }
        if self.nonzero > before {
            self.shard.push(chunk, &self.plain, &mut self.encoder)?;
        }
        Ok(())
    }
}
