//! The report's part for people: what reaches each observer and region, when, from which PV, and
//! what the rules say.

use super::document::{Figure, Mark, Point, Section, Table, link};
use super::error::Error;
use super::judgements::Judgement;
use super::sentences;
use super::words::{self, hours, minutes};
use crate::base::MONTHS;
use crate::glare::Lengths;
use crate::project::artifacts::{ReceiverFile, ReceiverId};
use crate::project::{Candidate, PlannedView, RECEIVERS, Results};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::{EyeYear, EyeYears, Measure, read_eyes};
use crate::receivers::metrics::eye_of;
use crate::receivers::points::Kind;
use crate::receivers::received::{Received, read_received};
use crate::rules::Outcome;
use crate::volume::TimeAxis;

/// Episodes that a receiver's table lists.
const EPISODES: usize = 5;

/// "In short", then the observers and regions one by one; nothing where there are none.
pub fn sections(results: &Results<'_>, judgements: &[Judgement]) -> Result<Vec<Section>, Error> {
    let Some(set) = results.receivers() else { return Ok(vec![nobody()]) };
    let mut all: Vec<(&Candidate, Received)> = Vec::new();
    for candidate in &results.resolved.candidates {
        all.push((candidate, read_received(results, candidate, set)?));
    }
    let eyes: Vec<EyeYears> = results
        .resolved
        .candidates
        .iter()
        .map(|c| read_eyes(results, c))
        .collect::<Result<_, _>>()?;
    let clock = Clock::new(&results.resolved.project.site, results.timeline.year);
    let count = all.first().map_or(0, |(_, r)| r.groups.len());
    let mut parts = Vec::new();
    for number in 0..count {
        parts.push(receiver(results, set, (&all, &eyes), number, &clock, judgements)?);
    }
    let each = Section {
        heading: "Observers and regions".into(),
        text: vec![
            "A region is represented by points on its surfaces. Its times are those of the point with the most glare, unless the text says that they hold somewhere on it.".into(),
        ],
        tables: std::iter::once(totals(&all, &clock)).chain(by_month(results, &all)).collect(),
        parts,
        ..Section::default()
    };
    Ok(vec![in_short(results, judgements, &all), each])
}

fn nobody() -> Section {
    Section {
        heading: "Observers and regions".into(),
        text: vec![
            "The project names no observer and no region. Add [[observer]] and [[region]] to project.toml (a window, a neighbour's façade, a road, a plot) to read here who is dazzled, when, for how long, and what the rules say.".into(),
        ],
        ..Section::default()
    }
}

fn mark(j: &Judgement) -> Mark {
    let open = j.verdict.limits.iter().any(|l| !l.certain && l.outcome != Outcome::NotApplicable);
    match j.verdict.outcome {
        Outcome::NotEvaluated => Mark::Open,
        Outcome::Exceeded if !open => Mark::Exceeded,
        Outcome::Kept | Outcome::Excused if !open => Mark::Kept,
        Outcome::NotApplicable => Mark::Plain,
        _ => Mark::Open,
    }
}

/// For each material: whom it dazzles more than the first rule allows, and whom it doesn't.
fn in_short(
    results: &Results<'_>,
    judgements: &[Judgement],
    all: &[(&Candidate, Received)],
) -> Section {
    let mut points = Vec::new();
    for (candidate, _) in all {
        for rule in &results.resolved.rules {
            let mine: Vec<&Judgement> = judgements
                .iter()
                .filter(|j| j.material == candidate.name && j.rule == rule.id)
                .collect();
            let names = |outcome: &dyn Fn(Outcome) -> bool| -> Vec<String> {
                mine.iter()
                    .filter(|j| outcome(j.verdict.outcome))
                    .map(|j| match mark(j) {
                        Mark::Open if j.verdict.outcome != Outcome::NotEvaluated => {
                            format!("{} (not certain within the noise)", j.receiver)
                        }
                        _ => j.receiver.clone(),
                    })
                    .collect()
            };
            let over = names(&|o| o == Outcome::Exceeded);
            let within = names(&|o| matches!(o, Outcome::Kept | Outcome::Excused));
            let open = names(&|o| o == Outcome::NotEvaluated);
            let mut text = String::new();
            for (lead, list) in
                [("Exceeded at ", &over), ("Kept at ", &within), ("Not evaluated at ", &open)]
            {
                if !list.is_empty() {
                    text += &format!("{lead}{}. ", words::list(list.iter().cloned()));
                }
            }
            if text.is_empty() {
                text = "The rule has no limit that applies here.".into();
            }
            let mark = match (over.is_empty(), within.is_empty(), open.is_empty()) {
                (false, _, _) => Mark::Exceeded,
                (_, false, true) => Mark::Kept,
                _ => Mark::Open,
            };
            let today = if mine.iter().any(|j| j.reference) { " (for comparison)" } else { "" };
            points.push(Point {
                lead: format!("{}{today}, rule {}:", candidate.name, rule.id),
                text: text.trim_end().to_owned(),
                mark,
            });
        }
    }
    let mut text = Vec::new();
    for rule in &results.resolved.rules {
        let status = serde_json::to_value(rule.status).ok();
        let status = status.as_ref().and_then(|s| s.as_str()).unwrap_or("");
        text.push(format!(
            "Rule {} (version {}, {status}) is taken from: {}. {}",
            rule.id, rule.version, rule.source, rule.note
        ));
    }
    let rules = Section { heading: "The rules".into(), text, ..Section::default() };
    Section { heading: "In short".into(), points, parts: vec![rules], ..Section::default() }
}

/// A row for each material and receiver.
fn totals(all: &[(&Candidate, Received)], clock: &Clock) -> Table {
    let mut table = Table {
        head: [
            "receiver",
            "material",
            "energy (Wh/m²)",
            "peak (W/m²)",
            "exceeded for 30 min of the worst day (W/m²)",
            "exceeded for 50 h of the year (W/m²)",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: Vec::new(),
    };
    let Some((_, first)) = all.first() else { return table };
    for at in first.groups.first().iter().flat_map(|g| &g.thresholds) {
        let t = at.threshold_w_m2;
        table.head.push(format!("above {t} W/m²: hours a year"));
        table.head.push("worst day".into());
        table.head.push("area".into());
    }
    for number in 0..first.groups.len() {
        for (candidate, received) in all {
            let Some(g) = received.groups.get(number).filter(|g| g.kind != Kind::Sensors) else {
                continue;
            };
            let mut row = vec![g.name.clone(), candidate.name.clone()];
            if g.not_evaluated.is_some() {
                row.push("not evaluated".into());
                row.resize(table.head.len(), "–".into());
                table.rows.push(row);
                continue;
            }
            row.push(format!("{:.0}", g.annual_max_wh_m2));
            row.push(format!("{:.1}", g.peak_w_m2));
            row.push(format!("{:.1}", g.exceeded_30min_w_m2));
            row.push(format!("{:.1}", g.exceeded_50h_w_m2));
            for at in &g.thresholds {
                row.push(hours(at.hours.value));
                row.push(if at.longest_day_h.value > 0.0 {
                    let long = minutes(at.longest_day_h.value * 60.0);
                    format!("{long}, {}", clock.date(at.longest_day))
                } else {
                    "–".into()
                });
                row.push(if g.area_m2 > 0.0 {
                    format!("{:.0} m²", at.area_m2)
                } else {
                    "–".into()
                });
            }
            table.rows.push(row);
        }
    }
    table
}

/// Hours of glare in each month, a row for each material and receiver that is dazzled; not where
/// the months of half the year aren't known.
fn by_month(results: &Results<'_>, all: &[(&Candidate, Received)]) -> Option<Table> {
    if results.resolved.project.time.half_year {
        return None;
    }
    let mut head: Vec<String> =
        ["receiver", "material", "above (W/m²)"].map(str::to_owned).to_vec();
    head.extend(MONTHS.map(|month| format!("{}. (h)", &month[..3])));
    let mut table = Table { head, rows: Vec::new() };
    for number in 0..all.first().map_or(0, |(_, r)| r.groups.len()) {
        for (candidate, received) in all {
            let Some(g) = received.groups.get(number).filter(|g| g.kind != Kind::Sensors) else {
                continue;
            };
            for at in g.thresholds.iter().filter(|at| at.anywhere.hours > 0.0) {
                let mut row =
                    vec![g.name.clone(), candidate.name.clone(), at.threshold_w_m2.to_string()];
                row.extend(at.anywhere.months_h.map(|h| match h {
                    h if h > 0.0 => format!("{h:.1}"),
                    _ => "–".into(),
                }));
                table.rows.push(row);
            }
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

fn receiver(
    results: &Results<'_>,
    set: &PlannedView,
    (all, eyes): (&[(&Candidate, Received)], &[EyeYears]),
    number: usize,
    clock: &Clock,
    judgements: &[Judgement],
) -> Result<Section, Error> {
    let mut out = Section::default();
    let Some(first) = all.first().and_then(|(_, r)| r.groups.get(number)) else { return Ok(out) };
    out.heading = match results.class(&first.name) {
        Some(class) => {
            let word = serde_json::to_value(class).ok();
            format!("{} ({})", first.name, word.as_ref().and_then(|w| w.as_str()).unwrap_or(""))
        }
        None => first.name.clone(),
    };
    out.text.push(sentences::place(first));
    let has_eye = eyes.iter().any(|e| eye_of(e, first).is_some());
    if first.not_evaluated.is_some() && !has_eye {
        out.points.extend(sentences::durations(clock, first).into_iter().map(|text| Point {
            text,
            mark: Mark::Open,
            ..Point::default()
        }));
        return Ok(out);
    }
    let mut charts = Vec::new();
    let mut looks = looks_table();
    for ((candidate, received), eyes) in all.iter().zip(eyes) {
        let Some(group) = received.groups.get(number) else { continue };
        let eye = eye_of(eyes, group);
        let text = match (eye, group.not_evaluated.is_some()) {
            (Some(eye), true) => sentences::eye_durations(clock, eye),
            _ => sentences::durations(clock, group),
        };
        let of_material: Vec<&Judgement> = judgements
            .iter()
            .filter(|j| j.material == candidate.name && j.receiver == group.name)
            .collect();
        let verdicts: Vec<_> = of_material.iter().map(|j| &j.verdict).collect();
        let glance = sentences::at_a_glance(clock, group, eye, &verdicts);
        out.points.push(Point {
            lead: format!("{}:", candidate.name),
            text: glance.into_iter().chain(text).collect::<Vec<_>>().join(" "),
            mark: Mark::Plain,
        });
        if let Some(eye) = eye {
            looks.rows.push(look(results, clock, &candidate.name, eye)?);
            let png = results.folder.receiver(
                &candidate.name,
                RECEIVERS,
                ReceiverId { number, name: &group.name },
                ReceiverFile::HazardChart,
            );
            if eye.luminance_cd_m2.value > 0.0 && results.folder.at(&png).exists() {
                charts.push(Figure {
                    path: link(&png),
                    caption: format!("{}, {}: hazard to the eye", group.name, candidate.name),
                });
            }
        }
        for j in of_material {
            out.points.push(Point {
                text: match j.criteria.is_empty() {
                    true => j.sentence.clone(),
                    false => {
                        format!(
                            "{} Criteria of the rule that are met: {}.",
                            j.sentence,
                            j.criteria.join("; ")
                        )
                    }
                },
                mark: mark(j),
                ..Point::default()
            });
        }
        // An empty chart says no more than the sentence.
        let dazzles = group.thresholds.iter().any(|t| t.anywhere.hours > 0.0);
        for (chart, words) in [
            (ReceiverFile::StrengthChart, "when it is lit, and how strongly"),
            (ReceiverFile::SurfaceChart, "which PV it is"),
        ] {
            let id = ReceiverId { number, name: &group.name };
            let png = results.folder.receiver(&candidate.name, &set.name, id, chart);
            if dazzles && results.folder.at(&png).exists() {
                charts.push(Figure {
                    path: link(&png),
                    caption: format!(
                        "{}, {}: {words}, by day and clock time",
                        group.name, candidate.name
                    ),
                });
            }
        }
    }
    out.figures = charts;
    out.tables.extend((!looks.rows.is_empty()).then_some(looks));
    out.tables.extend(episodes(results, all, number, clock)?);
    Ok(out)
}

/// What the eye of an observer sees, a row for each material.
fn looks_table() -> Table {
    Table {
        head: [
            "material",
            "at the eye (W/m²)",
            "brightest patch (cd/m²)",
            "when",
            "above 30 kcd/m²",
            "above 50 kcd/m²",
            "after-image possible",
            "burn of the retina possible",
            "veil (cd/m²)",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: Vec::new(),
    }
}

fn look(
    results: &Results<'_>,
    clock: &Clock,
    material: &str,
    eye: &EyeYear,
) -> Result<Vec<String>, Error> {
    let timeline = results.timeline;
    let at =
        |t: usize| timeline.steps.get(t).map_or_else(String::new, |s| clock.show(s.day, s.hour));
    let long = |measure| match eye.time(measure) {
        Some(g) if g.hours > 0.0 => {
            let day = minutes(g.longest_day_h * 60.0);
            format!("{} a year, {day} on {}", hours(g.hours), clock.date(g.longest_day))
        }
        _ => "never".into(),
    };
    if eye.luminance_cd_m2.value <= 0.0 {
        let mut row = vec![material.to_owned()];
        row.extend(["0", "0", "–", "never", "never", "never", "never", "0"].map(str::to_owned));
        return Ok(row);
    }
    Ok(vec![
        material.to_owned(),
        format!("{:.1}", eye.irradiance_w_m2.value),
        format!("{:.2e}", eye.luminance_cd_m2.value),
        at(eye.luminance_cd_m2.at),
        long(Measure::Luminance(30_000.0)),
        long(Measure::Luminance(50_000.0)),
        long(Measure::Yellow),
        long(Measure::Red),
        format!("{:.0}", eye.veil_cd_m2.value),
    ])
}

/// The longest times at which it is dazzled anywhere, at the lowest threshold that is exceeded.
fn episodes(
    results: &Results<'_>,
    all: &[(&Candidate, Received)],
    number: usize,
    clock: &Clock,
) -> Result<Option<Table>, Error> {
    let timeline = results.timeline;
    let lengths = Lengths::of(&TimeAxis::from(timeline))?;
    let mut table = Table {
        head: ["material", "above (W/m²)", "from", "to", "duration", "peak (W/m²)", "mostly from"]
            .map(str::to_owned)
            .to_vec(),
        rows: Vec::new(),
    };
    for (candidate, received) in all {
        let Some(group) = received.groups.get(number) else { continue };
        let lowest =
            group.thresholds.iter().min_by(|a, b| a.threshold_w_m2.total_cmp(&b.threshold_w_m2));
        let Some(at) = lowest else { continue };
        for e in at.episodes.iter().take(EPISODES) {
            let show = |t: usize| {
                timeline.steps.get(t).map_or_else(String::new, |s| clock.show(s.day, s.hour))
            };
            table.rows.push(vec![
                candidate.name.clone(),
                at.threshold_w_m2.to_string(),
                show(e.first),
                show(e.last),
                minutes(lengths.hours(e.first..=e.last) * 60.0),
                format!("{:.1}", e.peak_w_m2),
                e.surface.as_ref().map_or_else(
                    || "–".into(),
                    |(name, share)| format!("{name} ({:.0} %)", share * 100.0),
                ),
            ]);
        }
    }
    Ok((!table.rows.is_empty()).then_some(table))
}
