//! The photons of a tile's pixels: loaded once for neighbours, exact for each.
//!
//! A tile's pixels, in the Morton order of what they show, are cut into groups that lie so close
//! together that loading all their photons at once costs less than searching for each. How far
//! the group has to reach is guessed from the pixel in its middle; pixels whose k photons lie
//! farther are done again with a longer reach. Neither groups nor guesses show in the result of an open surface;
//! along its edges they decide where the raster of [`super::surfaces`] lies.

use std::f64::consts::PI;

use glam::Vec3;

use super::candidates::{Accept, Bound, Candidates, Light, Loaded};
use super::estimate::{Kernel, MIN_RADIUS_M};
use super::surfaces::{Mask, Plane, Surfaces, Tolerance};
use super::{Error, Gather};
use crate::base::Aabb;
use crate::pages::{Neighbour, Neighbours, Query, Store};

/// How much farther than its middle pixel a group looks.
const AHEAD: f32 = 1.5;
/// How much farther pixels look that didn't find enough.
const FARTHER: f32 = 1.7;
/// A group is worth its photons where there are at most this many for each that its pixels ask
/// for.
const WORTH: f32 = 0.5;
/// Largest extent of a group in reaches: it bounds the raster.
const MOST_REACHES: f32 = 12.0;
/// Photons of a group at most, unless one pixel needs more.
const MOST_LOADED: usize = 1 << 17;
/// Cells of the raster in a reach.
const CELLS: f32 = 32.0;
/// Pixels are of one plane where their offsets agree to this, m.
const PLANE_STEP_M: f32 = 0.01;
/// Smallest share of a disc that counts as its area: on less than that nothing can be measured.
const LEAST_SHARE: f64 = 1.0 / 64.0;

/// What of a photon becomes irradiance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    pub flux_w: f32,
    /// Cosine of incidence.
    pub cos: f32,
    pub timestep: u32,
}

/// A pixel on a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// Which pixel of the tile.
    pub pixel: u16,
    pub position: Vec3,
    pub normal: Vec3,
}

/// The disc over which the photons of a pixel are spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    pub bound: Bound,
    pub radius_m: f64,
    /// Of the part that belongs to the pixel's surface; weighted by the kernel.
    pub area_m2: f64,
    /// Whether the radius was raised to [`MIN_RADIUS_M`].
    pub floored: bool,
    kernel: Kernel,
}

impl Disc {
    /// Calls `each` for the photons of the disc with the weight that the kernel gives them.
    pub fn each(&self, candidates: &Candidates, mut each: impl FnMut(&Light, f64)) {
        match self.kernel {
            Kernel::Flat => candidates.within(self.bound, |light, _| each(light, 1.0)),
            Kernel::Epanechnikov => {
                let radius2 = self.radius_m * self.radius_m;
                candidates.within(self.bound, |light, d2| {
                    each(light, 2.0 * (1.0 - f64::from(d2) / radius2).max(0.0));
                });
            }
        }
    }
}

/// What was done for a tile, so that it can be done again for other timesteps.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorded {
    groups: Vec<(Vec<u32>, f32)>,
    /// For each spot its disc and the group that found it.
    discs: Vec<Option<(Disc, u32)>>,
}

/// Buffers, kept from tile to tile.
#[derive(Default)]
pub(super) struct Scratch {
    pilot: Neighbours,
    loaded: Vec<Loaded>,
    whole: Candidates,
    own: Candidates,
    mask: Mask,
    places: Vec<Vec3>,
    keyed: Vec<([u32; 3], i32, u32)>,
}

/// Finds the photons of pixels.
pub(super) struct Shared<'a> {
    store: &'a Store,
    surfaces: Option<&'a Surfaces<'a>>,
    gather: Gather,
    max_radius_m: f32,
    tolerance: Tolerance,
}

impl<'a> Shared<'a> {
    pub fn new(
        store: &'a Store,
        surfaces: Option<&'a Surfaces<'a>>,
        gather: &Gather,
    ) -> Result<Self, Error> {
        let max_radius_m = gather.radius_m(store)?;
        let gather = gather.as_used();
        Ok(Self {
            store,
            surfaces: surfaces.filter(|_| gather.edges),
            gather,
            max_radius_m,
            tolerance: gather.tolerance(),
        })
    }

    /// Calls `each` with the disc and the candidates of every spot. `value` turns photons into
    /// what is summed.
    pub fn tile(
        &self,
        spots: &[Spot],
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> Option<[i64; 2]>,
        recorded: Option<&mut Recorded>,
        mut each: impl FnMut(&Spot, &Disc, &Candidates),
    ) -> Result<(), Error> {
        if recorded.is_none() && self.surfaces.is_none() && self.gather.is_open() {
            return self.open(spots, scratch, value, each);
        }
        let mut jobs = vec![((0..spots.len() as u32).collect::<Vec<u32>>(), None)];
        let mut record = Recorded { groups: Vec::new(), discs: vec![None; spots.len()] };
        while let Some((numbers, reach_m)) = jobs.pop() {
            if numbers.is_empty() {
                continue;
            }
            let middle = numbers.len() / 2;
            let halves = |jobs: &mut Vec<(Vec<u32>, Option<f32>)>, reach_m| {
                jobs.push((numbers[middle..].to_vec(), reach_m));
                jobs.push((numbers[..middle].to_vec(), reach_m));
            };
            let group: Vec<Spot> = numbers.iter().map(|&n| spots[n as usize]).collect();
            let reach_m = match reach_m {
                Some(reach_m) => reach_m,
                None => {
                    let (radius_m, density) = self.pilot(&group[middle], scratch)?;
                    let reach_m = (radius_m * AHEAD).min(self.max_radius_m);
                    let extent =
                        Aabb::around(group.iter().map(|s| s.position)).size().max_element();
                    let edge = extent + 2.0 * reach_m;
                    let photons = edge * edge * density;
                    let worth = WORTH * self.gather.bandwidth as f32 * group.len() as f32;
                    let costly = photons > worth.min(self.most_loaded() as f32);
                    if group.len() > 1 && (costly || extent > MOST_REACHES * reach_m) {
                        halves(&mut jobs, None);
                        continue;
                    }
                    reach_m
                }
            };
            let Some(region) = self.load(&group, reach_m, scratch, value)? else {
                halves(&mut jobs, Some(reach_m));
                continue;
            };
            let number = record.groups.len() as u32;
            let mut failed = Vec::new();
            let mut answer = |at: usize, disc: Option<Disc>, candidates: &Candidates| match disc {
                Some(disc) => {
                    record.discs[numbers[at] as usize] = Some((disc, number));
                    each(&group[at], &disc, candidates);
                }
                None => failed.push(numbers[at]),
            };
            self.group(&group, (region, reach_m), scratch, |_| None, &mut answer);
            record.groups.push((numbers, reach_m));
            // What didn't find enough looks farther, still together, in the order of the tile.
            failed.sort_unstable();
            jobs.push((failed, Some((reach_m * FARTHER).min(self.max_radius_m))));
        }
        if let Some(out) = recorded {
            *out = record;
        }
        Ok(())
    }

    /// The same where discs end nowhere: the store's own search is exact, and shares what
    /// neighbours need by itself.
    fn open(
        &self,
        spots: &[Spot],
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> Option<[i64; 2]>,
        mut each: impl FnMut(&Spot, &Disc, &Candidates),
    ) -> Result<(), Error> {
        let query = |spot: &Spot| Query {
            point: spot.position,
            normal: spot.normal,
            count: self.gather.bandwidth,
            max_radius_m: self.max_radius_m,
        };
        let queries: Vec<Query> = spots.iter().map(query).collect();
        let Scratch { pilot, own, .. } = scratch;
        let light = |n: &Neighbour| {
            let beam = Beam { flux_w: n.flux_w, cos: n.cos, timestep: n.timestep };
            let [surface, normal] = value(beam).unwrap_or_default();
            Light { surface, normal, index: n.index, timestep: n.timestep }
        };
        self.store.nearest_each(&queries, pilot, |at, found| {
            let bound = own.take(found, self.gather.estimator, self.max_radius_m, light);
            each(&spots[at], &self.disc(bound, |_| 1.0), own);
            Ok(())
        })
    }

    /// The disc within a bound; `share` of it belongs to the pixel's surface.
    fn disc(&self, bound: Bound, share: impl Fn(f32) -> f64) -> Disc {
        let exact_m = f64::from(bound.distance2_m2).sqrt();
        let radius_m = exact_m.max(MIN_RADIUS_M);
        let share = share(radius_m as f32).max(LEAST_SHARE);
        Disc {
            bound,
            radius_m,
            area_m2: PI * radius_m * radius_m * share,
            floored: exact_m < MIN_RADIUS_M,
            kernel: self.gather.kernel,
        }
    }

    /// Does again what was recorded, for the photons that `value` lets through now.
    pub fn again(
        &self,
        spots: &[Spot],
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> Option<[i64; 2]>,
        recorded: &Recorded,
        mut each: impl FnMut(&Spot, &Disc, &Candidates),
    ) -> Result<(), Error> {
        for (number, (numbers, reach_m)) in recorded.groups.iter().enumerate() {
            let group: Vec<Spot> = numbers.iter().map(|&n| spots[n as usize]).collect();
            // No more photons than last time: they fit.
            let Some(region) = self.load(&group, *reach_m, scratch, value)? else { continue };
            let known = |at: usize| match recorded.discs[numbers[at] as usize] {
                Some((disc, by)) if by as usize == number => Some(Some(disc)),
                _ => Some(None),
            };
            let mut answer = |at: usize, disc: Option<Disc>, candidates: &Candidates| {
                if let Some(disc) = disc {
                    each(&group[at], &disc, candidates);
                }
            };
            self.group(&group, (region, *reach_m), scratch, known, &mut answer);
        }
        Ok(())
    }

    fn most_loaded(&self) -> usize {
        MOST_LOADED.max(8 * self.gather.bandwidth)
    }

    /// Radius that a pixel needs on an open surface, m, and photons per m2 there.
    fn pilot(&self, spot: &Spot, scratch: &mut Scratch) -> Result<(f32, f32), Error> {
        let query = Query {
            point: spot.position,
            normal: spot.normal,
            count: self.gather.bandwidth,
            max_radius_m: self.max_radius_m,
        };
        let found = &mut scratch.pilot;
        self.store.nearest(&query, found)?;
        let radius_m = match found.farthest().filter(|_| found.full()) {
            Some(at) => found.items()[at].distance2_m2.sqrt().max(MIN_RADIUS_M as f32),
            None => self.max_radius_m,
        };
        let area_m2 = PI as f32 * radius_m * radius_m;
        Ok((radius_m, found.items().len() as f32 / area_m2))
    }

    /// Loads the photons within reach of a group; `None` where they are too many.
    fn load(
        &self,
        group: &[Spot],
        reach_m: f32,
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> Option<[i64; 2]>,
    ) -> Result<Option<Aabb>, Error> {
        let around = Aabb::around(group.iter().map(|s| s.position));
        // Beyond the reach by more than rounding.
        let wide = reach_m * 1.0002 + 1e-4;
        let reach = Vec3::splat(wide);
        let region = Aabb { min: around.min - reach, max: around.max + reach };
        let alone = (group.len() == 1).then(|| group[0].normal);
        let most = if group.len() == 1 { usize::MAX } else { self.most_loaded() };
        let loaded = &mut scratch.loaded;
        loaded.clear();
        let mut too_many = false;
        self.store.in_box(region, |index, photon| {
            if around.distance_squared(photon.position) > wide * wide
                || alone.is_some_and(|n| photon.normal.dot(n) < self.tolerance.normal_cos)
            {
                return;
            }
            if loaded.len() >= most {
                too_many = true;
                return;
            }
            let cos = photon.normal.dot(photon.direction);
            let beam = Beam { flux_w: photon.flux_w, cos, timestep: photon.timestep };
            if let Some([surface, normal]) = value(beam) {
                let light = Light { surface, normal, index, timestep: photon.timestep };
                loaded.push(Loaded { position: photon.position, normal: photon.normal, light });
            }
        })?;
        Ok((!too_many).then_some(region))
    }

    /// Answers the spots of a group from its photons, plane by plane. `known` tells discs that
    /// were found before (and spots that are none of this group's).
    fn group(
        &self,
        group: &[Spot],
        (region, reach_m): (Aabb, f32),
        scratch: &mut Scratch,
        known: impl Fn(usize) -> Option<Option<Disc>>,
        answer: &mut impl FnMut(usize, Option<Disc>, &Candidates),
    ) {
        let Scratch { loaded, whole, own, mask, places, keyed, .. } = scratch;
        keyed.clear();
        for (i, spot) in group.iter().enumerate() {
            let offset = (spot.normal.dot(spot.position) / PLANE_STEP_M).round() as i32;
            keyed.push((spot.normal.to_array().map(f32::to_bits), offset, i as u32));
        }
        keyed.sort_unstable();
        let mut filled = false;
        for run in keyed.chunk_by_mut(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let normal = group[run[0].2 as usize].normal;
            let plane = Plane { normal, offset_m: run[0].1 as f32 * PLANE_STEP_M };
            let ends = self.surfaces.is_some_and(|surfaces| {
                places.clear();
                places.extend(run.iter().map(|r| group[r.2 as usize].position));
                mask.draw(surfaces, plane, self.tolerance, places, (reach_m, reach_m / CELLS))
            });
            if ends {
                // By component, those without one first.
                for r in run.iter_mut() {
                    let place = group[r.2 as usize].position;
                    r.1 = mask.component(place).map_or(-1, |c| c as i32);
                }
                run.sort_unstable_by_key(|r| (r.1, r.2));
            }
            for part in run.chunk_by(|a, b| !ends || a.1 == b.1) {
                let component = (ends && part[0].1 >= 0).then_some(part[0].1 as u32);
                if let Some(component) = component {
                    mask.measure(component);
                }
                let mask = component.map(|_| &*mask);
                let accept = |place: Vec3, n: Vec3| {
                    n.dot(normal) >= self.tolerance.normal_cos
                        && plane.height_m(place).abs() <= self.tolerance.plane_m
                        && component.is_none_or(|c| mask.is_none_or(|m| m.holds(c, place)))
                };
                // Many pixels on one plane are worth photons of their own; few sort out what they
                // find among all.
                let worth = part.len() * self.gather.bandwidth >= loaded.len();
                if worth {
                    own.fill(loaded, normal, (region, reach_m), Some(&accept));
                    self.spots(group, part, (reach_m, mask, None), own, &known, answer);
                } else {
                    if !filled {
                        whole.fill(loaded, normal, (region, reach_m), None);
                        filled = true;
                    }
                    let accept: Option<&Accept<'_>> = Some(&accept);
                    self.spots(group, part, (reach_m, mask, accept), whole, &known, answer);
                }
            }
        }
    }

    fn spots(
        &self,
        group: &[Spot],
        part: &[([u32; 3], i32, u32)],
        (reach_m, mask, accept): (f32, Option<&Mask>, Option<&Accept<'_>>),
        candidates: &mut Candidates,
        known: &impl Fn(usize) -> Option<Option<Disc>>,
        answer: &mut impl FnMut(usize, Option<Disc>, &Candidates),
    ) {
        let last_word = reach_m >= self.max_radius_m;
        let mut guess_m = reach_m / AHEAD * 1.05;
        for &(_, _, at) in part {
            let place = group[at as usize].position;
            match known(at as usize) {
                Some(Some(disc)) => {
                    candidates.look_again(place, disc.bound, accept);
                    answer(at as usize, Some(disc), candidates);
                    continue;
                }
                Some(None) => continue,
                None => {}
            }
            let bound = candidates.bound(
                place,
                self.gather.bandwidth,
                self.gather.estimator,
                (guess_m, reach_m, last_word),
                accept,
            );
            let disc = bound.map(|bound| {
                let exact_m = f64::from(bound.distance2_m2).sqrt();
                guess_m = if bound.full { exact_m as f32 * 1.08 } else { reach_m };
                guess_m = guess_m.max(reach_m / 64.0);
                let kernel = self.gather.kernel;
                self.disc(bound, |r| mask.map_or(1.0, |m| m.share(place, r, kernel)))
            });
            answer(at as usize, disc, candidates);
        }
    }
}
