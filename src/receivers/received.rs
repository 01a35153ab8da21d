//! What arrives at observers, regions and sensors: numbers for verdicts, sentences and charts.

use std::collections::BTreeMap;

use super::air::Crossings;
use super::clock::Clock;
use super::error::Error;
use super::points::Group;
use crate::base::Timeline;
use crate::base::limits::TILE_EDGE;
use crate::glare::{Lengths, Run, SpotGlare, margins, runs, spot};
use crate::pages::{Neighbours, Query, Store};
use crate::project::{Candidate, PlannedView, Results};
use crate::render::sensors::Footing;
use crate::render::{HitMap, PvInView};
use crate::rules::Class;
use crate::volume::{TimeAxis, Volume};

pub use super::year::{AtThreshold, Banded, Episode, GroupReceived, Received};

/// Points of a group whose photons are asked which PV surface sent them.
const ASKED_POINTS: usize = 12;
/// Episodes that are kept for each threshold.
const EPISODES: usize = 10;
/// Standard errors between a value and the ends of its band.
const BAND: f64 = 2.0;

/// What one point receives.
#[derive(Clone, Debug)]
pub struct PointReceived {
    /// Largest irradiance, W/m2, and its timestep.
    pub peak: (f32, usize),
    /// See [`margins`].
    pub margins: [f32; 2],
    /// For each threshold.
    pub glare: Vec<SpotGlare>,
}

/// A group, its points, and for each timestep the strongest irradiance and the PV surface that
/// sends most of it.
pub struct Reading {
    /// For people and verdicts.
    pub group: GroupReceived,
    /// For each point; none where it stands on the PV.
    pub points: Vec<Option<PointReceived>>,
    /// W/m2.
    pub strongest: Vec<f32>,
    /// PV surface number and its share; none where nobody was asked.
    pub surface: Vec<Option<(u16, f64)>>,
}

/// What was rendered at the points of a set.
pub struct Rendered<'a> {
    /// What they see.
    pub hits: &'a HitMap,
    /// Their series.
    pub volume: &'a Volume,
    /// Whether the series has no noise.
    pub exact: bool,
    /// Radiant exposure of each point, Wh/m2.
    pub annual: &'a [f32],
    /// For each threshold hours of the year and longest run after the filter in time, h, of each
    /// point.
    pub filtered: &'a [[Vec<f32>; 2]],
}

/// The photons that a series was made from.
pub struct SeriesPhotons<'a> {
    /// Of the material; none where nothing was made of photons.
    pub store: Option<&'a Store>,
    /// Of the points in free air, where they were counted there.
    pub air: Option<&'a Crossings>,
    /// How many a search takes.
    pub bandwidth: usize,
    /// Its largest radius, m.
    pub max_radius_m: f32,
}

/// The timesteps of a series.
pub struct Calendar {
    /// As they are.
    pub axis: TimeAxis,
    /// Their hours those that clocks show.
    pub civil: TimeAxis,
    /// How long they last.
    pub lengths: Lengths,
}

impl Calendar {
    /// The timesteps of a run, by a clock.
    ///
    /// # Errors
    /// Timesteps that make no calendar.
    pub fn of(timeline: &Timeline, clock: &Clock) -> Result<Self, Error> {
        let axis = TimeAxis::from(timeline);
        let civil = TimeAxis { hour: clock.hours(&axis), ..axis.clone() };
        Ok(Self { lengths: Lengths::of(&axis)?, civil, axis })
    }

    /// At which timesteps glare counts for receivers of a class.
    pub fn counts(&self, class: Option<Class>, clock: &Clock) -> Vec<bool> {
        let at = |t: usize| {
            let hour = clock.civil_hour(self.axis.day[t], self.axis.hour[t]);
            class.is_none_or(|class| class.counts_at(hour))
        };
        (0..self.axis.day.len()).map(at).collect()
    }
}

/// Reads what arrives at the groups of a set.
pub struct Reader<'a> {
    pub rendered: Rendered<'a>,
    pub photons: SeriesPhotons<'a>,
    pub calendar: &'a Calendar,
    /// Names of the PV surfaces.
    pub surfaces: &'a [String],
    /// W/m2.
    pub thresholds: &'a [f64],
    /// At which timesteps glare counts.
    pub counts: Vec<bool>,
}

/// What arrives at the groups of a set, from their file.
///
/// # Errors
/// When the file is missing or damaged.
pub fn read_received(
    results: &Results<'_>,
    candidate: &Candidate,
    set: &PlannedView,
) -> Result<Received, Error> {
    Ok(results.folder.read_json(&results.folder.received(&candidate.name, &set.name))?)
}

impl Reader<'_> {
    /// Reads a group. Memory holds its points 32 at a time.
    ///
    /// # Errors
    /// When the series or the photon store can't be read.
    pub fn read(&self, group: &Group) -> Result<Reading, Error> {
        let steps = self.calendar.axis.day.len();
        let mut strongest = vec![0.0f32; steps];
        let mut points: Vec<Option<PointReceived>> = vec![None; group.points()];
        self.series(group, |point, series| {
            for (most, value) in strongest.iter_mut().zip(series) {
                *most = most.max(*value);
            }
            points[point] = Some(self.point(series)?);
            Ok(())
        })?;
        let mut out = self.sums(group, &points);
        if out.not_evaluated.is_some() {
            return Ok(Reading { group: out, points, strongest, surface: vec![None; steps] });
        }
        let (by_step, total) = self.who(group, &points)?;
        let flux: f64 = total.values().sum();
        let name =
            |surface: u16| self.surfaces.get(usize::from(surface)).cloned().unwrap_or_default();
        out.surfaces = total.iter().map(|(s, f)| (name(*s), f / flux)).collect();
        let surface: Vec<_> = (0..steps).map(|t| by_step.get(&t).and_then(main)).collect();
        for (i, at) in out.thresholds.iter_mut().enumerate() {
            if !self.rendered.exact {
                self.bands(group, &points, i, at)?;
            }
            let threshold = at.threshold_w_m2 as f32;
            let dazzles = |t: usize| self.counts[t] && strongest[t] > threshold;
            at.anywhere = spot(&self.calendar.civil, &self.calendar.lengths, dazzles);
            let mut all = runs(&self.calendar.axis, dazzles);
            all.sort_by_key(|r| (std::cmp::Reverse(r.last - r.first), r.first));
            all.truncate(EPISODES);
            at.episodes = all.iter().map(|run| episode(run, &strongest, &by_step, name)).collect();
        }
        Ok(Reading { group: out, points, strongest, surface })
    }

    /// Calls `each` with the number in the group and the series of its points, but for those on
    /// the PV.
    fn series(
        &self,
        group: &Group,
        mut each: impl FnMut(usize, &[f32]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let end = group.first + group.points();
        let mut tile = group.first / TILE_EDGE;
        let steps = self.calendar.axis.day.len();
        while tile * TILE_EDGE < end {
            let first = group.first.max(tile * TILE_EDGE);
            let last = end.min((tile + 1) * TILE_EDGE);
            let mut all = vec![vec![0.0f32; steps]; last - first];
            self.rendered.volume.read_tile(tile, |from, numbers| {
                let slices = numbers.chunks_exact(TILE_EDGE * TILE_EDGE);
                for (t, slice) in (from..steps).zip(slices) {
                    for (series, column) in all.iter_mut().zip(first % TILE_EDGE..) {
                        series[t] = slice[column];
                    }
                }
            })?;
            for (series, number) in all.iter().zip(first..) {
                let point = number - group.first;
                if group.footing[point] != Footing::Pv {
                    each(point, series)?;
                }
            }
            tile += 1;
        }
        Ok(())
    }

    fn point(&self, series: &[f32]) -> Result<PointReceived, Error> {
        let peak = series
            .iter()
            .enumerate()
            .fold((0.0f32, 0), |most, (t, v)| if *v > most.0 { (*v, t) } else { most });
        let glare = |threshold: &f64| {
            let threshold = *threshold as f32;
            spot(&self.calendar.civil, &self.calendar.lengths, |t| {
                self.counts[t] && series[t] > threshold
            })
        };
        Ok(PointReceived {
            peak,
            margins: margins(&self.calendar.axis, &self.calendar.lengths, series)?,
            glare: self.thresholds.iter().map(glare).collect(),
        })
    }

    /// All that follows from the points one by one.
    fn sums(&self, group: &Group, points: &[Option<PointReceived>]) -> GroupReceived {
        let known = || points.iter().enumerate().filter_map(|(i, p)| Some((i, p.as_ref()?)));
        let air = group.footing.iter().filter(|f| **f == Footing::Air).count();
        let pv = group.footing.iter().filter(|f| **f == Footing::Pv).count();
        let mut notes = group.notes.clone();
        let whole = known().count();
        if pv > 0 && whole > 0 {
            let all = group.points();
            notes.push(format!("{pv} of {all} points lie on the PV itself and are left out"));
        }
        let area = |i: usize| group.area_m2[i];
        let area_m2 = known().fold(0.0, |sum, (i, _)| sum + area(i));
        let weight = |i: usize| if area_m2 > 0.0 { area(i) / area_m2 } else { 1.0 / whole as f64 };
        let annual = |i: usize| f64::from(self.rendered.annual[group.first + i]);
        let most = |of: &dyn Fn(&PointReceived) -> f32| {
            known().map(|(_, p)| f64::from(of(p))).fold(0.0, f64::max)
        };
        let peak =
            known().map(|(_, p)| p.peak).fold((0.0f32, 0), |a, b| if b.0 > a.0 { b } else { a });
        let mut seen: Option<PvInView> = None;
        for v in group.pv.iter().flatten() {
            let s = seen.get_or_insert(*v);
            s.nearest_m = s.nearest_m.min(v.nearest_m);
            s.widest_deg = s.widest_deg.max(v.widest_deg);
            s.solid_angle_sr = s.solid_angle_sr.max(v.solid_angle_sr);
        }
        let thresholds = self.thresholds.iter().enumerate().map(|(k, threshold)| {
            let dazzled = || known().filter(move |(_, p)| p.glare[k].hours > 0.0);
            let best = |of: &dyn Fn(&SpotGlare) -> f64| {
                known().map(|(_, p)| of(&p.glare[k])).fold(0.0, f64::max)
            };
            let day = known().map(|(_, p)| &p.glare[k]).fold((0.0, 0), |a, g| {
                if g.longest_day_h > a.0 { (g.longest_day_h, g.longest_day) } else { a }
            });
            let filtered = |map: usize| {
                let all = &self.rendered.filtered[k][map];
                known().map(|(i, _)| f64::from(all[group.first + i])).fold(0.0, f64::max)
            };
            AtThreshold {
                threshold_w_m2: *threshold,
                hours: Banded::exactly(best(&|g| g.hours)),
                longest_run_h: Banded::exactly(best(&|g| g.longest_run_h)),
                longest_day_h: Banded::exactly(day.0),
                longest_day: day.1,
                months: known().map(|(_, p)| p.glare[k].months()).max().unwrap_or(0),
                filtered_hours: filtered(0),
                filtered_run_h: filtered(1),
                area_m2: dazzled().fold(0.0, |sum, (i, _)| sum + area(i)),
                share: dazzled().count() as f64 / whole.max(1) as f64,
                anywhere: SpotGlare::default(),
                episodes: Vec::new(),
            }
        });
        GroupReceived {
            name: group.name.clone(),
            kind: group.kind,
            not_evaluated: (whole == 0).then(|| "it lies on the PV itself".to_owned()),
            notes,
            points: whole,
            in_air: air,
            area_m2,
            pv: seen,
            annual_max_wh_m2: known().map(|(i, _)| annual(i)).fold(0.0, f64::max),
            annual_mean_wh_m2: known().fold(0.0, |sum, (i, _)| sum + annual(i) * weight(i)),
            peak_w_m2: f64::from(peak.0),
            peak_at: peak.1,
            exceeded_30min_w_m2: most(&|p| p.margins[0]),
            exceeded_50h_w_m2: most(&|p| p.margins[1]),
            surfaces: BTreeMap::new(),
            thresholds: thresholds.collect(),
        }
    }

    /// Calls `each` with timestep, flux and PV surface of the photons that a point's series was
    /// made from.
    fn photons(&self, number: usize, mut each: impl FnMut(u32, f32, u16)) -> Result<(), Error> {
        let hit = &self.rendered.hits.hits[number];
        let SeriesPhotons { store, air, bandwidth, max_radius_m } = self.photons;
        match (store, air) {
            (Some(store), _) if hit.kind.receives() => {
                let (point, normal) = (hit.position, hit.normal);
                let query = Query { point, normal, count: bandwidth, max_radius_m };
                let mut found = Neighbours::default();
                store.nearest(&query, &mut found)?;
                found.items().iter().for_each(|p| each(p.timestep, p.flux_w, p.surface));
                Ok(())
            }
            (_, Some(air)) => air.photons(number, each),
            _ => Ok(()),
        }
    }

    /// Flux by timestep and PV surface around the points that receive most in the year, and by
    /// surface over the whole year.
    #[expect(clippy::type_complexity, reason = "a table of tables, used once")]
    fn who(
        &self,
        group: &Group,
        points: &[Option<PointReceived>],
    ) -> Result<(BTreeMap<usize, BTreeMap<u16, f64>>, BTreeMap<u16, f64>), Error> {
        let annual = |i: usize| self.rendered.annual[group.first + i];
        let mut order: Vec<usize> =
            (0..points.len()).filter(|i| points[*i].is_some() && annual(*i) > 0.0).collect();
        order.sort_by(|a, b| annual(*b).total_cmp(&annual(*a)).then(a.cmp(b)));
        // Half of them the brightest, half spread over the rest: the others shine at other times.
        let bright = order.len().min(ASKED_POINTS / 2);
        let every = (order.len() - bright).div_ceil(ASKED_POINTS / 2).max(1);
        let asked: Vec<usize> =
            order[..bright].iter().chain(order[bright..].iter().step_by(every)).copied().collect();
        let (mut by_step, mut total) = (BTreeMap::new(), BTreeMap::new());
        for point in asked {
            self.photons(group.first + point, |timestep, flux_w, surface| {
                let step: &mut BTreeMap<u16, f64> = by_step.entry(timestep as usize).or_default();
                *step.entry(surface).or_insert(0.0) += f64::from(flux_w);
                *total.entry(surface).or_insert(0.0) += f64::from(flux_w);
            })?;
        }
        Ok((by_step, total))
    }

    /// The bands of the largest values: their points' irradiances moved by two standard errors, as
    /// the number of photons behind each says.
    fn bands(
        &self,
        group: &Group,
        points: &[Option<PointReceived>],
        k: usize,
        at: &mut AtThreshold,
    ) -> Result<(), Error> {
        let value = |p: &PointReceived, which: usize| match which {
            0 => p.glare[k].hours,
            1 => p.glare[k].longest_run_h,
            _ => p.glare[k].longest_day_h,
        };
        let mut known: BTreeMap<usize, [SpotGlare; 2]> = BTreeMap::new();
        for which in 0..3 {
            // Where nothing exceeds the threshold, the brightest point may do so by its noise.
            let mut best: Option<(usize, (f64, f32))> = None;
            for (i, p) in points.iter().enumerate() {
                let Some(p) = p else { continue };
                let rank = (value(p, which), p.peak.0);
                if best.is_none_or(|(_, most)| rank > most) {
                    best = Some((i, rank));
                }
            }
            let Some((point, (found, _))) = best else { continue };
            if let std::collections::btree_map::Entry::Vacant(place) = known.entry(point) {
                place.insert(self.band(group, point, at.threshold_w_m2)?);
            }
            let ends = &known[&point];
            let of = |g: &SpotGlare| match which {
                0 => g.hours,
                1 => g.longest_run_h,
                _ => g.longest_day_h,
            };
            let banded = Banded {
                value: found,
                low: of(&ends[0]).min(found),
                high: of(&ends[1]).max(found),
            };
            match which {
                0 => at.hours = banded,
                1 => at.longest_run_h = banded,
                _ => at.longest_day_h = banded,
            }
        }
        Ok(())
    }

    /// The glare of a point whose irradiances are all lower, and all higher, than they are.
    fn band(&self, group: &Group, point: usize, threshold: f64) -> Result<[SpotGlare; 2], Error> {
        let mut counts: BTreeMap<usize, f64> = BTreeMap::new();
        self.photons(group.first + point, |timestep, _, _| {
            *counts.entry(timestep as usize).or_insert(0.0) += 1.0;
        })?;
        let series = self.rendered.volume.pixel(group.first + point, 0)?;
        let photons: f64 = counts.values().sum();
        let sum: f64 = series.iter().map(|v| f64::from(*v)).sum();
        let per_photon = if photons > 0.0 { sum / photons } else { 0.0 };
        let lit = |t: usize| series.get(t).is_some_and(|v| *v > 0.0);
        let moved = |t: usize, by: f64| {
            let value = f64::from(series[t]);
            match counts.get(&t) {
                Some(n) => value * (1.0 + by / n.sqrt()),
                // No photon where there are some before or after: up to three may have been missed
                // (95 %).
                None if by > 0.0 && (lit(t + 1) || t > 0 && lit(t - 1)) => 3.0 * per_photon,
                None => value,
            }
        };
        let dazzles = |t: usize, by: f64| self.counts[t] && moved(t, by) > threshold;
        Ok([-BAND, BAND]
            .map(|by| spot(&self.calendar.civil, &self.calendar.lengths, |t| dazzles(t, by))))
    }
}

/// The surface that sends most, and its share; of several the first.
fn main(surfaces: &BTreeMap<u16, f64>) -> Option<(u16, f64)> {
    let sum: f64 = surfaces.values().sum();
    let most = surfaces.iter().fold(None, |most: Option<(u16, f64)>, (s, f)| match most {
        Some((_, flux)) if flux >= *f => most,
        _ => Some((*s, *f)),
    });
    most.filter(|_| sum > 0.0).map(|(s, f)| (s, f / sum))
}

fn episode(
    run: &Run,
    strongest: &[f32],
    by_step: &BTreeMap<usize, BTreeMap<u16, f64>>,
    name: impl Fn(u16) -> String,
) -> Episode {
    let mut sums: BTreeMap<u16, f64> = BTreeMap::new();
    for surfaces in by_step.range(run.first..=run.last).map(|(_, s)| s) {
        for (surface, flux) in surfaces {
            *sums.entry(*surface).or_insert(0.0) += flux;
        }
    }
    Episode {
        first: run.first,
        last: run.last,
        peak_w_m2: strongest[run.first..=run.last]
            .iter()
            .fold(0.0, |most, v| f64::from(*v).max(most)),
        surface: main(&sums).map(|(s, share)| (name(s), share)),
    }
}
