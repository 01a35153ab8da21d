//! The document: numbers per material and view, the longest events, and the pictures.

use glintmap_formats::seal;
use serde_json::json;

use super::judged::{self, Judgement};
use super::moments;
use super::people;
use super::photons::Traced;
use super::pictures::read;
use crate::base::{Grid, Provenance, SpectralBasis};
use crate::project::{Candidate, PlannedMoment, PlannedView, RECEIVERS, Resolved, WordOr};
use crate::report::{Document, Figure, Section, Table, html};
use crate::run::error::Error;
use crate::run::job::{Job, Made};

/// Events that the report lists for a material, view and threshold.
const EVENTS: usize = 5;

/// Judges the observers and regions: `verdicts.json`.
pub(in crate::run) fn verdicts(job: &Job<'_>) -> Result<Made, Error> {
    let (judgements, name) = judged::judge(job)?;
    Ok(Made::new(vec![name], json!({ "verdicts": judgements.len() })))
}

/// Writes `report.html`.
pub(in crate::run) fn report(job: &Job<'_>, key: &str) -> Result<Made, Error> {
    let judgements = judged::read(job)?;
    let document = document(job, key, &judgements)?;
    let name = std::path::PathBuf::from("report.html");
    let path = job.folder.at(&name);
    seal::write_bytes(&path, html(&document).as_bytes())
        .map_err(|source| Error::Write { path, source })?;
    Ok(Made::new(vec![name], json!({ "verdicts": judgements.len() })))
}

fn document(job: &Job<'_>, key: &str, judgements: &[Judgement]) -> Result<Document, Error> {
    let resolved = job.resolved;
    let p = &resolved.project;
    let timeline = job.timeline()?;
    let mut document = Document {
        title: format!("Glare from photovoltaics: {}", p.site.name),
        subtitle: format!(
            "{:.4}° N, {:.4}° E · {} · {} suns{} · irradiance {}",
            p.site.latitude,
            p.site.longitude,
            p.time.year,
            timeline.steps.len(),
            if p.time.half_year { " of half a year, doubled" } else { "" },
            match &p.time.irradiance {
                WordOr::Word(strength) => strength.name(),
                WordOr::Table(_) => "as in the project file",
            },
        ),
        draft: resolved.is_draft(),
        sections: Vec::new(),
        provenance: format!("{} · settings {key} · seed {}", Provenance::PROGRAM, p.photons.seed),
    };
    document.sections.extend(people::sections(job, judgements)?);
    if job.resolved.needs_photons() {
        document.sections.push(photons(job)?);
    }
    for view in &resolved.views {
        document.sections.push(numbers(job, view)?);
    }
    for candidate in &resolved.candidates {
        document.sections.push(pictures_of(job, candidate)?);
    }
    document.sections.extend(moments(job));
    document.sections.push(limits_of_it(job));
    Ok(document)
}

fn photons(job: &Job<'_>) -> Result<Section, Error> {
    let mut table = Table {
        head: ["material", "photons sent", "stored", "flux landed", "absorbed", "blocked"]
            .map(str::to_owned)
            .to_vec(),
        rows: Vec::new(),
    };
    for candidate in &job.resolved.candidates {
        let path = job.folder.at(&job.folder.tally(&candidate.name));
        let text =
            std::fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
        let traced: Traced = serde_json::from_slice(&text)
            .map_err(|e| Error::Manifest { path, message: e.to_string() })?;
        let t = traced.tally;
        let share =
            |part: f64| format!("{:.2} %", 100.0 * part / t.sent.flux_w.max(f64::MIN_POSITIVE));
        table.rows.push(vec![
            candidate.name.clone(),
            t.sent.photons.to_string(),
            t.stored.photons.to_string(),
            share(t.stored.flux_w),
            share(t.absorbed.flux_w),
            share(t.blocked.flux_w),
        ]);
    }
    Ok(Section {
        heading: "What the PV does with the sun".into(),
        text: vec![format!(
            "Shares of the sunlight that falls onto the planes of the PV over all computed suns. “Landed” is what reaches a surface within {} m of the PV.",
            job.resolved.trace.max_path_m
        )],
        tables: vec![table],
        ..Section::default()
    })
}

pub(super) fn largest(grid: &Grid<f32>) -> f32 {
    grid.data().iter().copied().fold(0.0, f32::max)
}

fn numbers(job: &Job<'_>, view: &PlannedView) -> Result<Section, Error> {
    let resolved = job.resolved;
    let mut table = Table {
        head: vec!["material".into(), "annual, largest (Wh/m²)".into(), "peak (W/m²)".into()],
        rows: Vec::new(),
    };
    for t in &resolved.project.glare.thresholds_w_m2 {
        table.head.push(format!("above {t} W/m²: most hours a year"));
        table.head.push("longest event (h)".into());
        table.head.push("longest without a break (h)".into());
        table.head.push("events".into());
    }
    let mut events = Vec::new();
    for candidate in &resolved.candidates {
        let map = |file: &str, channel: &str| {
            read(job, &job.folder.map(&candidate.name, &view.name, file), channel)
        };
        let mut row = vec![candidate.name.clone()];
        row.push(format!("{:.0}", largest(&map("annual.exr", "annual.wh_m2")?)));
        let peak = map("peak.exr", super::render::peak_channel(resolved.quantity))?;
        row.push(format!("{:.1}", largest(&peak)));
        for &t in &resolved.project.glare.thresholds_w_m2 {
            for name in ["cumulative", "sustained", "longest_run"] {
                let file = format!("glare-{t}/{name}.exr");
                row.push(format!("{:.2}", largest(&map(&file, &format!("{name}.h"))?)));
            }
            let list = read_events(job, candidate, view, t)?;
            row.push(list.len().to_string());
            events.push((candidate.name.clone(), t, list));
        }
        table.rows.push(row);
    }
    let mut section = Section {
        heading: format!("Numbers in the view “{}”", view.name),
        text: vec![format!(
            "The largest value of any pixel. Durations come from the irradiance smoothed in space and time, as in the published method{}.",
            if view.is_direct() { "" } else { "; a pixel with few photons can stand out" }
        )],
        tables: vec![table],
        ..Section::default()
    };
    section.tables.extend(super::verdicts::table(job, view)?);
    section.tables.extend(longest_events(&events));
    Ok(section)
}

/// What the report needs of a line of `events.csv`.
struct Event {
    first: usize,
    last: usize,
    first_at: String,
    last_at: String,
    duration_h: f64,
    pixels: u64,
    peak_w_m2: f64,
}

fn read_events(
    job: &Job<'_>,
    candidate: &Candidate,
    view: &PlannedView,
    threshold: f64,
) -> Result<Vec<Event>, Error> {
    let name = job.folder.glare(&candidate.name, &view.name, threshold, "events.csv");
    let path = job.folder.at(&name);
    let text = std::fs::read_to_string(&path)
        .map_err(|source| Error::Read { path: path.clone(), source })?;
    let parse = |line: &str| -> Option<Event> {
        let mut words = line.split(',');
        Some(Event {
            first: words.next()?.parse().ok()?,
            last: words.next()?.parse().ok()?,
            pixels: words.nth(1)?.parse().ok()?,
            peak_w_m2: words.next()?.parse().ok()?,
            duration_h: words.nth(10)?.parse().ok()?,
            first_at: words.next()?.to_owned(),
            last_at: words.next()?.to_owned(),
        })
    };
    text.lines()
        .enumerate()
        .skip(1)
        .map(|(i, line)| {
            parse(line).ok_or_else(|| Error::Manifest {
                path: path.clone(),
                message: format!("line {} is no event", i + 1),
            })
        })
        .collect()
}

fn longest_events(all: &[(String, f64, Vec<Event>)]) -> Option<Table> {
    let mut table = Table {
        head: ["material", "above (W/m²)", "from", "to", "duration (h)", "pixels", "peak (W/m²)"]
            .map(str::to_owned)
            .to_vec(),
        rows: Vec::new(),
    };
    for (name, threshold, list) in all {
        let mut longest: Vec<&Event> = list.iter().collect();
        longest.sort_by_key(|e| (std::cmp::Reverse((e.last - e.first, e.pixels)), e.first));
        for e in longest.into_iter().take(EVENTS) {
            table.rows.push(vec![
                name.clone(),
                threshold.to_string(),
                e.first_at.clone(),
                e.last_at.clone(),
                format!("{:.2}", e.duration_h),
                e.pixels.to_string(),
                format!("{:.1}", e.peak_w_m2),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

fn pictures_of(job: &Job<'_>, candidate: &Candidate) -> Result<Section, Error> {
    let mut figures = Vec::new();
    let mut files = vec![
        ("annual".to_owned(), "energy from the PV in a year"),
        ("ratio".to_owned(), "energy in a year compared with the reference"),
    ];
    for t in &job.resolved.project.glare.thresholds_w_m2 {
        files.push((format!("glare-{t}/cumulative"), "hours of glare in a year"));
        files.push((format!("glare-{t}/sustained"), "longest glare event"));
    }
    let thresholds = &job.resolved.project.glare.thresholds_w_m2;
    if let Some(t) = thresholds.iter().min_by(|a, b| a.total_cmp(b)) {
        for (map, caption) in [
            ("longest_day_h", "glare on the worst day, unfiltered"),
            ("exceeded_30min_w_m2", "irradiance exceeded for 30 minutes of the worst day"),
            ("exceeded_50h_w_m2", "irradiance exceeded for 50 hours of the year"),
        ] {
            files.push((format!("glare-{t}/unfiltered/{map}"), caption));
        }
    }
    for (file, caption) in files {
        for view in &job.resolved.views {
            let png = job.folder.map(&candidate.name, &view.name, &format!("{file}.png"));
            if job.folder.at(&png).exists() {
                figures.push(Figure {
                    path: png.to_string_lossy().replace('\\', "/"),
                    caption: format!("{}, {}: {caption} ({file})", candidate.name, view.name),
                });
            }
        }
    }
    Ok(Section {
        heading: format!("Maps of “{}”", candidate.name), figures, ..Section::default()
    })
}

/// How trees were taken.
fn trees(resolved: &Resolved) -> String {
    let one = |s: &crate::site::Season| {
        let list: Vec<String> = s.transmittance.iter().map(|t| format!("{t}")).collect();
        format!("“{}” {}", s.modifier, list.join(" "))
    };
    match resolved.scene.seasons.as_slice() {
        [] => "Trees are opaque all year.".into(),
        seasons => format!(
            "Crowns let light through by month, each as a whole (January to December: {}); all else is opaque. Maps draw crowns as they stand in the model, and the mirror rule takes them as opaque.",
            seasons.iter().map(one).collect::<Vec<_>>().join("; ")
        ),
    }
}

/// Pictures of luminances, a part for each moment.
fn moments(job: &Job<'_>) -> Option<Section> {
    let one = |moment: &PlannedMoment| {
        let mut figures = Vec::new();
        for candidate in &job.resolved.candidates {
            let [plain, luminance] = moments::pictures(job, candidate, moment);
            for (png, words) in [(plain, "as seen"), (luminance, "luminance")] {
                if job.folder.at(&png).exists() {
                    figures.push(Figure {
                        path: png.to_string_lossy().replace('\\', "/"),
                        caption: format!("{}, {}: {words}", candidate.name, moment.name),
                    });
                }
            }
        }
        let heading = format!("{} ({})", moments::when(job, moment), moment.name);
        Section { heading, figures, ..Section::default() }
    };
    let parts: Vec<Section> = job.resolved.moments.iter().map(one).collect();
    (!parts.is_empty()).then(|| Section {
        heading: "At a moment".into(),
        text: vec!["The scene as an eye sees it in the sun under a clear sky, each picture exposed for itself; luminances on one scale. The HDR files beside them hold radiances (179 lm/W); those of half a sphere are for evalglare.".into()],
        parts,
        ..Section::default()
    })
}

fn limits_of_it(job: &Job<'_>) -> Section {
    let resolved = job.resolved;
    let p = &resolved.project;
    let sky = match resolved.weather {
        Some(_) => "The sun's strength comes from the weather file.",
        None => "The sky is always clear: the sun shines at every computed time of the year.",
    };
    let mut text = vec![
        format!(
            "{sky} {} Light is followed from the PV to the first surface; what that surface reflects again is left out. Beyond {} m from the PV nothing is computed.",
            trees(resolved),
            resolved.trace.max_path_m
        ),
        format!(
            "Time above a threshold counts the irradiance {}, from the PV alone. Irradiance on a surface is less than what an eye receives that looks towards the PV: a low beam puts only part of itself onto the ground. annual.exr holds both.",
            super::render::quantity_words(resolved.quantity)
        ),
        "Rules are judged at the point of an observer or region where each value is largest, unfiltered unless the rule asks for the filter; there it runs over time alone.".into(),
        format!(
            "What eyes see (luminance, hazard, veil) is integrated over the PV's cells of half a metre, without photons and without a limit of distance; only what lies before the eye counts. A watt is taken for {} lm. The hazard is that of Ho, Ghanbari and Diver (2011), of the part of the PV that is worst; the veil that of CIE 146:2002 at {} years of age, for a line of sight along the observer's direction (to the middle of the PV where it has none). Mirror images of the sun are some 10 million to a billion cd/m²: above every limit of luminance.",
            job.timeline().map_or(0.0, |t| t.basis.lm_per_w()),
            crate::render::eye::hazard::AGE_YEARS,
        ),
    ];
    if resolved.needs_photons() {
        text.push("The noise of a value is that of its photons: all irradiances two standard errors lower, and two higher. It doesn't hold what the model leaves out. In free air photons are counted where they cross a disc of 0.1 m radius or less, in a run of their own.".into());
    }
    let name = |v: &PlannedView| match v.name == RECEIVERS {
        true => "the observers and regions".to_owned(),
        false => format!("the view “{}”", v.name),
    };
    let direct: Vec<String> = resolved.with_sensors().filter(|v| v.is_direct()).map(name).collect();
    if !direct.is_empty() {
        text.push(format!(
            "Integrated over the PV without photons, so without noise: {}. How far that may be off stands in their annual.exr, error.wh_m2.",
            direct.join(", ")
        ));
    }
    if matches!(job.timeline().map(|t| t.basis), Ok(SpectralBasis::Visible)) {
        text.push("Irradiances are visible watts of Radiance's gensky, about half of the full spectrum: held against thresholds that mean the full one, they come out too low.".into());
    }
    if p.time.half_year {
        text.push("Half a year was computed and counted twice (Equation (1) of the paper). Hours of the year come out 20 to 50 % too high where glare is a matter of summer, and dates of the other half are not known.".into());
    }
    if resolved.is_draft() {
        text.push(format!(
            "This is a draft: {} photons are too few for durations. It shows where glare goes, and roughly when.",
            p.photons.stored
        ));
    }
    text.push("Whether people are disturbed is a judgement that a threshold can't make.".into());
    Section {
        heading: "What this assumes, and what it does not say".into(),
        text,
        ..Section::default()
    }
}
