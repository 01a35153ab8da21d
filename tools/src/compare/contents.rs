//! Files as what they hold: named lists of numbers, with the header apart.

use std::path::Path;

use anyhow::{Context, Result};
use glintmap::pages::{Access, OpenOptions, Store};
use glintmap::picture::files;
use glintmap_formats::{hits, npy};

use super::values::Difference;

/// A file of numbers.
pub struct Numbers {
    /// What it says of its making: names and values.
    pub header: Vec<(String, String)>,
    /// What the numbers are given for: pixels, photons, values.
    pub unit: &'static str,
    /// Extent of each dimension, the last one varying fastest.
    pub shape: Vec<usize>,
    /// Names and numbers.
    pub channels: Vec<(String, Vec<f64>)>,
}

impl Numbers {
    /// Reads a file of numbers; `None` for other kinds of files.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let numbers = match ending {
            "exr" | "hdr" | "png" | "tif" => picture(path),
            "npy" => array(path),
            "gmh" => hit_map(path),
            "gmp" => photons(path),
            _ => return Ok(None),
        };
        numbers.map(Some).with_context(|| path.display().to_string())
    }

    /// What differs in the numbers of two files.
    pub fn differences(&self, new: &Self) -> Vec<String> {
        if self.shape != new.shape {
            return vec![format!("its shape: {:?} -> {:?}", self.shape, new.shape)];
        }
        let of = |all: &'_ Self, name: &str| all.channels.iter().position(|(n, _)| n == name);
        let mut out = Vec::new();
        for (name, old) in &self.channels {
            let Some(at) = of(new, name) else {
                out.push(format!("channel {name} is gone"));
                continue;
            };
            let new = new.channels[at].1.iter().copied();
            let difference = Difference::of(old.iter().copied(), new);
            let said = difference.words(self.unit, |i| place(&self.shape, i));
            out.extend(said.map(|said| format!("{name}: {said}")));
        }
        let added = new.channels.iter().filter(|(name, _)| of(self, name).is_none());
        out.extend(added.map(|(name, _)| format!("channel {name} is new")));
        out
    }
}

/// Where a number lies, for people.
pub fn place(shape: &[usize], number: usize) -> String {
    let mut left = number;
    let mut at: Vec<usize> = shape
        .iter()
        .rev()
        .map(|&extent| {
            let here = left % extent.max(1);
            left /= extent.max(1);
            here
        })
        .collect();
    at.reverse();
    match at[..] {
        [row, column] => format!("row {row}, column {column}"),
        [step, row, column] => format!("timestep {step}, row {row}, column {column}"),
        _ => format!("number {number}"),
    }
}

fn picture(path: &Path) -> Result<Numbers> {
    let read = files::read(path)?;
    let wide = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect();
    let channels: Vec<_> =
        read.list().iter().map(|(name, grid)| (name.clone(), wide(grid.data()))).collect();
    let shape = vec![read.rows(), read.columns()];
    Ok(Numbers { header: read.attributes.clone(), unit: "pixels", shape, channels })
}

fn array(path: &Path) -> Result<Numbers> {
    let (shape, values) = match npy::Reader::<f32>::open(path) {
        Ok(reader) => {
            let values = reader.read_all()?.into_iter().map(f64::from).collect();
            (reader.shape().to_vec(), values)
        }
        Err(_) => {
            let reader = npy::Reader::<i32>::open(path)?;
            let values = reader.read_all()?.into_iter().map(f64::from).collect();
            (reader.shape().to_vec(), values)
        }
    };
    let channels = vec![("values".to_owned(), values)];
    Ok(Numbers { header: Vec::new(), unit: "values", shape, channels })
}

fn hit_map(path: &Path) -> Result<Numbers> {
    const FIELDS: [&str; 10] =
        ["x", "y", "z", "nx", "ny", "nz", "object", "face", "pv_distance_m", "kind"];
    let mut channels: Vec<_> = FIELDS.map(|name| (name.to_owned(), Vec::new())).into();
    let mut shape = Vec::new();
    let facts = hits::read(
        path,
        |facts| shape = vec![facts.rows, facts.columns],
        |record| {
            let [x, y, z] = record.position_m.map(f64::from);
            let [u, v, w] = record.normal.map(f64::from);
            let [object, face] = [record.object, record.face].map(f64::from);
            let last = [f64::from(record.pv_distance_m), f64::from(record.kind)];
            let all = [x, y, z, u, v, w, object, face, last[0], last[1]];
            channels.iter_mut().zip(all).for_each(|((_, list), value)| list.push(value));
        },
    )?;
    let header = vec![("header".to_owned(), serde_json::to_string(&facts)?)];
    Ok(Numbers { header, unit: "pixels", shape, channels })
}

fn photons(path: &Path) -> Result<Numbers> {
    const FIELDS: [&str; 12] =
        ["x", "y", "z", "nx", "ny", "nz", "dx", "dy", "dz", "flux_w", "timestep", "surface"];
    let store = Store::open(path, &OpenOptions { cache_bytes: 64 << 20, access: Access::Mapped })?;
    let mut channels: Vec<_> = FIELDS.map(|name| (name.to_owned(), Vec::new())).into();
    store.scan(|_, photon| {
        let vectors = [photon.position, photon.normal, photon.direction];
        let vectors = vectors.into_iter().flat_map(|v| v.to_array().map(f64::from));
        let last =
            [f64::from(photon.flux_w), f64::from(photon.timestep), f64::from(photon.surface)];
        channels.iter_mut().zip(vectors.chain(last)).for_each(|((_, list), v)| list.push(v));
    })?;
    let info = store.info();
    let header = vec![("header".to_owned(), format!("{info:?}"))];
    Ok(Numbers { header, unit: "photons", shape: vec![channels[0].1.len()], channels })
}
