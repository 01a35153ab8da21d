//! Results in sentences: where a receiver is, how long it is dazzled, what a rule says of it.

use super::words::{hours, list, minutes};
use crate::project::Results;
use crate::receivers::clock::Clock;
use crate::receivers::eyes::{EyeTime, EyeYear, Measure};
use crate::receivers::metrics::{conditions, lowest};
use crate::receivers::points::Kind;
use crate::receivers::received::{Banded, GroupReceived};
use crate::rules::{Judged, Limit, Outcome, Profile, Quantity, Verdict};

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

/// A criterion that is met.
pub fn criterion(limit: &Limit, value: f64) -> String {
    format!(
        "{} {}, {} {}",
        limit.quantity.words(),
        number(value, limit.quantity),
        limit.operator.words(),
        number(limit.value, limit.quantity)
    )
}

/// A limit as a planner says it: `50 h of glare a year above 10 W/m²`. `lowest_w_m2`: what counts
/// where the rule names no irradiance.
pub fn limit_words(limit: &Limit, lowest_w_m2: Option<f64>) -> String {
    let value = number(limit.value, limit.quantity);
    // A project without a threshold has no lowest one.
    let lowest_w_m2 = lowest_w_m2.filter(|t| t.is_finite());
    let above = match (limit.threshold_w_m2, lowest_w_m2) {
        (Some(t), _) => format!(" above {t} W/m²"),
        (None, Some(t)) => format!(" above {t} W/m² (the rule names no irradiance)"),
        (None, None) => String::new(),
    };
    match limit.quantity {
        Quantity::SustainedMin => format!("{value} for one glare event{above}"),
        Quantity::LongestRunMin => format!("{value} of glare without a break{above}"),
        Quantity::DailyTotalMin => format!("{value} of glare a day{above}"),
        Quantity::AnnualH => format!("{value} of glare a year{above}"),
        Quantity::Months => format!("{value} with glare{above}"),
        Quantity::LuminanceCdM2 => format!("a luminance of {value}"),
        Quantity::AfterImageRatio => {
            format!("{value} the retinal irradiance from which an after-image is possible")
        }
        Quantity::BurnRatio => {
            format!("{value} the retinal irradiance from which the retina may burn")
        }
        Quantity::IrradianceWM2 => format!("an irradiance of {value}"),
        Quantity::DistanceM => format!("a distance of {value} to the PV"),
        Quantity::PvAreaM2 => format!("a PV area of {value}"),
        Quantity::SubtendedDeg => format!("an angle of {value} that the PV spans"),
    }
}

/// `The limit of 50 h of glare a year above 10 W/m² may be exceeded: 42 h were found, 0 h to 94 h
/// within the noise.`
fn finding(limit: &Limit, judged: &Judged, lowest_w_m2: Option<f64>) -> String {
    let show = |v: f64| number(v, limit.quantity);
    let verb = match (judged.outcome, judged.certain) {
        (Outcome::Exceeded, true) => "is exceeded",
        (Outcome::Exceeded, false) => "is probably exceeded",
        (Outcome::Excused, true) => "is exceeded, which another limit excuses",
        (Outcome::Excused, false) => "is probably exceeded, which another limit excuses",
        (_, true) => "is kept",
        (_, false) => "may be exceeded",
    };
    let mut text = format!("The limit of {} {verb}", limit_words(limit, lowest_w_m2));
    if let Some(value) = judged.value {
        text += &format!(": {} were found", show(value));
    }
    if let Some([low, high]) = judged.band.filter(|[low, high]| low < high) {
        text += &format!(", {} to {} within the noise", show(low), show(high));
    }
    text + "."
}

/// What a rule says of a receiver.
pub fn verdict(
    results: &Results<'_>,
    group: &GroupReceived,
    has_eye: bool,
    profile: &Profile,
    verdict: &Verdict,
) -> String {
    let id = &profile.id;
    if profile.limits.is_empty() {
        return format!("Rule {id} has no numerical limit.");
    }
    if let (Some(reason), false) = (&group.not_evaluated, has_eye) {
        return format!("Rule {id} was not evaluated, because {reason}.");
    }
    let lowest_w_m2 = lowest(group).map(|at| at.threshold_w_m2);
    let judged: Vec<(&Limit, &Judged)> =
        profile.limits.iter().zip(&verdict.limits).filter(|(l, _)| !l.only_informs).collect();
    let counted = || judged.iter().filter(|(l, _)| !l.only_excuses);
    let exceeded = || counted().filter(|(_, j)| j.outcome == Outcome::Exceeded);
    let is_open = |j: &Judged| {
        !j.certain && matches!(j.outcome, Outcome::Exceeded | Outcome::Kept | Outcome::Excused)
    };
    let open = judged.iter().any(|(_, j)| is_open(j));
    let why = why(results, profile, verdict);
    let mut sentences = vec![match verdict.outcome {
        Outcome::Exceeded if exceeded().any(|(_, j)| j.certain) => {
            format!("Rule {id} is exceeded.")
        }
        Outcome::Exceeded => format!("Rule {id} is probably exceeded."),
        Outcome::Kept | Outcome::Excused if open => {
            format!("Rule {id} is kept, but not for certain within the noise.")
        }
        Outcome::Kept | Outcome::Excused => format!("Rule {id} is kept."),
        Outcome::NotApplicable => format!("Rule {id} has no limit for this class of receiver."),
        Outcome::NotEvaluated => format!("Rule {id} was not evaluated{why}."),
    }];
    let told = |(l, j): &&(&Limit, &Judged)| {
        is_open(j) || !l.only_excuses && j.outcome == Outcome::Exceeded
    };
    sentences.extend(judged.iter().filter(told).map(|(l, j)| finding(l, j, lowest_w_m2)));
    let not_evaluated = counted().any(|(_, j)| j.outcome == Outcome::NotEvaluated);
    if verdict.outcome == Outcome::Exceeded && not_evaluated {
        sentences.push(format!("Part of it was not evaluated{why}."));
    }
    if let Some(grade) = &verdict.grade {
        sentences.push(format!("The rule's grade is “{grade}”."));
    }
    sentences.join(" ")
}

/// What a rule assumes, in the words of its conditions, said plainly.
fn condition_words(condition: &str) -> String {
    match condition {
        "all-pv" => "all PV together".into(),
        "clear-sky" => "a sky that is always clear".into(),
        other => other.into(),
    }
}

fn why(results: &Results<'_>, profile: &Profile, verdict: &Verdict) -> String {
    let assumed = conditions(results);
    let mut reasons: Vec<String> = Vec::new();
    for (limit, judged) in profile.limits.iter().zip(&verdict.limits) {
        if judged.outcome != Outcome::NotEvaluated || limit.only_informs {
            continue;
        }
        let missing = limit.conditions.iter().filter(|c| !assumed.contains(c));
        let missing: Vec<String> = missing.map(|c| condition_words(c)).collect();
        let reason = match limit.quantity {
            Quantity::LuminanceCdM2 | Quantity::AfterImageRatio | Quantity::BurnRatio => {
                format!("the {} is computed for observers only", limit.quantity.words())
            }
            _ if !missing.is_empty() => format!("the rule assumes {}", list(missing)),
            Quantity::Months => {
                "only half of the year was computed, so its months are not known".into()
            }
            _ => match limit.threshold_w_m2 {
                Some(t) => {
                    format!("the project has no threshold of {t} W/m² (in glare.thresholds_w_m2)")
                }
                None => format!("the {} was not measured", limit.quantity.words()),
            },
        };
        if !reasons.contains(&reason) {
            reasons.push(reason);
        }
    }
    if reasons.is_empty() { String::new() } else { format!(", because {}", reasons.join("; ")) }
}

/// `(20 min to 30 min within the noise)`, or nothing where there is none.
fn within_noise(v: Banded, show: &dyn Fn(f64) -> String) -> String {
    match v.low < v.high {
        true => format!(" ({} to {} within the noise)", show(v.low), show(v.high)),
        false => String::new(),
    }
}

/// The worst day and the year of a receiver above the lowest threshold, unfiltered, then all rules
/// at a glance: `At worst 24 min on 21 June, and 17 h in the year. Kept: paper-2018. Exceeded: …`.
pub fn at_a_glance(
    clock: &Clock,
    group: &GroupReceived,
    eye: Option<&EyeYear>,
    verdicts: &[&Verdict],
) -> Option<String> {
    let long = |day: Banded, date: u32, year: Banded| {
        if year.value <= 0.0 {
            return format!("No glare{}.", within_noise(year, &hours));
        }
        let in_minutes = |h: f64| minutes(h * 60.0);
        format!(
            "At worst {}{} on {}, and {}{} in the year.",
            in_minutes(day.value),
            within_noise(day, &in_minutes),
            clock.date(date),
            hours(year.value),
            within_noise(year, &hours)
        )
    };
    let irradiance = |t: &&EyeTime| matches!(t.measure, Measure::Irradiance(_));
    let mut text = match (group.not_evaluated.is_some(), lowest(group)) {
        (false, Some(at)) => long(at.longest_day_h, at.longest_day, at.hours),
        _ => {
            // The thresholds of an eye are in the order of the project, its hours fall with them.
            let all = eye.into_iter().flat_map(|e| &e.times).filter(irradiance);
            let g = &all.max_by(|a, b| a.glare.hours.total_cmp(&b.glare.hours))?.glare;
            let [day, year] = [g.longest_day_h, g.hours].map(Banded::exactly);
            long(day, g.longest_day, year)
        }
    };
    let open =
        |v: &Verdict| v.limits.iter().any(|l| !l.certain && l.outcome != Outcome::NotApplicable);
    let kept = |v: &Verdict| matches!(v.outcome, Outcome::Kept | Outcome::Excused);
    let exceeded = |v: &Verdict| v.outcome == Outcome::Exceeded;
    let mut named = |words: &str, which: &dyn Fn(&Verdict) -> bool| {
        let all = verdicts.iter().filter(|v| which(v));
        let ids: Vec<&str> = all.map(|v| v.profile.as_str()).collect();
        if !ids.is_empty() {
            text += &format!(" {words}: {}.", ids.join(", "));
        }
    };
    named("Kept", &|v| kept(v) && !open(v));
    named("Exceeded", &|v| exceeded(v) && !open(v));
    named("Not certain within the noise", &|v| (kept(v) || exceeded(v)) && open(v));
    named("Not evaluated", &|v| v.outcome == Outcome::NotEvaluated);
    named("Without a limit for its class", &|v| v.outcome == Outcome::NotApplicable);
    Some(text)
}

/// How long a receiver has glare with a material, a sentence for each threshold.
pub fn durations(clock: &Clock, group: &GroupReceived) -> Vec<String> {
    if let Some(reason) = &group.not_evaluated {
        return vec![format!("Not evaluated, because {reason}.")];
    }
    let in_minutes = |h: f64| minutes(h * 60.0);
    let mut out = Vec::new();
    for at in &group.thresholds {
        let t = at.threshold_w_m2;
        if at.anywhere.hours <= 0.0 {
            let noise = match at.hours.high > 0.0 {
                true => format!(" (within the noise up to {} in the year)", hours(at.hours.high)),
                false => String::new(),
            };
            out.push(format!("The irradiance never exceeds {t} W/m²{noise}."));
            continue;
        }
        let mut text = format!(
            "{} exceeds {t} W/m² for {}{} on {}, its worst day, and for {}{} in the year.",
            if group.points > 1 { "At the worst point the irradiance" } else { "The irradiance" },
            in_minutes(at.longest_day_h.value),
            within_noise(at.longest_day_h, &in_minutes),
            clock.date(at.longest_day),
            hours(at.hours.value),
            within_noise(at.hours, &hours),
        );
        if group.points > 1 {
            text +=
                &format!(" Somewhere on it this lasts {} in the year", hours(at.anywhere.hours));
            if group.area_m2 > 0.0 {
                text += &format!(", on {:.0} of its {:.0} m²", at.area_m2, group.area_m2);
            }
            text.push('.');
        }
        out.push(text);
    }
    out
}

/// An observer on the PV: photons don't land there, the eye's irradiance is integrated.
pub fn eye_durations(clock: &Clock, eye: &EyeYear) -> Vec<String> {
    let mut out = Vec::new();
    for time in &eye.times {
        let Measure::Irradiance(t) = time.measure else { continue };
        let g = &time.glare;
        if g.hours <= 0.0 {
            out.push(format!("The irradiance at the eye never exceeds {t} W/m²."));
            continue;
        }
        out.push(format!(
            "The irradiance at the eye exceeds {t} W/m² for {} on {}, its worst day, and for {} in the year.",
            minutes(g.longest_day_h * 60.0),
            clock.date(g.longest_day),
            hours(g.hours)
        ));
    }
    out.push("These values are integrated over the PV, without photons and without noise.".into());
    out
}

/// Where a receiver is, and what PV it sees.
pub fn place(group: &GroupReceived) -> String {
    let mut parts = Vec::new();
    match (group.kind, group.points) {
        (_, 0) => {}
        (Kind::Observer, _) if group.in_air > 0 => parts.push("an observer in free air".into()),
        (Kind::Observer, _) => parts.push("an observer on a surface".into()),
        (_, n) if group.area_m2 > 0.0 => {
            parts.push(format!("{n} points on {:.0} m²", group.area_m2));
        }
        (_, n) => parts.push(format!("{n} points")),
    }
    if group.in_air > 0 && group.kind != Kind::Observer {
        parts.push(format!("{} of them in free air", group.in_air));
    }
    match &group.pv {
        Some(pv) => parts.push(format!(
            "the nearest PV in sight is {:.0} m away, the PV spans up to {:.1}° ({:.4} sr)",
            pv.nearest_m, pv.widest_deg, pv.solid_angle_sr
        )),
        None => parts.push("no PV is in sight".into()),
    }
    parts.extend(group.notes.iter().cloned());
    let mut text = parts.join("; ");
    if let Some(first) = text.get(..1) {
        text = format!("{}{}.", first.to_uppercase(), &text[1..]);
    }
    text
}
