//! The report: what the rules say, and the page.

use std::path::Path;
use std::time::Instant;

use serde_json::json;

use crate::project::artifacts::{REPORT, VERDICTS};
use crate::project::key_of;
use crate::report;
use crate::run::error::Error;
use crate::run::job::{Job, Stage};

/// Writes `verdicts.json` and `report.html`.
pub(in crate::run) fn report(job: &mut Job<'_>) -> Result<(), Error> {
    let pictures = job.manifest.units.get("pictures").map(|u| u.key.clone());
    let p = &job.resolved.project;
    let eyes = job.resolved.eyes_key()?;
    let facts =
        (pictures, eyes, job.resolved.moments_key()?, &job.resolved.rules, &p.observer, &p.region);
    let key = key_of("report", &facts)?;
    if !job.needs(Stage::Report, "report", &key) {
        return Ok(());
    }
    let began = Instant::now();
    let pv_m2: f64 = job.site()?.pv.iter().map(|s| s.area_m2).sum();
    let results = job.results()?;
    let judgements = report::judge(&results, pv_m2)?;
    job.folder.write_json(Path::new(VERDICTS), &judgements)?;
    let page = report::html(&report::document(&results, &key, &judgements)?);
    job.folder.write(Path::new(REPORT), |out| out.write_all(page.as_bytes()))?;
    let outputs = [REPORT, VERDICTS].map(Into::into);
    job.done("report", &key, &outputs, began, json!({ "verdicts": judgements.len() }))
}
