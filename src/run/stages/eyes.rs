//! The observers' eyes: luminance, hazard and veil of each material's year, as tables and charts.

use std::fmt::Write as _;
use std::path::PathBuf;

use glintmap_formats::seal;
use serde_json::json;

use super::judged::class;
use super::receivers::sheet::quoted;
use super::receivers::{OUTDOOR_H, occurrence};
use crate::base::{Irradiance, Provenance, SpectralBasis};
use crate::glare::{Kernel, Lengths};
use crate::picture::scatter::{Dots, LogAxis, Scatter, Zone};
use crate::project::{Candidate, RECEIVERS};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::{
    EyeYear, EyeYears, Looker, Measure, Thresholds, azimuth_altitude_deg, instants, sights, zone_of,
};
use crate::receivers::points::Spreader;
use crate::render::eye::hazard::{HazardZone, after_image_w_cm2, burn_w_cm2};
use crate::render::eye::{Eye, EyeInstant, EyeMaterial, EyePv};
use crate::rules::Class;
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::volume::TimeAxis;

/// Looks through the eyes of all observers.
pub(in crate::run) fn eyes(job: &Job<'_>) -> Result<Made, Error> {
    let resolved = job.resolved;
    let timeline = job.timeline()?;
    let axis = TimeAxis::from(timeline);
    let site = job.site()?;
    let clock = Clock::new(&resolved.project.site, axis.year);
    let bsdfs: Vec<Vec<EyeMaterial<'_>>> =
        resolved.candidates.iter().map(|c| EyeMaterial::by_surface(&c.bsdfs, site)).collect();
    let [sigma, ..] = resolved.project.glare.sigma;
    let filter = Kernel::gaussian('t', sigma, resolved.project.glare.truncate)?;
    let thresholds = Thresholds {
        filter: &filter,
        irradiances_w_m2: &resolved.project.glare.thresholds_w_m2,
        normal: resolved.quantity == Irradiance::FacingBeam,
    };
    let pv = EyePv::new(site);
    let lookers = lookers(job, &axis, &clock)?;
    let lengths = Lengths::of(&axis)?;
    let civil = TimeAxis { hour: clock.hours(&axis), ..axis.clone() };
    let mut sheets: Vec<Sheets> =
        resolved.candidates.iter().map(|_| Sheets::new(&axis, &clock)).collect();
    let mut outputs = Vec::new();
    job.progress.begin("eyes", lookers.len() as u64, "observers");
    for (number, looker) in lookers.iter().enumerate() {
        let seen = sights(&pv, looker.eye);
        let years = instants(&pv, &seen, timeline, &bsdfs, job.progress)?;
        for ((candidate, instants), sheets) in
            resolved.candidates.iter().zip(&years).zip(&mut sheets)
        {
            let year = EyeYear::of(looker, &seen, (&civil, &lengths), instants, &thresholds);
            sheets.add(job, &clock, &axis, &year, instants)?;
            let stem = occurrence(number, &looker.name);
            let file = format!("{stem}-hazard.png");
            let name = job.folder.map(&candidate.name, RECEIVERS, &file);
            let path = job.folder.prepare(&name)?;
            let texts = vec![("Software".to_owned(), Provenance::PROGRAM.to_owned())];
            chart(&year, candidate, &axis, instants).write_png(&path, &texts)?;
            outputs.push(name);
            sheets.years.observers.push(year);
        }
        job.progress.advance(1);
    }
    job.progress.finish();
    for (candidate, sheets) in resolved.candidates.iter().zip(sheets) {
        outputs.extend(sheets.write(job, candidate)?);
    }
    Ok(Made::new(outputs, json!({ "observers": lookers.len() })))
}

/// What the observers' eyes see of a material, from its file; nothing where nobody looks.
pub(in crate::run) fn read_eyes(job: &Job<'_>, candidate: &Candidate) -> Result<EyeYears, Error> {
    if job.resolved.project.observer.is_empty() {
        return Ok(EyeYears::default());
    }
    let path = job.folder.at(&job.folder.map(&candidate.name, RECEIVERS, "observers.json"));
    let text = std::fs::read(&path).map_err(|source| Error::Read { path: path.clone(), source })?;
    serde_json::from_slice(&text).map_err(|e| Error::Manifest { path, message: e.to_string() })
}

fn lookers(job: &Job<'_>, axis: &TimeAxis, clock: &Clock) -> Result<Vec<Looker>, Error> {
    let spreader = Spreader { resolved: job.resolved, site: job.site()? };
    let one = |o: &crate::project::ObserverTable| {
        let sensor = spreader.observer(o);
        let outdoor = class(job, &o.name) == Some(Class::Outdoor);
        let counts = |t: usize| {
            let hour = clock.civil_hour(axis.day[t], axis.hour[t]);
            !outdoor || (OUTDOOR_H[0]..=OUTDOOR_H[1]).contains(&hour)
        };
        Looker {
            name: o.name.clone(),
            eye: Eye { position: sensor.position, direction: sensor.normal },
            counts: (0..axis.day.len()).map(counts).collect(),
        }
    };
    Ok(job.resolved.project.observer.iter().map(one).collect())
}

/// The tables of one material.
struct Sheets {
    years: EyeYears,
    steps: String,
    daily: String,
    monthly: String,
}

const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

impl Sheets {
    fn new(axis: &TimeAxis, clock: &Clock) -> Self {
        let efficacy_lm_per_w = axis.basis.lm_per_w();
        Self {
            years: EyeYears { efficacy_lm_per_w, clock: clock.zone(), observers: Vec::new() },
            steps: "observer,timestep,day,hour,at,sun_altitude_deg,sun_azimuth_deg,\
                    irradiance_w_m2,irradiance_normal_w_m2,illuminance_lx,peak_cd_m2,mean_cd_m2,\
                    lit_sr,peak_azimuth_deg,peak_altitude_deg,off_axis_deg,apart_from_sun_deg,\
                    pv_surface,subtended_mrad,retinal_w_cm2,after_image_ratio,burn_ratio,hazard,\
                    veil_cd_m2\n"
                .into(),
            daily: "observer,measure,day,date,minutes,first_h,last_h\n".into(),
            monthly: format!("observer,measure,{},year_h,days,longest_day_min\n", MONTHS.join(",")),
        }
    }

    fn add(
        &mut self,
        job: &Job<'_>,
        clock: &Clock,
        axis: &TimeAxis,
        year: &EyeYear,
        instants: &[EyeInstant],
    ) -> Result<(), Error> {
        let (name, lm_per_w) = (quoted(&year.name), axis.basis.lm_per_w());
        let surfaces = &job.site()?.pv;
        let looks = glam::DVec3::from_array(year.direction);
        // Writing into a String can't fail.
        for (t, i) in instants.iter().enumerate().filter(|(_, i)| i.normal_w_m2 > 0.0) {
            let (sun_azimuth, sun_altitude) = azimuth_altitude_deg(axis.sun[t]);
            let (azimuth, altitude) = azimuth_altitude_deg(i.peak.towards);
            let apart =
                |a: glam::DVec3| libm::acos(a.dot(i.peak.towards).clamp(-1.0, 1.0)).to_degrees();
            let surface = surfaces.get(usize::from(i.surface)).map_or("", |s| s.name.as_str());
            let zone = match zone_of(i) {
                HazardZone::None => "none",
                HazardZone::Low => "green",
                HazardZone::AfterImage => "yellow",
                HazardZone::Burn => "red",
            };
            let (day, hour) = (axis.day[t], axis.hour[t]);
            let _ = writeln!(
                self.steps,
                "{name},{t},{day},{hour:.4},{},{sun_altitude:.2},{sun_azimuth:.2},{:.5e},{:.5e},{:.5e},{:.5e},{:.5e},{:.4e},{azimuth:.2},{altitude:.2},{:.2},{:.2},{},{:.3},{:.4e},{:.4e},{:.4e},{zone},{:.4e}",
                clock.show(day, hour),
                i.surface_w_m2,
                i.normal_w_m2,
                i.surface_w_m2 * lm_per_w,
                i.peak.radiance_w_m2_sr * lm_per_w,
                i.mean_w_m2_sr() * lm_per_w,
                i.lit_sr,
                apart(looks),
                apart(axis.sun[t]),
                quoted(surface),
                i.after_image.subtended_rad * 1e3,
                i.after_image.retinal_w_cm2,
                i.after_image.after_image_ratio(),
                i.burn.burn_ratio(),
                i.veil_w_m2_sr * lm_per_w,
            );
        }
        for time in &year.times {
            let measure = time.measure.words();
            for (day, minutes, first, last) in &time.days {
                let _ = writeln!(
                    self.daily,
                    "{name},{measure},{day},{},{minutes:.2},{first:.4},{last:.4}",
                    clock.date(*day)
                );
            }
            let months: Vec<String> =
                time.glare.months_h.iter().map(|h| format!("{h:.4}")).collect();
            let _ = writeln!(
                self.monthly,
                "{name},{measure},{},{:.4},{},{:.2}",
                months.join(","),
                time.glare.hours,
                time.glare.days,
                time.glare.longest_day_h * 60.0
            );
        }
        Ok(())
    }

    fn write(self, job: &Job<'_>, candidate: &Candidate) -> Result<Vec<PathBuf>, Error> {
        let json = serde_json::to_vec_pretty(&self.years).map_err(std::io::Error::from)?;
        let files = [
            ("observers.json", json),
            ("observers.csv", self.steps.into_bytes()),
            ("observers-daily.csv", self.daily.into_bytes()),
            ("observers-monthly.csv", self.monthly.into_bytes()),
        ];
        let mut out = Vec::new();
        for (file, bytes) in files {
            let name = job.folder.map(&candidate.name, RECEIVERS, file);
            let path = job.folder.prepare(&name)?;
            seal::write_bytes(&path, &bytes).map_err(|source| Error::Write { path, source })?;
            out.push(name);
        }
        Ok(out)
    }
}

/// Where the picture of an observer's hazard lies.
pub(super) fn hazard_png(
    job: &Job<'_>,
    candidate: &Candidate,
    number: usize,
    name: &str,
) -> PathBuf {
    let file = format!("{}-hazard.png", occurrence(number, name));
    job.folder.map(&candidate.name, RECEIVERS, &file)
}

const GREEN: [u8; 3] = [0xd3, 0xe8, 0xcb];
const YELLOW: [u8; 3] = [0xfb, 0xec, 0xb5];
const RED: [u8; 3] = [0xf3, 0xc6, 0xbd];
const DOT: [u8; 3] = [0x1f, 0x4e, 0x79];
const SUN: [u8; 3] = [0x00, 0x00, 0x00];

/// Retinal irradiance against subtended angle: the plot of Ho et al. (2011).
fn chart(
    year: &EyeYear,
    candidate: &Candidate,
    axis: &TimeAxis,
    instants: &[EyeInstant],
) -> Scatter {
    const X: (i32, i32) = (-4, 0);
    let angles: Vec<f64> = (0..=200)
        .map(|i| libm::pow(10.0, f64::from(X.0) + f64::from(X.1 - X.0) * f64::from(i) / 200.0))
        .collect();
    let curve = |of: fn(f64) -> f64| angles.iter().map(|&w| (w, of(w))).collect::<Vec<_>>();
    let zone =
        |label: &str, color, label_at, above| Zone { label: label.into(), color, label_at, above };
    let points: Vec<(f64, f64)> = instants
        .iter()
        .filter(|i| i.normal_w_m2 > 0.0)
        .map(|i| (i.after_image.subtended_rad, i.after_image.retinal_w_cm2))
        .collect();
    let hours = |measure| year.time(measure).map_or(0.0, |t| t.hours);
    let [green, yellow, red] = [Measure::Green, Measure::Yellow, Measure::Red].map(hours);
    let basis = match axis.basis {
        SpectralBasis::Visible => {
            " Irradiances are visible watts, about half of the full spectrum that the zones mean."
        }
        SpectralBasis::Broadband => "",
    };
    let sun = crate::render::eye::hazard::Hazard::of(
        1000.0,
        SunSize(axis.sun_diameter_deg).solid_angle_sr(),
    );
    Scatter {
        title: format!("{}: hazard to the eye", year.name),
        subtitle: format!(
            "{}: {yellow:.1} h a year with potential for an after-image, {red:.1} h for a burn, {green:.1} h below",
            candidate.name
        ),
        x: LogAxis { label: "angle that the source subtends (rad)".into(), decades: X },
        y: LogAxis { label: "irradiance on the retina (W/cm²)".into(), decades: (-6, 3) },
        zones: vec![
            zone("low potential for an after-image", GREEN, (1.3e-4, 2e-6), Vec::new()),
            zone("potential for an after-image", YELLOW, (1.2e-2, 1.0), curve(after_image_w_cm2)),
            zone("burn of the retina", RED, (3e-2, 60.0), curve(burn_w_cm2)),
        ],
        dots: vec![
            Dots { label: "each timestep that sends light".into(), color: DOT, size: 5.0, points },
            Dots {
                label: "the sun itself, looked at (1000 W/m²)".into(),
                color: SUN,
                size: 8.0,
                points: vec![(sun.subtended_rad, sun.retinal_w_cm2)],
            },
        ],
        caption: format!(
            "Ho, Ghanbari, Diver (2011): pupil 2 mm, transmittance 0.5, focal length 17 mm, a blink of 0.15 s. Of each timestep the part of the PV that is worst.{basis}"
        ),
    }
}

struct SunSize(f64);

impl SunSize {
    fn solid_angle_sr(&self) -> f64 {
        let radius = 0.5 * self.0.to_radians();
        2.0 * std::f64::consts::PI * (1.0 - libm::cos(radius))
    }
}
