use std::ops::Range;

use glam::DVec3;

use super::integral::{DISCS, Integral, Scratch, SeenCells, disc_places};
use super::kernel::Kernel;
use super::sight::{PvSight, Rooted};
use super::specular::Specular;
use super::year::DirectYear;
use crate::base::Timeline;
use crate::render::view::error::Error;
use crate::render::reflect::disc::{Disc, DiscPoint};
use crate::render::reflect::pv::{Cell, NOT_ASKED, seen_share};
use crate::site::Site;
use crate::bsdf::Bsdf;

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
    places: [Vec<DiscPoint>; DISCS],
    /// By facet: the numbers of its suns, by the month in which crowns let as much through.
    by_month: Vec<Vec<(usize, Vec<u32>)>>,
}

/// Buffers of one thread, kept from spot to spot.
#[derive(Debug, Default)]
pub struct DirectScratch {
    scratch: Scratch,
    seen: SeenCells,
    /// How much of the light from each node of a lattice gets to the spot, in [`SEEN`](crate::render::reflect::pv::SEEN)ths.
    at_node: Vec<u16>,
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
        let by_month = sight.suns.iter().map(|suns| {
            let of = |month: usize| {
                let all = 0..suns.len() as u32;
                let own: Vec<u32> =
                    all.filter(|i| usize::from(suns.month[*i as usize]) == month).collect();
                (!own.is_empty()).then_some((month, own))
            };
            (0..12).filter_map(of).collect()
        });
        Ok(Self { by_month: by_month.collect(), scene, sight, kernels, disc, places })
    }

    /// The year at a spot; see [`Self::part`].
    pub fn year(
        &self,
        position: DVec3,
        normal: DVec3,
        buffers: &mut DirectScratch,
        into: &mut DirectYear,
    ) {
        let all = 0..self.scene.timeline.steps.len() as u32;
        self.part((position, normal), &all, buffers, into);
    }

    /// Some timesteps of the year at a spot of a surface with its normal turned to where light may
    /// come from; `into` is written over. A timestep's numbers don't depend on which others are asked.
    pub fn part(
        &self,
        (position, normal): (DVec3, DVec3),
        timesteps: &Range<u32>,
        buffers: &mut DirectScratch,
        into: &mut DirectYear,
    ) {
        into.clear(self.scene.timeline.steps.len());
        let spot = Spot { position, eye: position + normal * LIFT_M, normal };
        for (number, facet) in self.sight.facets.iter().enumerate() {
            let suns = &self.sight.suns[number];
            let asked = suns.within(timesteps);
            if facet.before_m(spot.position) <= 0.0 || asked.is_empty() {
                continue;
            }
            for list in &mut buffers.scratch.arrived {
                list.resize(suns.len().max(list.len()), 0.0);
                list[asked.clone()].fill(0.0);
            }
            let mut lit = false;
            for root in self.sight.roots.iter().filter(|root| root.triangle.facet == number) {
                if root
                    .triangle
                    .cell
                    .corners
                    .iter()
                    .all(|c| spot.normal.dot(*c - spot.position) <= 0.0)
                {
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
                    specular.add(&root.triangle.cell.corners, suns, asked.clone(), into);
                }
                if self.kernels[number].is_empty() {
                    continue;
                }
                for (month, list) in &self.by_month[number] {
                    let at = |step| list.partition_point(|&i| suns.step[i as usize] < step);
                    let list = &list[at(timesteps.start)..at(timesteps.end)];
                    if list.is_empty() || !self.look_at(root, &spot, *month, buffers) {
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
                            seen: &buffers.seen,
                            scratch: &mut buffers.scratch,
                        };
                        integral.add(list);
                    }
                }
            }
            if lit {
                let [surface, normal, error] = &buffers.scratch.arrived;
                for i in asked {
                    let [s, n, e] = [surface[i], normal[i], error[i]].map(f64::from);
                    into.add(suns.step[i], s, n, e);
                }
            }
        }
    }

    /// Which parts of a triangle's asked cells the spot sees in a month; whether there are any.
    fn look_at(
        &self,
        root: &Rooted,
        spot: &Spot,
        month: usize,
        buffers: &mut DirectScratch,
    ) -> bool {
        let DirectScratch { seen, at_node, .. } = buffers;
        seen.clear();
        at_node.clear();
        at_node.resize(root.triangle.lattice.len(), NOT_ASKED);
        let sees = |place| self.spot_sees(place, root.triangle.facet, spot, month);
        look_into(&root.triangle.cell, root, &sees, seen, at_node);
        seen.any()
    }

    /// How much of the light from a place gets to the spot, in [`SEEN`](crate::render::reflect::pv::SEEN)ths.
    fn spot_sees(&self, place: DVec3, facet: usize, spot: &Spot, month: usize) -> u16 {
        let start = self.sight.facets[facet].lifted(place);
        let way = spot.eye - start;
        let away_m = way.length();
        let towards = way / away_m;
        if spot.normal.dot(towards) >= 0.0 || away_m >= self.scene.max_path_m {
            return 0;
        }
        let end_m = (away_m - 0.5 * LIFT_M).max(0.0) as f32;
        let (start, towards) = (start.as_vec3(), towards.as_vec3());
        let share = self.scene.site.transmittance(start, towards, end_m, month);
        seen_share(share)
    }

    /// The suns.
    pub fn timeline(&self) -> &Timeline {
        self.scene.timeline
    }
}

/// A cell whose corners say the same is seen, or hidden, as a whole; of others the parts are
/// asked, four for each asked cell.
fn look_into(
    cell: &Cell,
    root: &Rooted,
    sees: &impl Fn(DVec3) -> u16,
    seen: &mut SeenCells,
    at_node: &mut [u16],
) {
    let below = root.triangle.asked - cell.level;
    if below <= SKIPPED_LEVELS {
        let said = root.triangle.lattice.corners_see(cell, at_node, sees);
        if said.iter().all(|s| *s == said[0]) {
            return seen.push_even(1 << (2 * below), said[0]);
        }
        if below == 0 {
            return seen.push_parts(cell.parts().map(|part| sees(part.middle())));
        }
    }
    for part in cell.parts() {
        look_into(&part, root, sees, seen, at_node);
    }
}
