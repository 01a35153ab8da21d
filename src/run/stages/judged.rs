//! What the rules say of each observer and region, as data and as sentences.

use std::path::PathBuf;

use glintmap_formats::seal;
use serde::{Deserialize, Serialize};

use super::eyes::read_eyes;
use super::receivers::read_received;
use crate::project::{Candidate, PlannedView, RECEIVERS};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::{EyeTime, EyeYear, EyeYears, Measure};
use crate::receivers::points::Kind;
use crate::receivers::received::{AtThreshold, Banded, GroupReceived};
use crate::report::words::{hours, list, minutes};
use crate::rules::{Class, Judged, Limit, Measured, Metrics, Outcome, Profile, Quantity, Verdict};
use crate::run::error::Error;
use crate::run::job::Job;

/// One rule on one observer or region, with one material.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Judgement {
    /// The material or case.
    pub material: String,
    /// Whether that is the one that others are compared with.
    pub reference: bool,
    /// The observer or region.
    pub receiver: String,
    /// Whom it stands for; none: nobody said, every limit applies.
    pub class: Option<Class>,
    /// Id and version of the rule.
    pub rule: String,
    /// Its version.
    pub version: String,
    /// What it says.
    pub verdict: Verdict,
    /// The same in words.
    pub sentence: String,
    /// Criteria of the rule that are met, in words; they decide nothing by themselves.
    pub criteria: Vec<String>,
}

/// The class that the project file gives a receiver.
pub(super) fn class(job: &Job<'_>, name: &str) -> Option<Class> {
    let p = &job.resolved.project;
    let observer = p.observer.iter().find(|o| o.name == name).map(|o| o.class);
    let region = p.region.iter().find(|r| r.name == name).map(|r| r.class);
    observer.or(region).flatten()
}

/// Judges all observers and regions, and writes `verdicts.json`.
pub(super) fn judge(job: &Job<'_>) -> Result<(Vec<Judgement>, PathBuf), Error> {
    let mut out = Vec::new();
    let pv_m2: f64 = job.site()?.pv.iter().map(|s| s.area_m2).sum();
    for (number, candidate) in job.resolved.candidates.iter().enumerate() {
        let Some(set) = job.resolved.sensors.iter().find(|s| s.name == RECEIVERS) else { break };
        let reference = job.resolved.reference == Some(number);
        let eyes = read_eyes(job, candidate)?;
        for group in &read_received(job, candidate, set)?.groups {
            if group.kind == Kind::Sensors {
                continue;
            }
            let eye = eye_of(&eyes, group);
            let metrics = metrics(job, group, eye, pv_m2);
            for profile in &job.resolved.rules {
                out.push(one(job, candidate, reference, (group, eye), &metrics, profile)?);
            }
        }
    }
    let name = PathBuf::from("verdicts.json");
    let path = job.folder.at(&name);
    let text = serde_json::to_vec_pretty(&out).map_err(std::io::Error::from)?;
    seal::write_bytes(&path, &text).map_err(|source| Error::Write { path, source })?;
    Ok((out, name))
}

/// What was judged, from its file; nothing where there is none.
pub(in crate::run) fn read(job: &Job<'_>) -> Result<Vec<Judgement>, Error> {
    let path = job.folder.at(std::path::Path::new("verdicts.json"));
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
    serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
}

/// What was assumed, in the words of the rules' conditions.
pub(super) fn conditions(job: &Job<'_>) -> Vec<String> {
    let mut out = vec!["all-pv".to_owned()];
    if job.resolved.weather.is_none() {
        out.push("clear-sky".into());
    }
    out
}

/// The eye of an observer; regions have none.
pub(super) fn eye_of<'a>(eyes: &'a EyeYears, group: &GroupReceived) -> Option<&'a EyeYear> {
    let own = |e: &&EyeYear| group.kind == Kind::Observer && e.name == group.name;
    eyes.observers.iter().find(own)
}

fn metrics(job: &Job<'_>, group: &GroupReceived, eye: Option<&EyeYear>, pv_m2: f64) -> Metrics {
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
    let half_year = job.resolved.project.time.half_year;
    if let (Some(eye), true) = (eye, group.not_evaluated.is_some()) {
        // Photons don't land on what sends them; the eye's irradiance is integrated there.
        let peak = match job.resolved.quantity {
            crate::base::Irradiance::Surface => eye.irradiance_w_m2,
            crate::base::Irradiance::FacingBeam => eye.normal_w_m2,
        };
        plain(&mut measured, Quantity::IrradianceWM2, peak.value);
        let thresholds = &job.resolved.project.glare.thresholds_w_m2;
        for &t in thresholds {
            measured.extend(eye_times(eye, t, Some(t), half_year));
        }
        let lowest = thresholds.iter().copied().fold(f64::INFINITY, f64::min);
        measured.extend(eye_times(eye, lowest, None, half_year));
    }
    if group.not_evaluated.is_none() {
        let exact = job.resolved.sensors.iter().any(|s| s.name == RECEIVERS && s.is_direct());
        plain(&mut measured, Quantity::IrradianceWM2, group.peak_w_m2);
        for at in &group.thresholds {
            measured.extend(times(at, Some(at.threshold_w_m2), half_year, exact));
        }
        // Rules that name no irradiance: what lies above the lowest threshold counts.
        if let Some(at) = lowest(group) {
            measured.extend(times(at, None, half_year, exact));
        }
    }
    Metrics { class: class(job, &group.name), measured, conditions: conditions(job) }
}

fn lowest(group: &GroupReceived) -> Option<&AtThreshold> {
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

fn one(
    job: &Job<'_>,
    candidate: &Candidate,
    reference: bool,
    (group, eye): (&GroupReceived, Option<&EyeYear>),
    metrics: &Metrics,
    profile: &Profile,
) -> Result<Judgement, Error> {
    let verdict = profile.judge(metrics);
    let criteria = profile
        .limits
        .iter()
        .zip(&verdict.limits)
        .filter(|(limit, judged)| limit.only_informs && judged.outcome == Outcome::Exceeded)
        .map(|(limit, judged)| criterion(limit, judged.value.unwrap_or(0.0)))
        .collect();
    Ok(Judgement {
        material: candidate.name.clone(),
        reference,
        receiver: group.name.clone(),
        class: metrics.class,
        rule: profile.id.clone(),
        version: profile.version.clone(),
        sentence: sentence(job, group, eye.is_some(), profile, &verdict),
        verdict,
        criteria,
    })
}

fn number(value: f64, quantity: Quantity) -> String {
    match quantity {
        Quantity::AnnualH => hours(value),
        _ if quantity.unit() == "min" => minutes(value),
        Quantity::Months => format!("{value:.0} months"),
        Quantity::SubtendedDeg => format!("{value:.1}°"),
        _ => {
            let digits = if value.abs() < 10.0 { 1 } else { 0 };
            match value.abs() {
                large if large >= 1e6 => format!("{:.1} million {}", value / 1e6, quantity.unit()),
                large if large >= 1e4 => format!("{:.0} thousand {}", value / 1e3, quantity.unit()),
                _ => format!("{value:.digits$} {}", quantity.unit()),
            }
        }
    }
}

fn criterion(limit: &Limit, value: f64) -> String {
    format!(
        "{} {}, {} {}",
        limit.quantity.words(),
        number(value, limit.quantity),
        limit.operator.words(),
        number(limit.value, limit.quantity)
    )
}

/// `Within paper-2018.` or what of it is exceeded, or why it says nothing.
fn sentence(
    job: &Job<'_>,
    group: &GroupReceived,
    has_eye: bool,
    profile: &Profile,
    verdict: &Verdict,
) -> String {
    let id = &profile.id;
    if profile.limits.is_empty() {
        return format!("{id} has no numerical criterion.");
    }
    if let (Some(reason), false) = (&group.not_evaluated, has_eye) {
        return format!("{id}: not evaluated, because {reason}.");
    }
    let of = |outcome: Outcome| {
        profile
            .limits
            .iter()
            .zip(&verdict.limits)
            .filter(move |(l, j)| !l.only_informs && !l.only_excuses && j.outcome == outcome)
    };
    let said = |(limit, judged): (&Limit, &Judged)| {
        let show = |v: f64| number(v, limit.quantity);
        let mut text = limit.quantity.words().to_owned();
        if limit.quantity.is_time() {
            text += &above(group, limit);
        }
        if let Some(value) = judged.value {
            text += &format!(": {}", show(value));
        }
        if let Some([low, high]) = judged.band.filter(|[low, high]| low < high) {
            text += &format!(" ({} to {} within the noise)", show(low), show(high));
        }
        text + &format!(", {} {} is too much", limit.operator.words(), show(limit.value))
    };
    let mut text = match verdict.outcome {
        Outcome::Exceeded => {
            format!("Above {id}: {}.", list(of(Outcome::Exceeded).map(said)))
        }
        Outcome::Kept => format!("Within {id}."),
        Outcome::Excused => format!("Within {id}, because another limit excuses it."),
        Outcome::NotApplicable => format!("{id} has no limit for this class."),
        Outcome::NotEvaluated => format!("{id}: not evaluated{}.", why(job, profile, verdict)),
    };
    let open: Vec<String> = profile
        .limits
        .iter()
        .zip(&verdict.limits)
        .filter(|(l, j)| {
            !l.only_informs
                && !j.certain
                && matches!(j.outcome, Outcome::Exceeded | Outcome::Kept | Outcome::Excused)
        })
        .map(|(l, j)| match j.outcome {
            Outcome::Kept => said((l, j)),
            _ => l.id.clone(),
        })
        .collect();
    if !open.is_empty() {
        text += &format!(" Undecided, as the noise reaches over the limit: {}.", list(open));
    }
    if verdict.outcome == Outcome::Exceeded && of(Outcome::NotEvaluated).count() > 0 {
        text += &format!(" Not evaluated{}.", why(job, profile, verdict));
    }
    if let Some(grade) = &verdict.grade {
        text += &format!(" Its grade: {grade}.");
    }
    text
}

/// What the irradiance must exceed for time to count.
fn above(group: &GroupReceived, limit: &Limit) -> String {
    match (limit.threshold_w_m2, lowest(group)) {
        (Some(t), _) => format!(" above {t} W/m²"),
        (None, Some(at)) => {
            format!(" above {} W/m² (the rule names no irradiance)", at.threshold_w_m2)
        }
        _ => String::new(),
    }
}

fn why(job: &Job<'_>, profile: &Profile, verdict: &Verdict) -> String {
    let assumed = conditions(job);
    let mut reasons: Vec<String> = Vec::new();
    for (limit, judged) in profile.limits.iter().zip(&verdict.limits) {
        if judged.outcome != Outcome::NotEvaluated || limit.only_informs {
            continue;
        }
        let missing: Vec<String> =
            limit.conditions.iter().filter(|c| !assumed.contains(c)).cloned().collect();
        let reason = match limit.quantity {
            Quantity::LuminanceCdM2 | Quantity::AfterImageRatio | Quantity::BurnRatio => {
                format!("{} is computed for observers only", limit.quantity.words())
            }
            _ if !missing.is_empty() => format!("it assumes {}", list(missing)),
            Quantity::Months => "the months of half a year, doubled, are not known".into(),
            _ => match limit.threshold_w_m2 {
                Some(t) => format!("{t} W/m² is not among glare.thresholds_w_m2"),
                None => format!("{} was not measured", limit.quantity.words()),
            },
        };
        if !reasons.contains(&reason) {
            reasons.push(reason);
        }
    }
    if reasons.is_empty() { String::new() } else { format!(": {}", reasons.join("; ")) }
}

/// All rules in a line: `24 min on 21 June, 17 h in the year: within paper-2018; above …`. The
/// numbers are those above the lowest threshold, unfiltered, with what the noise makes of them.
pub(super) fn in_a_line(
    clock: &Clock,
    group: &GroupReceived,
    eye: Option<&EyeYear>,
    judgements: &[&Judgement],
) -> Vec<String> {
    let long = |day: Banded, date: u32, year: Banded| {
        let band = |v: Banded, show: &dyn Fn(f64) -> String| match v.low < v.high {
            true => format!(" ({} to {})", show(v.low), show(v.high)),
            false => String::new(),
        };
        let in_minutes = |h: f64| minutes(h * 60.0);
        if year.value <= 0.0 {
            return format!("no glare{}", band(year, &hours));
        }
        let (on, day_band) = (clock.date(date), band(day, &in_minutes));
        let (in_day, in_year) = (in_minutes(day.value), hours(year.value));
        format!("{in_day}{day_band} on {on}, {in_year}{} in the year", band(year, &hours))
    };
    let irradiance = |t: &&EyeTime| matches!(t.measure, Measure::Irradiance(_));
    let numbers = match (group.not_evaluated.is_some(), lowest(group)) {
        (false, Some(at)) => long(at.longest_day_h, at.longest_day, at.hours),
        // The thresholds of an eye are in the order of the project, its hours fall with them.
        _ => match eye
            .into_iter()
            .flat_map(|e| &e.times)
            .filter(irradiance)
            .max_by(|a, b| a.glare.hours.total_cmp(&b.glare.hours))
        {
            Some(EyeTime { glare: g, .. }) => {
                long(Banded::exactly(g.longest_day_h), g.longest_day, Banded::exactly(g.hours))
            }
            None => return Vec::new(),
        },
    };
    let open = |j: &Judgement| {
        j.verdict.limits.iter().any(|l| !l.certain && l.outcome != Outcome::NotApplicable)
    };
    let named = |word: &str, which: &dyn Fn(&Judgement) -> bool| {
        let ids: Vec<&str> =
            judgements.iter().filter(|j| which(j)).map(|j| j.rule.as_str()).collect();
        if ids.is_empty() { String::new() } else { format!("{word} {}", ids.join(", ")) }
    };
    let is = |j: &Judgement, outcomes: &[Outcome]| outcomes.contains(&j.verdict.outcome);
    let kept = [Outcome::Kept, Outcome::Excused];
    let parts = [
        named("within", &|j| is(j, &kept) && !open(j)),
        named("above", &|j| is(j, &[Outcome::Exceeded]) && !open(j)),
        named("undecided", &|j| (is(j, &kept) || is(j, &[Outcome::Exceeded])) && open(j)),
        named("not evaluated:", &|j| is(j, &[Outcome::NotEvaluated])),
        named("no limit for its class in", &|j| is(j, &[Outcome::NotApplicable])),
    ];
    let said: Vec<String> = parts.into_iter().filter(|p| !p.is_empty()).collect();
    let mut text = numbers;
    if !said.is_empty() {
        text += &format!(": {}", said.join("; "));
    }
    text.push('.');
    vec![text.replacen("no glare", "No glare", 1)]
}

/// A receiver with a material in a sentence: how long at worst, when, how much in the year.
pub(super) fn told(clock: &Clock, group: &GroupReceived) -> Vec<String> {
    if let Some(reason) = &group.not_evaluated {
        return vec![format!("Not evaluated: {reason}.")];
    }
    let mut out = Vec::new();
    for at in &group.thresholds {
        let t = at.threshold_w_m2;
        if at.anywhere.hours <= 0.0 {
            let noise = if at.hours.high > 0.0 {
                format!(" (the noise allows up to {} in the year)", hours(at.hours.high))
            } else {
                String::new()
            };
            out.push(format!("Never above {t} W/m²{noise}."));
            continue;
        }
        let band = |v: Banded, show: &dyn Fn(f64) -> String| {
            if v.low < v.high {
                format!(" ({} to {} within the noise)", show(v.low), show(v.high))
            } else {
                String::new()
            }
        };
        let in_minutes = |h: f64| minutes(h * 60.0);
        let where_ = if group.points > 1 { " at its worst point" } else { "" };
        let mut text = format!(
            "Above {t} W/m²{where_} for {}{} on {}, {}{} in the year",
            in_minutes(at.longest_day_h.value),
            band(at.longest_day_h, &in_minutes),
            clock.date(at.longest_day),
            hours(at.hours.value),
            band(at.hours, &hours),
        );
        if group.points > 1 {
            text += &format!("; {} in the year anywhere on it", hours(at.anywhere.hours));
            if group.area_m2 > 0.0 {
                text += &format!(", {:.0} of {:.0} m²", at.area_m2, group.area_m2);
            }
        }
        text.push('.');
        out.push(text);
    }
    out
}

/// The set of observers and regions, if there is one.
pub(in crate::run) fn receivers<'a>(job: &'a Job<'_>) -> Option<&'a PlannedView> {
    job.resolved.sensors.iter().find(|s| s.name == RECEIVERS)
}
