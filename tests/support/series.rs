//! A made-up time series and its slow twin: the same numbers in a dense array.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use glintmap::base::Irradiance;
use glintmap::base::{
    Provenance, Purpose, SeriesEntry, SpectralBasis, Stream, TileRect, TileSink, Timeline,
    Timestep, limits::TILE_EDGE, tiles,
};
use glintmap::volume::Writer;

/// All numbers of a volume in memory, `[timestep, row, column]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    pub timesteps: usize,
    pub rows: usize,
    pub columns: usize,
    pub numbers: Vec<f32>,
}

impl Dense {
    /// Numbers of which about `lit` (0 to 1) are not 0. Whole tiles stay dark, and whole chunks.
    pub fn random(shape: [usize; 3], lit: f64, seed: u64) -> Self {
        let [timesteps, rows, columns] = shape;
        let mut numbers = vec![0.0; timesteps * rows * columns];
        let blocks = columns.div_ceil(TILE_EDGE);
        for (i, value) in numbers.iter_mut().enumerate() {
            let (t, row, column) = (i / columns / rows, i / columns % rows, i % columns);
            let tile = row / TILE_EDGE * blocks + column / TILE_EDGE;
            let dark_tile = tile % 5 == 3;
            let dark_chunk = (t / 16 + tile) % 3 == 1 && timesteps > 16;
            let mut random = Stream::new(seed, Purpose::Survey, i as u64);
            if !dark_tile && !dark_chunk && random.uniform() < lit {
                *value = (random.uniform() * 1000.0) as f32;
            }
        }
        Self { timesteps, rows, columns, numbers }
    }

    pub fn at(&self, timestep: usize, row: usize, column: usize) -> f32 {
        self.numbers[(timestep * self.rows + row) * self.columns + column]
    }

    pub fn nonzero(&self) -> u64 {
        self.numbers.iter().filter(|v| **v != 0.0).count() as u64
    }

    pub fn tiles(&self) -> Vec<TileRect> {
        tiles(self.columns, self.rows, TILE_EDGE)
    }

    /// What a renderer would deliver for a tile.
    pub fn entries(&self, tile: TileRect) -> Vec<SeriesEntry> {
        let mut out = Vec::new();
        for timestep in 0..self.timesteps {
            for pixel in 0..tile.pixels() {
                let (row, column) = (pixel / tile.columns, pixel % tile.columns);
                let irradiance_w_m2 = self.at(timestep, tile.row + row, tile.column + column);
                if irradiance_w_m2 != 0.0 {
                    out.push(SeriesEntry {
                        timestep: timestep as u32,
                        pixel: pixel as u16,
                        irradiance_w_m2,
                    });
                }
            }
        }
        out
    }

    /// The numbers alone, little-endian, for numpy.fromfile.
    pub fn write_raw(&self, path: &Path) {
        let bytes: Vec<u8> = self.numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(path, bytes).expect("writes");
    }

    pub fn writer(&self, path: &Path) -> Writer {
        self.try_writer(path, &provenance()).expect("begins")
    }

    pub fn try_writer(
        &self,
        path: &Path,
        provenance: &Provenance,
    ) -> Result<Writer, glintmap::volume::Error> {
        let timeline = timeline(self.timesteps);
        let (columns, rows) = (self.columns, self.rows);
        Writer::create_or_resume(path, &timeline, columns, rows, Irradiance::Surface, provenance)
    }

    /// The whole volume, in one go.
    pub fn write(&self, path: &Path) -> glintmap::volume::Summary {
        self.write_at(path, &timeline(self.timesteps))
    }

    /// The same at other times.
    pub fn write_at(&self, path: &Path, timeline: &Timeline) -> glintmap::volume::Summary {
        let (columns, rows, provenance) = (self.columns, self.rows, provenance());
        let writer = Writer::create_or_resume(
            path,
            timeline,
            columns,
            rows,
            Irradiance::Surface,
            &provenance,
        )
        .expect("begins");
        for tile in self.tiles() {
            writer.put(tile, &self.entries(tile)).expect("writes");
        }
        writer.finish().expect("finishes")
    }
}

pub fn provenance() -> Provenance {
    Provenance {
        program: Provenance::PROGRAM.to_owned(),
        settings: "00c0ffee".to_owned(),
        seed: u64::MAX,
        inputs: BTreeMap::from([("scene.rad".to_owned(), "beef".to_owned())]),
        about: BTreeMap::from([("view".to_owned(), "plan".to_owned())]),
    }
}

/// Timesteps of a quarter of an hour, five to a day.
pub fn timeline(timesteps: usize) -> Timeline {
    let steps = (0..timesteps)
        .map(|i| {
            let (day, hour) = (i / 5, 10.0 + (i % 5) as f64 * 0.25);
            Timestep {
                day: day as u32,
                hour,
                sun: DVec3::new((i as f64).sin(), (i as f64).cos(), 1.0).normalize(),
                irradiance_w_m2: 800.0,
                weight_h: 0.25 + i as f64 / 1024.0,
                segment: day as u32,
            }
        })
        .collect();
    Timeline {
        steps,
        step_h: 0.25,
        year: 2025,
        half_year: false,
        sun_diameter_deg: 0.533,
        basis: SpectralBasis::Broadband,
    }
}

/// Name and bytes of each file below a folder.
pub fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut out = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("is a folder") {
            let path = entry.expect("reads").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("lies below").to_owned();
                out.insert(name, std::fs::read(&path).expect("reads"));
            }
        }
    }
    out
}

/// Runs a Python script in which every warning is an error; its arguments are paths.
pub fn run_python(python: &Path, script: &str, arguments: &[&Path]) -> String {
    let output = Command::new(python)
        .args(["-W", "error", "-c", script])
        .args(arguments)
        .output()
        .expect("Python starts");
    let (out, err) = (String::from_utf8_lossy(&output.stdout), &output.stderr);
    assert!(output.status.success(), "{out}{}", String::from_utf8_lossy(err));
    out.into_owned()
}
