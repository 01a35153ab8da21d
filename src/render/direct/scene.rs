use glam::DVec3;

use super::cells::Cell;
use super::disc::Disc;
use super::integral::{DISCS, Integral, SEEN_PARTS, Scratch, disc_places};
use super::kernel::Kernel;
use super::lobe::Place;
use super::sight::{PvSight, Rooted};
use super::specular::Specular;
use super::year::DirectYear;
use crate::base::Timeline;
use crate::render::Error;
use crate::site::Site;
use crate::site::bsdf::Bsdf;

/// Levels above the asked cells at which a spot begins to ask: a metre or two.
const SKIPPED_LEVELS: u32 = 2;
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
    /// A little off the surface: where rays end.
    pub eye: DVec3,
    pub normal: DVec3,
}

/// A year of suns, ready to be integrated over the PV for any spot.
#[derive(Debug)]
pub struct Direct<'a> {
    scene: DirectScene<'a>,
    sight: &'a PvSight,
    /// By facet: the terms of its scattering function.
    kernels: Vec<Vec<Kernel<'a>>>,
    disc: Disc,
    /// Places on the disc by the way in which it is looked at.
    places: [Vec<Place>; DISCS],
    /// By facet: the numbers of its suns.
    all: Vec<Vec<u32>>,
}

/// Buffers of one thread, kept from spot to spot.
#[derive(Debug, Default)]
pub struct DirectScratch {
    scratch: Scratch,
    seen_before: Vec<u32>,
    at_node: Vec<Answer>,
}

/// What a node of a lattice said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Answer {
    #[default]
    NotAsked,
    Hidden,
    Seen,
}

impl<'a> Direct<'a> {
    /// `sight` was made from the same scene and suns.
    ///
    /// # Errors
    /// [`Error::Settings`] where the parts don't fit each other.
    pub fn new(scene: DirectScene<'a>, sight: &'a PvSight) -> Result<Self, Error> {
        let (expected, found) = (scene.site.pv.len(), scene.bsdfs.len());
        if expected != found {
            let what = format!("{expected} PV surfaces, but {found} materials for them");
            return Err(Error::Settings { what });
        }
        let diameter_deg = scene.timeline.sun_diameter_deg;
        if !(f64::MIN_POSITIVE..=f64::MAX).contains(&scene.max_path_m)
            || !(0.0..10.0).contains(&diameter_deg)
        {
            let what = format!(
                "the longest path is {} m and the sun {} degrees wide, expected above 0 and below 10",
                scene.max_path_m, diameter_deg
            );
            return Err(Error::Settings { what });
        }
        let disc = Disc::new(scene.timeline.sun_diameter_deg);
        let facets = sight.facets.iter().zip(&sight.suns);
        let kernels = facets
            .map(|(facet, suns)| {
                let terms = scene.bsdfs[usize::from(facet.surface)].terms();
                terms.into_iter().map(|(share, term)| Kernel::of(share, term, suns)).collect()
            })
            .collect();
        let places = disc_places(&disc);
        let all = sight.suns.iter().map(|suns| (0..suns.len() as u32).collect()).collect();
        Ok(Self { scene, sight, kernels, disc, places, all })
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
        let spot = Spot { position, eye: position + normal * LIFT_M, normal };
        for (number, facet) in self.sight.facets.iter().enumerate() {
            let suns = &self.sight.suns[number];
            if facet.before_m(spot.position) <= 0.0 || suns.len() == 0 {
                continue;
            }
            for list in &mut buffers.scratch.arrived {
                list.clear();
                list.resize(suns.len(), 0.0);
            }
            let mut lit = false;
            for root in self.sight.roots.iter().filter(|root| root.facet == number) {
                if root.cell.corners.iter().all(|c| spot.normal.dot(*c - spot.position) <= 0.0) {
                    continue;
                }
                let bsdf = self.scene.bsdfs[usize::from(facet.surface)];
                if bsdf.has_delta() {
                    let specular = Specular {
                        site: self.scene.site,
                        facet,
                        bsdf,
                        disc: &self.disc,
                        points: &self.places[DISCS - 4],
                        spot: &spot,
                        max_path_m: self.scene.max_path_m,
                        sun_visibility: self.scene.sun_visibility,
                    };
                    specular.add(&root.cell.corners, suns, into);
                }
                if self.kernels[number].is_empty() || !self.look_at(root, &spot, buffers) {
                    continue;
                }
                lit = true;
                for kernel in &self.kernels[number] {
                    let mut integral = Integral {
                        facet,
                        root,
                        suns,
                        kernel,
                        disc: &self.disc,
                        places: &self.places,
                        spot: &spot,
                        toward: facet.frame.local_from_world(-normal).as_vec3().to_array(),
                        seen_before: &buffers.seen_before,
                        scratch: &mut buffers.scratch,
                    };
                    integral.add(&self.all[number]);
                }
            }
            if lit {
                let [surface, normal, error] = &buffers.scratch.arrived;
                for (i, &step) in suns.step.iter().enumerate() {
                    let [s, n, e] = [surface[i], normal[i], error[i]].map(f64::from);
                    into.add(step, s, n, e);
                }
            }
        }
    }

    /// Which parts of a triangle's asked cells the spot sees; whether there are any.
    fn look_at(&self, root: &Rooted, spot: &Spot, buffers: &mut DirectScratch) -> bool {
        let DirectScratch { seen_before, at_node, .. } = buffers;
        seen_before.clear();
        seen_before.push(0);
        at_node.clear();
        at_node.resize(root.lattice.len(), Answer::NotAsked);
        self.look_into(&root.cell, root, spot, (seen_before, at_node));
        seen_before.last().is_some_and(|&seen| seen > 0)
    }

    /// A cell whose corners say the same is seen, or hidden, as a whole; of others the parts are
    /// asked, four for each asked cell.
    fn look_into(
        &self,
        cell: &Cell,
        root: &Rooted,
        spot: &Spot,
        (seen_before, at_node): (&mut Vec<u32>, &mut [Answer]),
    ) {
        let below = root.asked - cell.level;
        if below <= SKIPPED_LEVELS {
            let mut count = 0;
            for node in cell.nodes {
                let answer = &mut at_node[root.lattice.number(node)];
                if *answer == Answer::NotAsked {
                    let free = self.spot_sees(root.lattice.place(node), root.facet, spot);
                    *answer = if free { Answer::Seen } else { Answer::Hidden };
                }
                count += u32::from(*answer == Answer::Seen);
            }
            let parts = SEEN_PARTS;
            let each = match count {
                0 => Some(0),
                3 => Some(parts),
                _ if below == 0 => {
                    let sees = |part: &&Cell| self.spot_sees(part.middle(), root.facet, spot);
                    Some(cell.parts().iter().filter(sees).count() as u32)
                }
                _ => None,
            };
            if let Some(each) = each {
                let mut seen = seen_before.last().copied().unwrap_or(0);
                for _ in 0..1_u32 << (2 * below) {
                    seen += each;
                    seen_before.push(seen);
                }
                return;
            }
        }
        for part in cell.parts() {
            self.look_into(&part, root, spot, (seen_before, at_node));
        }
    }

    fn spot_sees(&self, place: DVec3, facet: usize, spot: &Spot) -> bool {
        let start = self.sight.facets[facet].lifted(place);
        let way = spot.eye - start;
        let away_m = way.length();
        let towards = way / away_m;
        let faces = spot.normal.dot(towards) < 0.0 && away_m < self.scene.max_path_m;
        let end_m = (away_m - 0.5 * LIFT_M).max(0.0) as f32;
        let bvh = &self.scene.site.bvh;
        faces && !bvh.occluded(start.as_vec3(), towards.as_vec3(), 0.0, end_m)
    }

    /// The suns.
    pub fn timeline(&self) -> &Timeline {
        self.scene.timeline
    }
}
