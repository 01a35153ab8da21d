//! The words of the project file that no room has an enum for, and values that are a word or a
//! table. Each is deserialised where it stands, so that a wrong one has its line and column.

use std::fmt;
use std::marker::PhantomData;
use std::path::PathBuf;

use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde::{Deserialize as Read, Serialize};

/// How a view is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ViewBy {
    /// From stored photons.
    #[default]
    Photons,
    /// From stored photons, with the paper's estimator.
    Radiance,
    /// By integration over the PV.
    Direct,
}

impl ViewBy {
    /// As in the project file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Photons => "photons",
            Self::Radiance => "radiance",
            Self::Direct => "direct",
        }
    }
}

/// How observers and regions are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ReceiversBy {
    /// From stored photons.
    Photons,
    /// By integration over the PV.
    Direct,
}

/// Unit of length of a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Metres.
    #[serde(alias = "metre", alias = "meter", alias = "M")]
    M,
    /// Decimetres.
    #[serde(alias = "DM")]
    Dm,
    /// Centimetres.
    #[serde(alias = "CM")]
    Cm,
    /// Millimetres.
    #[serde(alias = "MM")]
    Mm,
    /// Kilometres.
    #[serde(alias = "KM")]
    Km,
    /// Inches.
    #[serde(alias = "inch")]
    In,
    /// Feet.
    #[serde(alias = "foot")]
    Ft,
}

impl Unit {
    /// As in the project file.
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Dm => "dm",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::Km => "km",
            Self::In => "in",
            Self::Ft => "ft",
        }
    }
}

/// Which axis of a scene file points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// As in glTF.
    #[serde(alias = "Y")]
    Y,
    /// As in maps.
    #[serde(alias = "Z")]
    Z,
    /// The first.
    #[serde(alias = "X")]
    X,
}

impl Up {
    /// As in the project file.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }
}

/// A strength of the sun that has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SunStrength {
    /// Broadband, a Linke turbidity of 3.
    ClearSky,
    /// Radiance's visible watts.
    Gensky,
}

impl SunStrength {
    /// As in the project file.
    pub fn name(self) -> &'static str {
        match self {
            Self::ClearSky => "clear-sky",
            Self::Gensky => "gensky",
        }
    }
}

/// A model of the sun's strength that has parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Read, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SkyModel {
    /// The clear sky with the turbidity of each month.
    Ineichen,
}

/// `{ constant = 1000 }`, `{ epw = "site.epw" }`, `{ model = "ineichen", linke = [...] }`.
#[derive(Clone, Debug, Default, Read, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SunStrengthTable {
    /// W/m2.
    pub constant: Option<f64>,
    /// A weather file.
    pub epw: Option<PathBuf>,
    /// A model.
    pub model: Option<SkyModel>,
    /// Its Linke turbidity of each month, from January.
    pub linke: Option<Vec<f64>>,
}

/// A word, or a table where a word doesn't say enough.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum WordOr<W, T> {
    /// `"word"`
    Word(W),
    /// `{ key = value }`
    Table(T),
}

impl<'de, W: Read<'de>, T: Read<'de>> Deserialize<'de> for WordOr<W, T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Either<W, T>(PhantomData<(W, T)>);
        impl<'de, W: Read<'de>, T: Read<'de>> Visitor<'de> for Either<W, T> {
            type Value = WordOr<W, T>;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("a text in quotes or a table in braces")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Self::Value, E> {
                W::deserialize(StrDeserializer::new(text)).map(WordOr::Word)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(WordOr::Table)
            }
        }
        from.deserialize_any(Either(PhantomData))
    }
}
