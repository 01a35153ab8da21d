//! What the rules say of each observer and region, as data and as sentences.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::Error;
use super::sentences;
use crate::project::artifacts::VERDICTS;
use crate::project::{Folder, Results};
use crate::receivers::eyes::{EyeYear, read_eyes};
use crate::receivers::metrics::{eye_of, metrics};
use crate::receivers::points::Kind;
use crate::receivers::received::{GroupReceived, read_received};
use crate::rules::{Class, Metrics, Outcome, Profile, Verdict};

/// One rule on one observer or region, with one material.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Judgement {
    /// The material or case.
    pub material: String,
    /// Whether that is the one that others are compared with.
    pub reference: bool,
    /// The observer or region.
    pub receiver: String,
    /// Whom it stands for; none: nobody said, every limit applies.
    pub class: Option<Class>,
    /// Id and version of the rule.
    pub rule: String,
    /// Its version.
    pub version: String,
    /// What it says.
    pub verdict: Verdict,
    /// The same in words.
    pub sentence: String,
    /// Criteria of the rule that are met, in words; they decide nothing by themselves.
    pub criteria: Vec<String>,
}

/// Judges all observers and regions. `pv_m2`: area of all PV.
///
/// # Errors
/// Results that are missing or damaged.
pub fn judge(results: &Results<'_>, pv_m2: f64) -> Result<Vec<Judgement>, Error> {
    let mut out = Vec::new();
    let Some(set) = results.receivers() else { return Ok(out) };
    for (number, candidate) in results.resolved.candidates.iter().enumerate() {
        let reference = results.resolved.reference == Some(number);
        let eyes = read_eyes(results, candidate)?;
        for group in &read_received(results, candidate, set)?.groups {
            if group.kind == Kind::Sensors {
                continue;
            }
            let eye = eye_of(&eyes, group);
            let metrics = metrics(results, group, eye, pv_m2);
            for profile in &results.resolved.rules {
                let of =
                    Subject { material: &candidate.name, reference, group, eye, metrics: &metrics };
                out.push(one(results, &of, profile));
            }
        }
    }
    Ok(out)
}

/// What was judged, from its file; nothing where there is none.
///
/// # Errors
/// When the file is damaged.
pub fn read(folder: &Folder) -> Result<Vec<Judgement>, Error> {
    let name = Path::new(VERDICTS);
    Ok(if folder.at(name).exists() { folder.read_json(name)? } else { Vec::new() })
}

/// Whom a rule judges, and what is known of it.
struct Subject<'a> {
    material: &'a str,
    reference: bool,
    group: &'a GroupReceived,
    eye: Option<&'a EyeYear>,
    metrics: &'a Metrics,
}

fn one(results: &Results<'_>, of: &Subject<'_>, profile: &Profile) -> Judgement {
    let verdict = profile.judge(of.metrics);
    let criteria = profile
        .limits
        .iter()
        .zip(&verdict.limits)
        .filter(|(limit, judged)| limit.only_informs && judged.outcome == Outcome::Exceeded)
        .map(|(limit, judged)| sentences::criterion(limit, judged.value.unwrap_or(0.0)))
        .collect();
    Judgement {
        material: of.material.to_owned(),
        reference: of.reference,
        receiver: of.group.name.clone(),
        class: of.metrics.class,
        rule: profile.id.clone(),
        version: profile.version.clone(),
        sentence: sentences::verdict(results, of.group, of.eye.is_some(), profile, &verdict),
        verdict,
        criteria,
    }
}
