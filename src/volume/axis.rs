//! What a volume knows of its timesteps, and how that lies in Zarr: one coordinate array for each
//! quantity, and attributes of the group, so that xarray shows days and hours beside the numbers.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use glintmap_formats::zarr::chunk::{Decoder, Encoder, Pipeline, encoded_bound};
use glintmap_formats::zarr::metadata::{Array, DataType};
use glintmap_formats::{npy, seal, zarr};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::fault::Wrong;
use super::{Error, document};
use crate::base::{SpectralBasis, Timeline};

/// Timesteps in one chunk of a coordinate array.
const CHUNK: usize = 1 << 16;

/// What a volume knows of its timesteps; all vectors have one item for each.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeAxis {
    /// Day of year, 0 is 1 January.
    pub day: Vec<u32>,
    /// Hour of day, local standard time, h.
    pub hour: Vec<f64>,
    /// Unit vector to the sun; x east, y north, z up.
    pub sun: Vec<DVec3>,
    /// Hours of the year that the timestep stands for, h.
    pub weight_h: Vec<f64>,
    /// Number of the segment.
    pub segment: Vec<u32>,
    /// Time between two timesteps of a day, h.
    pub step_h: f64,
    /// Half a year stands for the year.
    pub half_year: bool,
    /// The year that days of the year mean.
    pub year: i32,
    /// Diameter of the sun's disc, degrees.
    pub sun_diameter_deg: f64,
    /// What the watts are.
    pub basis: SpectralBasis,
}

impl From<&Timeline> for TimeAxis {
    fn from(timeline: &Timeline) -> Self {
        let steps = &timeline.steps;
        Self {
            day: steps.iter().map(|s| s.day).collect(),
            hour: steps.iter().map(|s| s.hour).collect(),
            sun: steps.iter().map(|s| s.sun).collect(),
            weight_h: steps.iter().map(|s| s.weight_h).collect(),
            segment: steps.iter().map(|s| s.segment).collect(),
            step_h: timeline.step_h,
            half_year: timeline.half_year,
            year: timeline.year,
            sun_diameter_deg: timeline.sun_diameter_deg,
            basis: timeline.basis,
        }
    }
}

/// The timesteps of each segment, from one number for each timestep: a segment starts wherever
/// the number changes.
pub fn segments_from_numbers<T: PartialEq>(numbers: &[T]) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for (i, number) in numbers.iter().enumerate() {
        match out.last_mut() {
            Some(last) if numbers[last.start] == *number => last.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
    out
}

/// The numbers of segments in an `.npy` file (one-dimensional, whole numbers of any type), one for
/// each of `timesteps`; [`segments_from_numbers`] says what they mean.
///
/// # Errors
/// A file that holds anything else, or another number of timesteps.
pub fn read_segments(path: &Path, timesteps: usize) -> Result<Vec<i64>, Error> {
    let numbers = npy::read_integers(path).map_err(Error::npy(path))?;
    if numbers.len() != timesteps {
        return Err(Error::Layout {
            path: path.to_owned(),
            field: "segment numbers",
            expected: format!("{timesteps}, one for each timestep of the volume"),
            found: numbers.len().to_string(),
        });
    }
    Ok(numbers)
}

/// A coordinate array of the timesteps, all of whose numbers are known.
pub(super) struct Coordinate {
    pub name: &'static str,
    pub array: Array,
    /// Its numbers, little endian.
    pub bytes: Vec<u8>,
}

/// What a volume in Zarr stores about its timesteps.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Axis {
    /// All.
    Full(TimeAxis),
    /// An import that knows the segments alone.
    Segments(Vec<u32>),
}

impl Axis {
    pub(super) fn len(&self) -> usize {
        self.segment().len()
    }

    pub(super) fn segment(&self) -> &[u32] {
        match self {
            Self::Full(axis) => &axis.segment,
            Self::Segments(segment) => segment,
        }
    }

    /// The coordinate arrays in the order in which they are stored.
    pub(super) fn arrays(&self) -> Vec<Coordinate> {
        let segment = self.segment();
        let n = segment.len();
        let whole = |name, units, about, numbers: &[u32]| {
            // Days and segments are bounded far below i32: segments by the number of timesteps.
            let bytes = |&n: &u32| i32::try_from(n).unwrap_or(i32::MAX).to_le_bytes();
            let bytes = numbers.iter().flat_map(bytes).collect();
            Coordinate { name, array: array(&[n], DataType::Int32, units, about), bytes }
        };
        let real = |name, shape: &[usize], units, about, numbers: &mut dyn Iterator<Item = f64>| {
            let bytes = numbers.flat_map(f64::to_le_bytes).collect();
            Coordinate { name, array: array(shape, DataType::Float64, units, about), bytes }
        };
        let mut out = Vec::new();
        if let Self::Full(axis) = self {
            let hour = &mut axis.hour.iter().copied();
            let sun = &mut axis.sun.iter().flat_map(|s| s.to_array());
            let weight_h = &mut axis.weight_h.iter().copied();
            out.extend([
                whole("day", "d", "day of year, 0 is 1 January", &axis.day),
                real("hour", &[n], "h", "hour of day, local standard time", hour),
                real("sun", &[n, 3], "1", "unit vector to the sun: east, north, up", sun),
                real("weight_h", &[n], "h", "hours of the year that it stands for", weight_h),
            ]);
        }
        let about = "number of the segment: an unbroken run of timesteps";
        out.push(whole("segment", "1", about, segment));
        out
    }

    /// What the group's attributes say about time.
    pub(super) fn attributes(&self) -> Map<String, Value> {
        let Self::Full(axis) = self else { return Map::new() };
        let pairs = [
            ("year", json!(axis.year)),
            ("step_h", json!(axis.step_h)),
            ("half_year", json!(axis.half_year)),
            ("sun_diameter_deg", json!(axis.sun_diameter_deg)),
            ("spectral_basis", json!(axis.basis)),
        ];
        pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// Hash of everything that is stored about time, hexadecimal.
    pub(super) fn fingerprint(&self) -> String {
        let mut hash = blake3::Hasher::new();
        for Coordinate { name, bytes, .. } in self.arrays() {
            hash.update(name.as_bytes()).update(&bytes);
        }
        hash.update(Value::Object(self.attributes()).to_string().as_bytes());
        hash.finalize().to_hex().to_string()
    }

    /// Writes the chunks of the coordinate arrays below the folder of the group.
    pub(super) fn write(&self, group: &Path) -> Result<(), Error> {
        let mut encoder = Encoder::new().map_err(Error::zarr(group))?;
        for Coordinate { name, array, bytes } in self.arrays() {
            let folder = group.join(name);
            let plain = file_bytes(&array);
            for (number, part) in bytes.chunks(plain).enumerate() {
                let path = chunk_path(&folder, &array, number);
                if let Some(parent) = path.parent() {
                    fs::create_dir_all(parent).map_err(Error::io(parent))?;
                }
                let mut padded = part.to_vec();
                padded.resize(plain, 0);
                let encoded = encoder.encode(&padded).map_err(Error::zarr(&path))?;
                seal::write_bytes(&path, encoded).map_err(Error::io(&path))?;
            }
        }
        Ok(())
    }

    /// Reads what a group stores about its `timesteps`; `None` where it has no such arrays.
    pub(super) fn read(
        group: &Path,
        attributes: &Map<String, Value>,
        timesteps: usize,
    ) -> Result<Option<Self>, Error> {
        if !group.join("segment").join(document::NAME).is_file() {
            return Ok(None);
        }
        let whole = |name| {
            let bytes = read_array(group, name, &[timesteps], DataType::Int32)?;
            let number = |bytes: &[u8; 4]| {
                let found = i32::from_le_bytes(*bytes);
                let expected = "numbers from 0 up".to_owned();
                u32::try_from(found).map_err(|_| {
                    Wrong { what: name, expected, found: found.to_string() }.at(group.join(name))
                })
            };
            bytes.as_chunks().0.iter().map(number).collect::<Result<Vec<u32>, Error>>()
        };
        let segment = whole("segment")?;
        if !group.join("day").join(document::NAME).is_file() {
            return Ok(Some(Self::Segments(segment)));
        }
        let real = |name, shape: &[usize]| {
            let bytes = read_array(group, name, shape, DataType::Float64)?;
            let numbers = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b));
            Ok::<Vec<f64>, Error>(numbers.collect())
        };
        let attribute = |field| Attribute { group, field, value: attributes.get(field) };
        let sun = real("sun", &[timesteps, 3])?;
        Ok(Some(Self::Full(TimeAxis {
            day: whole("day")?,
            hour: real("hour", &[timesteps])?,
            sun: sun.chunks_exact(3).map(DVec3::from_slice).collect(),
            weight_h: real("weight_h", &[timesteps])?,
            segment,
            step_h: attribute("step_h").read("a number")?,
            half_year: attribute("half_year").read("true or false")?,
            year: attribute("year").read("a whole number")?,
            sun_diameter_deg: attribute("sun_diameter_deg").read("a number")?,
            basis: attribute("spectral_basis").read("broadband or visible")?,
        })))
    }
}

/// An attribute of a group, which may not be there.
struct Attribute<'a> {
    group: &'a Path,
    field: &'static str,
    value: Option<&'a Value>,
}

impl Attribute<'_> {
    fn read<T: DeserializeOwned>(&self, expected: &str) -> Result<T, Error> {
        let known = self.value.and_then(|value| T::deserialize(value).ok());
        known.ok_or_else(|| {
            let found = self.value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
            Wrong { what: self.field, expected: expected.to_owned(), found }
                .at(self.group.join(document::NAME))
        })
    }
}

fn array(shape: &[usize], data_type: DataType, units: &str, long_name: &str) -> Array {
    let mut file_shape = shape.to_vec();
    file_shape[0] = file_shape[0].min(CHUNK);
    let names = ["timestep", "xyz"];
    Array {
        shape: shape.to_vec(),
        data_type,
        file_shape,
        chunk_shape: None,
        pipeline: Pipeline::OURS,
        dimension_names: names[..shape.len()].iter().map(|&n| n.to_owned()).collect(),
        attributes: Map::from_iter([
            ("units".to_owned(), json!(units)),
            ("long_name".to_owned(), json!(long_name)),
        ]),
    }
}

fn width(data_type: DataType) -> usize {
    match data_type {
        DataType::Float32 | DataType::Int32 => 4,
        DataType::Float64 => 8,
    }
}

fn file_bytes(array: &Array) -> usize {
    array.file_shape.iter().product::<usize>() * width(array.data_type)
}

fn chunk_path(folder: &Path, array: &Array, number: usize) -> PathBuf {
    let path = folder.join("c").join(number.to_string());
    if array.shape.len() > 1 { path.join("0") } else { path }
}

/// The bytes of a coordinate array: split along its first axis at most.
fn read_array(
    group: &Path,
    name: &'static str,
    shape: &[usize],
    data_type: DataType,
) -> Result<Vec<u8>, Error> {
    let folder = group.join(name);
    let array = document::read_array(&folder)?;
    let wrong = |expected: String, found: String| {
        Wrong { what: name, expected, found }.at(folder.join(document::NAME))
    };
    if array.shape != shape || array.data_type != data_type {
        return Err(wrong(
            format!("{} {}", data_type.name(), npy::shape_text(shape)),
            format!("{} {}", array.data_type.name(), npy::shape_text(&array.shape)),
        ));
    }
    let rest: usize = shape[1..].iter().product();
    let rows = array.file_shape[0];
    if array.chunk_shape.is_some() || array.file_shape[1..] != shape[1..] || rows > shape[0] {
        return Err(wrong(
            "chunks along the timesteps alone, none longer than the array".into(),
            npy::shape_text(&array.file_shape),
        ));
    }
    let mut decoder = Decoder::new().map_err(Error::zarr(&folder))?;
    let mut plain = vec![0u8; file_bytes(&array)];
    let length = shape[0] * rest * width(data_type);
    let mut out = Vec::with_capacity(length);
    for number in 0..shape[0].div_ceil(rows) {
        let path = chunk_path(&folder, &array, number);
        let claimed = fs::metadata(&path).map_err(Error::io(&path))?.len();
        let most = encoded_bound(plain.len()) as u64;
        if claimed > most {
            let what = format!("expected at most {most} bytes, found {claimed}");
            return Err(Error::zarr(&path)(zarr::Error::Damaged { what }));
        }
        let encoded = fs::read(&path).map_err(Error::io(&path))?;
        decoder.decode(array.pipeline, &encoded, &mut plain).map_err(Error::zarr(&path))?;
        out.extend_from_slice(&plain[..plain.len().min(length - out.len())]);
    }
    Ok(out)
}
