use serde::{Deserialize, Serialize};

/// Smallest cosine of incidence by which `En` divides: 87 degrees. A beam that grazes a surface
/// more flatly says nothing reliable about a plane that faces it.
pub const MIN_COS: f32 = 0.05;

/// Which irradiance a number is: the same beam puts less on a surface that it grazes than on a
/// plane that faces it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Irradiance {
    /// `E`: on the surface.
    #[default]
    #[serde(rename = "surface")]
    Surface,
    /// `En`: on a plane that faces the beam, what an eye receives.
    #[serde(rename = "normal")]
    FacingBeam,
}

impl Irradiance {
    /// The name in files: `surface` or `normal`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Surface => "surface",
            Self::FacingBeam => "normal",
        }
    }

    /// The one that this isn't.
    pub fn other(self) -> Self {
        match self {
            Self::Surface => Self::FacingBeam,
            Self::FacingBeam => Self::Surface,
        }
    }
}
