use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use glintmap_formats::zarr;
use glintmap_formats::zarr::metadata::{Array, DataType, MAX_DOCUMENT_BYTES, Pipeline};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::{Error, axis::Axis};
use crate::base::Irradiance;
use crate::base::limits::{MAX_TIMESTEPS, MAX_VIEW_EDGE, MAX_VIEW_PIXELS, TILE_EDGE};
use crate::base::{Provenance, TileRect};

/// Timesteps in one chunk: the natural step of reading.
pub const CHUNK_TIMESTEPS: usize = 16;
/// Numbers in one chunk.
pub(super) const CHUNK_VALUES: usize = CHUNK_TIMESTEPS * TILE_EDGE * TILE_EDGE;
/// Bytes of one chunk before it is compressed.
pub(super) const CHUNK_BYTES: usize = CHUNK_VALUES * 4;
/// The array's name in its group.
pub(super) const ARRAY: &str = "irradiance";
/// The ledger of a finished volume, beside the array's `zarr.json`.
pub(super) const LEDGER: &str = "tiles";
/// The ledger while the volume is written.
pub(super) const GROWING: &str = "tiles.growing";

fn long_name(quantity: Irradiance) -> &'static str {
    match quantity {
        Irradiance::Surface => "irradiance on the surface, from the photovoltaic surfaces alone",
        Irradiance::FacingBeam => {
            "irradiance on a plane that faces the beam, from the photovoltaic surfaces alone"
        }
    }
}

/// What decides a volume's bytes, in the head of its ledger.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Facts {
    /// `[timestep, row, column]`
    pub shape: [usize; 3],
    pub quantity: Irradiance,
    /// Hash of everything that is stored about time, hexadecimal.
    pub timeline: String,
    pub provenance: Provenance,
}

impl Facts {
    pub(super) fn new(
        axis: &Axis,
        columns: usize,
        rows: usize,
        quantity: Irradiance,
        provenance: &Provenance,
    ) -> Self {
        Self {
            shape: [axis.len(), rows, columns],
            quantity,
            timeline: axis.fingerprint(),
            provenance: provenance.clone(),
        }
    }

    /// The first difference to what `found` says, with both sides of it.
    pub(super) fn difference(&self, found: &Self) -> Option<(&'static str, String, String)> {
        let shape = |f: &Self| format!("{:?}", f.shape);
        let (a, b) = (&self.provenance, &found.provenance);
        let inputs = |p: &Provenance| format!("{:?}", p.inputs);
        let about = |p: &Provenance| format!("{:?}", p.about);
        [
            ("shape", shape(self), shape(found)),
            ("quantity", self.quantity.name().into(), found.quantity.name().into()),
            ("timeline", self.timeline.clone(), found.timeline.clone()),
            ("program", a.program.clone(), b.program.clone()),
            ("hash of settings", a.settings.clone(), b.settings.clone()),
            ("seed", a.seed.to_string(), b.seed.to_string()),
            ("set of inputs", inputs(a), inputs(b)),
            ("description", about(a), about(b)),
        ]
        .into_iter()
        .find(|(_, expected, found)| expected != found)
    }

    pub(super) fn tiling(&self) -> Tiling {
        let [timesteps, rows, columns] = self.shape;
        Tiling { timesteps, rows, columns }
    }

    /// The array's metadata.
    pub(super) fn array(&self, axis: &Axis) -> Array {
        let tiling = self.tiling();
        let coordinates: Vec<&str> = axis.arrays().iter().map(|(name, ..)| *name).collect();
        Array {
            shape: self.shape.to_vec(),
            data_type: DataType::Float32,
            file_shape: vec![tiling.chunks() * CHUNK_TIMESTEPS, TILE_EDGE, TILE_EDGE],
            chunk_shape: Some(vec![CHUNK_TIMESTEPS, TILE_EDGE, TILE_EDGE]),
            pipeline: Pipeline::OURS,
            dimension_names: ["timestep", "row", "column"].map(String::from).to_vec(),
            attributes: Map::from_iter([
                ("units".to_owned(), json!("W m-2")),
                ("long_name".to_owned(), json!(long_name(self.quantity))),
                ("quantity".to_owned(), json!(self.quantity)),
                // By this xarray knows that the arrays of the timesteps are coordinates.
                ("coordinates".to_owned(), json!(coordinates.join(" "))),
            ]),
        }
    }

    /// The group's attributes.
    pub(super) fn attributes(&self, axis: &Axis) -> Map<String, Value> {
        let mut out = Map::from_iter([
            ("title".to_owned(), json!("Irradiance reflected by photovoltaic surfaces over time")),
            ("source".to_owned(), json!(self.provenance.program)),
            ("quantity".to_owned(), json!(self.quantity)),
        ]);
        out.extend(axis.attributes());
        out.insert("provenance".to_owned(), json!(self.provenance));
        out
    }
}

/// How a volume is cut into tiles and chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tiling {
    pub timesteps: usize,
    pub rows: usize,
    pub columns: usize,
}

impl Tiling {
    /// Chunks in a shard.
    pub(super) fn chunks(&self) -> usize {
        self.timesteps.div_ceil(CHUNK_TIMESTEPS)
    }

    /// The timesteps of a chunk, first and behind the last.
    pub(super) fn chunk_timesteps(&self, chunk: usize) -> (usize, usize) {
        let first = chunk * CHUNK_TIMESTEPS;
        (first, (first + CHUNK_TIMESTEPS).min(self.timesteps))
    }

    pub(super) fn across(&self) -> usize {
        self.columns.div_ceil(TILE_EDGE)
    }

    pub(super) fn down(&self) -> usize {
        self.rows.div_ceil(TILE_EDGE)
    }

    pub(super) fn tiles(&self) -> usize {
        self.across() * self.down()
    }

    /// The pixels of tile `number`.
    pub(super) fn rect(&self, number: usize) -> TileRect {
        let (row, column) =
            (number / self.across() * TILE_EDGE, number % self.across() * TILE_EDGE);
        TileRect {
            column,
            row,
            columns: TILE_EDGE.min(self.columns - column),
            rows: TILE_EDGE.min(self.rows - row),
        }
    }

    /// The number of a tile; `None` where it isn't one of this volume's.
    pub(super) fn number(&self, tile: TileRect) -> Option<usize> {
        let aligned = tile.column.is_multiple_of(TILE_EDGE) && tile.row.is_multiple_of(TILE_EDGE);
        let inside = tile.column < self.columns && tile.row < self.rows;
        let number = tile.row / TILE_EDGE * self.across() + tile.column / TILE_EDGE;
        (aligned && inside && self.rect(number) == tile).then_some(number)
    }

    /// The shard of tile `number` below the folder of the array.
    pub(super) fn shard_path(&self, array: &Path, number: usize) -> PathBuf {
        let (row, column) = (number / self.across(), number % self.across());
        array.join("c").join("0").join(row.to_string()).join(column.to_string())
    }

    /// Holds the sizes against the program's limits; the error names the one that breaks them.
    pub(super) fn bounded(&self) -> Result<(), (&'static str, String, String)> {
        for (what, found, most) in [
            ("timesteps", self.timesteps, MAX_TIMESTEPS),
            ("rows", self.rows, MAX_VIEW_EDGE),
            ("columns", self.columns, MAX_VIEW_EDGE),
            ("pixels", self.rows.saturating_mul(self.columns), MAX_VIEW_PIXELS),
        ] {
            if found == 0 || found > most {
                return Err((what, format!("1 to {most}"), found.to_string()));
            }
        }
        Ok(())
    }
}

/// Reads a `zarr.json` of at most [`MAX_DOCUMENT_BYTES`].
pub(super) fn read_document(path: &Path) -> Result<Value, Error> {
    let mut text = Vec::new();
    let file = File::open(path).map_err(Error::io(path))?;
    file.take(MAX_DOCUMENT_BYTES).read_to_end(&mut text).map_err(Error::io(path))?;
    serde_json::from_slice(&text)
        .map_err(|e| Error::zarr(path)(zarr::Error::Damaged { what: format!("no JSON: {e}") }))
}

/// The metadata of the array in `folder`.
pub(super) fn read_array_metadata(folder: &Path) -> Result<Array, Error> {
    let path = folder.join("zarr.json");
    Array::from_json(&read_document(&path)?).map_err(Error::zarr(&path))
}
