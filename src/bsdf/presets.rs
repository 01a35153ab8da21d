#![doc = include_str!("presets.md")]

use super::interface::Coating;
use super::model::{Model, Part};

/// A material of the library.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// What `model = { preset = "…" }` and `glintmap bsdf …` call it.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Where its numbers come from.
    pub source: &'static str,
    model: fn() -> Model,
}

/// Soda-lime glass in the visible (Rubin 1985, "Optical properties of soda lime silica glasses").
const GLASS: f64 = 1.52;
/// Porous silica, a quarter of a wave thick at 600 nm.
const POROUS_SILICA: Coating = Coating { index: 1.27, thickness_nm: 118.0 };

fn glass(ggx_alpha: f64, cell_reflectance: f64, coating: Option<Coating>) -> Model {
    Model::CoatedGlass { index: GLASS, ggx_alpha, cell_reflectance, coating }
}

/// All of them.
pub const PRESETS: [Preset; 7] = [
    Preset {
        name: "standard",
        about: "lightly textured solar glass over dark cells",
        source: "the case study's: soda-lime glass 1.52, GGX alpha 0.05 for a lobe like that of the paper's Figure 8a, 4 % of what enters returns from cells and back sheet; an estimate, no measurement",
        model: || Model::PvGlass { index: GLASS, ggx_alpha: 0.05, cell_reflectance: 0.04 },
    },
    Preset {
        name: "anti-reflective",
        about: "the standard module with an anti-reflective film",
        source: "standard, coated with porous silica (Ballif et al. 2004, Solar Energy Materials and Solar Cells 82(3), 331 to 344): index 1.27 for some 40 % of pores, 118 nm for a quarter of a wave at 600 nm; thin-film optics, mean over 380 to 1,100 nm",
        model: || glass(0.05, 0.04, Some(POROUS_SILICA)),
    },
    Preset {
        name: "smooth",
        about: "float glass over dark cells, the worst case",
        source: "slope error of smooth glass without coating 6.55 mrad (Ho, Sims, Yellowhair and Bush 2015, SGHAT technical reference), taken per axis: GGX alpha 0.0093 = sqrt(2) x 0.00655",
        model: || glass(0.0093, 0.03, None),
    },
    Preset {
        name: "satinated",
        about: "etched or printed front glass, a lobe wider than 10 degrees",
        source: "the case study's: soda-lime glass 1.52, GGX alpha 0.28 for a lobe like that of the paper's Figure 8b, 6 % of what enters returns; an estimate, no measurement",
        model: || Model::PvGlass { index: GLASS, ggx_alpha: 0.28, cell_reflectance: 0.06 },
    },
    Preset {
        name: "deeply-textured",
        about: "rolled glass with deep structure",
        source: "slope error of deeply textured glass 82.6 mrad (SGHAT technical reference, see smooth), taken per axis: GGX alpha 0.117; regular pyramids send light into separate beams, which this can't show",
        model: || glass(0.117, 0.05, None),
    },
    Preset {
        name: "tile",
        about: "clay roof tile",
        source: "Lambertian with 25 %, as the paper takes for all surfaces but the PV, and the case study for its roof",
        model: || Model::Lambertian { reflectance: 0.25 },
    },
    Preset {
        name: "metal-sheet",
        about: "weathered metal roof: half bare aluminium, half dull",
        source: "aluminium at 550 nm, index 0.96 and extinction 6.69 (Rakic et al. 1998, doi:10.1364/AO.37.005271), GGX alpha 0.25; the dull half Lambertian with 40 %; the shares and alpha are estimates",
        model: || Model::Mixture {
            parts: vec![
                Part {
                    share: 0.5,
                    model: Model::Metal { index: 0.96, extinction: 6.69, ggx_alpha: 0.25 },
                },
                Part { share: 0.5, model: Model::Lambertian { reflectance: 0.40 } },
            ],
        },
    },
];

impl Preset {
    /// The preset of a name.
    pub fn named(name: &str) -> Option<Self> {
        PRESETS.into_iter().find(|p| p.name == name)
    }

    /// The numbers.
    pub fn model(&self) -> Model {
        (self.model)()
    }
}
