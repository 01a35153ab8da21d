//! The mirror rule for a project: receivers in, tables and a chart out.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::error::Error;
use super::resolve::Resolved;
use crate::base::{Progress, Provenance};
use crate::glare::rules::{self, Quantity};
use crate::picture::occurrence::{Occurrence, Series, Span};
use crate::render::{
    self, MirrorDay, MirrorReceiver, MirrorRule, MirrorSummary, MirrorTimes, MirrorYear,
};
use crate::site::Site;
use crate::sky;

/// The profile whose limits are judged.
const RULE: &str = "de-lai-2015";

/// What is asked.
#[derive(Clone, Debug)]
pub struct MirrorAsked {
    /// Observers of the project by name; with no points and no object, empty means all of them.
    pub observers: Vec<String>,
    /// Points in the air, m from the local origin.
    pub points: Vec<DVec3>,
    /// An object whose faces are covered with points.
    pub object: Option<String>,
    /// Between those points, m.
    pub spacing_m: f64,
    /// Seconds from one instant to the next.
    pub step_s: u32,
    /// Least angle between sun and reflection, degrees.
    pub separation_deg: f64,
    /// Whether the air lifts the sun.
    pub refraction: bool,
}

/// What the rule says.
#[derive(Clone, Debug, Serialize)]
pub struct Mirrored {
    /// The rule.
    pub rule: &'static str,
    /// Where the suns come from, and how they were looked at.
    pub assumptions: Assumptions,
    /// Names of the PV surfaces by number.
    pub surfaces: Vec<String>,
    /// Each receiver.
    pub receivers: Vec<MirroredAt>,
    /// The points of the object, where one was asked for.
    pub region: Option<MirroredRegion>,
}

/// How the suns were looked at.
#[derive(Clone, Debug, Serialize)]
pub struct Assumptions {
    /// Which formulas say where the sun stands.
    pub sun: &'static str,
    /// The year.
    pub year: i32,
    /// Seconds from one instant to the next.
    pub step_s: u32,
    /// Least angle between sun and reflection, degrees.
    pub separation_deg: f64,
    /// Whether the air lifts the sun.
    pub refraction: bool,
    /// Whether ridges beyond the scene hide the sun.
    pub far_horizon: bool,
    /// Suns of the year.
    pub suns: usize,
    /// In words.
    pub note: &'static str,
}

const NOTE: &str = "point sun, ideal mirror, no intensity, always clear, all PV together; hours are local standard time of the meridian, day 0 is 1 January; terrain, buildings and trees are opaque all year";

/// One receiver.
#[derive(Clone, Debug, Serialize)]
pub struct MirroredAt {
    /// The observer's name, or the point.
    pub name: String,
    /// Where, m from the local origin.
    pub point: [f64; 3],
    /// The year in a line.
    #[serde(flatten)]
    pub year: MirrorSummary,
    /// First and last lit date, `MM-DD`, and that with most minutes; `null` if it is never lit.
    pub dates: Option<[String; 3]>,
    /// Minutes of the year by PV surface.
    pub minutes_by_surface: BTreeMap<String, f64>,
    /// Which limits of the rule are exceeded.
    pub exceeded: Vec<String>,
    /// The lit days.
    pub daily: Vec<MirrorDay>,
    /// The chart: unbroken runs by day and surface.
    pub chart: Vec<render::MirrorRun>,
}

/// Many points.
#[derive(Clone, Debug, Serialize)]
pub struct MirroredRegion {
    /// The object.
    pub object: String,
    /// Between points, m.
    pub spacing_m: f64,
    /// Points with any.
    pub lit_points: usize,
    /// Points at which a limit of the rule is exceeded.
    pub exceeding_points: usize,
    /// The worst: most hours of the year, and most minutes of a day.
    pub worst: MirrorSummary,
    /// All points.
    pub points: Vec<([f64; 3], MirrorSummary)>,
}

/// Applies the rule.
///
/// # Errors
/// An observer that the project doesn't have, nobody to look, settings that make no sense, or
/// whatever is wrong with the scene.
pub fn mirror(
    resolved: &Resolved,
    asked: &MirrorAsked,
    progress: &dyn Progress,
) -> Result<Mirrored, Error> {
    let named = observers(resolved, asked)?;
    let site = Site::load(&resolved.scene, &resolved.pv)?;
    let times = MirrorTimes {
        place: resolved.place,
        model: resolved.times.sun,
        year: resolved.times.year,
        step_s: asked.step_s,
        refraction: asked.refraction,
        horizon: resolved.horizon.clone(),
    };
    let rule = MirrorRule::new(&site, times, asked.separation_deg)?;
    let limits = Limits::read()?;
    let surfaces: Vec<String> = site.pv.iter().map(|pv| pv.name.clone()).collect();
    let eyes: Vec<_> =
        named.iter().map(|(_, at)| MirrorReceiver { position: *at, normal: None }).collect();
    let receivers = named
        .into_iter()
        .zip(rule.years(&eyes, progress)?)
        .map(|((name, at), year)| at_one(name, at, &year, &surfaces, &limits, resolved.times.year))
        .collect();
    let region = asked
        .object
        .as_ref()
        .map(|id| region(&site, &rule, id, asked.spacing_m, &limits, progress))
        .transpose()?;
    Ok(Mirrored {
        rule: RULE,
        assumptions: Assumptions {
            sun: resolved.times.sun.name(),
            year: resolved.times.year,
            step_s: asked.step_s,
            separation_deg: asked.separation_deg,
            refraction: asked.refraction,
            far_horizon: resolved.horizon.is_some(),
            suns: rule.suns(),
            note: NOTE,
        },
        surfaces,
        receivers,
        region,
    })
}

fn observers(resolved: &Resolved, asked: &MirrorAsked) -> Result<Vec<(String, DVec3)>, Error> {
    let known = &resolved.project.observer;
    let wrong = |message: String| Error::Project {
        path: resolved.file.clone(),
        line: 0,
        column: 0,
        message,
    };
    let place = |o: &super::project::ObserverTable| (o.name.clone(), DVec3::from_array(o.point));
    let mut out = Vec::new();
    for name in &asked.observers {
        let found = known.iter().find(|o| &o.name == name).ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|o| o.name.as_str()).collect();
            wrong(format!("no [[observer]] is named \"{name}\" (there are: {})", names.join(", ")))
        })?;
        out.push(place(found));
    }
    for point in &asked.points {
        if !point.is_finite() {
            return Err(wrong(format!("expected a point in metres, found {point}")));
        }
        out.push((format!("{},{},{}", point.x, point.y, point.z), *point));
    }
    if out.is_empty() && asked.object.is_none() {
        out = known.iter().map(place).collect();
        if out.is_empty() {
            return Err(wrong(
                "nobody looks: expected an [[observer]], --point or --object, found none".into(),
            ));
        }
    }
    Ok(out)
}

/// The rule's own limits.
struct Limits(Vec<rules::Limit>);

impl Limits {
    fn read() -> Result<Self, Error> {
        Ok(Self(rules::built_in(RULE)?.limits))
    }

    fn exceeded(&self, year: &MirrorSummary) -> Vec<String> {
        let above = |l: &&rules::Limit| match l.quantity {
            Quantity::DailyTotalMin => year.most_minutes > l.value,
            Quantity::AnnualH => year.hours > l.value,
            _ => false,
        };
        self.0.iter().filter(above).map(|l| l.id.clone()).collect()
    }
}

fn at_one(
    name: String,
    at: DVec3,
    lit: &MirrorYear,
    surfaces: &[String],
    limits: &Limits,
    calendar: i32,
) -> MirroredAt {
    let (year, daily) = (lit.summary(), lit.days());
    let mut minutes_by_surface = BTreeMap::new();
    for (surface, minutes) in daily.iter().flat_map(|d| &d.by_surface) {
        let name = surfaces.get(usize::from(*surface)).cloned().unwrap_or_default();
        *minutes_by_surface.entry(name).or_insert(0.0) += minutes;
    }
    let date = |day| date(calendar, day);
    MirroredAt {
        name,
        point: at.to_array(),
        dates: (year.days > 0)
            .then(|| [date(year.first_day), date(year.last_day), date(year.most_on_day)]),
        exceeded: limits.exceeded(&year),
        year,
        minutes_by_surface,
        daily,
        chart: lit.runs(),
    }
}

fn date(year: i32, day: u32) -> String {
    let (month, day) = sky::date_of_day(year, day);
    format!("{month:02}-{day:02}")
}

fn region(
    site: &Site,
    rule: &MirrorRule<'_>,
    id: &str,
    spacing_m: f64,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<MirroredRegion, Error> {
    let points = render::points_on(site, id, spacing_m)?;
    let years = rule.map(&points, progress, |year| year.summary())?;
    let mut worst = MirrorSummary::default();
    for y in years.iter().filter(|y| y.days > 0) {
        let any = worst.days > 0;
        worst.hours = worst.hours.max(y.hours);
        if y.most_minutes > worst.most_minutes {
            (worst.most_minutes, worst.most_on_day) = (y.most_minutes, y.most_on_day);
        }
        worst.first_day = if any { worst.first_day.min(y.first_day) } else { y.first_day };
        worst.earliest_h = if any { worst.earliest_h.min(y.earliest_h) } else { y.earliest_h };
        worst.days = worst.days.max(y.days);
        worst.last_day = worst.last_day.max(y.last_day);
        worst.latest_h = worst.latest_h.max(y.latest_h);
    }
    Ok(MirroredRegion {
        object: id.to_owned(),
        spacing_m,
        lit_points: years.iter().filter(|y| y.days > 0).count(),
        exceeding_points: years.iter().filter(|y| !limits.exceeded(y).is_empty()).count(),
        worst,
        points: points.iter().map(|p| p.position.to_array()).zip(years).collect(),
    })
}

impl Mirrored {
    /// A table of all lit days of all receivers: minutes together and by PV surface.
    pub fn daily_csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let mut out = String::from("receiver,day,date,first_h,last_h,minutes");
        for surface in &self.surfaces {
            out.push(',');
            out.push_str(&quoted(surface));
        }
        out.push('\n');
        for r in &self.receivers {
            for d in &r.daily {
                let date = date(self.assumptions.year, d.day);
                let head = quoted(&r.name);
                out.push_str(&format!(
                    "{head},{},{date},{:.4},{:.4},{}",
                    d.day, d.first_h, d.last_h, d.minutes
                ));
                for number in 0..self.surfaces.len() {
                    let own = d.by_surface.iter().find(|s| usize::from(s.0) == number);
                    out.push_str(&format!(",{}", own.map_or(0.0, |s| s.1)));
                }
                out.push('\n');
            }
        }
        out
    }

    /// A table of the points of the region; empty where none was asked for.
    pub fn points_csv(&self) -> String {
        let mut out = String::from(
            "x,y,z,hours,most_minutes,most_on_day,days,first_day,last_day,earliest_h,latest_h\n",
        );
        for ([x, y, z], s) in self.region.iter().flat_map(|r| &r.points) {
            out.push_str(&format!(
                "{x:.4},{y:.4},{z:.4},{:.4},{},{},{},{},{},{:.4},{:.4}\n",
                s.hours,
                s.most_minutes,
                s.most_on_day,
                s.days,
                s.first_day,
                s.last_day,
                s.earliest_h,
                s.latest_h
            ));
        }
        out
    }

    /// The chart of one receiver: day against clock time, coloured by PV surface.
    fn chart(&self, resolved: &Resolved, at: &MirroredAt) -> Occurrence {
        const MONTHS: [&str; 12] =
            ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
        let a = &self.assumptions;
        let columns = sky::days_in_year(a.year);
        let parts = (0..columns)
            .filter_map(|day| match sky::date_of_day(a.year, day) {
                (month, 1) => Some((day, MONTHS[(month as usize - 1) % 12].to_owned())),
                _ => None,
            })
            .collect();
        let step_h = f64::from(a.step_s) / 3600.0;
        let series = self
            .surfaces
            .iter()
            .enumerate()
            .map(|(number, name)| Series {
                label: format!(
                    "{name}: {:.1} h a year",
                    at.minutes_by_surface.get(name).copied().unwrap_or(0.0) / 60.0
                ),
                spans: at
                    .chart
                    .iter()
                    .filter(|run| usize::from(run.surface) == number)
                    .map(|run| Span { column: run.day, from: run.first_h, to: run.last_h + step_h })
                    .collect(),
            })
            .filter(|s: &Series| !s.spans.is_empty())
            .collect();
        let [x, y, z] = at.point;
        let zone = resolved.place.meridian_deg / 15.0;
        Occurrence {
            title: at.name.clone(),
            subtitle: format!(
                "Mirrored sun at {x:.1}, {y:.1}, {z:.1} m: {:.1} h a year, at most {} min a day ({})",
                at.year.hours, at.year.most_minutes, self.rule
            ),
            columns,
            parts,
            range: (0.0, 24.0),
            series,
            curves: daylight(resolved, columns),
            caption: format!(
                "Local standard time (UTC{zone:+}). {NOTE}. Sun and reflection at least {} degrees apart; steps of {} s; {} suns of {}. Grey: sunrise and sunset on a flat horizon.",
                a.separation_deg, a.step_s, a.sun, a.year
            ),
        }
    }

    /// Writes the chart of each receiver: into `path`, or with its number where there are several.
    ///
    /// # Errors
    /// When the pictures can't be written.
    pub fn write_charts(&self, resolved: &Resolved, path: &Path) -> Result<(), Error> {
        let texts = vec![("Software".to_owned(), Provenance::PROGRAM.to_owned())];
        for (i, at) in self.receivers.iter().enumerate() {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            let path = match self.receivers.len() {
                1 => path.to_owned(),
                _ => path.with_file_name(format!("{stem}-{}.png", i + 1)),
            };
            self.chart(resolved, at).write_png(&path, &texts)?;
        }
        Ok(())
    }
}

/// Sunrise and sunset of each day, h, to some minutes.
fn daylight(resolved: &Resolved, days: u32) -> Vec<Vec<f64>> {
    const PER_HOUR: u32 = 20;
    let mut out = vec![Vec::new(), Vec::new()];
    for day in 0..days {
        let hour = |i: u32| f64::from(i) / f64::from(PER_HOUR);
        let up = |i: &u32| {
            let t = &resolved.times;
            sky::sun_direction(&resolved.place, t.sun, t.year, day, hour(*i)).z > 0.0
        };
        let first = (0..24 * PER_HOUR).find(up);
        let last = (0..24 * PER_HOUR).rev().find(up);
        out[0].push(first.map_or(f64::NAN, hour));
        out[1].push(last.map_or(f64::NAN, hour));
    }
    out
}
