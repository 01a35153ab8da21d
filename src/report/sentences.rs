//! Results in sentences: where a receiver is, how long it is dazzled, what a rule says of it.

use super::judgements::Judgement;
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

/// `Within paper-2018.` or what of it is exceeded, or why it says nothing.
pub fn verdict(
    results: &Results<'_>,
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
        Outcome::NotEvaluated => format!("{id}: not evaluated{}.", why(results, profile, verdict)),
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
        text += &format!(" Not evaluated{}.", why(results, profile, verdict));
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

fn why(results: &Results<'_>, profile: &Profile, verdict: &Verdict) -> String {
    let assumed = conditions(results);
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
pub fn in_a_line(
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
pub fn durations(clock: &Clock, group: &GroupReceived) -> Vec<String> {
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

/// An observer on the PV: photons don't land there, the eye's irradiance is integrated.
pub fn eye_durations(clock: &Clock, eye: &EyeYear) -> Vec<String> {
    let mut out = Vec::new();
    for time in &eye.times {
        let Measure::Irradiance(t) = time.measure else { continue };
        let g = &time.glare;
        if g.hours <= 0.0 {
            out.push(format!("Never above {t} W/m² at the eye."));
            continue;
        }
        out.push(format!(
            "Above {t} W/m² at the eye for {} on {}, {} in the year.",
            minutes(g.longest_day_h * 60.0),
            clock.date(g.longest_day),
            hours(g.hours)
        ));
    }
    out.push("Integrated over the PV, without photons.".into());
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
