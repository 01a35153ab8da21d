//! Which maps are drawn, and what is written beside them. A quantity has one scale over all
//! materials and views, so that pictures can be laid side by side.

use crate::base::{Grid, SpectralBasis};
use crate::picture::Scale;
use crate::picture::scale::{self, Below};
use crate::project::artifacts::{irradiance_unit, quantity_words};
use crate::project::{GlareMap, Map, PlannedView, SeriesOf};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::run::units::OfView;

/// Decades of the logarithmic scale of annual maps.
const DECADES: f64 = 3.0;
/// Share of the lit pixels that a scale covers: single hot pixels don't decide.
const COVERED: f64 = 0.999;
/// Ratios beyond this are drawn as this.
const LARGEST_RATIO: f64 = 10.0;
/// What no colour means where no threshold is exceeded.
const NEVER: &str = "no colour: never above the threshold";
/// What no colour means below the lower end of a scale.
pub(super) const LESS: &str = "no colour: less, or nothing";

/// A map that is drawn.
pub(super) struct Drawing {
    pub map: Map,
    pub title: String,
    pub legend: String,
    /// What no colour means.
    pub bare: String,
    pub caption: String,
    pub scale: Scale,
    /// Of a ratio: it isn't drawn where both parts are below this many Wh/m2, because there it
    /// compares single photons.
    pub faint_wh_m2: Option<f64>,
    /// Whether it shows what is known of noise; views of direct integration have none.
    pub is_of_noise: bool,
}

/// Makes the list of all drawings.
pub(super) struct Atlas<'a> {
    pub job: &'a Job<'a>,
    pub basis: SpectralBasis,
    pub drawings: Vec<Drawing>,
}

/// Everything that is drawn of each material in each view, if the map is there.
pub(super) fn drawings(job: &Job<'_>) -> Result<Vec<Drawing>, Error> {
    let mut atlas = Atlas { job, basis: job.timeline()?.basis, drawings: Vec::new() };
    atlas.energy()?;
    atlas.durations()?;
    atlas.unfiltered()?;
    atlas.noise()?;
    Ok(atlas.drawings)
}

impl<'a> Atlas<'a> {
    /// The unit of irradiance.
    pub fn watts(&self) -> &'static str {
        irradiance_unit(self.basis)
    }

    /// Which irradiance it is.
    pub fn what(&self) -> &'static str {
        quantity_words(self.job.resolved.quantity)
    }

    pub fn thresholds(&self) -> &'a [f64] {
        &self.job.resolved.project.glare.thresholds_w_m2
    }

    /// Every map of a kind, over all materials and those views that `which` takes.
    pub fn maps(
        &self,
        map: Map,
        which: impl Fn(&PlannedView) -> bool,
    ) -> Result<Vec<Grid<f32>>, Error> {
        let mut grids = Vec::new();
        for candidate in &self.job.resolved.candidates {
            for view in self.job.resolved.views.iter().filter(|view| which(view)) {
                let name = self.job.folder.exr(&candidate.name, &view.name, map);
                if self.job.folder.at(&name).exists() {
                    grids.push(self.job.read_map(OfView { candidate, view }, map)?);
                }
            }
        }
        Ok(grids)
    }

    /// Every map of a kind, over all materials and views.
    pub fn all(&self, map: Map) -> Result<Vec<Grid<f32>>, Error> {
        self.maps(map, |_| true)
    }

    /// A logarithmic scale; what lies below it shows the background: there, single photons decide.
    pub fn decades(&self, map: Map, grids: &[Grid<f32>]) -> Scale {
        let max = scale::nice_ceiling(scale::percentile(grids, COVERED).max(1e-6));
        Scale {
            below: Below::Transparent,
            ..Scale::logarithmic(max, DECADES, map.unit(self.basis))
        }
    }

    /// A scale from 0 to the largest of all values.
    pub fn linear(&self, map: Map, grids: &[Grid<f32>]) -> Scale {
        let max = scale::percentile(grids, 1.0);
        let max = if max > 0.0 { scale::nice_ceiling(max) } else { 1.0 };
        Scale::linear(max, map.unit(self.basis))
    }

    /// A drawing of a map, its title that of the map; where it counts time above a threshold, with
    /// the threshold.
    pub fn drawing(&self, map: Map, legend: String, caption: String, scale: Scale) -> Drawing {
        let title = map.title_above(self.basis);
        let bare = if title == map.title() { LESS } else { NEVER }.to_owned();
        let (faint_wh_m2, is_of_noise) = (None, false);
        Drawing { map, title, legend, bare, caption, scale, faint_wh_m2, is_of_noise }
    }

    /// The energy of the year, the strongest irradiance, and the comparison with the reference.
    fn energy(&mut self) -> Result<(), Error> {
        let resolved = self.job.resolved;
        let annual = self.decades(Map::Annual, &self.all(Map::Annual)?);
        let faintest = annual.min;
        self.drawings.push(self.drawing(
            Map::Annual,
            "annual radiant exposure".into(),
            "Sunlight that the PV throws onto each surface, summed over the year; the sun's own light is not in it.".into(),
            annual,
        ));
        let quantity = resolved.quantity;
        let peak = Map::Peak(SeriesOf { quantity, asked: quantity });
        self.drawings.push(self.drawing(
            peak,
            format!("largest irradiance {}", self.what()),
            "The largest value of any timestep, unfiltered; noise makes single pixels too bright."
                .into(),
            self.decades(peak, &self.all(peak)?),
        ));
        let Some(reference) = resolved.reference else { return Ok(()) };
        let name = &resolved.candidates[reference].name;
        let largest = scale::percentile(&self.all(Map::Ratio)?, 0.99).max(1e-6);
        let scale = Scale::ratio(scale::nice_ceiling(largest).min(LARGEST_RATIO));
        let caption = format!(
            "Above 1 this material sends more light to a place than {name} does, below 1 less."
        );
        let (faint, unit) = (scale::format_value(faintest), Map::Annual.unit(self.basis));
        self.drawings.push(Drawing {
            title: format!("Energy in a year compared with {name}"),
            bare: format!("no colour: both below {faint} {unit}"),
            faint_wh_m2: Some(faintest),
            ..self.drawing(Map::Ratio, format!("ratio to {name}"), caption, scale)
        });
        Ok(())
    }

    /// Durations from the filtered series.
    fn durations(&mut self) -> Result<(), Error> {
        for (map, meaning) in [
            (GlareMap::Cumulative, "Sum of all times of the year above the threshold."),
            (
                GlareMap::Sustained,
                "The longest time that one event, connected in space and time, covers a place on any day.",
            ),
            (
                GlareMap::LongestRun,
                "The longest uninterrupted time above the threshold on any day.",
            ),
        ] {
            self.above_each_threshold(map, "time above", |what| {
                format!("{meaning} Irradiance {what}, smoothed in space and time as in the published method.")
            })?;
        }
        Ok(())
    }

    /// A map of times at every threshold, on one scale.
    pub fn above_each_threshold(
        &mut self,
        map: GlareMap,
        legend: &str,
        caption: impl Fn(&str) -> String,
    ) -> Result<(), Error> {
        let mut grids = Vec::new();
        for &t in self.thresholds() {
            grids.extend(self.all(Map::Glare(t, map))?);
        }
        for &t in self.thresholds() {
            let (map, watts) = (Map::Glare(t, map), self.watts());
            let scale = self.linear(map, &grids);
            let legend = format!("{legend} {t} {watts}");
            self.drawings.push(self.drawing(map, legend, caption(self.what()), scale));
        }
        Ok(())
    }
}
