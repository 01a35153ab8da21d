use super::Error;
use crate::base::{Timeline, limits};
use crate::bsdf::Bsdf;
use crate::site::Site;

/// Where photons are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Receivers {
    /// On every surface but PV.
    #[default]
    All,
    /// On purely diffuse materials alone, as Radiance does. What lands elsewhere is booked as
    /// escaped: it is lost to the store.
    Diffuse,
}

/// What decides how photons are sent.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    /// Target number of stored photons, per material.
    pub stored: u64,
    /// How far a photon flies from the PV at most, m.
    pub max_path_m: f64,
    /// Seed of the counter-based sampling.
    pub seed: u64,
    /// Whether the way from the PV to the sun must be free.
    pub sun_visibility: bool,
    /// Where photons are kept.
    pub receivers: Receivers,
}

/// Everything that photons depend on.
#[derive(Clone, Debug)]
pub struct Emission<'a> {
    /// What stands there.
    pub site: &'a Site,
    /// The suns.
    pub timeline: &'a Timeline,
    /// How each PV surface scatters, by surface number.
    pub bsdfs: Vec<&'a Bsdf>,
    /// The settings.
    pub settings: Settings,
}

impl Emission<'_> {
    /// Whether all parts fit together.
    ///
    /// # Errors
    /// The first thing that doesn't.
    pub fn check(&self) -> Result<(), Error> {
        let expected = self.site.pv.len();
        if expected == 0 {
            return Err(Error::NoPv);
        }
        if self.bsdfs.len() != expected {
            return Err(Error::Bsdfs { expected, found: self.bsdfs.len() });
        }
        if self.timeline.steps.is_empty() {
            return Err(Error::NoSun);
        }
        let setting = |name, expected, found: String| Err(Error::Setting { name, expected, found });
        let Settings { stored, max_path_m, .. } = self.settings;
        if stored == 0 || stored > limits::MAX_PHOTONS {
            return setting("photons.stored", "from 1 to 2^40", stored.to_string());
        }
        if !(max_path_m > 0.0 && max_path_m <= limits::MAX_PATH_M) {
            return setting(
                "photons.max_path_m",
                "above 0 and at most 1,000,000",
                max_path_m.to_string(),
            );
        }
        let diameter_deg = self.timeline.sun_diameter_deg;
        if !(0.0..=10.0).contains(&diameter_deg) {
            return setting("the sun's diameter", "from 0 to 10 degrees", diameter_deg.to_string());
        }
        Ok(())
    }
}
