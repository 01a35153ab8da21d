use std::fs::File;
use std::io::Read;
use std::path::Path;

use glintmap_formats::zarr::metadata::{Array, MAX_DOCUMENT_BYTES};
use glintmap_formats::{seal, zarr};
use serde_json::Value;

use super::Error;

/// The name of Zarr's metadata in the folder of a group or an array.
pub(super) const NAME: &str = "zarr.json";

/// Reads a `zarr.json` of at most [`MAX_DOCUMENT_BYTES`].
pub(super) fn read(path: &Path) -> Result<Value, Error> {
    let mut text = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    file.take(MAX_DOCUMENT_BYTES).read_to_end(&mut text).map_err(Error::io(path))?;
    serde_json::from_slice(&text)
        .map_err(|e| Error::zarr(path)(zarr::Error::Damaged { what: format!("no JSON: {e}") }))
}

/// The metadata of the array in `folder`.
pub(super) fn read_array(folder: &Path) -> Result<Array, Error> {
    let path = folder.join(NAME);
    Array::from_json(&read(&path)?).map_err(Error::zarr(&path))
}

/// Writes and seals a `zarr.json`.
pub(super) fn write(path: &Path, document: &Value) -> Result<(), Error> {
    seal::write_bytes(path, format!("{document:#}\n").as_bytes()).map_err(Error::io(path))
}
