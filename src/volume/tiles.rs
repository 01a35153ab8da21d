//! Where each chunk of a volume lies on disk, and its numbers.
//!
//! A shard's index has 16 bytes for each chunk of a year, which for all tiles of a large view would
//! take more memory than the picture. So an index is checked as a whole when a tile is first asked
//! for, and a window of it is kept, which moves with what is asked. What the ledger says of a shard (its
//! length, the checksum of its index) tells a lost or an exchanged shard from a dark tile.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glintmap_formats::zarr;
use glintmap_formats::zarr::chunk::{Decoder, Pipeline, encoded_bound};
use glintmap_formats::zarr::ledger::{Ledger, Record};
use glintmap_formats::zarr::metadata::{self, Array, DataType};
use glintmap_formats::zarr::shard::{self, Entry};

use super::Error;
use super::axis::Axis;
use super::document;
use super::layout::{ARRAY, CHUNK_BYTES, CHUNK_TIMESTEPS, Facts, GROWING, LEDGER, Tiling};
use crate::base::Irradiance;
use crate::base::limits::TILE_EDGE;

/// A volume in Zarr: where each chunk lies, as far as that was asked for.
#[derive(Debug)]
pub(super) struct Tiles {
    array: PathBuf,
    pub tiling: Tiling,
    pipeline: Pipeline,
    /// What was written, by tile; `None` for a volume that another program wrote.
    records: Option<Vec<Record>>,
    /// Which irradiance it is, where that is known.
    pub quantity: Option<Irradiance>,
    indexes: Vec<Mutex<Index>>,
    /// Entries of a tile's index that are kept in memory at a time.
    window: usize,
}

#[derive(Debug)]
enum Index {
    /// Not looked at.
    Unknown,
    /// No shard: all 0.
    Absent,
    /// A shard whose index was checked.
    Present { file_bytes: u64, first: usize, entries: Vec<Option<Entry>> },
}

/// Memory for decoding, one for each thread.
pub(super) struct Scratch {
    decoder: Decoder,
    encoded: Vec<u8>,
    plain: Vec<u8>,
}

impl Scratch {
    pub(super) fn new(path: &Path) -> Result<Self, Error> {
        let decoder = Decoder::new().map_err(Error::zarr(path))?;
        Ok(Self { decoder, encoded: Vec::new(), plain: vec![0; CHUNK_BYTES] })
    }
}

impl Tiles {
    /// Opens the group at `path`; also returns what it stores about its timesteps. The indexes of
    /// all shards together take about `index_cache_bytes`.
    pub(super) fn open(
        path: &Path,
        index_cache_bytes: usize,
    ) -> Result<(Self, Option<Axis>), Error> {
        let array_folder = path.join(ARRAY);
        let group_path = path.join(document::NAME);
        if !group_path.exists() && array_folder.join(GROWING).exists() {
            return Err(Error::Unfinished { path: path.to_owned() });
        }
        let group = document::read(&group_path)?;
        let attributes = metadata::group_attributes(&group).map_err(Error::zarr(&group_path))?;
        let array = document::read_array(&array_folder)?;
        let (tiling, pipeline) = understand(&array_folder, &array)?;
        let ledger = read_ledger(&array_folder, &tiling)?;
        let ours = attributes.contains_key("provenance");
        if ours && ledger.is_none() {
            let path = array_folder.join(LEDGER);
            let what = "it is missing, so that lost tiles couldn't be told from dark ones".into();
            return Err(Error::Ledger { path, what });
        }
        let axis = Axis::read(path, &attributes, tiling.timesteps)?;
        let said = array.attributes.get("quantity").cloned();
        let quantity: Option<Irradiance> = said.and_then(|q| serde_json::from_value(q).ok());
        // Zarr's metadata have no checksum; the ledger has, and knows what they must say.
        if let Some(facts) = ledger.as_ref().map(|ledger| &ledger.facts) {
            let timeline = axis.as_ref().map(Axis::fingerprint);
            if timeline.as_ref() != Some(&facts.timeline) || quantity != Some(facts.quantity) {
                return Err(Error::Metadata { path: path.to_owned() });
            }
        }
        let records = ledger.map(|ledger| ledger.records);
        let indexes = (0..tiling.tiles.count())
            .map(|n| match &records {
                Some(records) if records[n].bytes == 0 => Index::Absent,
                _ => Index::Unknown,
            })
            .map(Mutex::new)
            .collect();
        let window = index_cache_bytes / size_of::<Option<Entry>>() / tiling.tiles.count();
        let window = window.clamp(1, tiling.chunks());
        let array = array_folder;
        Ok((Self { array, tiling, pipeline, records, quantity, indexes, window }, axis))
    }

    /// What the ledger says, tile by tile.
    pub(super) fn records(&self) -> Option<&[Record]> {
        self.records.as_deref()
    }

    /// Decodes those of `chunks` of tile `number` that are not left out and hands each to `each`:
    /// its number and its little-endian numbers `[16, 32, 32]`.
    pub(super) fn decode(
        &self,
        number: usize,
        chunks: std::ops::Range<usize>,
        scratch: &mut Scratch,
        mut each: impl FnMut(usize, &[u8]),
    ) -> Result<(), Error> {
        let mut file: Option<File> = None;
        for chunk in chunks {
            let Some((entry, file_bytes)) = self.locate(number, chunk, &mut file)? else {
                continue;
            };
            let file = self.open_shard(number, &mut file)?;
            let Scratch { decoder, encoded, plain } = &mut *scratch;
            shard::read_chunk(
                file,
                file_bytes,
                self.tiling.chunks(),
                entry,
                encoded_bound(CHUNK_BYTES),
                encoded,
            )
            .and_then(|()| decoder.decode(self.pipeline, encoded, plain))
            .map_err(|error| self.chunk_error(number, chunk, error))?;
            each(chunk, plain);
        }
        Ok(())
    }

    /// Where a chunk lies, and the length of its shard; `None` where it is all 0.
    fn locate(
        &self,
        number: usize,
        chunk: usize,
        file: &mut Option<File>,
    ) -> Result<Option<(Entry, u64)>, Error> {
        let mut index = self.index(number);
        if matches!(*index, Index::Unknown) {
            *index = self.load(number, chunk, file)?;
        }
        let Index::Present { file_bytes, first, entries } = &mut *index else {
            return Ok(None);
        };
        if !(*first..*first + entries.len()).contains(&chunk) {
            let chunks = self.tiling.chunks();
            *first = chunk / self.window * self.window;
            entries.resize(self.window.min(chunks - *first), None);
            let file = self.open_shard(number, file)?;
            shard::read_entries(file, *file_bytes, chunks, *first, entries)
                .map_err(|error| self.tile_error(number, error))?;
        }
        Ok(entries[chunk - *first].map(|entry| (entry, *file_bytes)))
    }

    /// The shard of a tile, unless it is open already.
    fn open_shard<'f>(&self, number: usize, file: &'f mut Option<File>) -> Result<&'f File, Error> {
        match file {
            Some(file) => Ok(file),
            none => {
                let path = self.tiling.shard_path(&self.array, number);
                Ok(none.insert(File::open(&path).map_err(Error::io(&path))?))
            }
        }
    }

    /// Checks a shard's index, and keeps the part of it around `chunk`.
    fn load(&self, number: usize, chunk: usize, opened: &mut Option<File>) -> Result<Index, Error> {
        let path = self.tiling.shard_path(&self.array, number);
        let damaged = |what: String| self.tile_error(number, zarr::Error::Damaged { what });
        let record = self.records.as_ref().map(|records| records[number]);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let Some(record) = record else { return Ok(Index::Absent) };
                let bytes = record.bytes;
                return Err(damaged(format!("its shard of {bytes} bytes is missing")));
            }
            Err(e) => return Err(Error::io(&path)(e)),
        };
        let file_bytes = file.metadata().map_err(Error::io(&path))?.len();
        if let Some(record) = record.filter(|r| r.bytes != file_bytes) {
            let expected = record.bytes;
            return Err(damaged(format!("expected {expected} bytes, found {file_bytes}")));
        }
        let first = chunk / self.window * self.window;
        let mut entries = Vec::new();
        let crc = shard::read_index(&file, file_bytes, self.tiling.chunks(), |i, entry| {
            if (first..first + self.window).contains(&i) {
                entries.push(entry);
            }
        })
        .map_err(|error| self.tile_error(number, error))?;
        if record.is_some_and(|r| r.index_crc != crc) {
            return Err(damaged(
                "it is the shard of something else (checksum of its index)".into(),
            ));
        }
        *opened = Some(file);
        Ok(Index::Present { file_bytes, first, entries })
    }

    fn index(&self, number: usize) -> MutexGuard<'_, Index> {
        // An index is replaced as a whole: after a panic elsewhere it is still right.
        self.indexes[number].lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tile_error(&self, number: usize, error: zarr::Error) -> Error {
        let path = self.tiling.shard_path(&self.array, number);
        let tile = self.tiling.tiles.rect(number);
        match error {
            zarr::Error::Io(source) => Error::Io { path, source },
            other => Error::Tile {
                path,
                columns: tile.column..tile.column + tile.columns,
                rows: tile.row..tile.row + tile.rows,
                what: reason(other),
            },
        }
    }

    fn chunk_error(&self, number: usize, chunk: usize, error: zarr::Error) -> Error {
        match self.tile_error(number, error) {
            Error::Tile { path, columns, rows, what } => {
                let timesteps = self.tiling.chunk_timesteps(chunk);
                Error::Chunk { path, chunk, timesteps, columns, rows, what }
            }
            other => other,
        }
    }
}

fn reason(error: zarr::Error) -> String {
    match error {
        zarr::Error::Damaged { what } => what,
        other => other.to_string(),
    }
}

/// Whether the array is cut as a volume is.
fn understand(folder: &Path, array: &Array) -> Result<(Tiling, Pipeline), Error> {
    let wrong = |field: &'static str, expected: String, found: String| Error::Layout {
        path: folder.join("zarr.json"),
        field,
        expected,
        found,
    };
    let &[timesteps, rows, columns] = array.shape.as_slice() else {
        let found = format!("{:?}", array.shape);
        return Err(wrong("shape", "[timestep, row, column]".into(), found));
    };
    let tiling = Tiling::new([timesteps, rows, columns]);
    tiling.bounded().map_err(|wrong| wrong.at(folder.join(document::NAME)))?;
    if array.data_type != DataType::Float32 {
        return Err(wrong("data_type", "float32".into(), array.data_type.name().into()));
    }
    let chunk = [CHUNK_TIMESTEPS, TILE_EDGE, TILE_EDGE];
    let file = [tiling.chunks() * CHUNK_TIMESTEPS, TILE_EDGE, TILE_EDGE];
    if array.chunk_shape.as_deref() != Some(&chunk) || array.file_shape != file {
        let expected = format!("shards {file:?} of chunks {chunk:?}");
        let found = array.chunk_shape.as_ref().map_or_else(
            || format!("chunks {:?} without shards", array.file_shape),
            |chunk| format!("shards {:?} of chunks {chunk:?}", array.file_shape),
        );
        return Err(wrong("codecs", expected, found));
    }
    Ok((tiling, array.pipeline))
}

/// The ledger, one record for each tile in order; `None` where there is none.
fn read_ledger(array: &Path, tiling: &Tiling) -> Result<Option<Ledger<Facts>>, Error> {
    let (path, tiles) = (array.join(LEDGER), tiling.tiles.count());
    let damaged = |what: String| Error::Ledger { path: path.clone(), what };
    let Some(ledger) = Facts::ledger(&path, tiles)? else { return Ok(None) };
    let shape = tiling.shape();
    if ledger.facts.shape != shape {
        return Err(damaged(format!("expected shape {shape:?}, found {:?}", ledger.facts.shape)));
    }
    let found = ledger.records.len();
    let ordered = ledger.records.iter().enumerate().all(|(n, r)| r.tile as usize == n);
    if ledger.torn || found != tiles || !ordered {
        let what = format!("expected {tiles} records in order, found {found} that hold");
        return Err(damaged(what));
    }
    Ok(Some(ledger))
}
