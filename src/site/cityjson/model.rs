//! CityJSON as serde sees it: only what is read, everything else skipped without being kept.
//!
//! Files of a city have hundreds of megabytes, mostly attributes and coordinates. Boundaries are
//! kept flat where they can be, objects in the order of the file (a map would lose it, and with it
//! the numbers of faces), and values of a wrong type become faults with a name instead of ending
//! the parse.

use std::collections::HashMap;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

/// A CityJSON document, the first line of a CityJSONSeq file, or one of its features.
#[derive(Deserialize)]
pub(super) struct Document {
    #[serde(rename = "type", default)]
    pub kind: String,
    #[serde(default)]
    pub version: Option<Loose>,
    #[serde(default)]
    pub transform: Option<Transform>,
    #[serde(default)]
    pub metadata: Option<Metadata>,
    #[serde(rename = "CityObjects", default)]
    pub objects: Option<Ordered<CityObject>>,
    #[serde(default)]
    pub vertices: Option<Vec<[f64; 3]>>,
    #[serde(rename = "geometry-templates", default)]
    pub templates: Option<Templates>,
}

#[derive(Clone, Copy, Deserialize)]
pub(super) struct Transform {
    pub scale: [f64; 3],
    pub translate: [f64; 3],
}

#[derive(Deserialize)]
pub(super) struct Metadata {
    #[serde(rename = "referenceSystem", default)]
    pub crs: Option<Loose>,
}

#[derive(Deserialize, Default)]
pub(super) struct Templates {
    #[serde(default)]
    pub templates: Vec<Geometry>,
    #[serde(rename = "vertices-templates", default)]
    pub vertices: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
pub(super) struct CityObject {
    #[serde(rename = "type", default)]
    pub kind: String,
    #[serde(default)]
    pub geometry: Option<Vec<Geometry>>,
    #[serde(default)]
    pub children: Option<Vec<String>>,
    #[serde(default)]
    pub parents: Option<Vec<String>>,
}

#[derive(Deserialize)]
pub(super) struct Geometry {
    #[serde(rename = "type", default)]
    pub kind: String,
    #[serde(default)]
    pub lod: Option<Loose>,
    #[serde(default)]
    pub boundaries: Nest,
    #[serde(default)]
    pub semantics: Option<Semantics>,
    #[serde(default)]
    pub template: Option<usize>,
    #[serde(rename = "transformationMatrix", default)]
    pub matrix: Option<Vec<f64>>,
}

#[derive(Deserialize)]
pub(super) struct Semantics {
    #[serde(default)]
    pub surfaces: Vec<SemanticSurface>,
    #[serde(default)]
    pub values: Nest,
}

#[derive(Deserialize)]
pub(super) struct SemanticSurface {
    #[serde(rename = "type", default)]
    pub kind: String,
}

/// A text that older versions write as a number.
pub(super) struct Loose(pub String);

impl<'de> Deserialize<'de> for Loose {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = Loose;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a text or a number")
            }
            fn visit_str<E: Error>(self, v: &str) -> Result<Loose, E> {
                Ok(Loose(v.to_owned()))
            }
            fn visit_u64<E: Error>(self, v: u64) -> Result<Loose, E> {
                Ok(Loose(v.to_string()))
            }
            fn visit_i64<E: Error>(self, v: i64) -> Result<Loose, E> {
                Ok(Loose(v.to_string()))
            }
            fn visit_f64<E: Error>(self, v: f64) -> Result<Loose, E> {
                Ok(Loose(v.to_string()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}

/// Nested arrays of indices, as deep as the kind of geometry wants; innermost arrays are packed.
#[derive(Debug, Default, PartialEq)]
pub(super) enum Nest {
    /// `null`.
    #[default]
    Null,
    /// A number outside any packed array.
    One(u32),
    /// An array of indices; [`Nest::NULL`] for `null`.
    Row(Vec<u32>),
    /// An array of arrays.
    List(Vec<Nest>),
}

impl Nest {
    /// `null` among indices.
    pub const NULL: u32 = u32::MAX;
}

impl<'de> Deserialize<'de> for Nest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Nested;
        impl<'de> Visitor<'de> for Nested {
            type Value = Nest;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("nested arrays of indices (whole numbers from 0) or null")
            }
            fn visit_unit<E: Error>(self) -> Result<Nest, E> {
                Ok(Nest::Null)
            }
            fn visit_u64<E: Error>(self, v: u64) -> Result<Nest, E> {
                match u32::try_from(v) {
                    Ok(v) if v != Nest::NULL => Ok(Nest::One(v)),
                    _ => Err(E::custom(format!("index {v} is beyond every list"))),
                }
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Nest, A::Error> {
                let mut row = Vec::new();
                while let Some(item) = seq.next_element()? {
                    match item {
                        Nest::Null => row.push(Nest::NULL),
                        Nest::One(v) => row.push(v),
                        other => {
                            let mut list: Vec<Nest> = row.into_iter().map(Nest::unpacked).collect();
                            list.push(other);
                            while let Some(item) = seq.next_element()? {
                                list.push(item);
                            }
                            return Ok(Nest::List(list));
                        }
                    }
                }
                Ok(Nest::Row(row))
            }
        }
        deserializer.deserialize_any(Nested)
    }
}

impl Nest {
    fn unpacked(v: u32) -> Self {
        if v == Self::NULL { Self::Null } else { Self::One(v) }
    }
}

/// A JSON object in the order of the file, with the keys that occur twice.
pub(super) struct Ordered<T> {
    pub entries: Vec<(String, T)>,
    pub repeated: Vec<String>,
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ordered<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = Ordered<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of city objects by their ids")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Ordered<T>, A::Error> {
                let mut out = Ordered { entries: Vec::new(), repeated: Vec::new() };
                let mut known: HashMap<String, ()> = HashMap::new();
                while let Some(key) = map.next_key::<String>()? {
                    if known.insert(key.clone(), ()).is_some() {
                        out.repeated.push(key);
                        map.next_value::<IgnoredAny>()?;
                    } else {
                        out.entries.push((key, map.next_value()?));
                    }
                }
                Ok(out)
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nest(text: &str) -> Result<Nest, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn nests_are_packed_and_keep_null() {
        assert_eq!(nest("[0, 7, null]"), Ok(Nest::Row(vec![0, 7, Nest::NULL])));
        assert_eq!(
            nest("[null, [1, 2], []]"),
            Ok(Nest::List(vec![Nest::Null, Nest::Row(vec![1, 2]), Nest::Row(vec![])]))
        );
        for bad in ["[-1]", "[1.5]", "[4294967295]", "[\"a\"]", "{}", "[[1,"] {
            assert!(nest(bad).is_err(), "{bad}");
        }
        // Deep nesting must not overflow the stack.
        assert!(nest(&"[".repeat(100_000)).unwrap_err().contains("recursion"));
    }
}
