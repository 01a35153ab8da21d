//! How a volume is cut, and what decides its bytes.
//!
//! A renderer writes a tile of 32 x 32 pixels with its whole year at a time, the analysis reads some
//! timesteps of all tiles. Chunks of 16 x 32 x 32 numbers serve both: 64 KiB, which zstd packs well and
//! a core unpacks in the second cache. All chunks of a tile lie in one file, so that there are some
//! thousand files and not a million.

use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glintmap_formats::zarr;
use glintmap_formats::zarr::chunk::Pipeline;
use glintmap_formats::zarr::ledger::{self, Ledger};
use glintmap_formats::zarr::metadata::{Array, DataType};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::axis::Axis;
use super::fault::{Error, Wrong};
use crate::base::Irradiance;
use crate::base::limits::{MAX_TIMESTEPS, MAX_VIEW_EDGE, MAX_VIEW_PIXELS, TILE_EDGE};
use crate::base::{Provenance, Tiles};

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
    pub(super) fn difference(&self, found: &Self) -> Option<Wrong> {
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
        .map(|(what, expected, found)| Wrong { what, expected, found })
    }

    /// The ledger at `path`, of at most `most` records; `None` where there is none.
    pub(super) fn ledger(path: &Path, most: usize) -> Result<Option<Ledger<Self>>, Error> {
        let file = match File::open(path) {
            Ok(file) => file,
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Ok(None);
            }
            Err(e) => return Err(Error::io(path)(e)),
        };
        let wrong = |e: zarr::Error| Error::Ledger { path: path.to_owned(), what: e.to_string() };
        ledger::read(&mut BufReader::new(file), most).map(Some).map_err(wrong)
    }

    pub(super) fn tiling(&self) -> Tiling {
        Tiling::new(self.shape)
    }

    /// The array's metadata.
    pub(super) fn array(&self, axis: &Axis) -> Array {
        let tiling = self.tiling();
        let coordinates: Vec<&str> = axis.arrays().iter().map(|c| c.name).collect();
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
    pub tiles: Tiles,
}

impl Tiling {
    /// That of a volume of `[timestep, row, column]`.
    pub(super) fn new([timesteps, rows, columns]: [usize; 3]) -> Self {
        Self { timesteps, tiles: Tiles { columns, rows, edge: TILE_EDGE } }
    }

    /// `[timestep, row, column]`
    pub(super) fn shape(&self) -> [usize; 3] {
        [self.timesteps, self.tiles.rows, self.tiles.columns]
    }

    /// Chunks in a shard.
    pub(super) fn chunks(&self) -> usize {
        self.timesteps.div_ceil(CHUNK_TIMESTEPS)
    }

    /// The timesteps of a chunk.
    pub(super) fn chunk_timesteps(&self, chunk: usize) -> Range<usize> {
        let first = chunk * CHUNK_TIMESTEPS;
        first..(first + CHUNK_TIMESTEPS).min(self.timesteps)
    }

    /// The shard of tile `number` below the folder of the array.
    pub(super) fn shard_path(&self, array: &Path, number: usize) -> PathBuf {
        let (row, column) = (number / self.tiles.across(), number % self.tiles.across());
        array.join("c").join("0").join(row.to_string()).join(column.to_string())
    }

    /// Holds the sizes against the program's limits; the error names the one that breaks them.
    pub(super) fn bounded(&self) -> Result<(), Wrong> {
        let [timesteps, rows, columns] = self.shape();
        for (what, found, most) in [
            ("timesteps", timesteps, MAX_TIMESTEPS),
            ("rows", rows, MAX_VIEW_EDGE),
            ("columns", columns, MAX_VIEW_EDGE),
            ("pixels", rows.saturating_mul(columns), MAX_VIEW_PIXELS),
        ] {
            if found == 0 || found > most {
                let expected = format!("1 to {most}");
                return Err(Wrong { what, expected, found: found.to_string() });
            }
        }
        Ok(())
    }
}
