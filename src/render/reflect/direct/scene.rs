//! Direct integration of a scene: for a receiver point, facet by facet, what delta lobes mirror and
//! what the terms of the scattering send.

use std::ops::Range;

use glam::DVec3;

use super::integral::{Arrived, Integral, Scratch};
use super::kernel::Kernel;
use super::quadrature::{DiscPoints, DiscRule};
use super::receiver::{LIFT_M, ReceiverPoint};
use super::sight::{PvSight, Rooted};
use super::specular::Specular;
use super::visible::VisibleCells;
use super::year::DirectYear;
use crate::base::Timeline;
use crate::bsdf::Bsdf;
use crate::render::reflect::disc::Disc;
use crate::render::reflect::pv::{Cell, NOT_ASKED, seen_share};
use crate::render::view::error::Error;
use crate::site::Site;

/// Levels above the asked cells at which a receiver begins to ask: a metre or two.
const SKIPPED_LEVELS: u32 = 2;

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

/// A year of suns, ready to be integrated over the PV for any receiver.
#[derive(Debug)]
pub struct Direct<'a> {
    scene: DirectScene<'a>,
    sight: &'a PvSight,
    /// By facet: the terms of its scattering function.
    kernels: Vec<Vec<Kernel<'a>>>,
    disc: Disc,
    disc_points: DiscPoints,
    /// By facet: the numbers of its suns, by the month in which crowns let as much through.
    by_month: Vec<Vec<(usize, Vec<u32>)>>,
}

/// Buffers of one thread, kept from receiver to receiver.
#[derive(Debug, Default)]
pub struct DirectScratch {
    scratch: Scratch,
    visible: VisibleCells,
    /// How much of the light from each node of a lattice gets to the receiver, in [`SEEN`](crate::render::reflect::pv::SEEN)ths.
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
                terms
                    .into_iter()
                    .map(|(share, term)| Kernel::of(share, term, suns, &disc))
                    .collect()
            })
            .collect();
        let disc_points = DiscPoints::of(&disc);
        let by_month = sight.suns.iter().map(|suns| {
            let of = |month: usize| {
                let all = 0..suns.len() as u32;
                let own: Vec<u32> =
                    all.filter(|i| usize::from(suns.month[*i as usize]) == month).collect();
                (!own.is_empty()).then_some((month, own))
            };
            (0..12).filter_map(of).collect()
        });
        Ok(Self { by_month: by_month.collect(), scene, sight, kernels, disc, disc_points })
    }

    /// The year at a point of a surface; see [`Self::part`].
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

    /// Some timesteps of the year at a point of a surface with its normal turned to where light may
    /// come from; `into` is written over. A timestep's numbers don't depend on which others are asked.
    pub fn part(
        &self,
        (position, normal): (DVec3, DVec3),
        timesteps: &Range<u32>,
        buffers: &mut DirectScratch,
        into: &mut DirectYear,
    ) {
        into.clear(self.scene.timeline.steps.len());
        let receiver = ReceiverPoint::new(position, normal);
        for (number, facet) in self.sight.facets.iter().enumerate() {
            let asked = self.sight.suns[number].within(timesteps);
            if facet.before_m(position) <= 0.0 || asked.is_empty() {
                continue;
            }
            let faces = |root: &&Rooted| {
                let corners = &root.triangle.cell.corners;
                root.triangle.facet == number
                    && corners.iter().any(|c| normal.dot(*c - position) > 0.0)
            };
            let roots = || self.sight.roots.iter().filter(faces);
            self.add_mirrored(number, &receiver, roots(), &asked, into);
            self.add_scattered(number, &receiver, roots(), (timesteps, &asked), buffers, into);
        }
    }

    /// What a facet's delta lobe sends, exactly.
    fn add_mirrored<'r>(
        &self,
        number: usize,
        receiver: &ReceiverPoint,
        roots: impl Iterator<Item = &'r Rooted>,
        asked: &Range<usize>,
        into: &mut DirectYear,
    ) {
        let facet = &self.sight.facets[number];
        let bsdf = self.scene.bsdfs[usize::from(facet.surface)];
        if !bsdf.has_delta() {
            return;
        }
        let specular = Specular {
            site: self.scene.site,
            facet,
            bsdf,
            disc: &self.disc,
            points: self.disc_points.get(DiscRule::Rings),
            receiver,
            max_path_m: self.scene.max_path_m,
            sun_visibility: self.scene.sun_visibility,
        };
        for root in roots {
            specular.add(
                &root.triangle.cell.corners,
                &self.sight.suns[number],
                asked.clone(),
                into,
            );
        }
    }

    /// What the terms of a facet's scattering send: triangle by triangle, for the suns of each month
    /// in which crowns let as much through.
    fn add_scattered<'r>(
        &self,
        number: usize,
        receiver: &ReceiverPoint,
        roots: impl Iterator<Item = &'r Rooted>,
        (timesteps, asked): (&Range<u32>, &Range<usize>),
        buffers: &mut DirectScratch,
        into: &mut DirectYear,
    ) {
        let (facet, suns) = (&self.sight.facets[number], &self.sight.suns[number]);
        let kernels = &self.kernels[number];
        if kernels.is_empty() {
            return;
        }
        buffers.scratch.arrived.clear(suns.len(), asked.clone());
        let mut lit = false;
        for root in roots {
            for (month, list) in &self.by_month[number] {
                let at = |step| list.partition_point(|&i| suns.step[i as usize] < step);
                let list = &list[at(timesteps.start)..at(timesteps.end)];
                if list.is_empty() || !self.look_at(root, receiver, *month, buffers) {
                    continue;
                }
                lit = true;
                for kernel in kernels {
                    let mut integral = Integral {
                        facet,
                        root,
                        suns,
                        kernel,
                        disc: &self.disc,
                        disc_points: &self.disc_points,
                        receiver,
                        toward: facet.frame.local_from_world(-receiver.normal).as_vec3().to_array(),
                        visible: &buffers.visible,
                        scratch: &mut buffers.scratch,
                    };
                    integral.add(list);
                }
            }
        }
        if lit {
            let Arrived { surface, normal, error } = &buffers.scratch.arrived;
            for i in asked.clone() {
                let [s, n, e] = [surface[i], normal[i], error[i]].map(f64::from);
                into.add(suns.step[i], s, n, e);
            }
        }
    }

    /// Which parts of a triangle's asked cells the receiver sees in a month; whether there are any.
    fn look_at(
        &self,
        root: &Rooted,
        receiver: &ReceiverPoint,
        month: usize,
        buffers: &mut DirectScratch,
    ) -> bool {
        let DirectScratch { visible, at_node, .. } = buffers;
        visible.clear();
        at_node.clear();
        at_node.resize(root.triangle.lattice.len(), NOT_ASKED);
        let sees = |place| self.receiver_sees(place, root.triangle.facet, receiver, month);
        look_into(&root.triangle.cell, root, &sees, visible, at_node);
        visible.any()
    }

    /// How much of the light from a place of a facet gets to the receiver, in
    /// [`SEEN`](crate::render::reflect::pv::SEEN)ths.
    fn receiver_sees(
        &self,
        place: DVec3,
        facet: usize,
        receiver: &ReceiverPoint,
        month: usize,
    ) -> u16 {
        let way = receiver.ray_end - place;
        if receiver.normal.dot(way) >= 0.0 || way.length() >= self.scene.max_path_m {
            return 0;
        }
        let start = self.sight.facets[facet].ray_start(place, way.normalize());
        let way = receiver.ray_end - start;
        let (away_m, towards) = (way.length(), way.normalize());
        let end_m = (away_m - 0.5 * LIFT_M).max(0.0) as f32;
        let (start, towards) = (start.as_vec3(), towards.as_vec3());
        seen_share(self.scene.site.transmittance(start, towards, end_m, month))
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
    visible: &mut VisibleCells,
    at_node: &mut [u16],
) {
    let below = root.triangle.asked - cell.level;
    if below <= SKIPPED_LEVELS {
        let said = root.triangle.lattice.corners_see(cell, at_node, sees);
        if said.iter().all(|s| *s == said[0]) {
            return visible.push_even(1 << (2 * below), said[0]);
        }
        if below == 0 {
            let mut parts = cell.parts().map(|part| sees(part.middle()));
            if parts.iter().all(|p| *p == parts[0]) {
                // The border passes between a corner and the middles: a sliver of the corner's part
                // isn't as the rest, and the cell counts as uneven.
                for (part, said) in parts.iter_mut().zip(said) {
                    *part = ((7 * u32::from(*part) + u32::from(said)) / 8) as u16;
                }
            }
            return visible.push_parts(parts);
        }
    }
    for part in cell.parts() {
        look_into(&part, root, sees, visible, at_node);
    }
}
