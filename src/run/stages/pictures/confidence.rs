//! How sure the maps are: standard error, search radius, and the hours that noise leaves open.

use super::{COVERED, Quantity, decades, of_views};
use crate::picture::{Scale, scale};
use crate::run::error::Error;
use crate::run::job::Job;

/// Adds the pictures of what is known of noise; views of direct integration have none.
pub(super) fn quantities(
    job: &Job<'_>,
    (watts, hours_unit, what): (&str, &str, &str),
    out: &mut Vec<Quantity>,
) -> Result<(), Error> {
    let largest = |file: &str, channel: &str, share: f64| {
        let grids = of_views(job, file, channel, |view| !view.is_direct())?;
        Ok::<_, Error>(scale::nice_ceiling(scale::percentile(&grids, share).max(1e-6)))
    };
    let error = "standard_error.wh_m2";
    out.push(Quantity {
        file: "annual".into(),
        picture: Some("standard_error"),
        channel: error.into(),
        title: "Standard error of the energy in a year".into(),
        legend: "standard error".into(),
        bare: "no colour: less, or nothing".into(),
        caption: "What photons landing at random make of the annual map: two of three values lie \
                  within one standard error of the truth, 95 of 100 within two."
            .into(),
        scale: decades(largest("annual", error, COVERED)?, hours_unit),
        faint_wh_m2: None,
    });
    out.push(Quantity {
        file: "annual".into(),
        picture: Some("radius"),
        channel: "radius.m".into(),
        title: "Radius over which photons were counted".into(),
        legend: "radius of the disc".into(),
        bare: "no colour: nothing to receive light".into(),
        caption: "Details smaller than this are blurred.".into(),
        scale: Scale::linear(largest("annual", "radius.m", 1.0)?, "m"),
        faint_wh_m2: None,
    });
    let thresholds = &job.resolved.project.glare.thresholds_w_m2;
    let file = |t: f64| format!("glare-{t}/band");
    let mut max = 1e-6f64;
    for &t in thresholds {
        max = max.max(largest(&file(t), "high.h", 1.0)?);
    }
    for &t in thresholds {
        for (picture, channel, title, how) in [
            ("band_low_h", "low.h", "at least", "taken off"),
            ("band_high_h", "high.h", "at most", "added to"),
        ] {
            out.push(Quantity {
                file: file(t),
                picture: Some(picture),
                channel: channel.into(),
                title: format!("Hours of glare in a year above {t} {watts}, {title}"),
                legend: format!("time above {t} {watts}, {title}"),
                bare: "no colour: never above the threshold".into(),
                caption: format!(
                    "Two standard errors {how} every value; a limit between this and its \
                     counterpart is undecided. Irradiance {what}, unfiltered."
                ),
                scale: Scale::linear(max, "h"),
                faint_wh_m2: None,
            });
        }
    }
    Ok(())
}
