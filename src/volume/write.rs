//! A volume written tile by tile, so that a killed run loses no tile that was finished.
//!
//! A tile is sealed as one shard, then noted in the growing ledger: 32 bytes with the shard's length
//! and the checksum of its index. Whoever goes on reads the ledger and believes a record only if its shard
//! is there as it says. Zarr's metadata come last of all: without them the folder is no Zarr group, and
//! nobody takes half a year for a whole one.

use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glintmap_formats::zarr::chunk::Encoder;
use glintmap_formats::zarr::ledger::{self, Ledger, Record};
use glintmap_formats::zarr::{metadata, shard};
use glintmap_formats::{header, seal, zarr};
use serde_json::Value;

use super::Error;
use super::axis::{Axis, TimeAxis};
use super::document;
use super::fault::Wrong;
use super::layout::{ARRAY, CHUNK_BYTES, CHUNK_TIMESTEPS, Facts, GROWING, LEDGER, Tiling};
use crate::base::Irradiance;
use crate::base::limits::TILE_EDGE;
use crate::base::{Provenance, SeriesEntry, SinkError, TileRect, TileSink, Timeline, checked_tile};

/// Writes a volume tile by tile, from many threads, in any order; the bytes don't depend on it.
/// A tile that was put stays when the program is killed: the next writer of the same volume goes
/// on from there. Until [`Self::finish`] the folder is no Zarr group, so that nobody takes half a
/// year for a whole one.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    array: PathBuf,
    axis: Axis,
    facts: Facts,
    tiling: Tiling,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// The tiles that are done, by number.
    records: Vec<Option<Record>>,
    /// The growing ledger, locked as long as this writer lives.
    journal: File,
}

/// What a finished volume holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Bytes of all shards.
    pub bytes: u64,
    /// Irradiances that are not 0.
    pub nonzero: u64,
    /// Tiles of the view.
    pub tiles: usize,
    /// Tiles where nothing but 0 is.
    pub empty_tiles: usize,
    /// Chunks of the view and year.
    pub chunks: u64,
    /// Chunks where anything but 0 is.
    pub lit_chunks: u64,
    /// Bytes that the same numbers would take uncompressed and dense.
    pub dense_bytes: u64,
}

impl Summary {
    pub(super) fn new<'a>(tiling: &Tiling, records: impl Iterator<Item = &'a Record>) -> Self {
        let voxels: u64 = tiling.shape().iter().map(|&n| n as u64).product();
        let mut out = Self {
            bytes: 0,
            nonzero: 0,
            tiles: tiling.tiles.count(),
            empty_tiles: 0,
            chunks: tiling.tiles.count() as u64 * tiling.chunks() as u64,
            lit_chunks: 0,
            dense_bytes: voxels * 4,
        };
        for record in records {
            out.bytes += record.bytes;
            out.nonzero += record.nonzero;
            out.lit_chunks += u64::from(record.chunks);
            out.empty_tiles += usize::from(record.bytes == 0);
        }
        out
    }
}

impl Writer {
    /// Begins a volume at `path`, or goes on with one that was begun from the same facts.
    ///
    /// # Errors
    /// [`Error::Different`] where the volume there was made from something else (nothing is
    /// removed), [`Error::Occupied`], [`Error::Busy`], sizes beyond the limits, the file system's.
    pub fn create_or_resume(
        path: &Path,
        timeline: &Timeline,
        columns: usize,
        rows: usize,
        quantity: Irradiance,
        provenance: &Provenance,
    ) -> Result<Self, Error> {
        let axis = Axis::Full(TimeAxis::from(timeline));
        Self::open(path, axis, columns, rows, quantity, provenance)
    }

    pub(super) fn open(
        path: &Path,
        axis: Axis,
        columns: usize,
        rows: usize,
        quantity: Irradiance,
        provenance: &Provenance,
    ) -> Result<Self, Error> {
        Tiling::new([axis.len(), rows, columns]).bounded()?;
        let facts = Facts::new(&axis, columns, rows, quantity, provenance);
        let tiling = facts.tiling();
        let array = path.join(ARRAY);
        let sealed = load(&array.join(LEDGER), &facts, path)?;
        let growing = array.join(GROWING);
        if sealed.is_none() && !growing.exists() && !is_fresh(path, &array)? {
            return Err(Error::Occupied { path: path.to_owned() });
        }
        fs::create_dir_all(&array).map_err(Error::io(&array))?;
        let (journal, appended) = open_journal(path, &array, &facts, sealed.is_some())?;
        let mut records = vec![None; tiling.tiles.count()];
        for record in sealed.map(|l| l.records).into_iter().flatten().chain(appended) {
            let known = usize::try_from(record.tile).ok().and_then(|n| records.get_mut(n));
            if let Some(known) = known.filter(|_| is_there(&array, &tiling, &record)) {
                *known = Some(record);
            }
        }
        axis.write(path)?;
        for row in 0..tiling.tiles.down() {
            let folder = array.join("c").join("0").join(row.to_string());
            fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
        }
        let state = Mutex::new(State { records, journal });
        Ok(Self { path: path.to_owned(), array, axis, facts, tiling, state })
    }

    /// Tiles that are already there.
    pub fn done(&self) -> usize {
        self.state().records.iter().flatten().count()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A record is set and written in one go: after a panic elsewhere the state is still whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn tiling(&self) -> Tiling {
        self.tiling
    }

    /// A shard for tile `number`, to be filled chunk by chunk and handed back to [`Self::keep`].
    pub(super) fn shard(&self, number: usize) -> GrowingShard {
        let path = self.tiling.shard_path(&self.array, number);
        GrowingShard { path, number, chunks: self.tiling.chunks(), next: 0, lit: 0, out: None }
    }

    /// Seals a shard and notes that its tile is done.
    pub(super) fn keep(&self, shard: GrowingShard, nonzero: u64) -> Result<(), Error> {
        let record = shard.seal(nonzero)?;
        let mut state = self.state();
        // After the shard, so that a record never speaks of what isn't there.
        let path = self.array.join(GROWING);
        state.journal.write_all(&record.to_bytes()).map_err(Error::io(&path))?;
        if let Some(known) = state.records.get_mut(record.tile as usize) {
            *known = Some(record);
        }
        Ok(())
    }

    fn write_tile(&self, number: usize, entries: &[SeriesEntry]) -> Result<(), Error> {
        let tile = self.tiling.tiles.rect(number);
        let mut shard = self.shard(number);
        let mut encoder = Encoder::new().map_err(Error::zarr(&shard.path))?;
        let mut plain = vec![0u8; CHUNK_BYTES];
        let mut nonzero = 0;
        let chunk_of = |e: &SeriesEntry| e.timestep as usize / CHUNK_TIMESTEPS;
        for part in entries.chunk_by(|a, b| chunk_of(a) == chunk_of(b)) {
            plain.fill(0);
            let mut lit = 0;
            // A zero that was delivered all the same is left out like all others.
            for entry in part.iter().filter(|e| e.irradiance_w_m2 != 0.0) {
                let (row, column) =
                    (entry.pixel as usize / tile.columns, entry.pixel as usize % tile.columns);
                let slice = entry.timestep as usize % CHUNK_TIMESTEPS;
                let at = ((slice * TILE_EDGE + row) * TILE_EDGE + column) * 4;
                plain[at..at + 4].copy_from_slice(&entry.irradiance_w_m2.to_le_bytes());
                lit += 1;
            }
            if lit > 0 {
                shard.push(part.first().map_or(0, chunk_of), &plain, &mut encoder)?;
                nonzero += lit;
            }
        }
        self.keep(shard, nonzero)
    }

    /// Seals the volume: from here on it is a Zarr group that others open.
    ///
    /// # Errors
    /// [`Error::MissingTiles`]; what the file system says.
    pub fn finish(self) -> Result<Summary, Error> {
        let records: Vec<Record> = self.state().records.iter().flatten().copied().collect();
        let tiles = self.tiling.tiles.count();
        if records.len() != tiles {
            let missing = tiles - records.len();
            return Err(Error::MissingTiles { path: self.path.clone(), missing, tiles });
        }
        let array = self.facts.array(&self.axis);
        let coordinates = self.axis.arrays();
        let mut members: Vec<(&str, &metadata::Array)> =
            coordinates.iter().map(|c| (c.name, &c.array)).collect();
        members.push((ARRAY, &array));
        for (name, array) in &members {
            document::write(&self.path.join(name).join(document::NAME), &array.to_json())?;
        }
        let ledger = self.array.join(LEDGER);
        seal::write(&ledger, |out| ledger::write(out, &self.facts, &records))
            .map_err(Error::io(&ledger))?;
        let attributes = self.facts.attributes(&self.axis);
        let group = metadata::group(&attributes, &members);
        document::write(&self.path.join(document::NAME), &group)?;
        let growing = self.array.join(GROWING);
        fs::remove_file(&growing).map_err(Error::io(&growing))?;
        Ok(Summary::new(&self.tiling, records.iter()))
    }
}

impl TileSink for Writer {
    fn has(&self, tile: TileRect) -> bool {
        self.tiling.tiles.number(tile).is_some_and(|n| self.state().records[n].is_some())
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        let number = checked_tile(&self.tiling.tiles, &(0..self.tiling.timesteps), tile, entries)?;
        self.write_tile(number, entries).map_err(|error| match error {
            Error::Io { path, source } | Error::Zarr { path, source: zarr::Error::Io(source) } => {
                let what = format!("{}: {source}", path.display());
                SinkError::Io(io::Error::new(source.kind(), what))
            }
            Error::Interrupted(stop) => SinkError::Interrupted(stop),
            other => SinkError::Io(io::Error::other(other)),
        })
    }
}

/// A shard that is being written. Its file begins with the first chunk that isn't all 0; without
/// one there is none.
pub(super) struct GrowingShard {
    path: PathBuf,
    number: usize,
    chunks: usize,
    next: usize,
    lit: u32,
    out: Option<shard::Writer<BufWriter<File>>>,
}

impl GrowingShard {
    /// Appends chunk `number`, of [`CHUNK_BYTES`]; those before it that were not pushed are 0.
    pub(super) fn push(
        &mut self,
        number: usize,
        plain: &[u8],
        encoder: &mut Encoder,
    ) -> Result<(), Error> {
        let out = match &mut self.out {
            Some(out) => out,
            none => {
                let tmp = seal::growing(&self.path);
                let file = File::create(&tmp).map_err(Error::io(&tmp))?;
                none.insert(shard::Writer::new(BufWriter::with_capacity(1 << 16, file)))
            }
        };
        out.skip(number - self.next);
        let encoded = encoder.encode(plain).map_err(Error::zarr(&self.path))?;
        out.push(encoded).map_err(Error::zarr(&self.path))?;
        self.next = number + 1;
        self.lit += 1;
        Ok(())
    }

    fn seal(mut self, nonzero: u64) -> Result<Record, Error> {
        // There are at most 2048 x 2048 tiles.
        let tile = u32::try_from(self.number).unwrap_or(u32::MAX);
        let Some(mut out) = self.out.take() else {
            for stale in [self.path.clone(), seal::growing(&self.path)] {
                match fs::remove_file(&stale) {
                    Err(e) if e.kind() != io::ErrorKind::NotFound => {
                        return Err(Error::io(&stale)(e));
                    }
                    _ => {}
                }
            }
            return Ok(Record { tile, ..Record::default() });
        };
        out.skip(self.chunks - self.next);
        let tmp = seal::growing(&self.path);
        let sealed = out.finish().and_then(|(mut file, written)| {
            file.flush()?;
            seal::seal(file.get_ref(), &tmp, &self.path)?;
            Ok(written)
        });
        let shard::Written { bytes, index_crc } = sealed.map_err(|error| {
            let _ = fs::remove_file(&tmp);
            Error::zarr(&self.path)(error)
        })?;
        Ok(Record { tile, index_crc, bytes, nonzero, chunks: self.lit })
    }
}

impl Drop for GrowingShard {
    fn drop(&mut self) {
        if self.out.take().is_some() {
            // Given up after an error: what was written so far is of no use.
            let _ = fs::remove_file(seal::growing(&self.path));
        }
    }
}

/// Whether nothing of value lies at `path`: nothing at all, or what a writer leaves that was
/// killed before it had begun.
fn is_fresh(path: &Path, array: &Path) -> Result<bool, Error> {
    let names = |folder: &Path| match fs::read_dir(folder) {
        Ok(entries) => entries
            .map(|entry| entry.map(|e| e.file_name()))
            .collect::<io::Result<Vec<_>>>()
            .map_err(Error::io(folder)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(Error::io(folder)(e)),
    };
    if path.exists() && !path.is_dir() {
        return Ok(false);
    }
    let within = names(path)?;
    Ok(within.is_empty() || (within.len() == 1 && within[0] == ARRAY && names(array)?.is_empty()))
}

/// Whether the shard that a record speaks of is there as it says.
fn is_there(array: &Path, tiling: &Tiling, record: &Record) -> bool {
    let path = tiling.shard_path(array, record.tile as usize);
    match fs::metadata(&path) {
        Ok(found) => found.len() == record.bytes && record.bytes > 0,
        Err(e) => e.kind() == io::ErrorKind::NotFound && record.bytes == 0,
    }
}

/// The ledger at `path`, finished or growing, if it was made from `facts`; `None` where there is none.
fn load(path: &Path, facts: &Facts, volume: &Path) -> Result<Option<Ledger<Facts>>, Error> {
    // A tile may be put several times; a journal that is far longer than that isn't ours.
    let most = facts.tiling().tiles.count().saturating_mul(8).saturating_add(1 << 16);
    let ledger = Facts::ledger(path, most)?;
    match ledger.as_ref().and_then(|ledger| facts.difference(&ledger.facts)) {
        Some(Wrong { what, expected, found }) => {
            Err(Error::Different { path: volume.to_owned(), what, expected, found })
        }
        None => Ok(ledger),
    }
}

/// Opens and locks the growing ledger, its file position behind the last good record.
fn open_journal(
    volume: &Path,
    array: &Path,
    facts: &Facts,
    has_sealed: bool,
) -> Result<(File, Vec<Record>), Error> {
    let path = array.join(GROWING);
    let io = Error::io(&path);
    let mut file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .map_err(&io)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(Error::Busy { path: volume.to_owned() }),
        Err(TryLockError::Error(e)) => return Err(io(e)),
    }
    // A header that was cut off is no loss as long as no shard can have followed it.
    let nothing_followed = has_sealed || !array.join("c").exists();
    let whole = header::read::<Value>(&mut file, ledger::NAME, ledger::VERSION).is_ok();
    file.seek(SeekFrom::Start(0)).map_err(&io)?;
    let records = if !whole && nothing_followed {
        file.set_len(0).map_err(&io)?;
        ledger::write_header(&mut file, facts).map_err(&io)?;
        file.sync_all().map_err(&io)?;
        Vec::new()
    } else {
        let lost = || io(io::ErrorKind::NotFound.into());
        let ledger = load(&path, facts, volume)?.ok_or_else(lost)?;
        file.set_len(ledger.good_bytes).map_err(&io)?;
        ledger.records
    };
    file.seek(SeekFrom::End(0)).map_err(&io)?;
    Ok((file, records))
}
