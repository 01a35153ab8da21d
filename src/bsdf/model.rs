//! Models of reflection as a project names them, and the ranges in which their numbers mean
//! something.
//!
//! A [`Model`] is data: what `{ kind = "pv-glass", index = 1.52, ... }` says.
//! [`super::Bsdf::from_model`] makes of it what scatters. Ranges are checked here, once, so that
//! nothing behind has to expect an index of 0 or a roughness for which the sampling breaks down.

use serde::Deserialize as _;

use super::Error;
use super::interface::Coating;
use super::presets::{PRESETS, Preset};

/// A reflection model as a project names it: `{ kind = "pv-glass", index = 1.52, ... }`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Model {
    /// Scatters evenly: an old roof tile.
    Lambertian {
        /// Share of the light that comes back, 0..1.
        reflectance: f64,
    },
    /// An ideal mirror, the same at every angle.
    Mirror {
        /// Share of the light that comes back, 0..1.
        reflectance: f64,
    },
    /// Smooth glass over perfect black: Fresnel's equations alone.
    Glass {
        /// Refractive index, 1.01..3 (glass: 1.52).
        index: f64,
    },
    /// A PV module: structured glass over a dark cell.
    PvGlass {
        /// Refractive index of the front, 1..3 (glass: 1.52).
        index: f64,
        /// GGX roughness alpha of the front, 0.001..1 (clear glass 0.01 to 0.05, satinated 0.2
        /// and above; the lobe's half width is about `2 * alpha` radians).
        ggx_alpha: f64,
        /// Share of the light inside the glass that comes out again, scattered by cells and back
        /// sheet, 0..0.9 (dark cells: 0.02 to 0.05).
        cell_reflectance: f64,
    },
    /// Glass over cells, smooth or rough, with or without an anti-reflective film.
    CoatedGlass {
        /// Refractive index of the glass, 1.01..3 (soda-lime glass: 1.52).
        index: f64,
        /// GGX roughness alpha, 0.001..1, or 0 for a perfectly smooth front.
        #[serde(default)]
        ggx_alpha: f64,
        /// Share of the light inside the glass that comes out again, 0..0.9.
        #[serde(default)]
        cell_reflectance: f64,
        /// The film.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        coating: Option<Coating>,
    },
    /// Bare metal, rough.
    Metal {
        /// Refractive index, 0.01..20.
        index: f64,
        /// Extinction coefficient, 0..20.
        extinction: f64,
        /// GGX roughness alpha, 0.001..1.
        ggx_alpha: f64,
    },
    /// Several of them side by side: each takes its share of the light, the rest is absorbed.
    Mixture {
        /// One to sixteen, none of them a mixture.
        parts: Vec<Part>,
    },
}

/// A part of a mixture: `{ share = 0.9, model = { preset = "satinated" } }`.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Share of the area, above 0; all shares add up to 1 at most.
    pub share: f64,
    /// What it is made of; a model, or the name of a preset.
    #[serde(deserialize_with = "preset_or_model")]
    pub model: Model,
}

/// Reads a model, or a preset's name as `"satinated"` or `{ preset = "satinated" }`.
///
/// # Errors
/// What serde finds wrong, and names that no preset has.
pub fn preset_or_model<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Model, D::Error> {
    use serde::de::Error as _;
    let value = serde_json::Value::deserialize(from)?;
    let name = match &value {
        serde_json::Value::String(name) => Some(name.as_str()),
        serde_json::Value::Object(map) if map.contains_key("preset") && map.len() == 1 => {
            map["preset"].as_str()
        }
        _ => None,
    };
    match name {
        Some(name) => Preset::named(name).map(|p| p.model()).ok_or_else(|| {
            D::Error::custom(Error::NoPreset {
                found: name.to_owned(),
                known: PRESETS.map(|p| p.name).join(", "),
            })
        }),
        None => Model::deserialize(value).map_err(D::Error::custom),
    }
}

/// Most parts of a mixture.
const MOST_PARTS: usize = 16;

impl Model {
    /// The word in `kind = "..."`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lambertian { .. } => "lambertian",
            Self::Mirror { .. } => "mirror",
            Self::Glass { .. } => "glass",
            Self::PvGlass { .. } => "pv-glass",
            Self::CoatedGlass { .. } => "coated-glass",
            Self::Metal { .. } => "metal",
            Self::Mixture { .. } => "mixture",
        }
    }

    /// Whether every number lies in its range.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for the first that doesn't; not-a-number never does.
    pub fn check(&self) -> Result<(), Error> {
        let model = self.name();
        let within = |field, found: f64, low: f64, high: f64| {
            if found >= low && found <= high {
                Ok(())
            } else {
                Err(Error::OutOfRange { model, field, low, high, found })
            }
        };
        match self {
            &Self::Lambertian { reflectance } | &Self::Mirror { reflectance } => {
                within("reflectance", reflectance, 0.0, 1.0)
            }
            &Self::Glass { index } => within("index", index, 1.01, 3.0),
            &Self::PvGlass { index, ggx_alpha, cell_reflectance } => {
                within("index", index, 1.01, 3.0)?;
                within("ggx_alpha", ggx_alpha, 0.001, 1.0)?;
                within("cell_reflectance", cell_reflectance, 0.0, 0.9)
            }
            &Self::CoatedGlass { index, ggx_alpha, cell_reflectance, coating } => {
                within("index", index, 1.01, 3.0)?;
                if ggx_alpha != 0.0 {
                    within("ggx_alpha (or 0)", ggx_alpha, 0.001, 1.0)?;
                }
                within("cell_reflectance", cell_reflectance, 0.0, 0.9)?;
                if let Some(film) = coating {
                    within("coating.index", film.index, 1.01, 3.0)?;
                    within("coating.thickness_nm", film.thickness_nm, 1.0, 2000.0)?;
                }
                Ok(())
            }
            &Self::Metal { index, extinction, ggx_alpha } => {
                within("index", index, 0.01, 20.0)?;
                within("extinction", extinction, 0.0, 20.0)?;
                within("ggx_alpha", ggx_alpha, 0.001, 1.0)
            }
            Self::Mixture { parts } => {
                let wrong = |expected, found: String| Err(Error::Mixture { expected, found });
                if !(1..=MOST_PARTS).contains(&parts.len()) {
                    return wrong("1 to 16 parts", parts.len().to_string());
                }
                for part in parts {
                    if matches!(part.model, Self::Mixture { .. }) {
                        return wrong("parts that are no mixtures", "a mixture".into());
                    }
                    within("share", part.share, 1e-6, 1.0)?;
                    part.model.check()?;
                }
                let sum: f64 = parts.iter().map(|p| p.share).sum();
                if sum > 1.0 + 1e-9 {
                    return wrong("shares that add up to 1 at most", sum.to_string());
                }
                Ok(())
            }
        }
    }
}
