use crate::base::FaultKind;

/// A reflection model as a project names it: `{ kind = "pv-glass", index = 1.52, ... }`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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
}

/// Why a model can't be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number lies outside of what the model means.
    #[error("{model}: {field} must be from {low} to {high}, found {found}")]
    OutOfRange {
        /// The model's kind.
        model: &'static str,
        /// The number's name.
        field: &'static str,
        /// Smallest value allowed.
        low: f64,
        /// Largest value allowed.
        high: f64,
        /// What was given.
        found: f64,
    },
    /// A file that can't be read.
    #[error("{path}: can't be read: {reason}")]
    Read {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// A file that is no XML.
    #[error("{path}:{line}:{column}: not well-formed XML: {reason}")]
    Xml {
        /// The file.
        path: String,
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What the parser says.
        reason: String,
    },
    /// Something in a BSDF file isn't as it must be.
    #[error("{path}:{line}: {item}: expected {expected}, found {found}")]
    File {
        /// The file.
        path: String,
        /// Line, from 1.
        line: u32,
        /// Element, and what it belongs to.
        item: Box<str>,
        /// What would do.
        expected: Box<str>,
        /// What is there.
        found: String,
    },
    /// A block that scatters more light than comes in.
    #[error("{path}: {block} scatters up to {percent:.2} % of the light, more than came in")]
    TooMuch {
        /// The file.
        path: String,
        /// The block.
        block: &'static str,
        /// Its largest total, %.
        percent: f64,
    },
    /// A file without the reflection that was asked for.
    #[error(
        "{path}: holds no {wanted}; it has {found}. `side = \"front\"` (the default) is Radiance's front, WINDOW's `Reflection Back`; `side = \"back\"` is `Reflection Front`"
    )]
    NoReflection {
        /// The file.
        path: String,
        /// The block.
        wanted: String,
        /// All blocks.
        found: String,
    },
}

impl Error {
    /// What it means for the process.
    pub fn kind(&self) -> FaultKind {
        match self {
            Self::OutOfRange { .. }
            | Self::Read { .. }
            | Self::Xml { .. }
            | Self::File { .. }
            | Self::TooMuch { .. }
            | Self::NoReflection { .. } => FaultKind::Input,
        }
    }
}

impl Model {
    /// The word in `kind = "..."`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Lambertian { .. } => "lambertian",
            Self::Mirror { .. } => "mirror",
            Self::Glass { .. } => "glass",
            Self::PvGlass { .. } => "pv-glass",
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
        match *self {
            Self::Lambertian { reflectance } | Self::Mirror { reflectance } => {
                within("reflectance", reflectance, 0.0, 1.0)
            }
            Self::Glass { index } => within("index", index, 1.01, 3.0),
            Self::PvGlass { index, ggx_alpha, cell_reflectance } => {
                within("index", index, 1.01, 3.0)?;
                within("ggx_alpha", ggx_alpha, 0.001, 1.0)?;
                within("cell_reflectance", cell_reflectance, 0.0, 0.9)
            }
        }
    }
}
