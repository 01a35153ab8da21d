//! Day by hour: when an observer or a region is dazzled, how strongly, and by which PV. The chart
//! that ForgeSolar's annual occurrence made a habit.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::PathBuf;

use super::error::Error;
use crate::base::Provenance;
use crate::glare::Lengths;
use crate::picture::Chart;
use crate::picture::chart::{Axis, Cell, SURFACES, Swatch};
use crate::project::artifacts::{ReceiverFile, ReceiverId, irradiance_unit, quantity_words};
use crate::project::{Candidate, PlannedView, Results};
use crate::receivers::clock::Clock;
use crate::receivers::points::Kind;
use crate::receivers::received::read_received;
use crate::receivers::tables::OccurrenceRow;
use crate::volume::TimeAxis;

const NIGHT: [u8; 3] = [228, 231, 238];
const DAYLIGHT: [u8; 3] = [251, 248, 240];
const BELOW: [u8; 3] = [226, 214, 178];
/// Above the first threshold, the second, and so on; the last stands for all further ones.
const ABOVE: [[u8; 3]; 4] = [[242, 166, 38], [203, 45, 38], [122, 8, 60], [45, 4, 40]];
const OTHERS: [u8; 3] = [110, 110, 110];
/// Draws the charts of all observers and regions; their names below `run/`.
///
/// # Errors
/// Results that are missing or damaged, charts that can't be written.
pub fn draw(results: &Results<'_>) -> Result<Vec<PathBuf>, Error> {
    let mut outputs = Vec::new();
    for candidate in &results.resolved.candidates {
        for set in &results.resolved.sensors {
            let received = read_received(results, candidate, set)?;
            for (number, group) in received.groups.iter().enumerate() {
                if group.kind != Kind::Sensors && group.not_evaluated.is_none() {
                    outputs.extend(one(
                        results,
                        candidate,
                        set,
                        ReceiverId { number, name: &group.name },
                    )?);
                }
            }
        }
    }
    Ok(outputs)
}

fn one(
    results: &Results<'_>,
    candidate: &Candidate,
    set: &PlannedView,
    receiver: ReceiverId<'_>,
) -> Result<Vec<PathBuf>, Error> {
    let name = |file| results.folder.receiver(&candidate.name, &set.name, receiver, file);
    let lit: Vec<OccurrenceRow> = results.folder.read_table(&name(ReceiverFile::Occurrence))?;
    let board = Board::new(*results)?;
    let mut thresholds = results.thresholds_w_m2().to_vec();
    thresholds.sort_by(f64::total_cmp);
    let texts = texts(results);
    let mut chart =
        board.chart(set, &format!("{}: light from “{}”", receiver.name, candidate.name));
    board.by_strength(&mut chart, &lit, &thresholds);
    let png = name(ReceiverFile::StrengthChart);
    chart.write_png(&results.folder.at(&png), &texts)?;
    let mut outputs = vec![png];
    let lowest = thresholds.first().copied().unwrap_or(0.0);
    let dazzling: Vec<&OccurrenceRow> =
        lit.iter().filter(|l| l.strongest_w_m2() > lowest as f32).collect();
    let several = dazzling.iter().any(|l| l.pv_surface != dazzling[0].pv_surface);
    if several {
        let title = format!("{}: which PV of “{}” dazzles", receiver.name, candidate.name);
        let mut chart = board.chart(set, &title);
        board.by_surface(&mut chart, &dazzling, lowest);
        let png = name(ReceiverFile::SurfaceChart);
        chart.write_png(&results.folder.at(&png), &texts)?;
        outputs.push(png);
    }
    Ok(outputs)
}

/// The axes and the daylight, the same for all charts of a run.
struct Board<'a> {
    results: Results<'a>,
    lengths: Lengths,
    clock: Clock,
    /// Days that a timestep stands for.
    days: f64,
    watts: &'static str,
}

impl<'a> Board<'a> {
    fn new(results: Results<'a>) -> Result<Self, Error> {
        let timeline = results.timeline;
        let mut days: Vec<u32> = timeline.steps.iter().map(|s| s.day).collect();
        days.dedup();
        let gap = days.windows(2).map(|d| d[1] - d[0]).min().unwrap_or(1);
        let clock = Clock::new(&results.resolved.project.site, timeline.year);
        let watts = irradiance_unit(timeline.basis);
        let lengths = Lengths::of(&TimeAxis::from(timeline))?;
        Ok(Self { results, lengths, clock, days: f64::from(gap), watts })
    }

    fn cell(&self, timestep: usize, color: [u8; 3]) -> Option<Cell> {
        let step = self.results.timeline.steps.get(timestep)?;
        let day = f64::from(step.day);
        let hour = self.clock.civil_hour(step.day, step.hour);
        let half = self.lengths.hours(timestep..=timestep) / 2.0;
        Some(Cell { x: [day, day + self.days], y: [hour - half, hour + half], color })
    }

    fn chart(&self, set: &PlannedView, title: &str) -> Chart {
        let p = &self.results.resolved.project;
        let steps = &self.results.timeline.steps;
        let cells: Vec<Cell> = (0..steps.len()).filter_map(|t| self.cell(t, DAYLIGHT)).collect();
        let low = cells.iter().map(|c| c.y[0]).fold(24.0, f64::min);
        let high = cells.iter().map(|c| c.y[1]).fold(0.0, f64::max);
        // Whole pairs of hours, so that the marks lie on round ones.
        let from = (libm::floor(low / 2.0) * 2.0).clamp(0.0, 22.0);
        let to = (libm::ceil(high / 2.0) * 2.0).clamp(from + 2.0, 26.0);
        let leap = self.clock.date(59) == "29 February";
        let mut caption = Vec::new();
        if p.time.half_year {
            caption.push("Only the half year that was computed is shown; it stands for the other half, whose dates and times differ somewhat.".to_owned());
        }
        if self.days > 1.0 {
            caption.push(format!(
                "Every {}th day was computed; it stands for those after it.",
                self.days
            ));
        }
        Chart {
            title: title.to_owned(),
            subtitle: format!("{} · {}", p.site.name, p.time.year),
            x: Axis::days_of_year(leap),
            y: Axis::clock(from, to, format!("clock time ({})", self.clock.zone())),
            ground: NIGHT,
            cells,
            key: Vec::new(),
            lines: Vec::new(),
            caption,
            watermark: self
                .results
                .resolved
                .is_draft_of(set)
                .then(|| "draft, not for assessment".to_owned()),
        }
    }

    fn by_strength(&self, chart: &mut Chart, lit: &[OccurrenceRow], thresholds: &[f64]) {
        let watts = self.watts;
        let level = |value: f32| thresholds.iter().filter(|t| value > **t as f32).count();
        let color = |level: usize| match level {
            0 => BELOW,
            n => ABOVE[(n - 1).min(ABOVE.len() - 1)],
        };
        // The strongest last: it must not be covered.
        let mut order: Vec<&OccurrenceRow> = lit.iter().collect();
        order.sort_by_key(|l| (level(l.strongest_w_m2()), l.timestep));
        chart.cells.extend(
            order.iter().filter_map(|l| self.cell(l.timestep, color(level(l.strongest_w_m2())))),
        );
        let swatch = |color, label: String| Swatch { color, label };
        chart.key.push(swatch(NIGHT, "night, or not computed".into()));
        chart.key.push(swatch(DAYLIGHT, "sun above the horizon".into()));
        match thresholds.first() {
            Some(t) => chart.key.push(swatch(BELOW, format!("lit, at most {t} {watts}"))),
            None => chart.key.push(swatch(BELOW, "lit".into())),
        }
        for (i, t) in thresholds.iter().enumerate() {
            let label = match thresholds.get(i + 1) {
                Some(next) => format!("above {t} to {next} {watts}"),
                None => format!("above {t} {watts}"),
            };
            chart.key.push(swatch(color(i + 1), label));
        }
        let what = quantity_words(self.results.resolved.quantity);
        chart.caption.insert(
            0,
            format!("The strongest irradiance {what} at any of its points, from the PV alone, unfiltered."),
        );
    }

    fn by_surface(&self, chart: &mut Chart, lit: &[&OccurrenceRow], threshold: f64) {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for l in lit {
            *counts.entry(&l.pv_surface).or_default() += 1;
        }
        let mut names: Vec<&str> = counts.keys().copied().filter(|n| !n.is_empty()).collect();
        names.sort_by_key(|n| (Reverse(counts[n]), *n));
        names.truncate(SURFACES.len());
        let color =
            |name: &str| names.iter().position(|n| *n == name).map_or(OTHERS, |i| SURFACES[i]);
        chart.cells.extend(lit.iter().filter_map(|l| self.cell(l.timestep, color(&l.pv_surface))));
        for name in &names {
            chart.key.push(Swatch { color: color(name), label: (*name).to_owned() });
        }
        if lit.iter().any(|l| !names.contains(&l.pv_surface.as_str())) {
            chart.key.push(Swatch { color: OTHERS, label: "others".into() });
        }
        chart.caption.insert(
            0,
            format!(
                "The PV surface that sends most of the light, where it exceeds {threshold} {}.",
                self.watts
            ),
        );
    }
}

fn texts(results: &Results<'_>) -> Vec<(String, String)> {
    vec![
        ("Software".to_owned(), Provenance::PROGRAM.to_owned()),
        ("Title".to_owned(), results.resolved.project.site.name.clone()),
    ]
}
