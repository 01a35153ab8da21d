//! What a receiver's year comes to in the quantities that rules judge.

use super::eyes::{EyeYear, EyeYears, Measure};
use super::points::Kind;
use super::received::{AtThreshold, Banded, GroupReceived};
use crate::base::Irradiance;
use crate::project::Results;
use crate::rules::{Measured, Metrics, Quantity};

/// What was assumed, in the words of the rules' conditions.
pub fn conditions(results: &Results<'_>) -> Vec<String> {
    let mut out = vec!["all-pv".to_owned()];
    if results.resolved.weather.is_none() {
        out.push("clear-sky".into());
    }
    out
}

/// The eye of an observer; regions have none.
pub fn eye_of<'a>(eyes: &'a EyeYears, group: &GroupReceived) -> Option<&'a EyeYear> {
    let own = |e: &&EyeYear| group.kind == Kind::Observer && e.name == group.name;
    eyes.observers.iter().find(own)
}

/// All that is known of a receiver. `pv_m2`: area of all PV.
pub fn metrics(
    results: &Results<'_>,
    group: &GroupReceived,
    eye: Option<&EyeYear>,
    pv_m2: f64,
) -> Metrics {
    let mut measured = Vec::new();
    let plain = |measured: &mut Vec<Measured>, quantity, value| {
        let (threshold_w_m2, filtered, band) = (None, false, None);
        measured.push(Measured { quantity, threshold_w_m2, filtered, value, band });
    };
    // Area and place are known even where the light is not.
    plain(&mut measured, Quantity::PvAreaM2, pv_m2);
    if let Some(pv) = &group.pv {
        plain(&mut measured, Quantity::DistanceM, pv.nearest_m);
        plain(&mut measured, Quantity::SubtendedDeg, pv.widest_deg);
    }
    if let Some(eye) = eye {
        plain(&mut measured, Quantity::LuminanceCdM2, eye.luminance_cd_m2.value);
        plain(&mut measured, Quantity::AfterImageRatio, eye.after_image.value);
        plain(&mut measured, Quantity::BurnRatio, eye.burn.value);
    }
    let half_year = results.resolved.project.time.half_year;
    if let (Some(eye), true) = (eye, group.not_evaluated.is_some()) {
        // Photons don't land on what sends them; the eye's irradiance is integrated there.
        let peak = match results.resolved.quantity {
            Irradiance::Surface => eye.irradiance_w_m2,
            Irradiance::FacingBeam => eye.normal_w_m2,
        };
        plain(&mut measured, Quantity::IrradianceWM2, peak.value);
        let thresholds = results.thresholds_w_m2();
        for &t in thresholds {
            measured.extend(eye_times(eye, t, Some(t), half_year));
        }
        let lowest = thresholds.iter().copied().fold(f64::INFINITY, f64::min);
        measured.extend(eye_times(eye, lowest, None, half_year));
    }
    if group.not_evaluated.is_none() {
        let exact = results.receivers().is_some_and(|set| set.is_direct());
        plain(&mut measured, Quantity::IrradianceWM2, group.peak_w_m2);
        for at in &group.thresholds {
            measured.extend(times(at, Some(at.threshold_w_m2), half_year, exact));
        }
        // Rules that name no irradiance: what lies above the lowest threshold counts.
        if let Some(at) = lowest(group) {
            measured.extend(times(at, None, half_year, exact));
        }
    }
    Metrics { class: results.class(&group.name), measured, conditions: conditions(results) }
}

/// The glare above the lowest threshold.
pub fn lowest(group: &GroupReceived) -> Option<&AtThreshold> {
    group.thresholds.iter().min_by(|a, b| a.threshold_w_m2.total_cmp(&b.threshold_w_m2))
}

/// `exact`: integrated, without noise.
fn times(
    at: &AtThreshold,
    threshold_w_m2: Option<f64>,
    half_year: bool,
    exact: bool,
) -> Vec<Measured> {
    let banded = |quantity, v: Banded, factor: f64| Measured {
        quantity,
        threshold_w_m2,
        filtered: false,
        value: v.value * factor,
        band: Some([v.low * factor, v.high * factor]),
    };
    // The filter makes noise smaller: the band of the unfiltered value holds that of the filtered.
    let filtered = |quantity, value: f64, around: Banded, factor: f64| {
        let around = if exact { Banded::exactly(value) } else { around };
        let band = Some([around.low.min(value) * factor, around.high.max(value) * factor]);
        Measured { quantity, threshold_w_m2, filtered: true, value: value * factor, band }
    };
    let mut out = vec![
        banded(Quantity::AnnualH, at.hours, 1.0),
        banded(Quantity::LongestRunMin, at.longest_run_h, 60.0),
        banded(Quantity::SustainedMin, at.longest_run_h, 60.0),
        banded(Quantity::DailyTotalMin, at.longest_day_h, 60.0),
        filtered(Quantity::AnnualH, at.filtered_hours, at.hours, 1.0),
        filtered(Quantity::SustainedMin, at.filtered_run_h, at.longest_run_h, 60.0),
        filtered(Quantity::LongestRunMin, at.filtered_run_h, at.longest_run_h, 60.0),
    ];
    // The months of the mirrored half aren't known.
    if !half_year {
        let months = at.months as f64;
        out.push(Measured { value: months, band: None, ..banded(Quantity::Months, at.hours, 1.0) });
    }
    out
}

/// Times above an irradiance at an eye, in the words of rules that name it or none.
fn eye_times(
    eye: &EyeYear,
    above_w_m2: f64,
    threshold_w_m2: Option<f64>,
    half_year: bool,
) -> Vec<Measured> {
    let mut out = Vec::new();
    for (measure, filtered) in
        [(Measure::Irradiance(above_w_m2), false), (Measure::Filtered(above_w_m2), true)]
    {
        let Some(glare) = eye.time(measure) else { continue };
        let run = glare.longest_run_h * 60.0;
        let day = glare.longest_day_h * 60.0;
        for (quantity, value) in [
            (Quantity::AnnualH, Some(glare.hours)),
            (Quantity::LongestRunMin, Some(run)),
            (Quantity::SustainedMin, Some(run)),
            (Quantity::DailyTotalMin, (!filtered).then_some(day)),
            (Quantity::Months, (!filtered && !half_year).then_some(glare.months() as f64)),
        ] {
            let measured =
                |value| Measured { quantity, threshold_w_m2, filtered, value, band: None };
            out.extend(value.map(measured));
        }
    }
    out
}
