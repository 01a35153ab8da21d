//! Judging a receiver by a profile: what was measured against each limit.
//!
//! A limit may protect only some classes of receivers, may excuse another limit, or may only
//! inform; hence five outcomes instead of yes and no. A value with a band of noise is judged by its
//! middle, and [`Judged::certain`] says whether the whole band agrees.

use serde::{Deserialize, Serialize};

use super::profile::{Class, Limit, Profile, Quantity};

/// One thing that was measured at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// What it is.
    pub quantity: Quantity,
    /// The irradiance above which time counted, W/m2; none where the quantity isn't a time.
    pub threshold_w_m2: Option<f64>,
    /// Whether the irradiance was filtered first.
    pub filtered: bool,
    /// The value, in the quantity's unit.
    pub value: f64,
    /// Between which values it lies by its noise, where that is known.
    pub band: Option<[f64; 2]>,
}

/// What is known of a receiver: a pixel, an observer, or a region.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metrics {
    /// Who or what it is; none where nobody said, then every limit applies.
    pub class: Option<Class>,
    /// All that was measured.
    pub measured: Vec<Measured>,
    /// What was assumed when it was measured, in the words of [`Limit::conditions`].
    pub conditions: Vec<String>,
}

impl Metrics {
    fn find(&self, limit: &Limit) -> Option<&Measured> {
        let assumed = limit.conditions.iter().all(|condition| self.conditions.contains(condition));
        let fits = |m: &&Measured| {
            m.quantity == limit.quantity
                && m.threshold_w_m2 == limit.threshold_w_m2
                && m.filtered == limit.filtered
        };
        self.measured.iter().find(fits).filter(|m| assumed && m.value.is_finite())
    }
}

/// How one limit was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It is exceeded.
    Exceeded,
    /// It is kept.
    Kept,
    /// It is exceeded, but another limit that is kept excuses that.
    Excused,
    /// What it needs wasn't measured.
    NotEvaluated,
    /// It doesn't protect receivers of this class.
    NotApplicable,
}

/// One limit and how it was judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The limit's name.
    pub limit: String,
    /// How it was judged.
    pub outcome: Outcome,
    /// What was measured.
    pub value: Option<f64>,
    /// Between which values it lies by its noise, where that is known.
    pub band: Option<[f64; 2]>,
    /// Whether the whole band lies on one side of the limit; a value without a band is taken as it
    /// is.
    pub certain: bool,
}

/// What a profile says of a receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The profile.
    pub profile: String,
    /// [`Outcome::Exceeded`] if any limit is, else [`Outcome::NotEvaluated`] if any wasn't
    /// evaluated, else [`Outcome::Kept`]; [`Outcome::NotApplicable`] if no limit applies.
    pub outcome: Outcome,
    /// The profile's name for how many limits are exceeded, where all were evaluated.
    pub grade: Option<String>,
    /// Each limit, in the profile's order.
    pub limits: Vec<Judged>,
}

impl Profile {
    /// Judges a receiver.
    pub fn judge(&self, metrics: &Metrics) -> Verdict {
        let limits: Vec<Judged> = (self.limits.iter())
            .map(|limit| {
                let measured = metrics.find(limit);
                let band = measured.and_then(|m| m.band);
                let exceeds = |v: f64| limit.operator.exceeds(v, limit.value);
                Judged {
                    limit: limit.id.clone(),
                    outcome: self.outcome(limit, metrics),
                    value: measured.map(|m| m.value),
                    band,
                    certain: band.is_none_or(|[low, high]| exceeds(low) == exceeds(high)),
                }
            })
            .collect();
        let counted: Vec<Outcome> = (self.limits.iter().zip(&limits))
            .filter(|(limit, _)| !limit.only_excuses && !limit.only_informs)
            .map(|(_, judged)| judged.outcome)
            .collect();
        let count = |outcome| counted.iter().filter(|found| **found == outcome).count();
        let exceeded = count(Outcome::Exceeded);
        let open = count(Outcome::NotEvaluated);
        let outcome = if exceeded > 0 {
            Outcome::Exceeded
        } else if open > 0 {
            Outcome::NotEvaluated
        } else if count(Outcome::NotApplicable) == counted.len() {
            Outcome::NotApplicable
        } else {
            Outcome::Kept
        };
        let grade = self.grades.get(exceeded).filter(|_| open == 0).cloned();
        Verdict { profile: self.id.clone(), outcome, grade, limits }
    }

    fn outcome(&self, limit: &Limit, metrics: &Metrics) -> Outcome {
        let applies = |class| limit.classes.is_empty() || limit.classes.contains(&class);
        if !metrics.class.is_none_or(applies) {
            return Outcome::NotApplicable;
        }
        let Some(found) = metrics.find(limit) else { return Outcome::NotEvaluated };
        if !limit.operator.exceeds(found.value, limit.value) {
            return Outcome::Kept;
        }
        let excuse = limit.excused_by.as_ref();
        match excuse.and_then(|id| self.limits.iter().find(|other| other.id == *id)) {
            None => Outcome::Exceeded,
            Some(other) => match self.outcome(other, metrics) {
                Outcome::Kept => Outcome::Excused,
                Outcome::NotEvaluated => Outcome::NotEvaluated,
                _ => Outcome::Exceeded,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::profile::built_in;

    fn measured(quantity: Quantity, value: f64) -> Measured {
        Measured { quantity, threshold_w_m2: None, filtered: false, value, band: None }
    }

    #[test]
    fn the_papers_limits_are_strict() {
        let profile = built_in("paper-2018").unwrap();
        let judge = |sustained: f64, annual: f64| {
            let at = |quantity, value, threshold| Measured {
                quantity,
                threshold_w_m2: Some(threshold),
                filtered: true,
                value,
                band: None,
            };
            let measured = vec![
                at(Quantity::SustainedMin, sustained, 10.0),
                at(Quantity::AnnualH, annual, 10.0),
                at(Quantity::SustainedMin, 0.0, 30.0),
                at(Quantity::AnnualH, 0.0, 30.0),
            ];
            profile.judge(&Metrics { measured, ..Metrics::default() }).outcome
        };
        assert_eq!(judge(30.0, 50.0), Outcome::Kept);
        assert_eq!(judge(30.1, 50.0), Outcome::Exceeded);
        assert_eq!(judge(15.0, 50.1), Outcome::Exceeded);
    }

    #[test]
    fn a_band_that_straddles_the_limit_leaves_it_open() {
        let profile = built_in("at-ove-r11-3-2016").unwrap();
        let judged = |value, band| {
            let day = Measured { band, ..measured(Quantity::DailyTotalMin, value) };
            let measured = vec![day, measured(Quantity::AnnualH, 1.0)];
            let verdict = profile.judge(&Metrics { measured, ..Metrics::default() });
            (verdict.limits[0].outcome, verdict.limits[0].certain)
        };
        assert_eq!(judged(24.0, None), (Outcome::Kept, true));
        assert_eq!(judged(24.0, Some([15.0, 30.0])), (Outcome::Kept, true));
        assert_eq!(judged(24.0, Some([15.0, 45.0])), (Outcome::Kept, false));
        assert_eq!(judged(45.0, Some([30.0, 60.0])), (Outcome::Exceeded, false));
        assert_eq!(judged(45.0, Some([31.0, 60.0])), (Outcome::Exceeded, true));
    }

    /// Table 2 of the paper: distance, area and angle are listed, they decide nothing.
    #[test]
    fn criteria_that_only_inform_decide_nothing() {
        let profile = built_in("paper-2018").unwrap();
        let near = vec![
            measured(Quantity::DistanceM, 99.0),
            measured(Quantity::PvAreaM2, 11.0),
            measured(Quantity::SubtendedDeg, 7.6),
        ];
        let verdict = |class| {
            let metrics =
                Metrics { class: Some(class), measured: near.clone(), ..Metrics::default() };
            let verdict = profile.judge(&metrics);
            assert_eq!(verdict.outcome, Outcome::NotEvaluated);
            let met = verdict.limits.iter().filter(|l| l.outcome == Outcome::Exceeded);
            met.map(|l| l.limit.clone()).collect::<Vec<_>>()
        };
        assert_eq!(verdict(Class::Dwelling), ["distance-residential", "area-residential", "angle"]);
        assert_eq!(verdict(Class::Office), ["angle"]);
    }

    #[test]
    fn what_was_not_measured_is_not_evaluated() {
        for id in crate::rules::ids().filter(|id| *id != "us-faa-2021") {
            let verdict = built_in(id).unwrap().judge(&Metrics::default());
            assert_eq!(verdict.outcome, Outcome::NotEvaluated, "{id}");
            assert_eq!(verdict.grade, None, "{id}");
        }
        let none = built_in("us-faa-2021").unwrap().judge(&Metrics::default());
        assert_eq!(none.outcome, Outcome::NotApplicable);
        // Measured, but not as the German guideline wants it: with a sun that has a size.
        let metrics = Metrics {
            class: Some(Class::Dwelling),
            measured: vec![
                measured(Quantity::DailyTotalMin, 90.0),
                measured(Quantity::AnnualH, 90.0),
            ],
            conditions: vec!["clear-sky".to_owned()],
        };
        let verdict = built_in("de-lai-2015").unwrap().judge(&metrics);
        assert_eq!(verdict.outcome, Outcome::NotEvaluated);
    }

    #[test]
    fn grades_count_limits() {
        let profile = built_in("uk-pagerpower-4").unwrap();
        let grade = |months, minutes| {
            let measured = vec![
                measured(Quantity::Months, months),
                measured(Quantity::DailyTotalMin, minutes),
            ];
            let metrics = Metrics { class: Some(Class::Dwelling), measured, conditions: vec![] };
            profile.judge(&metrics).grade
        };
        assert_eq!(grade(3.0, 60.0).as_deref(), Some("low"));
        assert_eq!(grade(4.0, 60.0).as_deref(), Some("moderate"));
        assert_eq!(grade(4.0, 61.0).as_deref(), Some("high"));
    }

    #[test]
    fn a_kept_luminance_excuses_durations() {
        let profile = built_in("ch-practice-2021").unwrap();
        let outcome_after = |minutes: f64, luminance: Option<f64>| {
            let mut list =
                vec![measured(Quantity::DailyTotalMin, minutes), measured(Quantity::AnnualH, 20.0)];
            list.extend(luminance.map(|l| measured(Quantity::LuminanceCdM2, l)));
            let metrics = Metrics { measured: list, ..Metrics::default() };
            profile.judge(&metrics).outcome
        };
        let outcome = |luminance| outcome_after(45.0, luminance);
        assert_eq!(outcome(None), Outcome::NotEvaluated);
        assert_eq!(outcome(Some(50_000.0)), Outcome::Kept);
        assert_eq!(outcome(Some(50_001.0)), Outcome::Exceeded);
        // Short glare may be as bright as it is.
        assert_eq!(outcome_after(30.0, Some(1e9)), Outcome::Kept);
        assert_eq!(outcome_after(30.0, None), Outcome::Kept);
    }
}
