use glam::DVec3;

use super::cells::{Rooted, rooted};
use super::disc::Disc;
use super::integral::{DirectYear, Integral, Scratch};
use super::kernel::{Batch, Kernel};
use super::specular::Specular;
use crate::base::{Frame, Progress, Timeline};
use crate::render::Error;
use crate::render::facet::{Facet, facets};
use crate::site::Site;
use crate::site::bsdf::Bsdf;

/// Edge of the cells of PV that are asked what they see, m: shadows and hidden parts are known to
/// that.
const CELL_M: f64 = 0.5;
/// Spots on surfaces are lifted off them by this much, m.
const LIFT_M: f64 = 2e-3;

/// What direct integration depends on.
#[derive(Clone, Debug)]
pub struct DirectScene<'a> {
    /// What stands there.
    pub site: &'a Site,
    /// The suns.
    pub timeline: &'a Timeline,
    /// How each PV surface scatters, by surface number.
    pub bsdfs: Vec<&'a Bsdf>,
    /// How far light is followed from the PV, m.
    pub max_path_m: f64,
    /// Whether the way from the PV to the sun must be free.
    pub sun_visibility: bool,
}

/// Where light arrives: a spot of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spot {
    pub position: DVec3,
    pub normal: DVec3,
}

/// The suns in front of a facet, in its frame.
#[derive(Debug, Default)]
pub(super) struct Lights {
    pub batch: Batch,
}

/// A year of suns, ready to be integrated over the PV for any spot.
#[derive(Debug)]
pub struct Direct<'a> {
    scene: DirectScene<'a>,
    facets: Vec<Facet>,
    lights: Vec<Lights>,
    roots: Vec<Rooted>,
    disc: Disc,
    points: Vec<Vec<(f64, f64)>>,
}

/// Buffers of one thread, kept from spot to spot.
#[derive(Debug, Default)]
pub struct DirectScratch {
    scratch: Scratch,
    seen_before: Vec<u32>,
}

impl<'a> Direct<'a> {
    /// Works out what doesn't depend on where light goes: which suns each part of the PV sees.
    ///
    /// # Errors
    /// [`Error::Settings`] where the parts don't fit each other, [`Error::Interrupted`].
    pub fn new(scene: DirectScene<'a>, progress: &dyn Progress) -> Result<Self, Error> {
        let (expected, found) = (scene.site.pv.len(), scene.bsdfs.len());
        if expected != found {
            let what = format!("{expected} PV surfaces, but {found} materials for them");
            return Err(Error::Settings { what });
        }
        if !(scene.max_path_m > 0.0 && scene.timeline.sun_diameter_deg < 10.0) {
            let what = format!(
                "the longest path is {} m and the sun {} degrees wide, expected above 0 and below 10",
                scene.max_path_m, scene.timeline.sun_diameter_deg
            );
            return Err(Error::Settings { what });
        }
        let facets = facets(scene.site);
        let disc = Disc::new(scene.timeline.sun_diameter_deg);
        let kernel = |f: &Facet| Kernel::of(scene.bsdfs[usize::from(f.surface)]);
        let lights = facets.iter().map(|f| Lights::of(f, &kernel(f), scene.timeline)).collect();
        let points = facets
            .iter()
            .map(|f| match disc.radius_rad / kernel(f).width() {
                // Beside the lobe the disc is small, of its size, or larger.
                r if r < 0.2 => Disc::points(4),
                r if r < 0.6 => Disc::points(16),
                _ => Disc::points(64),
            })
            .collect();
        let (timeline, free) = (scene.timeline, scene.sun_visibility);
        let roots = rooted(scene.site, &facets, timeline, CELL_M, free, progress)?;
        Ok(Self { scene, facets, lights, roots, disc, points })
    }

    /// The year at a spot of a surface with its normal turned to where light may come from; `into`
    /// is written over.
    pub fn year(
        &self,
        position: DVec3,
        normal: DVec3,
        buffers: &mut DirectScratch,
        into: &mut DirectYear,
    ) {
        into.clear(self.scene.timeline.steps.len());
        let spot = Spot { position: position + normal * LIFT_M, normal };
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            if facet.before_m(spot.position) <= 0.0
                || root.cell.corners.iter().all(|c| spot.normal.dot(*c - spot.position) <= 0.0)
            {
                continue;
            }
            let bsdf = self.scene.bsdfs[usize::from(facet.surface)];
            if bsdf.is_delta() {
                let specular = Specular {
                    site: self.scene.site,
                    facet,
                    bsdf,
                    disc: &self.disc,
                    spot: &spot,
                    max_path_m: self.scene.max_path_m,
                    sun_visibility: self.scene.sun_visibility,
                };
                specular.add(&root.cell.corners, &self.lights[root.facet], into);
                continue;
            }
            if !self.look_at(root, &spot, &mut buffers.seen_before) {
                continue;
            }
            let mut integral = Integral {
                facet,
                root,
                kernel: Kernel::of(bsdf),
                disc: &self.disc,
                points: &self.points[root.facet],
                spot: &spot,
                max_path_m: self.scene.max_path_m,
                seen_before: &buffers.seen_before,
                scratch: &mut buffers.scratch,
                year: into,
            };
            integral.add(&self.lights[root.facet]);
        }
    }

    /// Which asked cells of a triangle the spot sees; whether there is one.
    fn look_at(&self, root: &Rooted, spot: &Spot, seen_before: &mut Vec<u32>) -> bool {
        let facet = &self.facets[root.facet];
        let mut seen = 0;
        seen_before.clear();
        seen_before.push(0);
        for cell in root.asked() {
            let start = facet.lifted(cell.middle());
            let way = spot.position - start;
            let away_m = way.length();
            let towards = way / away_m;
            let faces =
                spot.normal.dot(towards) < 0.0 && away_m - cell.radius_m() < self.scene.max_path_m;
            let end_m = (away_m - 0.5 * LIFT_M).max(0.0) as f32;
            let free = faces
                && !self.scene.site.bvh.occluded(start.as_vec3(), towards.as_vec3(), 0.0, end_m);
            seen += u32::from(free);
            seen_before.push(seen);
        }
        seen > 0
    }

    /// The suns.
    pub fn timeline(&self) -> &Timeline {
        self.scene.timeline
    }
}

impl Lights {
    fn of(facet: &Facet, kernel: &Kernel<'_>, timeline: &Timeline) -> Self {
        let mut batch = Batch::default();
        for (i, step) in timeline.steps.iter().enumerate() {
            let sun = facet.frame.local_from_world(step.sun);
            if sun.z > 0.0 && step.irradiance_w_m2 > 0.0 {
                batch.push(i as u32, sun, step.irradiance_w_m2, kernel);
            }
        }
        Self { batch }
    }

    /// The i-th sun with its frame in the world's axes.
    pub(super) fn in_world(&self, facet: &Facet, i: usize) -> Frame {
        Frame::around(facet.frame.world_from_local(self.batch.sun(i)))
    }
}
