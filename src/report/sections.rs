//! The report's document: its sections about the run, the views, the maps and what was assumed.

use serde::Deserialize;

use super::document::{Document, Figure, Section, Table, link};
use super::error::Error;
use super::judgements::Judgement;
use super::maps::read_map;
use super::{receiver_sections, view_verdicts};
use crate::base::{Provenance, SpectralBasis, Tally};
use crate::glare::{ListedEvent, YearMap};
use crate::project::artifacts::{MomentFile, quantity_words};
use crate::project::{
    Candidate, GlareMap, Map, PlannedMoment, PlannedView, RECEIVERS, Resolved, Results, SeriesOf,
    WordOr,
};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::VEIL_AGE_YEARS;

/// Events that the report lists for a material, view and threshold.
const EVENTS: usize = 5;

/// The whole page. `key`: hash of what it was made from.
///
/// # Errors
/// Results that are missing or damaged.
pub fn document(
    results: &Results<'_>,
    key: &str,
    judgements: &[Judgement],
) -> Result<Document, Error> {
    let resolved = results.resolved;
    let p = &resolved.project;
    let timeline = results.timeline;
    let mut document = Document {
        title: format!("Glare from photovoltaics: {}", p.site.name),
        subtitle: format!(
            "{:.4}° N, {:.4}° E · {} · {} sun positions{} · irradiance {}",
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
    document.sections.extend(receiver_sections::sections(results, judgements)?);
    if results.resolved.needs_photons() {
        document.sections.push(photons(results)?);
    }
    for view in &resolved.views {
        document.sections.push(numbers(results, view)?);
    }
    for candidate in &resolved.candidates {
        document.sections.push(pictures_of(results, candidate));
    }
    document.sections.extend(moments(results));
    document.sections.push(limits_of_it(results));
    Ok(document)
}

/// What the report needs of the file that says where the photons went.
#[derive(Deserialize)]
struct Traced {
    tally: Tally,
}

fn photons(results: &Results<'_>) -> Result<Section, Error> {
    let mut table = Table {
        head: ["material", "photons sent", "stored", "flux landed", "absorbed", "blocked"]
            .map(str::to_owned)
            .to_vec(),
        rows: Vec::new(),
    };
    for candidate in &results.resolved.candidates {
        let name = results.folder.tally(&candidate.name);
        let Traced { tally: t } = results.folder.read_json(&name)?;
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
            "Shares of the sunlight that falls onto the PV at all computed sun positions. “Landed” is what reaches a surface within {} m of the PV.",
            results.resolved.trace.max_path_m
        )],
        tables: vec![table],
        ..Section::default()
    })
}

fn numbers(results: &Results<'_>, view: &PlannedView) -> Result<Section, Error> {
    let resolved = results.resolved;
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
        let largest = |map| Ok::<_, Error>(read_map(results, candidate, view, map)?.largest());
        let mut row = vec![candidate.name.clone()];
        row.push(format!("{:.0}", largest(Map::Annual)?));
        let quantity = resolved.quantity;
        row.push(format!("{:.1}", largest(Map::Peak(SeriesOf { quantity, asked: quantity }))?));
        for &t in results.thresholds_w_m2() {
            for map in [GlareMap::Cumulative, GlareMap::Sustained, GlareMap::LongestRun] {
                row.push(format!("{:.2}", largest(Map::Glare(t, map))?));
            }
            let name = results.folder.events(&candidate.name, &view.name, t);
            let list: Vec<ListedEvent> = results.folder.read_table(&name)?;
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
    section.tables.extend(view_verdicts::table(results, view)?);
    section.tables.extend(longest_events(&events));
    Ok(section)
}

fn longest_events(all: &[(String, f64, Vec<ListedEvent>)]) -> Option<Table> {
    let mut table = Table {
        head: ["material", "above (W/m²)", "from", "to", "duration (h)", "pixels", "peak (W/m²)"]
            .map(str::to_owned)
            .to_vec(),
        rows: Vec::new(),
    };
    for (name, threshold, list) in all {
        let mut longest: Vec<&ListedEvent> = list.iter().collect();
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

fn pictures_of(results: &Results<'_>, candidate: &Candidate) -> Section {
    let thresholds = results.thresholds_w_m2();
    let mut maps = vec![Map::Annual, Map::Ratio];
    for &t in thresholds {
        maps.extend([GlareMap::Cumulative, GlareMap::Sustained].map(|map| Map::Glare(t, map)));
    }
    if let Some(&t) = thresholds.iter().min_by(|a, b| a.total_cmp(b)) {
        let year = [YearMap::LongestDay, YearMap::ExceededOnWorstDay, YearMap::ExceededInYear];
        maps.extend(year.map(|map| Map::Glare(t, GlareMap::Unfiltered(map))));
    }
    let mut figures = Vec::new();
    for map in maps {
        for view in &results.resolved.views {
            let png = results.folder.png(&candidate.name, &view.name, map);
            if results.folder.at(&png).exists() {
                let title = map.title_above(results.timeline.basis);
                let caption = format!("{}, view “{}”: {title}", candidate.name, view.name);
                figures.push(Figure { path: link(&png), caption });
            }
        }
    }
    Section { heading: format!("Maps of “{}”", candidate.name), figures, ..Section::default() }
}

/// How trees were taken.
fn trees(resolved: &Resolved) -> String {
    match resolved.scene.seasons.as_slice() {
        [] => "Trees are opaque all year.".into(),
        seasons => format!(
            "Tree crowns let light through by month, each crown as a whole (January to December: {}). Everything else is opaque. Maps show crowns as they stand in the model; the mirror rule takes them as opaque.",
            seasons
                .iter()
                .map(|s| {
                    let list = s.transmittance.iter().map(f64::to_string).collect::<Vec<_>>();
                    format!("“{}” {}", s.modifier, list.join(" "))
                })
                .collect::<Vec<_>>()
                .join("; ")
        ),
    }
}

/// Pictures of luminances, a part for each moment.
fn moments(results: &Results<'_>) -> Option<Section> {
    let clock = Clock::new(&results.resolved.project.site, results.resolved.times.year);
    let one = |moment: &PlannedMoment| {
        let mut figures = Vec::new();
        for candidate in &results.resolved.candidates {
            for (file, words) in
                [(MomentFile::Picture, "as seen"), (MomentFile::LuminancePicture, "luminance")]
            {
                let png = results.folder.moment(&candidate.name, &moment.name, file);
                if results.folder.at(&png).exists() {
                    figures.push(Figure {
                        path: link(&png),
                        caption: format!("{}, {}: {words}", candidate.name, moment.name),
                    });
                }
            }
        }
        let heading = format!("{} ({})", clock.show(moment.day, moment.hour), moment.name);
        Section { heading, figures, ..Section::default() }
    };
    let parts: Vec<Section> = results.resolved.moments.iter().map(one).collect();
    (!parts.is_empty()).then(|| Section {
        heading: "At a moment".into(),
        text: vec!["The scene as an eye sees it in the sun under a clear sky, each picture exposed for itself; luminances on one scale. The HDR files beside them hold radiances (179 lm/W); those of half a sphere are for evalglare.".into()],
        parts,
        ..Section::default()
    })
}

fn limits_of_it(results: &Results<'_>) -> Section {
    let resolved = results.resolved;
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
            "Time counts while the irradiance {}, from the PV alone, is above the threshold. An eye that looks towards the PV receives more than a surface does, because a low beam strikes the ground at a flat angle. The file annual.exr holds both irradiances.",
            quantity_words(resolved.quantity)
        ),
        "Rules are judged at that point of an observer or region where each value is largest. The irradiance is not filtered unless the rule asks for it; the filter then runs over time only.".into(),
        format!(
            "What eyes see (luminance, hazard, veiling luminance) is integrated over cells of the PV half a metre wide, without photons and without a limit of distance; only what lies in front of the eye counts. A watt is taken for {} lm. The hazard is that of Ho, Ghanbari and Diver (2011), of the part of the PV that is worst; the veil that of CIE 146:2002 at {} years of age, for a line of sight along the observer's direction (to the middle of the PV where it has none). Mirror images of the sun have some 10 million to a billion cd/m², more than any limit of luminance.",
            results.timeline.basis.lm_per_w(),
            VEIL_AGE_YEARS,
        ),
    ];
    if resolved.needs_photons() {
        text.push("“Within the noise” gives the values for all irradiances two standard errors lower and two standard errors higher, as the number of photons behind them says. It does not include what the model leaves out. In free air, photons are counted where they cross a disc of 0.1 m radius or less, in a run of their own.".into());
    }
    let name = |v: &PlannedView| match v.name == RECEIVERS {
        true => "the observers and regions".to_owned(),
        false => format!("the view “{}”", v.name),
    };
    let direct: Vec<String> = resolved.with_sensors().filter(|v| v.is_direct()).map(name).collect();
    if !direct.is_empty() {
        text.push(format!(
            "Some values are integrated over the PV without photons, so without noise: {}. The channel error.wh_m2 of their annual.exr says how far they may be off.",
            direct.join(", ")
        ));
    }
    if results.timeline.basis == SpectralBasis::Visible {
        text.push("Irradiances are visible watts of Radiance's gensky, about half of the full spectrum. Compared with thresholds that mean the full spectrum, they come out too low.".into());
    }
    if p.time.half_year {
        text.push("Half a year was computed and counted twice (Equation (1) of the paper). Where glare occurs in summer, the hours of the year come out 20 to 50 % too high, and the dates of the other half are not known.".into());
    }
    if resolved.is_draft() {
        text.push(format!(
            "This is a draft: {} photons are too few for durations. It shows where glare goes, and roughly when.",
            p.photons.stored
        ));
    }
    text.push("A threshold cannot decide whether people feel disturbed.".into());
    Section {
        heading: "What this assumes, and what it does not say".into(),
        text,
        ..Section::default()
    }
}
