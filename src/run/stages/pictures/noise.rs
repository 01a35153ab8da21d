//! How sure the maps are: standard error, search radius, and the hours that noise leaves open.

use super::atlas::{Atlas, Drawing};
use crate::picture::{Scale, scale};
use crate::project::{GlareMap, Map};
use crate::run::error::Error;

impl Atlas<'_> {
    /// What is known of noise.
    pub(super) fn noise(&mut self) -> Result<(), Error> {
        let maps = self.maps(Map::StandardError, |view| !view.is_direct())?;
        let caption = "What photons landing at random make of the annual map: two of three values lie \
                       within one standard error of the truth, 95 of 100 within two.";
        let scale = self.decades(Map::StandardError, &maps);
        self.push_noise(Map::StandardError, "standard error", caption.into(), scale);
        let scale = Scale::linear(self.largest(Map::Radius)?, Map::Radius.unit(self.basis));
        let caption = "Details smaller than this are blurred.".to_owned();
        self.push_noise(Map::Radius, "radius of the disc", caption, scale);
        if let Some(radius) = self.drawings.last_mut() {
            radius.bare = "no colour: nothing to receive light".into();
        }
        let mut max = 1e-6f64;
        for &t in self.thresholds() {
            max = max.max(self.largest(Map::Glare(t, GlareMap::AtMost))?);
        }
        for &t in self.thresholds() {
            for (map, words, how) in [
                (GlareMap::AtLeast, "at least", "taken off"),
                (GlareMap::AtMost, "at most", "added to"),
            ] {
                let legend = format!("time above {t} {}, {words}", self.watts());
                let caption = format!(
                    "Two standard errors {how} every value; a limit between this and its \
                     counterpart is undecided. Irradiance {}, unfiltered.",
                    self.what()
                );
                let map = Map::Glare(t, map);
                let scale = Scale::linear(max, map.unit(self.basis));
                self.push_noise(map, &legend, caption, scale);
                if let Some(drawing) = self.drawings.last_mut() {
                    drawing.title += &format!(", {words}");
                }
            }
        }
        Ok(())
    }

    fn largest(&self, map: Map) -> Result<f64, Error> {
        let grids = self.maps(map, |view| !view.is_direct())?;
        Ok(scale::nice_ceiling(scale::percentile(&grids, 1.0).max(1e-6)))
    }

    fn push_noise(&mut self, map: Map, legend: &str, caption: String, scale: Scale) {
        let drawing = self.drawing(map, legend.to_owned(), caption, scale);
        self.drawings.push(Drawing { is_of_noise: true, ..drawing });
    }
}
