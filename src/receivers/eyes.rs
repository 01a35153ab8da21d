//! What the observers' eyes see over the year: luminance of the PV, the hazard, the veil, and how
//! long. Computed from the BSDF alone, without photons: also for eyes in free air.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::error::Error;
use crate::base::{Progress, Timeline};
use crate::glare::{Kernel, Lengths, SpotGlare, spot};
use crate::project::artifacts::EyesFile;
use crate::project::{Candidate, Results};
use crate::render::eye::hazard::{self, Hazard, HazardZone, after_image_w_cm2, burn_w_cm2, zone};
use crate::render::eye::{Eye, EyeInstant, EyeMaterial, EyePv, Seen, SunAt};
use crate::sky;
use crate::volume::TimeAxis;

/// Luminances above which time is counted, cd/m2: MIT's and Swissolar's (Table 2 of the paper).
pub const LUMINANCES_CD_M2: [f64; 2] = [30_000.0, 50_000.0];

/// Age of the observers for the veil, years.
pub const VEIL_AGE_YEARS: f64 = hazard::AGE_YEARS;

/// `observers.json`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EyeYears {
    /// Lumens that a watt of the project's sunlight stands for.
    pub efficacy_lm_per_w: f64,
    /// Which clock hours mean: the site's time zone.
    pub clock: String,
    /// In the order of the project file.
    pub observers: Vec<EyeYear>,
}

/// A largest value and its timestep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Largest {
    /// The value.
    pub value: f64,
    /// Its timestep; the first of several.
    pub at: usize,
}

/// The year of an observer's eye.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EyeYear {
    /// As in the project file.
    pub name: String,
    /// Where, m from the local origin.
    pub point: [f64; 3],
    /// Where it looks; to the middle of the PV where the project says nothing.
    pub direction: [f64; 3],
    /// All PV in sight, sr; in the month with most where crowns let light through.
    pub pv_sr: f64,
    /// To the nearest PV in sight, m.
    pub nearest_m: Option<f64>,
    /// Radiant exposure of the plane across the line of sight, Wh/m2.
    pub exposure_wh_m2: f64,
    /// Irradiance of that plane, W/m2.
    pub irradiance_w_m2: Largest,
    /// Irradiance of planes that face the beams, W/m2.
    pub normal_w_m2: Largest,
    /// Luminance of the brightest patch, cd/m2.
    pub luminance_cd_m2: Largest,
    /// Mean luminance of all lit PV in sight, cd/m2.
    pub mean_luminance_cd_m2: Largest,
    /// Veiling luminance, cd/m2.
    pub veil_cd_m2: Largest,
    /// Retinal irradiance over that of a possible after-image.
    pub after_image: Largest,
    /// Retinal irradiance over that of a possible burn.
    pub burn: Largest,
    /// How long, by measure.
    pub times: Vec<EyeTime>,
}

/// How long something is exceeded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EyeTime {
    /// What.
    pub measure: Measure,
    /// When and how long.
    pub glare: SpotGlare,
    /// The lit days: day of year, minutes, first and last hour.
    pub days: Vec<(u32, f64, f64, f64)>,
}

/// What is exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// An irradiance of the project's thresholds, W/m2.
    Irradiance(f64),
    /// The same after the filter in time.
    Filtered(f64),
    /// A luminance, cd/m2.
    Luminance(f64),
    /// Retinal irradiance in the green zone (low potential for an after-image).
    Green,
    /// In the yellow zone (potential for an after-image).
    Yellow,
    /// In the red zone (potential for a burn).
    Red,
}

impl Measure {
    /// For tables.
    pub fn words(self) -> String {
        match self {
            Self::Irradiance(t) => format!("irradiance > {t} W/m2"),
            Self::Filtered(t) => format!("filtered irradiance > {t} W/m2"),
            Self::Luminance(t) => format!("luminance > {t} cd/m2"),
            Self::Green => "hazard green".into(),
            Self::Yellow => "hazard yellow".into(),
            Self::Red => "hazard red".into(),
        }
    }
}

/// The observers' eyes with a material, from their file; nothing where nobody looks.
///
/// # Errors
/// When the file is missing or damaged.
pub fn read_eyes(results: &Results<'_>, candidate: &Candidate) -> Result<EyeYears, Error> {
    if results.resolved.project.observer.is_empty() {
        return Ok(EyeYears::default());
    }
    Ok(results.folder.read_json(&results.folder.eyes(&candidate.name, EyesFile::Years))?)
}

/// Sources of light as the hazard plot of Ho et al. (2011) shows them: angle that the source
/// subtends, rad, and irradiance on the retina, W/cm2.
pub struct HazardPlot {
    /// Each timestep that sends light.
    pub timesteps: Vec<(f64, f64)>,
    /// The sun itself, looked at.
    pub sun: (f64, f64),
    /// From where on an after-image is possible.
    pub after_image: Vec<(f64, f64)>,
    /// From where on a burn is possible.
    pub burn: Vec<(f64, f64)>,
}

impl HazardPlot {
    /// An observer's year. `angles_rad`: where the borders of the zones are asked for.
    pub fn of(instants: &[EyeInstant], sun_diameter_deg: f64, angles_rad: &[f64]) -> Self {
        let border = |of: fn(f64) -> f64| angles_rad.iter().map(|&w| (w, of(w))).collect();
        let at = |hazard: &Hazard| (hazard.subtended_rad, hazard.retinal_w_cm2);
        let irradiance_w_m2 = 1000.0;
        let sun = SunAt { direction: DVec3::Z, irradiance_w_m2, diameter_deg: sun_diameter_deg };
        Self {
            timesteps: instants
                .iter()
                .filter(|i| i.normal_w_m2 > 0.0)
                .map(|i| at(&i.after_image))
                .collect(),
            sun: at(&Hazard::of(irradiance_w_m2, sun.solid_angle_sr())),
            after_image: border(after_image_w_cm2),
            burn: border(burn_w_cm2),
        }
    }
}

/// An observer: its name, its eye, at which timesteps glare counts for it.
pub struct Observer {
    /// As in the project file.
    pub name: String,
    /// The eye.
    pub eye: Eye,
    /// By timestep.
    pub counts: Vec<bool>,
}

/// Which irradiance is held against the thresholds.
#[derive(Clone, Copy, Debug)]
pub struct Thresholds<'a> {
    /// W/m2.
    pub irradiances_w_m2: &'a [f64],
    /// Of the plane that faces the beam, or of that across the line of sight.
    pub normal: bool,
    /// The filter in time.
    pub filter: &'a Kernel,
}

/// What an eye has in sight: once, or for each month where crowns let light through.
pub fn sights(pv: &EyePv<'_>, eye: Eye) -> Vec<Seen> {
    let months = if pv.has_seasons() { 12 } else { 1 };
    (0..months).into_par_iter().map(|month| pv.seen(eye, month)).collect()
}

/// The instants of an eye's year, by timestep, for each material. `materials`: how each PV surface
/// scatters, for each candidate; `seen`: see [`sights`].
///
/// # Errors
/// Interruption.
pub fn instants(
    pv: &EyePv<'_>,
    seen: &[Seen],
    timeline: &Timeline,
    materials: &[Vec<EyeMaterial<'_>>],
    progress: &dyn Progress,
) -> Result<Vec<Vec<EyeInstant>>, Error> {
    let one = |step: &crate::base::Timestep| {
        progress.check().map_err(crate::render::Error::from)?;
        let mut out = vec![EyeInstant::default(); materials.len()];
        let month = sky::date_of_day(timeline.year, step.day).0.saturating_sub(1) as usize;
        let seen = &seen[month % seen.len()];
        if seen.solid_angle_sr <= 0.0 || step.irradiance_w_m2 <= 0.0 {
            return Ok(out);
        }
        let sun = SunAt {
            direction: step.sun,
            irradiance_w_m2: step.irradiance_w_m2,
            diameter_deg: timeline.sun_diameter_deg,
        };
        let lit = pv.lit(sun.direction, seen, month);
        let mut glints = Vec::new();
        for (out, materials) in out.iter_mut().zip(materials) {
            pv.look(seen, &lit, &sun, materials, &mut glints);
            *out = EyeInstant::of(&seen.eye, &mut glints);
        }
        Ok(out)
    };
    let by_step: Vec<_> = timeline.steps.par_iter().map(one).collect::<Result<_, Error>>()?;
    let of = |m: usize| by_step.iter().map(|all| all[m]).collect();
    Ok((0..materials.len()).map(of).collect())
}

impl EyeYear {
    /// Sums an eye's instants up. The axis has the hours that clocks show, `lengths` are those of
    /// standard time.
    pub fn of(
        observer: &Observer,
        seen: &[Seen],
        (axis, lengths): (&TimeAxis, &Lengths),
        instants: &[EyeInstant],
        thresholds: &Thresholds<'_>,
    ) -> Self {
        let lm_per_w = axis.basis.lm_per_w();
        let largest = |of: &dyn Fn(&EyeInstant) -> f64| {
            let mut most = Largest::default();
            for (at, instant) in instants.iter().enumerate() {
                let value = of(instant);
                if value > most.value {
                    most = Largest { value, at };
                }
            }
            most
        };
        let mut times = Vec::new();
        let mut count = |measure, exceeds: &dyn Fn(&EyeInstant) -> bool| {
            let exceeded = |t: usize| observer.counts[t] && exceeds(&instants[t]);
            times.push(time(measure, axis, lengths, exceeded));
        };
        for &t in thresholds.irradiances_w_m2 {
            count(Measure::Irradiance(t), &|i| thresholds.of(i) > t);
        }
        for t in LUMINANCES_CD_M2 {
            count(Measure::Luminance(t), &|i| i.peak.radiance_w_m2_sr * lm_per_w > t);
        }
        for (measure, zone) in [
            (Measure::Green, HazardZone::Low),
            (Measure::Yellow, HazardZone::AfterImage),
            (Measure::Red, HazardZone::Burn),
        ] {
            count(measure, &|i| zone_of(i) == zone);
        }
        let nearest_m = seen.iter().fold(f64::INFINITY, |least, s| s.nearest_m.min(least));
        // The filter counts timesteps: it sees the finest regular grid.
        let (shows, wide) = match lengths.spread(axis) {
            Some((shows, wide)) => (shows, Some(wide)),
            None => ((0..instants.len()).collect(), None),
        };
        let even = wide.as_ref().unwrap_or(axis);
        let own = Lengths::even(even);
        let values: Vec<f64> = shows.iter().map(|t| thresholds.of(&instants[*t])).collect();
        let filtered = smoothed(&even.segment, &values, thresholds.filter);
        for &threshold in thresholds.irradiances_w_m2 {
            let exceeded = |i: usize| observer.counts[shows[i]] && filtered[i] > threshold;
            times.push(time(Measure::Filtered(threshold), even, &own, exceeded));
        }
        let exposure = instants.iter().zip(&axis.weight_h).map(|(i, w)| i.surface_w_m2 * w);
        Self {
            name: observer.name.clone(),
            point: observer.eye.position.to_array(),
            direction: observer.eye.direction.to_array(),
            pv_sr: seen.iter().fold(0.0, |most, s| s.solid_angle_sr.max(most)),
            nearest_m: Some(nearest_m).filter(|m| m.is_finite()),
            exposure_wh_m2: exposure.fold(0.0, |sum, v| sum + v),
            irradiance_w_m2: largest(&|i| i.surface_w_m2),
            normal_w_m2: largest(&|i| i.normal_w_m2),
            luminance_cd_m2: largest(&|i| i.peak.radiance_w_m2_sr * lm_per_w),
            mean_luminance_cd_m2: largest(&|i| i.mean_w_m2_sr() * lm_per_w),
            veil_cd_m2: largest(&|i| i.veil_w_m2_sr * lm_per_w),
            after_image: largest(&|i| i.after_image.after_image_ratio()),
            burn: largest(&|i| i.burn.burn_ratio()),
            times,
        }
    }

    /// How long something is exceeded.
    pub fn time(&self, measure: Measure) -> Option<&SpotGlare> {
        self.times.iter().find(|t| t.measure == measure).map(|t| &t.glare)
    }
}

impl Thresholds<'_> {
    fn of(&self, instant: &EyeInstant) -> f64 {
        if self.normal { instant.normal_w_m2 } else { instant.surface_w_m2 }
    }
}

/// The zone of an instant.
pub fn zone_of(instant: &EyeInstant) -> HazardZone {
    zone(instant.after_image.after_image_ratio(), instant.burn.burn_ratio())
}

/// The filter along each segment, whose borders reflect.
fn smoothed(segments: &[u32], values: &[f64], filter: &Kernel) -> Vec<f64> {
    let weights = filter.weights();
    let mut out = Vec::with_capacity(values.len());
    let mut first = 0;
    for part in segments.chunk_by(|a, b| a == b) {
        let own = &values[first..first + part.len()];
        let period = 2 * own.len();
        let at = |i: usize, by: usize, back: bool| {
            let by = by % period;
            let i = if back { (i + period - by) % period } else { (i + by) % period };
            own[if i < own.len() { i } else { period - 1 - i }]
        };
        for (i, value) in own.iter().enumerate() {
            let mut sum = value * weights[0];
            for (by, weight) in weights.iter().enumerate().skip(1).rev() {
                sum += (at(i, by, true) + at(i, by, false)) * weight;
            }
            out.push(sum);
        }
        first += part.len();
    }
    out
}

fn time(
    measure: Measure,
    axis: &TimeAxis,
    lengths: &Lengths,
    exceeded: impl Fn(usize) -> bool,
) -> EyeTime {
    let mut days: Vec<(u32, f64, f64, f64)> = Vec::new();
    for t in (0..axis.day.len()).filter(|t| exceeded(*t)) {
        let (day, hour) = (axis.day[t], axis.hour[t]);
        let minutes = lengths.hours(t..=t) * 60.0;
        match days.last_mut() {
            Some(last) if last.0 == day => {
                last.1 += minutes;
                last.3 = hour;
            }
            _ => days.push((day, minutes, hour, hour)),
        }
    }
    EyeTime { measure, glare: spot(axis, lengths, exceeded), days }
}

/// Azimuth clockwise from north and altitude of a direction, degrees.
pub fn azimuth_altitude_deg(direction: DVec3) -> (f64, f64) {
    let (altitude, azimuth) = sky::altitude_azimuth_deg(direction);
    (azimuth, altitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SciPy's `gaussian_filter1d([0, 0, 8, 4, 0], 1)`, and nothing passes a segment's border.
    #[test]
    fn the_filter_is_scipys_and_ends_with_the_segment() {
        let kernel = Kernel::gaussian('t', 1.0, 4.0).expect("a filter");
        let found = smoothed(&[0, 0, 0, 0, 0, 1, 1], &[0., 0., 8., 4., 0., 1., 1.], &kernel);
        let expected = [0.485_647, 2.152_807, 4.159_969, 3.550_344, 1.651_234, 1.0, 1.0];
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-5, "{found:?}");
        }
    }
}
