//! The observers' eyes: luminance, hazard and veil of each material's year, as tables and charts.

use serde_json::json;

use crate::base::{Irradiance, Provenance};
use crate::glare::Kernel;
use crate::project::artifacts::{EyesFile, ReceiverFile, ReceiverId};
use crate::project::{ObserverTable, RECEIVERS};
use crate::receivers::clock::Clock;
use crate::receivers::eyes::{
    EyeYear, EyeYears, HazardPlot, Observer, Thresholds, instants, sights,
};
use crate::receivers::points::Spreader;
use crate::receivers::received::Calendar;
use crate::receivers::tables::EyeTables;
use crate::render::eye::{Eye, EyeMaterial, EyePv};
use crate::report::hazard_chart::{angles_rad, hazard_chart};
use crate::run::error::Error;
use crate::run::job::{Job, Made};

/// Looks through the eyes of all observers.
pub(in crate::run) fn eyes(job: &Job<'_>) -> Result<Made, Error> {
    let resolved = job.resolved;
    let (timeline, site) = (job.timeline()?, job.site()?);
    let clock = Clock::new(&resolved.project.site, timeline.year);
    let calendar = Calendar::of(timeline, &clock)?;
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
    let observers = observers(job, &calendar, &clock)?;
    let surfaces: Vec<String> = site.pv.iter().map(|s| s.name.clone()).collect();
    let mut all = Vec::new();
    for _ in &resolved.candidates {
        let (efficacy_lm_per_w, clock_zone) = (timeline.basis.lm_per_w(), clock.zone());
        let years = EyeYears { efficacy_lm_per_w, clock: clock_zone, observers: Vec::new() };
        all.push((years, EyeTables::new(&clock, &calendar.axis, &surfaces)?));
    }
    let texts = vec![("Software".to_owned(), Provenance::PROGRAM.to_owned())];
    let angles_rad = angles_rad();
    let mut outputs = Vec::new();
    job.progress.begin("eyes", observers.len() as u64, "observers");
    for (number, observer) in observers.iter().enumerate() {
        let seen = sights(&pv, observer.eye);
        let by_material = instants(&pv, &seen, timeline, &bsdfs, job.progress)?;
        for ((candidate, instants), (years, tables)) in
            resolved.candidates.iter().zip(&by_material).zip(&mut all)
        {
            let times = (&calendar.civil, &calendar.lengths);
            let year = EyeYear::of(observer, &seen, times, instants, &thresholds);
            tables.add(&year, instants)?;
            let receiver = ReceiverId { number, name: &observer.name };
            let file = ReceiverFile::HazardChart;
            let name = job.folder.receiver(&candidate.name, RECEIVERS, receiver, file);
            let plot = HazardPlot::of(instants, timeline.sun_diameter_deg, &angles_rad);
            let chart = hazard_chart(&year, candidate, timeline.basis, plot);
            chart.write_png(&job.folder.prepare(&name)?, &texts)?;
            outputs.push(name);
            years.observers.push(year);
        }
        job.progress.advance(1);
    }
    job.progress.finish();
    for (candidate, (years, tables)) in resolved.candidates.iter().zip(all) {
        let name = |file| job.folder.eyes(&candidate.name, file);
        job.folder.write_json(&name(EyesFile::Years), &years)?;
        outputs.push(name(EyesFile::Years));
        let files = [EyesFile::Timesteps, EyesFile::Days, EyesFile::Months];
        for (file, bytes) in files.into_iter().zip(tables.finish()?) {
            job.folder.write(&name(file), |out| out.write_all(&bytes))?;
            outputs.push(name(file));
        }
    }
    Ok(Made::new(outputs, json!({ "observers": observers.len() })))
}

fn observers(job: &Job<'_>, calendar: &Calendar, clock: &Clock) -> Result<Vec<Observer>, Error> {
    let spreader = Spreader { resolved: job.resolved, site: job.site()? };
    let results = job.results()?;
    let one = |table: &ObserverTable| {
        let sensor = spreader.observer(table);
        Observer {
            name: table.name.clone(),
            eye: Eye { position: sensor.position, direction: sensor.normal },
            counts: calendar.counts(results.class(&table.name), clock),
        }
    };
    Ok(job.resolved.project.observer.iter().map(one).collect())
}
