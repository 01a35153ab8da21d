//! Maps of the series as it is: worst days, unbroken glare, days, months, clock times, margins.

use super::{COVERED, Quantity, all, decades};
use crate::picture::{Scale, scale};
use crate::receivers::clock::Clock;
use crate::report::words::MONTHS;
use crate::run::error::Error;
use crate::run::job::Job;

/// What was read off the series as it is: the measure that rules judge.
pub(super) fn quantities(
    job: &Job<'_>,
    (watts, what): (&str, &str),
    out: &mut Vec<Quantity>,
) -> Result<(), Error> {
    let thresholds = &job.resolved.project.glare.thresholds_w_m2;
    for (file, channel, title, meaning, unit) in [
        (
            "longest_day_h",
            "longest_day.h",
            "Glare on the worst day",
            "The most time above the threshold on any one day.",
            "h",
        ),
        (
            "longest_run_h",
            "longest_run.h",
            "Longest unbroken glare",
            "The longest time above the threshold without a break on any day.",
            "h",
        ),
    ] {
        let mut grids = Vec::new();
        for t in thresholds {
            grids.extend(all(job, &format!("glare-{t}/unfiltered/{file}"), channel)?);
        }
        let max = scale::percentile(&grids, 1.0);
        let max = if max > 0.0 { scale::nice_ceiling(max) } else { 1.0 };
        for t in thresholds {
            out.push(Quantity {
                file: format!("glare-{t}/unfiltered/{file}"),
                picture: None,
                channel: channel.into(),
                title: format!("{title} above {t} {watts}"),
                legend: format!("above {t} {watts}"),
                bare: "no colour: never above the threshold".into(),
                caption: format!(
                    "{meaning} Irradiance {what}, unfiltered; noise makes single pixels too high."
                ),
                scale: Scale::linear(max, unit),
                faint_wh_m2: None,
            });
        }
    }
    // The margins don't depend on a threshold: one picture for all. Days, months and clock times
    // are drawn for the lowest: those of others lie within.
    let Some(t) = thresholds.iter().min_by(|a, b| a.total_cmp(b)) else { return Ok(()) };
    months(job, *t, (watts, what), out)?;
    let zone = Clock::new(&job.resolved.project.site, job.timeline()?.year).zone();
    for (file, channel, title, meaning, unit) in [
        ("days", "days.d", "Days with glare", "Days with any glare.".to_owned(), "d"),
        (
            "first_hour",
            "first_hour.h",
            "Earliest glare of any day",
            format!("Clock time, {zone}."),
            "h",
        ),
        (
            "last_hour",
            "last_hour.h",
            "Latest glare of any day",
            format!("Clock time, {zone}."),
            "h",
        ),
    ] {
        let file = format!("glare-{t}/unfiltered/{file}");
        let grids = all(job, &file, channel)?;
        let max = scale::percentile(&grids, 1.0);
        let mut scale = Scale::linear(if max > 0.0 { scale::nice_ceiling(max) } else { 1.0 }, unit);
        if unit == "h" && max > 0.0 {
            let lit = grids.iter().flat_map(|g| g.data()).filter(|h| **h > 0.0);
            let least = lit.fold(24.0f32, |least, h| least.min(*h));
            scale.min = f64::from(least).floor();
            scale.max = libm::ceil(max).max(scale.min + 1.0);
        }
        out.push(Quantity {
            file,
            picture: None,
            channel: channel.into(),
            title: format!("{title} above {t} {watts}"),
            legend: if unit == "h" { "clock time".into() } else { "days with glare".into() },
            bare: "no colour: never above the threshold".into(),
            caption: format!("{meaning} Irradiance {what}, unfiltered."),
            scale,
            faint_wh_m2: None,
        });
    }
    for (file, channel, title, legend) in [
        (
            "exceeded_30min_w_m2",
            "exceeded_30min.w_m2",
            "Exceeded for half an hour on the worst day",
            "irradiance exceeded for 30 min",
        ),
        (
            "exceeded_50h_w_m2",
            "exceeded_50h.w_m2",
            "Exceeded for 50 hours of the year",
            "irradiance exceeded for 50 h",
        ),
    ] {
        let file = format!("glare-{t}/unfiltered/{file}");
        let max =
            scale::nice_ceiling(scale::percentile(&all(job, &file, channel)?, COVERED).max(1e-6));
        out.push(Quantity {
            file,
            picture: None,
            channel: channel.into(),
            title: title.into(),
            legend: legend.into(),
            bare: "no colour: less, or not for so long".into(),
            caption: format!("The margin to any threshold: one below this value is exceeded for that long here. Irradiance {what}, unfiltered."),
            scale: decades(max, watts),
            faint_wh_m2: None,
        });
    }
    Ok(())
}

/// Hours of glare in each month that has any, on one scale.
fn months(
    job: &Job<'_>,
    threshold: f64,
    (watts, what): (&str, &str),
    out: &mut Vec<Quantity>,
) -> Result<(), Error> {
    let file = |month: usize| format!("glare-{threshold}/unfiltered/month_{month:02}_h");
    let channel = |month: usize| format!("month_{month:02}.h");
    let mut grids = Vec::new();
    for month in 1..=12 {
        grids.push(all(job, &file(month), &channel(month))?);
    }
    let lit: Vec<bool> = grids.iter().map(|list| !list.is_empty()).collect();
    let max = scale::percentile(&grids.concat(), 1.0);
    let max = if max > 0.0 { scale::nice_ceiling(max) } else { 1.0 };
    for (month, name) in (1..=12).zip(MONTHS).filter(|(month, _)| lit[month - 1]) {
        out.push(Quantity {
            file: file(month),
            picture: None,
            channel: channel(month),
            title: format!("Hours of glare in {name} above {threshold} {watts}"),
            legend: format!("above {threshold} {watts}"),
            bare: "no colour: never above the threshold in this month".into(),
            caption: format!(
                "Days that were not computed count as the computed one before them. Irradiance {what}, unfiltered; noise makes single pixels too high."
            ),
            scale: Scale::linear(max, "h"),
            faint_wh_m2: None,
        });
    }
    Ok(())
}
