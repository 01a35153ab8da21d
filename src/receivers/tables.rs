//! What arrives at receivers, as tables for spreadsheets: the rows of `sensors.csv`, of each
//! receiver's occurrence, and of the observers' eyes.

use std::io::{self, Write};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::clock::Clock;
use super::eyes::{EyeYear, azimuth_altitude_deg, zone_of};
use super::points::Group;
use super::received::Reading;
use crate::base::table::{Fixed, FixedOr0, Scientific, Shortest, Table, columns};
use crate::base::{Grid, MONTHS};
use crate::glare::SpotGlare;
use crate::render::HitMap;
use crate::render::eye::EyeInstant;
use crate::render::eye::hazard::HazardZone;
use crate::volume::TimeAxis;

/// One point; where nothing is known the values are left out. The columns of each threshold
/// follow.
#[derive(Clone, Debug, Default, Serialize)]
struct PointRow {
    group: String,
    point: usize,
    x_m: Fixed<4>,
    y_m: Fixed<4>,
    z_m: Fixed<4>,
    nx: Fixed<4>,
    ny: Fixed<4>,
    nz: Fixed<4>,
    stands_on: String,
    area_m2: Fixed<4>,
    pv_distance_m: Fixed<3>,
    annual_wh_m2: Shortest,
    annual_normal_wh_m2: Shortest,
    peak_w_m2: Shortest,
    peak_at: String,
    exceeded_30min_w_m2: Shortest,
    exceeded_50h_w_m2: Shortest,
}

/// The glare of a point above a threshold.
#[derive(Clone, Debug, Default, Serialize)]
struct GlareCells {
    hours: FixedOr0<4>,
    days: Option<u32>,
    longest_run_min: FixedOr0<2>,
    longest_run_at: String,
    longest_day_min: FixedOr0<2>,
    longest_day: String,
    first_hour: Fixed<4>,
    last_hour: Fixed<4>,
}

impl GlareCells {
    fn of(g: &SpotGlare, clock: &Clock, axis: &TimeAxis) -> Self {
        if g.hours <= 0.0 {
            return Self {
                hours: FixedOr0(Some(0.0)),
                days: Some(0),
                longest_run_min: FixedOr0(Some(0.0)),
                longest_day_min: FixedOr0(Some(0.0)),
                ..Self::default()
            };
        }
        let [first, last] = g.between_h.unwrap_or_default();
        let at = g.longest_run_at as usize;
        Self {
            hours: FixedOr0(Some(g.hours)),
            days: Some(g.days),
            longest_run_min: FixedOr0(Some(g.longest_run_h * 60.0)),
            longest_run_at: clock.show(axis.day[at], axis.hour[at]),
            longest_day_min: FixedOr0(Some(g.longest_day_h * 60.0)),
            longest_day: clock.date(g.longest_day),
            first_hour: first.into(),
            last_hour: last.into(),
        }
    }
}

/// The points of a set, group by group: `sensors.csv`.
pub struct PointTable<'a> {
    /// Of the set.
    pub hits: &'a HitMap,
    /// Radiant exposure of its points, Wh/m2.
    pub annual: &'a Grid<f32>,
    /// The same facing the beams.
    pub normal: &'a Grid<f32>,
    /// W/m2.
    pub thresholds: &'a [f64],
    /// What turns timesteps into dates.
    pub clock: &'a Clock,
    /// The timesteps.
    pub axis: &'a TimeAxis,
}

impl PointTable<'_> {
    /// The table before its first row.
    ///
    /// # Errors
    /// Whatever `out` says.
    pub fn begin<W: Write>(&self, out: W) -> io::Result<Table<W>> {
        let mut all = columns::<PointRow>()?;
        let cells = columns::<GlareCells>()?;
        for t in self.thresholds {
            all.extend(cells.iter().map(|column| format!("{column}_above_{t}")));
        }
        Table::with_columns(out, &all)
    }

    /// A row for each point of a group.
    ///
    /// # Errors
    /// Whatever the table's file says.
    pub fn add<W: Write>(
        &self,
        table: &mut Table<W>,
        group: &Group,
        reading: &Reading,
    ) -> io::Result<()> {
        for (i, point) in reading.points.iter().enumerate() {
            let number = group.first + i;
            let hit = &self.hits.hits[number];
            let [x_m, y_m, z_m] = hit.position.as_dvec3().to_array().map(Fixed::from);
            let [nx, ny, nz] = hit.normal.as_dvec3().to_array().map(Fixed::from);
            let mut row = PointRow {
                group: group.name.clone(),
                point: i,
                x_m,
                y_m,
                z_m,
                nx,
                ny,
                nz,
                stands_on: format!("{:?}", group.footing[i]).to_lowercase(),
                area_m2: group.area_m2[i].into(),
                pv_distance_m: group.pv[i].as_ref().map(|pv| pv.nearest_m).into(),
                ..PointRow::default()
            };
            let mut glare = vec![GlareCells::default(); reading.group.thresholds.len()];
            if let Some(p) = point {
                let (peak, at) = p.peak;
                let [worst, year] = p.margins;
                row.annual_wh_m2 = Shortest(Some(self.annual.data()[number]));
                row.annual_normal_wh_m2 = Shortest(Some(self.normal.data()[number]));
                row.peak_w_m2 = Shortest(Some(peak));
                if peak > 0.0 {
                    row.peak_at = self.clock.show(self.axis.day[at], self.axis.hour[at]);
                }
                row.exceeded_30min_w_m2 = Shortest(Some(worst));
                row.exceeded_50h_w_m2 = Shortest(Some(year));
                let cells = p.glare.iter().map(|g| GlareCells::of(g, self.clock, self.axis));
                glare = cells.collect();
            }
            table.push((row, glare))?;
        }
        Ok(())
    }
}

/// A timestep at which a receiver is lit.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct OccurrenceRow {
    /// Its index.
    pub timestep: usize,
    day: u32,
    hour: Fixed<4>,
    at: String,
    sun_altitude_deg: Fixed<2>,
    sun_azimuth_deg: Fixed<2>,
    /// The strongest irradiance at any of its points, W/m2.
    strongest_w_m2: Shortest,
    /// The PV surface that sends most of the light; empty where nobody was asked.
    pub pv_surface: String,
    share: Fixed<3>,
}

impl OccurrenceRow {
    /// The strongest irradiance at any point of the receiver, W/m2.
    pub fn strongest_w_m2(&self) -> f32 {
        self.strongest_w_m2.0.unwrap_or_default()
    }
}

/// When a group is lit: a row for each timestep with light.
pub fn occurrence(
    reading: &Reading,
    surfaces: &[String],
    clock: &Clock,
    axis: &TimeAxis,
) -> Vec<OccurrenceRow> {
    let lit = reading.strongest.iter().enumerate().filter(|(_, v)| **v > 0.0);
    let row = |(t, strongest): (usize, &f32)| {
        let sun = axis.sun[t];
        let sender = reading.surface[t];
        let name = sender.and_then(|(s, _)| surfaces.get(usize::from(s)));
        OccurrenceRow {
            timestep: t,
            day: axis.day[t],
            hour: axis.hour[t].into(),
            at: clock.show(axis.day[t], axis.hour[t]),
            sun_altitude_deg: libm::asin(sun.z).to_degrees().into(),
            sun_azimuth_deg: libm::atan2(sun.x, sun.y).to_degrees().rem_euclid(360.0).into(),
            strongest_w_m2: Shortest(Some(*strongest)),
            pv_surface: name.cloned().unwrap_or_default(),
            share: sender.map(|(_, share)| share).into(),
        }
    };
    lit.map(row).collect()
}

/// An observer's eye at a timestep with light.
#[derive(Clone, Debug, Default, Serialize)]
struct EyeRow {
    observer: String,
    timestep: usize,
    day: u32,
    hour: Fixed<4>,
    at: String,
    sun_altitude_deg: Fixed<2>,
    sun_azimuth_deg: Fixed<2>,
    irradiance_w_m2: Scientific<5>,
    irradiance_normal_w_m2: Scientific<5>,
    illuminance_lx: Scientific<5>,
    peak_cd_m2: Scientific<5>,
    mean_cd_m2: Scientific<5>,
    lit_sr: Scientific<4>,
    peak_azimuth_deg: Fixed<2>,
    peak_altitude_deg: Fixed<2>,
    off_axis_deg: Fixed<2>,
    apart_from_sun_deg: Fixed<2>,
    pv_surface: String,
    subtended_mrad: Fixed<3>,
    retinal_w_cm2: Scientific<4>,
    after_image_ratio: Scientific<4>,
    burn_ratio: Scientific<4>,
    hazard: &'static str,
    veil_cd_m2: Scientific<4>,
}

/// A day on which an observer's eye sees more than a measure allows.
#[derive(Clone, Debug, Default, Serialize)]
struct EyeDay {
    observer: String,
    measure: String,
    day: u32,
    date: String,
    minutes: Fixed<2>,
    first_h: Fixed<4>,
    last_h: Fixed<4>,
}

/// Whose year, and what was exceeded; the hours of the months follow, then [`EyeSums`].
#[derive(Clone, Debug, Default, Serialize)]
struct EyeMeasure {
    observer: String,
    measure: String,
}

#[derive(Clone, Debug, Default, Serialize)]
struct EyeSums {
    year_h: Fixed<4>,
    days: u32,
    longest_day_min: Fixed<2>,
}

/// The tables of the observers' eyes with one material.
pub struct EyeTables<'a> {
    clock: &'a Clock,
    axis: &'a TimeAxis,
    surfaces: &'a [String],
    timesteps: Table<Vec<u8>>,
    days: Table<Vec<u8>>,
    months: Table<Vec<u8>>,
}

impl<'a> EyeTables<'a> {
    /// Tables without a row. `surfaces`: names of the PV surfaces.
    ///
    /// # Errors
    /// None that depends on the outside.
    pub fn new(clock: &'a Clock, axis: &'a TimeAxis, surfaces: &'a [String]) -> io::Result<Self> {
        let months = MONTHS.map(|name| name[..3].to_lowercase()).to_vec();
        let months = [columns::<EyeMeasure>()?, months, columns::<EyeSums>()?].concat();
        Ok(Self {
            clock,
            axis,
            surfaces,
            timesteps: Table::of::<EyeRow>(Vec::new())?,
            days: Table::of::<EyeDay>(Vec::new())?,
            months: Table::with_columns(Vec::new(), &months)?,
        })
    }

    /// Adds an observer.
    ///
    /// # Errors
    /// None that depends on the outside.
    pub fn add(&mut self, year: &EyeYear, instants: &[EyeInstant]) -> io::Result<()> {
        for (t, instant) in instants.iter().enumerate().filter(|(_, i)| i.normal_w_m2 > 0.0) {
            self.timesteps.push(self.row(year, t, instant))?;
        }
        let observer = || year.name.clone();
        for time in &year.times {
            let measure = time.measure.words();
            for &(day, minutes, first_h, last_h) in &time.days {
                let (measure, date) = (measure.clone(), self.clock.date(day));
                let observer = observer();
                self.days.push(EyeDay {
                    observer,
                    measure,
                    day,
                    date,
                    minutes: minutes.into(),
                    first_h: first_h.into(),
                    last_h: last_h.into(),
                })?;
            }
            let sums = EyeSums {
                year_h: time.glare.hours.into(),
                days: time.glare.days,
                longest_day_min: (time.glare.longest_day_h * 60.0).into(),
            };
            let months = time.glare.months_h.map(Fixed::<4>::from);
            self.months.push((EyeMeasure { observer: observer(), measure }, months, sums))?;
        }
        Ok(())
    }

    fn row(&self, year: &EyeYear, t: usize, i: &EyeInstant) -> EyeRow {
        let (axis, lm_per_w) = (self.axis, self.axis.basis.lm_per_w());
        let (sun_azimuth_deg, sun_altitude_deg) = azimuth_altitude_deg(axis.sun[t]);
        let (peak_azimuth_deg, peak_altitude_deg) = azimuth_altitude_deg(i.peak.towards);
        let apart = |a: DVec3| libm::acos(a.dot(i.peak.towards).clamp(-1.0, 1.0)).to_degrees();
        let hazard = match zone_of(i) {
            HazardZone::None => "none",
            HazardZone::Low => "green",
            HazardZone::AfterImage => "yellow",
            HazardZone::Burn => "red",
        };
        EyeRow {
            observer: year.name.clone(),
            timestep: t,
            day: axis.day[t],
            hour: axis.hour[t].into(),
            at: self.clock.show(axis.day[t], axis.hour[t]),
            sun_altitude_deg: sun_altitude_deg.into(),
            sun_azimuth_deg: sun_azimuth_deg.into(),
            irradiance_w_m2: Scientific(i.surface_w_m2),
            irradiance_normal_w_m2: Scientific(i.normal_w_m2),
            illuminance_lx: Scientific(i.surface_w_m2 * lm_per_w),
            peak_cd_m2: Scientific(i.peak.radiance_w_m2_sr * lm_per_w),
            mean_cd_m2: Scientific(i.mean_w_m2_sr() * lm_per_w),
            lit_sr: Scientific(i.lit_sr),
            peak_azimuth_deg: peak_azimuth_deg.into(),
            peak_altitude_deg: peak_altitude_deg.into(),
            off_axis_deg: apart(DVec3::from_array(year.direction)).into(),
            apart_from_sun_deg: apart(axis.sun[t]).into(),
            pv_surface: self.surfaces.get(usize::from(i.surface)).cloned().unwrap_or_default(),
            subtended_mrad: (i.after_image.subtended_rad * 1e3).into(),
            retinal_w_cm2: Scientific(i.after_image.retinal_w_cm2),
            after_image_ratio: Scientific(i.after_image.after_image_ratio()),
            burn_ratio: Scientific(i.burn.burn_ratio()),
            hazard,
            veil_cd_m2: Scientific(i.veil_w_m2_sr * lm_per_w),
        }
    }

    /// The tables by timestep, day and month.
    ///
    /// # Errors
    /// None that depends on the outside.
    pub fn finish(self) -> io::Result<[Vec<u8>; 3]> {
        Ok([self.timesteps.finish()?, self.days.finish()?, self.months.finish()?])
    }
}
