//! A whole year of an observer's eye in fine steps: when does the PV exceed an irradiance or a
//! luminance, to the minute?

use std::collections::BTreeMap;

use glam::DVec3;
use serde::Serialize;

use super::error::Error;
use super::eyes::{LUMINANCES_CD_M2, sights};
use super::points::Spreader;
use crate::base::{Irradiance, Progress};
use crate::glare::{Lengths, SpotGlare, spot};
use crate::project::Resolved;
use crate::render::eye::{Eye, EyeMaterial, EyePv, SweepLimits, Sweeper};
use crate::site::Site;
use crate::sky::{self, DayRange, HourRange, TimeSpec};
use crate::volume::TimeAxis;

/// What is asked.
#[derive(Clone, Debug)]
pub struct SweepAsked {
    /// Observers of the project by name; empty: all, unless there are points.
    pub observers: Vec<String>,
    /// Points in the air, m from the local origin; they look at the middle of the PV.
    pub points: Vec<DVec3>,
    /// Materials by name; empty: all.
    pub materials: Vec<String>,
    /// Seconds from one instant to the next.
    pub step_s: u32,
    /// Seconds between the instants that are looked at first.
    pub coarse_s: u32,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct Swept {
    /// Which formulas say where the sun stands.
    pub sun: &'static str,
    /// The year.
    pub year: i32,
    /// Seconds from one instant to the next.
    pub step_s: u32,
    /// Instants with the sun above the horizon.
    pub instants: usize,
    /// Lumens that a watt is taken for.
    pub lm_per_w: f64,
    /// In words.
    pub note: String,
    /// Each observer with each material.
    pub eyes: Vec<SweptEye>,
}

/// An observer with a material.
#[derive(Clone, Debug, Serialize)]
pub struct SweptEye {
    /// The observer's name, or the point.
    pub observer: String,
    /// The material or case.
    pub material: String,
    /// Instants that were looked at, of all.
    pub looked: usize,
    /// Of these with shadows.
    pub asked: usize,
    /// By what is exceeded, in words.
    pub exceeded: BTreeMap<String, Exceeded>,
}

/// When something is exceeded; hours are local standard time.
#[derive(Clone, Debug, Serialize)]
pub struct Exceeded {
    /// How long.
    #[serde(flatten)]
    pub glare: SpotGlare,
    /// First and last date, `MM-DD`, and that with most; `null` for never.
    pub dates: Option<[String; 3]>,
    /// Lit days: day of year, date, minutes, first and last hour.
    pub days: Vec<(u32, String, f64, f64, f64)>,
}

/// Sweeps the year.
///
/// # Errors
/// Names that the project doesn't have, a step that isn't a whole part of the day, whatever is
/// wrong with the scene.
pub fn sweep(
    resolved: &Resolved,
    asked: &SweepAsked,
    progress: &dyn Progress,
) -> Result<Swept, Error> {
    let wrong = |message: String| Error::from(resolved.mistaken(message));
    let step_s = asked.step_s;
    if !(10..=3600).contains(&step_s) || 86_400 % step_s != 0 {
        return Err(wrong(format!(
            "the step is {step_s} s, expected 10 s to 1 h, a whole part of the day"
        )));
    }
    let candidates: Vec<_> = resolved
        .candidates
        .iter()
        .filter(|c| asked.materials.is_empty() || asked.materials.contains(&c.name))
        .collect();
    let known: Vec<_> = resolved.candidates.iter().map(|c| c.name.as_str()).collect();
    if let Some(name) = asked.materials.iter().find(|m| !known.contains(&m.as_str())) {
        let known = known.join(", ");
        return Err(wrong(format!("no material is named \"{name}\" (there are: {known})")));
    }
    let site = Site::load(&resolved.scene, &resolved.pv)?;
    let eyes = eyes(&Spreader { resolved, site: &site }, asked, &wrong)?;
    let step_h = f64::from(step_s) / 3600.0;
    let spec = TimeSpec {
        days: DayRange { from: 0, to: sky::days_in_year(resolved.times.year) - 1, step: 1 },
        hours: HourRange { from: 0.0, to: 24.0 - step_h, step: step_h },
        finer: Vec::new(),
        half_year: false,
        ..resolved.times.clone()
    };
    let mut timeline = sky::timeline(&resolved.place, &spec)?;
    if let Some(horizon) = &resolved.horizon {
        timeline = horizon.cut(timeline)?;
    }
    let axis = TimeAxis::from(&timeline);
    let lm_per_w = axis.basis.lm_per_w();
    let limits = SweepLimits {
        irradiances_w_m2: resolved.project.glare.thresholds_w_m2.clone(),
        normal: resolved.quantity == Irradiance::FacingBeam,
        radiances_w_m2_sr: LUMINANCES_CD_M2.map(|l| l / lm_per_w).to_vec(),
    };
    let mut words: Vec<String> =
        limits.irradiances_w_m2.iter().map(|t| format!("irradiance > {t} W/m2")).collect();
    words.extend(LUMINANCES_CD_M2.map(|t| format!("luminance > {t} cd/m2")));
    let pv = EyePv::new(&site);
    let materials: Vec<_> =
        candidates.iter().map(|c| EyeMaterial::by_surface(&c.bsdfs, &site)).collect();
    let coarse = (asked.coarse_s / step_s).max(1) as usize;
    let mut out = Vec::new();
    progress.begin("sweep", (eyes.len() * candidates.len()) as u64, "eyes");
    for (name, eye) in &eyes {
        let seen = sights(&pv, *eye);
        for (candidate, materials) in candidates.iter().zip(&materials) {
            let sweeper =
                Sweeper { pv: &pv, seen: &seen, timeline: &timeline, materials, limits: &limits };
            let found = sweeper.run(coarse, progress)?;
            let exceeded = words.iter().enumerate().map(|(bit, words)| {
                let lit = |t: usize| found.exceeded[t] >> bit & 1 != 0;
                (words.clone(), exceeded(&axis, lit))
            });
            out.push(SweptEye {
                observer: name.clone(),
                material: candidate.name.clone(),
                looked: found.looked,
                asked: found.asked,
                exceeded: exceeded.collect(),
            });
            progress.advance(1);
        }
    }
    progress.finish();
    Ok(Swept {
        sun: resolved.times.sun.name(),
        year: timeline.year,
        step_s,
        instants: timeline.steps.len(),
        lm_per_w,
        note: format!(
            "irradiance {}; {}; hours are local standard time",
            match resolved.quantity {
                Irradiance::Surface => "of the plane across the line of sight",
                Irradiance::FacingBeam => "of planes that face the beams",
            },
            if pv.has_seasons() { "crowns by season" } else { "trees are opaque all year" }
        ),
        eyes: out,
    })
}

fn eyes(
    spreader: &Spreader<'_>,
    asked: &SweepAsked,
    wrong: &dyn Fn(String) -> Error,
) -> Result<Vec<(String, Eye)>, Error> {
    let known = &spreader.resolved.project.observer;
    let eye = |o: &crate::project::ObserverTable| {
        let sensor = spreader.observer(o);
        (o.name.clone(), Eye { position: sensor.position, direction: sensor.normal })
    };
    let mut out = Vec::new();
    for name in &asked.observers {
        let found = known.iter().find(|o| o.name == *name).ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|o| o.name.as_str()).collect();
            wrong(format!("no [[observer]] is named \"{name}\" (there are: {})", names.join(", ")))
        })?;
        out.push(eye(found));
    }
    for p in &asked.points {
        let table = crate::project::ObserverTable {
            name: format!("{},{},{}", p.x, p.y, p.z),
            point: p.to_array(),
            direction: None,
            coordinates: None,
            class: None,
        };
        out.push(eye(&table));
    }
    if out.is_empty() {
        out = known.iter().map(eye).collect();
    }
    if out.is_empty() {
        return Err(wrong("nobody looks: expected an [[observer]] or --point, found none".into()));
    }
    Ok(out)
}

fn exceeded(axis: &TimeAxis, lit: impl Fn(usize) -> bool) -> Exceeded {
    let glare = spot(axis, &Lengths::even(axis), &lit);
    let date = |day| {
        let (month, day) = sky::date_of_day(axis.year, day);
        format!("{month:02}-{day:02}")
    };
    let mut days: Vec<(u32, String, f64, f64, f64)> = Vec::new();
    for t in (0..axis.day.len()).filter(|t| lit(*t)) {
        let (day, hour) = (axis.day[t], axis.hour[t]);
        match days.last_mut() {
            Some(last) if last.0 == day => {
                last.2 += axis.step_h * 60.0;
                last.4 = hour;
            }
            _ => days.push((day, date(day), axis.step_h * 60.0, hour, hour)),
        }
    }
    let dates = days
        .first()
        .zip(days.last())
        .map(|(first, last)| [first.1.clone(), last.1.clone(), date(glare.longest_day)]);
    Exceeded { glare, dates, days }
}

impl Swept {
    /// A table of all days on which anything is exceeded.
    pub fn daily_csv(&self) -> String {
        let mut out = String::from("observer,material,measure,day,date,minutes,first_h,last_h\n");
        for eye in &self.eyes {
            for (measure, exceeded) in &eye.exceeded {
                for (day, date, minutes, first, last) in &exceeded.days {
                    out.push_str(&format!(
                        "\"{}\",{},{measure},{day},{date},{minutes:.3},{first:.4},{last:.4}\n",
                        eye.observer.replace('"', "\"\""),
                        eye.material
                    ));
                }
            }
        }
        out
    }
}
