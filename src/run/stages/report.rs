//! The report: what the rules say, and the page.

use std::path::Path;

use serde_json::json;

use crate::project::artifacts::{REPORT, VERDICTS};
use crate::report::{self, judgements};
use crate::run::error::Error;
use crate::run::job::{Job, Made};

/// Judges the observers and regions: `verdicts.json`.
pub(in crate::run) fn verdicts(job: &Job<'_>) -> Result<Made, Error> {
    let pv_m2: f64 = job.site()?.pv.iter().map(|s| s.area_m2).sum();
    let judgements = report::judge(&job.results()?, pv_m2)?;
    job.folder.write_json(Path::new(VERDICTS), &judgements)?;
    Ok(Made::new(vec![VERDICTS.into()], json!({ "verdicts": judgements.len() })))
}

/// Writes `report.html`.
pub(in crate::run) fn report(job: &Job<'_>, key: &str) -> Result<Made, Error> {
    let judgements = judgements::read(&job.folder)?;
    let page = report::html(&report::document(&job.results()?, key, &judgements)?);
    job.folder.write(Path::new(REPORT), |out| out.write_all(page.as_bytes()))?;
    Ok(Made::new(vec![REPORT.into()], json!({ "verdicts": judgements.len() })))
}
