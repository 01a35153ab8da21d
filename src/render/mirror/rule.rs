use glam::DVec3;
use rayon::prelude::*;

use super::suns::Suns;
use super::{MirrorTimes, MirrorYear};
use crate::base::Progress;
use crate::render::Error;
use crate::render::facet::{Facet, facets};
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
/// So every facet is a patch of the sky, and the suns in that patch are looked up.
#[derive(Debug)]
pub struct MirrorRule<'a> {
    site: &'a Site,
    times: MirrorTimes,
    suns: Suns,
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
        let suns = Suns::of(&times)?;
        let closest_cos = libm::cos(separation_deg.to_radians());
        Ok(Self { site, times, suns, facets: facets(site), closest_cos })
    }

    /// Suns of the year that stand above the horizon.
    pub fn suns(&self) -> usize {
        self.suns.directions.len()
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
        progress.begin("mirror rule", receivers.len() as u64, "points");
        let out = receivers
            .par_iter()
            .map(|receiver| {
                progress.check()?;
                let year = MirrorYear::new(&self.times, self.lit(receiver));
                progress.advance(1);
                Ok(reduce(year))
            })
            .collect();
        progress.finish();
        out
    }

    /// All instants at which a receiver is lit, in order, each with every surface that does it.
    fn lit(&self, receiver: &MirrorReceiver) -> Vec<Lit> {
        let place = receiver.position + receiver.normal.unwrap_or_default() * LIFT_M;
        let mut out = Vec::new();
        for facet in &self.facets {
            let before_m = facet.before_m(place);
            if before_m <= 0.0 {
                continue;
            }
            let normal = facet.frame.z;
            let image = place - normal * (2.0 * before_m);
            for triangle in &facet.triangles {
                let corners = triangle.map(|c| c - image);
                let edges = [0, 1, 2].map(|i| corners[i].cross(corners[(i + 1) % 3]));
                self.suns.around(&corners, |range| {
                    for i in range {
                        let sun = self.suns.directions[i];
                        if edges.iter().any(|e| e.dot(sun) < 0.0) {
                            continue;
                        }
                        let away_m = before_m / normal.dot(sun);
                        let spot = image + sun * away_m;
                        let seen = self.shows(facet, receiver.normal, place, spot, away_m, sun);
                        if seen {
                            let instant = self.suns.instants[i];
                            out.push(Lit { instant, surface: facet.surface });
                        }
                    }
                });
            }
        }
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
