//! The mirror rule for a project: receivers in, tables and a chart out.

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;

use super::error::Error;
use super::points::Spreader;
use crate::base::Progress;
use crate::project::{Ids, ObserverTable, Picture, PlannedView, RegionTable, Resolved};
use crate::render::{
    self, Anywhere, HitMap, MirrorDay, MirrorReceiver, MirrorRule, MirrorSummary, MirrorTimes,
    MirrorYear,
};
use crate::rules;
use crate::rules::Quantity;
use crate::site::Site;
use crate::sky;

/// The profile whose limits are judged.
const RULE: &str = "de-lai-2015";

/// What is asked.
#[derive(Clone, Debug)]
pub struct MirrorAsked {
    /// Observers of the project by name. Where nothing at all is named, all observers and regions
    /// look.
    pub observers: Vec<String>,
    /// Regions of the project by name.
    pub regions: Vec<String>,
    /// Points in the air, m from the local origin.
    pub points: Vec<DVec3>,
    /// An object whose faces are covered with points.
    pub object: Option<String>,
    /// Between the points of objects and regions, m; as the project says if left out.
    pub spacing_m: Option<f64>,
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
    /// Each region, and the object that was asked for.
    pub regions: Vec<MirroredRegion>,
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
    /// Suns of the year, as one every five minutes tells.
    pub suns: usize,
    /// Suns that were worked out: one every five minutes, all that come near.
    pub worked_out: usize,
    /// In words.
    pub note: &'static str,
}

pub const NOTE: &str = "point sun, ideal mirror, no intensity, always clear, all PV together; hours are local standard time of the meridian, day 0 is 1 January; terrain, buildings and trees are opaque all year";

/// One receiver, or a region as a whole.
#[derive(Clone, Debug, Serialize)]
pub struct MirroredAt {
    /// The observer's or region's name, or the point.
    pub name: String,
    /// Where, m from the local origin; `null`: anywhere on a region.
    pub point: Option<[f64; 3]>,
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
    /// The region's name, or the object.
    pub name: String,
    /// How its points were made.
    pub notes: Vec<String>,
    /// Area that its points stand for, m2.
    pub area_m2: f64,
    /// Points with any.
    pub lit_points: usize,
    /// Points at which a limit of the rule is exceeded.
    pub exceeding_points: usize,
    /// Area that those stand for, m2.
    pub exceeding_m2: f64,
    /// The worst of each: most hours of the year and most minutes of a day may be those of
    /// different points.
    pub worst: MirrorSummary,
    /// The point with most hours of the year.
    pub worst_point: Option<[f64; 3]>,
    /// The times at which any of its points is lit; its hours are more than any point's.
    pub anywhere: MirroredAt,
    /// All points.
    pub points: Vec<MirroredPoint>,
}

/// One point of a region.
#[derive(Clone, Debug, Serialize)]
pub struct MirroredPoint {
    /// Where, m from the local origin.
    pub point: [f64; 3],
    /// The area that it stands for, m2.
    pub area_m2: f64,
    /// The year in a line.
    #[serde(flatten)]
    pub year: MirrorSummary,
}

/// Points that a region may have.
const MOST_POINTS: usize = 100_000;
/// Between the points of an object that was asked for, m.
const SPACING_M: f64 = 0.5;

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
    let tables = regions(resolved, asked)?;
    let site = Site::load(&resolved.scene, &resolved.pv)?;
    let spreader = Spreader { resolved, site: &site };
    let named = observers(&spreader, asked, tables.is_empty())?;
    let times = MirrorTimes {
        place: resolved.place,
        model: resolved.times.sun,
        year: resolved.times.year,
        step_s: asked.step_s,
        refraction: asked.refraction,
        horizon: resolved.horizon.clone(),
    };
    let rule = MirrorRule::new(&site, times, asked.separation_deg)?;
    let teller = Teller {
        limits: Limits::read()?,
        surfaces: site.pv.iter().map(|pv| pv.name.clone()).collect(),
        year: resolved.times.year,
    };
    let eyes: Vec<_> =
        named.iter().map(|(_, at)| MirrorReceiver { position: *at, normal: None }).collect();
    let receivers = named
        .into_iter()
        .zip(rule.years(&eyes, progress)?)
        .map(|((name, at), year)| teller.at(name, Some(at), &year))
        .collect();
    let regions = tables
        .iter()
        .map(|table| region(&spreader, &rule, table, &teller, progress))
        .collect::<Result<_, _>>()?;
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
            worked_out: rule.worked_out(),
            note: NOTE,
        },
        surfaces: teller.surfaces,
        receivers,
        regions,
    })
}

fn wrong(resolved: &Resolved, message: String) -> Error {
    resolved.mistaken(message).into()
}

impl MirrorAsked {
    fn names_nothing(&self) -> bool {
        self.observers.is_empty()
            && self.points.is_empty()
            && self.regions.is_empty()
            && self.object.is_none()
    }
}

/// The regions that are asked for, with their spacing; the object as the last.
fn regions(resolved: &Resolved, asked: &MirrorAsked) -> Result<Vec<RegionTable>, Error> {
    if asked.spacing_m.is_some_and(|s| !(1e-3..=1e4).contains(&s)) {
        let spacing = asked.spacing_m.unwrap_or_default();
        let what = format!("the spacing is {spacing}, expected 0.001 to 10000 m");
        return Err(wrong(resolved, what));
    }
    let known = &resolved.project.region;
    let mut out = if asked.names_nothing() { known.clone() } else { Vec::new() };
    for name in &asked.regions {
        let found = known.iter().find(|r| &r.name == name).ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|r| r.name.as_str()).collect();
            let known = names.join(", ");
            wrong(resolved, format!("no [[region]] is named \"{name}\" (there are: {known})"))
        })?;
        out.push(found.clone());
    }
    out.extend(asked.object.as_ref().map(|id| RegionTable {
        name: id.clone(),
        object: Some(Ids::One(id.clone())),
        polygon: None,
        height_m: None,
        view: None,
        coordinates: None,
        spacing_m: Some(SPACING_M),
        class: None,
    }));
    for table in &mut out {
        table.spacing_m = asked.spacing_m.or(table.spacing_m);
    }
    Ok(out)
}

fn observers(
    spreader: &Spreader<'_>,
    asked: &MirrorAsked,
    no_region: bool,
) -> Result<Vec<(String, DVec3)>, Error> {
    let resolved = spreader.resolved;
    let known = &resolved.project.observer;
    let place = |o: &ObserverTable| (o.name.clone(), spreader.observer(o).position);
    let mut out = Vec::new();
    for name in &asked.observers {
        let found = known.iter().find(|o| &o.name == name).ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|o| o.name.as_str()).collect();
            let known = names.join(", ");
            wrong(resolved, format!("no [[observer]] is named \"{name}\" (there are: {known})"))
        })?;
        out.push(place(found));
    }
    for point in &asked.points {
        if !point.is_finite() {
            return Err(wrong(resolved, format!("expected a point in metres, found {point}")));
        }
        out.push((format!("{},{},{}", point.x, point.y, point.z), *point));
    }
    if asked.names_nothing() {
        out = known.iter().map(place).collect();
        if out.is_empty() && no_region {
            let what = "nobody looks: expected an [[observer]], a [[region]], --point or --object, found none";
            return Err(wrong(resolved, what.into()));
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

/// What a year is told with.
struct Teller {
    limits: Limits,
    surfaces: Vec<String>,
    year: i32,
}

impl Teller {
    fn at(&self, name: String, at: Option<DVec3>, lit: &MirrorYear) -> MirroredAt {
        let (year, daily) = (lit.summary(), lit.days());
        let mut minutes_by_surface = BTreeMap::new();
        for (surface, minutes) in daily.iter().flat_map(|d| &d.by_surface) {
            let name = self.surfaces.get(usize::from(*surface)).cloned().unwrap_or_default();
            *minutes_by_surface.entry(name).or_insert(0.0) += minutes;
        }
        let date = |day| date(self.year, day);
        MirroredAt {
            name,
            point: at.map(|p| p.to_array()),
            dates: (year.days > 0)
                .then(|| [date(year.first_day), date(year.last_day), date(year.most_on_day)]),
            exceeded: self.limits.exceeded(&year),
            year,
            minutes_by_surface,
            daily,
            chart: lit.runs(),
        }
    }
}

pub fn date(year: i32, day: u32) -> String {
    let (month, day) = sky::date_of_day(year, day);
    format!("{month:02}-{day:02}")
}

/// A region: its points, on their surface or (a plot at some height) in the air.
fn region(
    spreader: &Spreader<'_>,
    rule: &MirrorRule<'_>,
    table: &RegionTable,
    teller: &Teller,
    progress: &dyn Progress,
) -> Result<MirroredRegion, Error> {
    let trace = &spreader.resolved.trace;
    let hits = |view: &PlannedView| {
        let Some(Picture { view, .. }) = view.picture() else {
            return Ok(HitMap { columns: 0, rows: 0, hits: Vec::new() });
        };
        Ok(render::hits(view, spreader.site, trace.max_path_m, trace.seed, progress)?)
    };
    let (samples, notes) = spreader.region(table, &hits, MOST_POINTS)?;
    if samples.is_empty() {
        let what = format!("[[region]] \"{}\": not one point of it lies on the scene", table.name);
        return Err(wrong(spreader.resolved, what));
    }
    let receivers: Vec<_> = samples
        .iter()
        .map(|s| MirrorReceiver {
            position: s.sensor.position,
            normal: table.height_m.is_none().then_some(s.sensor.normal),
        })
        .collect();
    let anywhere = Anywhere::new(rule);
    let years = rule.map(&receivers, progress, |year| {
        anywhere.add(&year);
        year.summary()
    })?;
    let mut worst = MirrorSummary::default();
    let mut worst_point = None;
    for (y, at) in years.iter().zip(&receivers).filter(|(y, _)| y.days > 0) {
        let any = worst.days > 0;
        if y.hours > worst.hours {
            (worst.hours, worst_point) = (y.hours, Some(at.position.to_array()));
        }
        if y.most_minutes > worst.most_minutes {
            (worst.most_minutes, worst.most_on_day) = (y.most_minutes, y.most_on_day);
        }
        worst.first_day = if any { worst.first_day.min(y.first_day) } else { y.first_day };
        worst.earliest_h = if any { worst.earliest_h.min(y.earliest_h) } else { y.earliest_h };
        worst.days = worst.days.max(y.days);
        worst.last_day = worst.last_day.max(y.last_day);
        worst.latest_h = worst.latest_h.max(y.latest_h);
    }
    let exceeds = |y: &&MirrorSummary| !teller.limits.exceeded(y).is_empty();
    let exceeding = samples.iter().zip(&years).filter(|(_, y)| exceeds(y));
    Ok(MirroredRegion {
        name: table.name.clone(),
        notes,
        area_m2: samples.iter().fold(0.0, |sum, s| sum + s.area_m2),
        lit_points: years.iter().filter(|y| y.days > 0).count(),
        exceeding_points: years.iter().filter(exceeds).count(),
        exceeding_m2: exceeding.fold(0.0, |sum, (s, _)| sum + s.area_m2),
        worst,
        worst_point,
        anywhere: teller.at(table.name.clone(), None, &anywhere.year()),
        points: samples
            .iter()
            .zip(years)
            .map(|(s, year)| MirroredPoint {
                point: s.sensor.position.to_array(),
                area_m2: s.area_m2,
                year,
            })
            .collect(),
    })
}

/// Sunrise and sunset of each day of the project's year on a flat horizon, h of local standard time,
/// to some minutes; none where the sun stays below it.
pub fn sunrise_and_sunset(resolved: &Resolved) -> Vec<[Option<f64>; 2]> {
    const PER_HOUR: u32 = 20;
    let times = &resolved.times;
    let hour = |i: u32| f64::from(i) / f64::from(PER_HOUR);
    (0..sky::days_in_year(times.year))
        .map(|day| {
            let up = |i: &u32| {
                sky::sun_direction(&resolved.place, times.sun, times.year, day, hour(*i)).z > 0.0
            };
            let first = (0..24 * PER_HOUR).find(up);
            [first, (0..24 * PER_HOUR).rev().find(up)].map(|at| at.map(hour))
        })
        .collect()
}
