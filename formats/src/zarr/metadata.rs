//! `zarr.json` of arrays and groups.
//!
//! Of Zarr v3 (<https://zarr-specs.readthedocs.io/en/latest/v3/core/>) the part is read that volumes
//! need: regular grids, the codecs `bytes`, `zstd` and `crc32c`, shards. Whatever else a document says is refused
//! with the name of the field, never read as something that it isn't.

use serde_json::{Map, Value, json};

use super::Error;
use super::chunk::{Pipeline, ZSTD_LEVEL};

/// Bytes of a `zarr.json` that are read.
pub const MAX_DOCUMENT_BYTES: u64 = 16 << 20;

/// Types of numbers that we use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// `float32`
    Float32,
    /// `float64`
    Float64,
    /// `int32`
    Int32,
}

impl DataType {
    const ALL: [Self; 3] = [Self::Float32, Self::Float64, Self::Int32];

    /// Zarr's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Float32 => "float32",
            Self::Float64 => "float64",
            Self::Int32 => "int32",
        }
    }

    fn zero(self) -> Value {
        match self {
            Self::Int32 => json!(0),
            Self::Float32 | Self::Float64 => json!(0.0),
        }
    }
}

/// What an array's `zarr.json` says.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Type of the numbers.
    pub data_type: DataType,
    /// Shape of what lies in one file: the shard where the array is sharded.
    pub file_shape: Vec<usize>,
    /// Shape of the chunks in a shard, where the array is sharded.
    pub chunk_shape: Option<Vec<usize>>,
    /// Codecs of a chunk.
    pub pipeline: Pipeline,
    /// Names of the axes, or empty.
    pub dimension_names: Vec<String>,
    /// Attributes: units, names.
    pub attributes: Map<String, Value>,
}

impl Array {
    /// The document.
    pub fn to_json(&self) -> Value {
        let mut chunk_codecs =
            vec![json!({"name": "bytes", "configuration": {"endian": "little"}})];
        if self.pipeline.zstd {
            let configuration = json!({"level": ZSTD_LEVEL, "checksum": false});
            chunk_codecs.push(json!({"name": "zstd", "configuration": configuration}));
        }
        if self.pipeline.crc32c {
            chunk_codecs.push(json!({"name": "crc32c"}));
        }
        let codecs = match &self.chunk_shape {
            None => Value::Array(chunk_codecs),
            Some(shape) => json!([{"name": "sharding_indexed", "configuration": {
                "chunk_shape": shape,
                "codecs": chunk_codecs,
                "index_codecs": [
                    {"name": "bytes", "configuration": {"endian": "little"}},
                    {"name": "crc32c"},
                ],
                "index_location": "end",
            }}]),
        };
        json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": self.shape,
            "data_type": self.data_type.name(),
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": self.file_shape}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": self.data_type.zero(),
            "codecs": codecs,
            "attributes": self.attributes,
            "dimension_names": self.dimension_names,
            "storage_transformers": [],
        })
    }

    /// Reads a document.
    ///
    /// # Errors
    /// [`Error::Metadata`] where it isn't of the part of Zarr that we read.
    pub fn from_json(document: &Value) -> Result<Self, Error> {
        let root = Field { path: String::new(), value: Some(document) };
        root.at("zarr_format").is(&json!(3))?;
        root.at("node_type").is(&json!("array"))?;
        let shape = root.at("shape").lengths()?;
        let data_type = root.at("data_type");
        let data_type = DataType::ALL
            .into_iter()
            .find(|t| data_type.value == Some(&json!(t.name())))
            .ok_or_else(|| data_type.wrong("float32, float64 or int32"))?;
        root.at("chunk_grid").at("name").is(&json!("regular"))?;
        let file_shape = root.at("chunk_grid").at("configuration").at("chunk_shape").lengths()?;
        let keys = root.at("chunk_key_encoding");
        keys.at("name").is(&json!("default"))?;
        if keys.at("configuration").value.is_some() {
            keys.at("configuration").at("separator").is(&json!("/"))?;
        }
        let fill = root.at("fill_value");
        if fill.value.and_then(Value::as_f64) != Some(0.0) {
            return Err(fill.wrong("0"));
        }
        let transformers = root.at("storage_transformers");
        if transformers.value.and_then(Value::as_array).is_some_and(|list| !list.is_empty()) {
            return Err(transformers.wrong("none"));
        }
        let codecs = root.at("codecs");
        let first = codecs.item(0);
        let (chunk_shape, pipeline) = if first.at("name").value == Some(&json!("sharding_indexed"))
        {
            codecs.of_length(1)?;
            let sharding = first.at("configuration");
            if sharding.at("index_location").value.is_some() {
                sharding.at("index_location").is(&json!("end"))?;
            }
            let index = sharding.at("index_codecs");
            if index.pipeline()? != (Pipeline { zstd: false, crc32c: true }) {
                return Err(index.wrong("bytes, crc32c"));
            }
            let chunk_shape = sharding.at("chunk_shape").lengths()?;
            (Some(chunk_shape), sharding.at("codecs").pipeline()?)
        } else {
            (None, codecs.pipeline()?)
        };
        for (name, other) in [("chunk_grid", Some(&file_shape)), ("codecs", chunk_shape.as_ref())] {
            if other.is_some_and(|o| o.len() != shape.len() || o.contains(&0)) {
                return Err(root.at(name).wrong(&format!("{} lengths above 0", shape.len())));
            }
        }
        let names = root.at("dimension_names").value.and_then(Value::as_array);
        let name = |n: &Value| n.as_str().unwrap_or_default().to_owned();
        let dimension_names = names.map(|list| list.iter().map(name).collect()).unwrap_or_default();
        let attributes = root.at("attributes").value.and_then(Value::as_object);
        let attributes = attributes.cloned().unwrap_or_default();
        Ok(Self {
            shape,
            data_type,
            file_shape,
            chunk_shape,
            pipeline,
            dimension_names,
            attributes,
        })
    }
}

/// The document of a group that holds `arrays`, their metadata consolidated in it.
pub fn group(attributes: &Map<String, Value>, arrays: &[(&str, &Array)]) -> Value {
    let members: Map<String, Value> =
        arrays.iter().map(|(name, array)| ((*name).to_owned(), array.to_json())).collect();
    json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": {
            "kind": "inline",
            "must_understand": false,
            "metadata": members,
        },
    })
}

/// The attributes of a group's document.
///
/// # Errors
/// [`Error::Metadata`] where it isn't a group of Zarr v3.
pub fn group_attributes(document: &Value) -> Result<Map<String, Value>, Error> {
    let root = Field { path: String::new(), value: Some(document) };
    root.at("zarr_format").is(&json!(3))?;
    root.at("node_type").is(&json!("group"))?;
    let attributes = root.at("attributes").value.and_then(Value::as_object);
    Ok(attributes.cloned().unwrap_or_default())
}

/// A place in a document, which may not be there.
struct Field<'a> {
    path: String,
    value: Option<&'a Value>,
}

impl<'a> Field<'a> {
    fn at(&self, key: &str) -> Field<'a> {
        let dot = if self.path.is_empty() { "" } else { "." };
        let value = self.value.and_then(|v| v.get(key));
        Field { path: format!("{}{dot}{key}", self.path), value }
    }

    fn item(&self, number: usize) -> Field<'a> {
        let value = self.value.and_then(|v| v.get(number));
        Field { path: format!("{}[{number}]", self.path), value }
    }

    fn wrong(&self, expected: &str) -> Error {
        let found = self.value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
        let (field, expected) = (self.path.clone(), expected.to_owned());
        Error::Metadata { field, expected, found: found.chars().take(80).collect() }
    }

    fn is(&self, expected: &Value) -> Result<(), Error> {
        if self.value == Some(expected) { Ok(()) } else { Err(self.wrong(&expected.to_string())) }
    }

    fn of_length(&self, length: usize) -> Result<&'a [Value], Error> {
        let list = self.value.and_then(Value::as_array).filter(|list| list.len() == length);
        list.map(Vec::as_slice).ok_or_else(|| self.wrong(&format!("a list of {length}")))
    }

    fn lengths(&self) -> Result<Vec<usize>, Error> {
        let list = self.value.and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        let length = |v: &Value| v.as_u64().and_then(|n| usize::try_from(n).ok());
        let out: Option<Vec<usize>> = list.iter().map(length).collect();
        out.filter(|o| (1..=8).contains(&o.len())).ok_or_else(|| self.wrong("a list of lengths"))
    }

    fn pipeline(&self) -> Result<Pipeline, Error> {
        const WANTED: &str = "the codecs bytes (little), zstd (optional), crc32c (optional)";
        let mut out = Pipeline { zstd: false, crc32c: false };
        let list = self.value.and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        for (i, codec) in list.iter().enumerate() {
            match codec.get("name").and_then(Value::as_str) {
                Some("bytes") if i == 0 => {
                    self.item(0).at("configuration").at("endian").is(&json!("little"))?;
                }
                Some("zstd") if i == 1 => out.zstd = true,
                Some("crc32c") if i > 0 && !out.crc32c => out.crc32c = true,
                _ => return Err(self.item(i).wrong(WANTED)),
            }
        }
        if list.is_empty() { Err(self.wrong(WANTED)) } else { Ok(out) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> Array {
        Array {
            shape: vec![40, 50, 60],
            data_type: DataType::Float32,
            file_shape: vec![48, 32, 32],
            chunk_shape: Some(vec![16, 32, 32]),
            pipeline: Pipeline::OURS,
            dimension_names: ["timestep", "row", "column"].map(String::from).to_vec(),
            attributes: Map::from_iter([("units".to_owned(), json!("W m-2"))]),
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let array = series();
        assert_eq!(Array::from_json(&array.to_json()).expect("reads"), array);
        let plain = Array { chunk_shape: None, data_type: DataType::Int32, ..series() };
        assert_eq!(Array::from_json(&plain.to_json()).expect("reads"), plain);
    }

    #[test]
    fn whatever_we_do_not_read_is_refused_by_name() {
        for (pointer, value, named) in [
            ("/zarr_format", json!(2), "zarr_format"),
            ("/shape", json!([40, -1, 60]), "shape"),
            ("/shape", json!([40, 50]), "chunk_grid"),
            ("/shape", json!(7), "shape"),
            ("/data_type", json!("float16"), "data_type"),
            ("/fill_value", json!("NaN"), "fill_value"),
            ("/fill_value", json!(1.0), "fill_value"),
            ("/chunk_grid/configuration/chunk_shape", json!([0, 32, 32]), "chunk_grid"),
            ("/chunk_key_encoding/name", json!("v2"), "chunk_key_encoding.name"),
            ("/codecs/0/configuration/index_location", json!("start"), "index_location"),
            ("/codecs/0/configuration/codecs/1/name", json!("gzip"), "codecs[1]"),
            ("/codecs/0/configuration/index_codecs", json!([]), "index_codecs"),
            ("/codecs/0/configuration/codecs/0/configuration/endian", json!("big"), "endian"),
            ("/codecs", json!([]), "codecs"),
            ("/storage_transformers", json!([{"name": "x"}]), "storage_transformers"),
        ] {
            let mut document = series().to_json();
            *document.pointer_mut(pointer).expect("is there") = value;
            let error = Array::from_json(&document).expect_err(pointer).to_string();
            assert!(error.contains(named), "{pointer}: {error}");
        }
        assert!(Array::from_json(&json!([])).is_err());
    }
}
