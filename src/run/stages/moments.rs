//! Pictures of luminances at an instant: radiances as HDR, for people as PNG, and what the eye at
//! the view point gets of the PV.

use std::path::PathBuf;

use glam::DVec3;
use serde_json::{Value, json};

use crate::base::{Grid, Provenance, Timestep};
use crate::picture::{Figure, Scale, exr, hdr, luminance, png, tonemap};
use crate::project::artifacts::MomentFile;
use crate::project::{Camera, Candidate, Key, PlannedMoment};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::azimuth_altitude_deg;
use crate::receivers::points::Spreader;
use crate::render::eye::{Eye, EyeInstant, EyeMaterial, EyePv, SunAt};
use crate::render::moment::{Moment, WATT_LM, illuminance_lx};
use crate::render::{Projection, View};
use crate::run::error::Error;
use crate::run::job::{Job, Made};
use crate::sky::{self, DayRange, HourRange, TimeSpec};

/// Upper end of the falsecolours, cd/m2: one scale for all materials and moments.
const BRIGHTEST_CD_M2: f64 = 1e6;
/// Decades that they span.
const DECADES: f64 = 4.0;

/// Takes all pictures, of each material.
pub(in crate::run) fn luminances(job: &Job<'_>, key: &str) -> Result<Made, Error> {
    let resolved = job.resolved;
    let mut outputs = Vec::new();
    for moment in &resolved.moments {
        for candidate in &resolved.candidates {
            outputs.extend(take(job, moment, candidate, key)?);
        }
    }
    let made = outputs.len();
    Ok(Made::new(outputs, json!({ "files": made })))
}

/// `11 June, 09:30 (06-11 09:30 CEST)`
pub(super) fn when(job: &Job<'_>, moment: &PlannedMoment) -> String {
    let clock = Clock::new(&job.resolved.project.site, job.resolved.times.year);
    clock.show(moment.day, moment.hour)
}

fn camera(job: &Job<'_>, moment: &PlannedMoment) -> Result<View, Error> {
    let [columns, rows] = moment.size;
    let options = match &moment.camera {
        Camera::Options(options) => options.clone(),
        Camera::Observer { number, fisheye } => {
            let spreader = Spreader { resolved: job.resolved, site: job.site()? };
            let eye = spreader.observer(&job.resolved.project.observer[*number]);
            let (p, d) = (eye.position + eye.normal * 2e-3, eye.normal);
            let up = if d.z.abs() > 0.99 { "0 1 0" } else { "0 0 1" };
            let kind = match fisheye {
                true => "-vta -vh 180 -vv 180".to_owned(),
                false => {
                    let across = 40.0 * libm::fmin(1.0, columns as f64 / rows as f64);
                    let tall = 2.0
                        * libm::atan(
                            libm::tan(0.5 * across.to_radians()) * rows as f64 / columns as f64,
                        )
                        .to_degrees();
                    format!("-vtv -vh {across} -vv {tall:.6}")
                }
            };
            format!("{kind} -vp {} {} {} -vd {} {} {} -vu {up}", p.x, p.y, p.z, d.x, d.y, d.z)
        }
    };
    Ok(View::parse(&options, columns, rows)?)
}

/// From 0 (January).
fn month(job: &Job<'_>, moment: &PlannedMoment) -> usize {
    sky::date_of_day(job.resolved.times.year, moment.day).0.saturating_sub(1) as usize
}

/// The sun at the instant, as a timeline of one timestep has it.
fn instant(job: &Job<'_>, moment: &PlannedMoment) -> Result<(Timestep, f64, f64), Error> {
    let resolved = job.resolved;
    let spec = TimeSpec {
        days: DayRange { from: moment.day, to: moment.day, step: 1 },
        hours: HourRange { from: moment.hour, to: moment.hour, step: 0.25 },
        finer: Vec::new(),
        half_year: false,
        ..resolved.times.clone()
    };
    let mut timeline = sky::timeline(&resolved.place, &spec)?;
    if let Some(horizon) = &resolved.horizon {
        timeline = horizon.cut(timeline)?;
    }
    let step = timeline.steps.first().copied().ok_or_else(|| {
        resolved.mistake(&Key::item("moment", moment.table), "the sun is below the horizon then")
    })?;
    Ok((step, timeline.sun_diameter_deg, timeline.basis.lm_per_w()))
}

fn take(
    job: &Job<'_>,
    moment: &PlannedMoment,
    candidate: &Candidate,
    key: &str,
) -> Result<Vec<PathBuf>, Error> {
    let view = camera(job, moment)?;
    let (step, diameter_deg, lm_per_w) = instant(job, moment)?;
    let sun = SunAt { direction: step.sun, irradiance_w_m2: step.irradiance_w_m2, diameter_deg };
    let site = job.site()?;
    let materials = EyeMaterial::by_surface(&candidate.bsdfs, site);
    let scene = Moment::new(site, month(job, moment), sun, lm_per_w, materials.clone());
    let picture = scene.paint(&view, job.progress)?;
    let name = |file| job.folder.moment(&candidate.name, &moment.name, file);
    let facts = facts(job, moment, candidate, &view, (&sun, lm_per_w), &materials, &picture)?;
    let lines = vec![
        format!("SOFTWARE= {}", Provenance::PROGRAM),
        format!("{}, {}: luminance by 179 lm/W", candidate.name, when(job, moment)),
        view.to_view_line(),
    ];
    hdr::write(&job.folder.prepare(&name(MomentFile::Radiance))?, &picture, &lines)?;
    let values = picture.map(|p| luminance(*p) * WATT_LM as f32);
    let about = [("material", candidate.name.as_str()), ("moment", moment.name.as_str())];
    exr::write(
        &job.folder.at(&name(MomentFile::Luminance)),
        &[(MomentFile::CHANNEL, &values)],
        &job.attributes(key, &about)?,
    )?;
    let texts = vec![("Software".to_owned(), Provenance::PROGRAM.to_owned())];
    let pixels = tonemap::tonemap(&picture, tonemap::Exposure::Auto, false);
    png::write(&job.folder.at(&name(MomentFile::Picture)), &pixels, &texts)?;
    let scale = Scale::logarithmic(BRIGHTEST_CD_M2, DECADES, "cd/m²");
    let mut figure = Figure::new(&values, scale);
    figure.title = format!("{}: luminance", candidate.name);
    figure.subtitle = format!("{} · {}", job.resolved.project.site.name, when(job, moment));
    figure.legend = "luminance".into();
    figure.opacity = 1.0;
    figure.caption = vec![told(&facts)];
    figure.write_png(&job.folder.at(&name(MomentFile::LuminancePicture)), &texts)?;
    job.folder.write_json(&name(MomentFile::Facts), &facts)?;
    Ok(MomentFile::ALL.map(name).to_vec())
}

/// What the eye at the view point gets of the PV; and of all, where the picture is half a sphere.
fn facts(
    job: &Job<'_>,
    moment: &PlannedMoment,
    candidate: &Candidate,
    view: &View,
    (sun, lm_per_w): (&SunAt, f64),
    materials: &[EyeMaterial<'_>],
    picture: &Grid<[f32; 3]>,
) -> Result<Value, Error> {
    let (azimuth, altitude) = azimuth_altitude_deg(sun.direction);
    let mut out = json!({
        "moment": moment.name,
        "material": candidate.name,
        "at": when(job, moment),
        "view": view.to_options(),
        "sun": {
            "altitude_deg": altitude,
            "azimuth_deg": azimuth,
            "irradiance_w_m2": sun.irradiance_w_m2,
            "lm_per_w": lm_per_w,
            "luminance_cd_m2": sun.irradiance_w_m2 * lm_per_w / sun.solid_angle_sr(),
        },
    });
    if view.projection() == Projection::Parallel {
        return Ok(out);
    }
    let pv = EyePv::new(job.site()?);
    let month = month(job, moment);
    let seen = pv.seen(Eye { position: view.point(), direction: view.direction() }, month);
    let lit = pv.lit(sun.direction, &seen, month);
    let mut glints = Vec::new();
    pv.look(&seen, &lit, sun, materials, &mut glints);
    let eye = EyeInstant::of(&seen.eye, &mut glints);
    out["pv"] = json!({
        "solid_angle_sr": seen.solid_angle_sr,
        "lit_sr": eye.lit_sr,
        "irradiance_w_m2": eye.surface_w_m2,
        "illuminance_lx": eye.surface_w_m2 * lm_per_w,
        "peak_cd_m2": eye.peak.radiance_w_m2_sr * lm_per_w,
        "mean_cd_m2": eye.mean_w_m2_sr() * lm_per_w,
        "peak_towards": (eye.peak.towards != DVec3::ZERO).then(|| eye.peak.towards.to_array()),
        "after_image_ratio": eye.after_image.after_image_ratio(),
        "burn_ratio": eye.burn.burn_ratio(),
        "veil_cd_m2": eye.veil_w_m2_sr * lm_per_w,
    });
    let round = matches!(view.projection(), Projection::Angular | Projection::Hemispherical);
    if round && view.size() == [180.0, 180.0] {
        out["illuminance_lx"] = illuminance_lx(view, picture).into();
    }
    Ok(out)
}

fn told(facts: &Value) -> String {
    let number = |a: &str, b: &str| facts[a][b].as_f64().unwrap_or(0.0);
    let mut text = format!(
        "Sun {:.1}° high at {:.0}°, {:.0} W/m², clear sky (CIE). ",
        number("sun", "altitude_deg"),
        number("sun", "azimuth_deg"),
        number("sun", "irradiance_w_m2")
    );
    if facts["pv"].is_object() {
        text += &format!(
            "From here the PV's brightest patch has {:.2e} cd/m², its mean {:.2e}; sun on the PV alone gives the eye {:.1} W/m². ",
            number("pv", "peak_cd_m2"),
            number("pv", "mean_cd_m2"),
            number("pv", "irradiance_w_m2")
        );
    }
    text + "Surfaces reflect sun and sky once; what they reflect again is left out."
}
