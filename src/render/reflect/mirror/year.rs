use super::rule::Lit;
use super::suns::MirrorTimes;

/// The instants of a year at which one receiver is lit.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorYear {
    step_s: u32,
    per_day: u32,
    /// In order; an instant at which several surfaces dazzle stands there once for each.
    pub lit: Vec<Lit>,
}

/// One day of a receiver.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MirrorDay {
    /// Day of the year, 0 is 1 January.
    pub day: u32,
    /// Minutes lit, by whichever surface.
    pub minutes: f64,
    /// First lit instant, local standard time, h.
    pub first_h: f64,
    /// Last lit instant, local standard time, h.
    pub last_h: f64,
    /// Minutes by number of the PV surface; together more than `minutes` where surfaces dazzle
    /// at the same time.
    pub by_surface: Vec<(u16, f64)>,
}

/// The year of a receiver in a line; all zero where it is never lit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct MirrorSummary {
    /// Hours of the year.
    pub hours: f64,
    /// Most minutes of one day.
    pub most_minutes: f64,
    /// The first such day.
    pub most_on_day: u32,
    /// Days with any.
    pub days: u32,
    /// First of them, 0 is 1 January.
    pub first_day: u32,
    /// Last of them.
    pub last_day: u32,
    /// Earliest lit instant of any day, local standard time, h.
    pub earliest_h: f64,
    /// Latest lit instant of any day, local standard time, h.
    pub latest_h: f64,
}

impl MirrorYear {
    pub(super) fn new(times: &MirrorTimes, lit: Vec<Lit>) -> Self {
        Self { step_s: times.step_s, per_day: times.per_day(), lit }
    }

    /// Day of the year of an instant.
    pub fn day(&self, instant: u32) -> u32 {
        instant / self.per_day
    }

    /// Local standard time of an instant, h.
    pub fn hour(&self, instant: u32) -> f64 {
        f64::from(instant % self.per_day * self.step_s) / 3600.0
    }

    fn minutes(&self, instants: u32) -> f64 {
        f64::from(instants * self.step_s) / 60.0
    }

    /// The lit days, in order.
    pub fn days(&self) -> Vec<MirrorDay> {
        let mut out = Vec::new();
        for lit in self.lit.chunk_by(|a, b| self.day(a.instant) == self.day(b.instant)) {
            let instants = lit.chunk_by(|a, b| a.instant == b.instant).count() as u32;
            let mut surfaces: Vec<u16> = lit.iter().map(|l| l.surface).collect();
            surfaces.sort_unstable();
            out.push(MirrorDay {
                day: self.day(lit[0].instant),
                minutes: self.minutes(instants),
                first_h: self.hour(lit[0].instant),
                last_h: self.hour(lit[lit.len() - 1].instant),
                by_surface: surfaces
                    .chunk_by(|a, b| a == b)
                    .map(|same| (same[0], self.minutes(same.len() as u32)))
                    .collect(),
            });
        }
        out
    }

    /// The year in a line.
    pub fn summary(&self) -> MirrorSummary {
        let days = self.days();
        let (Some(first), Some(last)) = (days.first(), days.last()) else {
            return MirrorSummary::default();
        };
        let most = days.iter().fold(first, |m, d| if d.minutes > m.minutes { d } else { m });
        MirrorSummary {
            hours: days.iter().map(|d| d.minutes).sum::<f64>() / 60.0,
            most_minutes: most.minutes,
            most_on_day: most.day,
            days: days.len() as u32,
            first_day: first.day,
            last_day: last.day,
            earliest_h: days.iter().fold(24.0, |m, d| m.min(d.first_h)),
            latest_h: days.iter().fold(0.0, |m, d| m.max(d.last_h)),
        }
    }

    /// The chart of day against clock time: unbroken runs of instants of one surface, each with
    /// its day, its first and last hour, and the surface. In order of surface, then time.
    pub fn runs(&self) -> Vec<MirrorRun> {
        let mut lit = self.lit.clone();
        lit.sort_unstable_by_key(|l| (l.surface, l.instant));
        let follows = |a: &Lit, b: &Lit| {
            a.surface == b.surface
                && b.instant == a.instant + 1
                && self.day(a.instant) == self.day(b.instant)
        };
        lit.chunk_by(follows)
            .map(|run| MirrorRun {
                day: self.day(run[0].instant),
                first_h: self.hour(run[0].instant),
                last_h: self.hour(run[run.len() - 1].instant),
                surface: run[0].surface,
            })
            .collect()
    }
}

/// An unbroken run of lit instants of one day and surface.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MirrorRun {
    /// Day of the year, 0 is 1 January.
    pub day: u32,
    /// First instant, local standard time, h.
    pub first_h: f64,
    /// Last instant, local standard time, h.
    pub last_h: f64,
    /// Number of the PV surface.
    pub surface: u16,
}
