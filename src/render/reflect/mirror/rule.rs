//! The mirror rule at a receiver: for each PV surface the suns whose mirror image falls into the eye, with
//! nothing in the way of the sun or of the reflection, and far enough from the sun itself (LAI 2015).

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::suns::MirrorTimes;
use super::suns::{Ahead, Suns};
use super::year::MirrorYear;
use crate::base::Progress;
use crate::render::reflect::facet::{Facet, facets};
use crate::render::view::error::Error;
use crate::site::Site;

/// Where somebody looks: an eye in the air, or a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorReceiver {
    /// Where, m from the local origin.
    pub position: DVec3,
    /// Normal of the surface that it lies on: what stands behind it doesn't count, and rays start
    /// a little before it. `None` for an eye, which sees all around.
    pub normal: Option<DVec3>,
}

impl MirrorReceiver {
    /// Where rays end.
    fn place(&self) -> DVec3 {
        self.position + self.normal.unwrap_or_default() * LIFT_M
    }
}

/// An instant at which a PV surface throws the sun at a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Lit {
    /// `day * per_day + of_day`.
    pub instant: u32,
    /// Number of the PV surface.
    pub surface: u16,
}

/// Degrees by which sun and reflection are apart at least, seen from the receiver: closer
/// together the sun itself is what dazzles.
pub const SEPARATION_DEG: f64 = 10.0;
/// Points of surfaces are lifted off them by this much, m.
const LIFT_M: f64 = 2e-3;

/// The mirror rule of the German LAI (2015): a point sun, an ideal mirror, no intensity, always
/// clear; all PV together; the scene stands in the way of the sun and of its reflection.
///
/// For a receiver and a plane of PV the mirror image of the receiver behind the plane looks along
/// the sun's own direction through the facet exactly when the sun's reflection meets the receiver.
/// So every facet is a patch of the sky, and the suns in that patch are looked up; suns are worked
/// out every five minutes, and step by step only where they come near any receiver's patches.
#[derive(Debug)]
pub struct MirrorRule<'a> {
    site: &'a Site,
    times: MirrorTimes,
    ahead: Ahead,
    /// Suns that were worked out.
    worked_out: AtomicUsize,
    facets: Vec<Facet>,
    /// Cosine of the least angle between sun and reflection.
    closest_cos: f64,
}

impl<'a> MirrorRule<'a> {
    /// Works the suns of the year out. `separation_deg`: [`SEPARATION_DEG`] by the rule.
    ///
    /// # Errors
    /// [`Error::Settings`] for a step, year or angle that can't be.
    pub fn new(site: &'a Site, times: MirrorTimes, separation_deg: f64) -> Result<Self, Error> {
        if !(0.0..=180.0).contains(&separation_deg) {
            let what = format!(
                "the least angle between sun and reflection is {separation_deg}, expected 0 to 180 degrees"
            );
            return Err(Error::Settings { what });
        }
        let ahead = Ahead::of(&times)?;
        let worked_out = AtomicUsize::new(ahead.len());
        let closest_cos = libm::cos(separation_deg.to_radians());
        Ok(Self { site, times, ahead, worked_out, facets: facets(site), closest_cos })
    }

    /// Suns of the year that stand above the horizon, counted every five minutes.
    pub fn suns(&self) -> usize {
        self.ahead.shown
    }

    /// Suns that were worked out so far.
    pub fn worked_out(&self) -> usize {
        self.worked_out.load(Ordering::Relaxed)
    }

    /// Which suns are looked at.
    pub fn times(&self) -> &MirrorTimes {
        &self.times
    }

    /// PV surfaces of the scene.
    pub fn surfaces(&self) -> usize {
        self.site.pv.len()
    }

    /// The year of each receiver, in their order.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn years(
        &self,
        receivers: &[MirrorReceiver],
        progress: &dyn Progress,
    ) -> Result<Vec<MirrorYear>, Error> {
        self.map(receivers, progress, |year| year)
    }

    /// What `reduce` makes of the year of each receiver, in their order: a façade of many points
    /// needn't keep every minute of each.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn map<T: Send>(
        &self,
        receivers: &[MirrorReceiver],
        progress: &dyn Progress,
        reduce: impl Fn(MirrorYear) -> T + Sync,
    ) -> Result<Vec<T>, Error> {
        let suns = self.near(receivers);
        self.worked_out.fetch_add(suns.directions.len(), Ordering::Relaxed);
        progress.begin("mirror rule", receivers.len() as u64, "points");
        let out = receivers
            .par_iter()
            .map(|receiver| {
                progress.check()?;
                let year = MirrorYear::new(&self.times, self.lit(receiver, &suns));
                progress.advance(1);
                Ok(reduce(year))
            })
            .collect();
        progress.finish();
        out
    }

    /// The suns that may stand in some receiver's patches.
    fn near(&self, receivers: &[MirrorReceiver]) -> Suns {
        let marks = || vec![false; self.ahead.len()];
        let join = |mut all: Vec<bool>, more: Vec<bool>| {
            all.iter_mut().zip(more).for_each(|(a, b)| *a |= b);
            all
        };
        let near = receivers
            .par_iter()
            .with_min_len(64)
            .fold(marks, |mut near, receiver| {
                self.patches(receiver, |_, _, _, corners| self.ahead.mark(corners, &mut near));
                near
            })
            .reduce(marks, join);
        self.ahead.around(&near)
    }

    /// Calls `each` with every facet before a receiver, the mirror image of the receiver, how far
    /// before the facet it lies, and the corners of each triangle as the image sees them.
    fn patches(
        &self,
        receiver: &MirrorReceiver,
        mut each: impl FnMut(&Facet, DVec3, f64, &[DVec3; 3]),
    ) {
        let place = receiver.place();
        for facet in &self.facets {
            let before_m = facet.before_m(place);
            if before_m > 0.0 {
                let image = place - facet.frame.z * (2.0 * before_m);
                for triangle in &facet.triangles {
                    each(facet, image, before_m, &triangle.map(|c| c - image));
                }
            }
        }
    }

    /// All instants at which a receiver is lit, in order, each with every surface that does it.
    fn lit(&self, receiver: &MirrorReceiver, suns: &Suns) -> Vec<Lit> {
        let place = receiver.place();
        let mut out = Vec::new();
        self.patches(receiver, |facet, image, before_m, corners| {
            let edges = [0, 1, 2].map(|i| corners[i].cross(corners[(i + 1) % 3]));
            suns.around(corners, |range| {
                for i in range {
                    let sun = suns.directions[i];
                    if edges.iter().any(|e| e.dot(sun) < 0.0) {
                        continue;
                    }
                    let away_m = before_m / facet.frame.z.dot(sun);
                    let spot = image + sun * away_m;
                    if self.shows(facet, receiver.normal, place, spot, away_m, sun) {
                        out.push(Lit { instant: suns.instants[i], surface: facet.surface });
                    }
                }
            });
        });
        out.sort_unstable();
        // Triangles of a facet share edges.
        out.dedup();
        out
    }

    /// Whether the reflection of `sun` at `spot` counts at `place`, `away_m` from it.
    fn shows(
        &self,
        facet: &Facet,
        normal: Option<DVec3>,
        place: DVec3,
        spot: DVec3,
        away_m: f64,
        sun: DVec3,
    ) -> bool {
        let towards = (spot - place) / away_m;
        if !towards.is_finite()
            || towards.dot(sun) > self.closest_cos
            || normal.is_some_and(|n| n.dot(towards) <= 0.0)
        {
            return false;
        }
        let start = facet.lifted(spot);
        let way = place - start;
        let length = way.length();
        let bvh = &self.site.bvh;
        // What touches the receiver itself doesn't hide it.
        let free = length <= LIFT_M
            || !bvh.occluded(
                start.as_vec3(),
                (way / length).as_vec3(),
                0.0,
                (length - 0.5 * LIFT_M) as f32,
            );
        free && !bvh.occluded(start.as_vec3(), sun.as_vec3(), 0.0, f32::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Silent;
    use crate::render::reflect::mirror::tests::{receiver, roof, site, times};

    /// Suns that come near, and all suns: the same instants, at every step and place on Earth.
    #[test]
    fn suns_that_come_near_are_as_good_as_all() {
        let site = site(&[roof()]);
        let receivers = [
            receiver(30.0, 270.0, 11.0),
            receiver(30.0, 275.0, 14.0),
            receiver(60.0, 265.0, 14.0),
            receiver(9.0, 100.0, 30.0),
            receiver(4.0, 200.0, 60.0),
        ];
        let mut lit = 0;
        for (latitude_deg, step_s, refraction) in
            [(47.038, 60, false), (47.038, 20, true), (12.0, 60, false), (70.0, 27, true)]
        {
            let mut times = MirrorTimes { step_s, refraction, ..times() };
            times.place.latitude_deg = latitude_deg;
            let all = Suns::of(&times).expect("suns");
            let rule = MirrorRule::new(&site, times, SEPARATION_DEG).expect("a rule");
            let years = rule.years(&receivers, &Silent).expect("runs");
            for (receiver, year) in receivers.iter().zip(&years) {
                assert_eq!(year.lit, rule.lit(receiver, &all));
                lit += year.lit.len();
            }
            let (worked_out, of) = (rule.worked_out(), all.directions.len());
            println!("{latitude_deg}, {step_s} s: {worked_out} of {of}");
            assert!(worked_out < of);
        }
        assert!(lit > 10_000, "{lit}");
    }
}
