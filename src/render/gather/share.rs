//! The photons of a tile's pixels: loaded once for neighbours, exact for each.
//!
//! The problem: a map has a hundred thousand query points, each of which asks for its k nearest
//! photons (400, or 50,000 for a series). A search of the store for each reads the same pages again
//! and again, and tests most photons once for every point around them.
//!
//! The idea: points that lie close together have nearly the same neighbours.
//!
//! 1. **Groups.** A tile's pixels, in the Morton order of what they show, are halved until loading
//!    all photons of a group at once costs less than a search for each point ([`Shared::tile`]).
//!    How far the group has to reach is guessed from the point in its middle; points whose k
//!    photons lie farther go round again with a longer reach.
//! 2. **Planes and pieces** (`group.rs`). Points of a group on one plane share a raster of where
//!    their surface ends ([`super::surfaces`]), and those on one piece of it the photons there.
//! 3. **Candidates** ([`super::candidates`]). Neighbours on a piece share a list of photons; each
//!    point only says which of them came and went since the point before, so that sums are changed
//!    instead of made anew.
//!
//! Sums are of integers ([`super::flux`]), so their order doesn't matter: neither groups nor
//! guesses show in the result on an open surface, and a twin in the tests searches for every point
//! alone. Along the edges of a surface they decide where the raster lies.
//!
//! What would do worse: a grid of cells with the photons of each (flat discs at roof edges reach
//! across ten cells, and its size fits only one density), and one list of candidates for a whole
//! tile (a tile that shows a gable and the street behind it has two far-apart sets of neighbours).

mod group;

use std::f64::consts::PI;
use std::ops::Range;

use glam::Vec3;

use super::candidates::{Answer, Bound, Candidates, Change, Last, Wanted};
use super::error::Error;
use super::estimator::{Kernel, MIN_RADIUS_M};
use super::flux::Beam;
use super::photon_set::{Light, PhotonSet};
use super::settings::Gather;
use super::surfaces::{Mask, Plane, Surfaces, Tolerance};
use crate::base::Aabb;
use crate::pages::{ALWAYS, Neighbour, Neighbours, Query, Store};
use crate::render::view::order::QueryPoint;

/// How much farther than its middle pixel a group looks.
const AHEAD: f32 = 1.5;
/// So few pixels that aren't worth their photons together are searched for one by one.
const FEW: usize = 4;
/// What a search of its own costs besides, in photons.
const SEARCH: f32 = 100.0;
/// Pixels share a list of candidates within this part of their radius around their middle ...
const SPREAD: f32 = 0.3;
/// ... which reaches farther than the radius before by this part,
const SPARE: f32 = 0.04;
/// and grows by this factor where that was too little.
const LONGER: f32 = 1.25;
/// How much farther pixels look that didn't find enough.
const FARTHER: f32 = 1.7;
/// A group is worth its photons where there are at most this many for each that its pixels would
/// meet one by one.
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

/// A box that reaches farther on all sides.
fn grown(around: Aabb, reach_m: f32) -> Aabb {
    let reach = Vec3::splat(reach_m);
    Aabb { min: around.min - reach, max: around.max + reach }
}

/// A reach, by more than rounding longer.
fn wider(reach_m: f32) -> f32 {
    reach_m * 1.0002 + 1e-4
}

fn around<'s>(group: impl Iterator<Item = &'s QueryPoint>) -> Aabb {
    Aabb::around(group.map(|s| s.position))
}

/// Where the photons of a group may lie.
struct Reach {
    region: Aabb,
    around: Aabb,
    wide_m: f32,
    /// Of a group of one: its normal, and the least cosine of a photon's with it.
    alone: Option<(Vec3, f32)>,
}

impl Reach {
    fn of(group: &[QueryPoint], reach_m: f32, tolerance: Tolerance) -> Self {
        let (around, wide_m) = (around(group.iter()), wider(reach_m));
        let alone = (group.len() == 1).then(|| (group[0].normal, tolerance.normal_cos));
        Self { region: grown(around, wide_m), around, wide_m, alone }
    }

    fn holds(&self, position: Vec3, normal: Vec3) -> bool {
        self.around.distance_squared(position) <= self.wide_m * self.wide_m
            && self.alone.is_none_or(|(n, cos)| normal.dot(n) >= cos)
    }
}

/// The disc over which the photons of a pixel are spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Disc {
    pub bound: Bound,
    pub radius_m: f64,
    /// Of the part that belongs to the pixel's surface; weighted by the kernel.
    pub area_m2: f64,
    /// Whether the radius was raised to [`MIN_RADIUS_M`].
    pub floored: bool,
    kernel: Kernel,
}

/// A disc and what lies in it.
pub(in crate::render) struct Found<'a> {
    pub disc: Disc,
    loaded: &'a PhotonSet,
    candidates: &'a mut Candidates,
}

impl Found<'_> {
    /// Calls `each` with what differs from the photons of the pixel that was answered before.
    pub fn changes(&mut self, mut each: impl FnMut(Change<'_>)) {
        match self.disc.kernel {
            Kernel::Flat => self.candidates.changes(self.loaded, self.disc.bound, each),
            Kernel::Epanechnikov => {
                let radius2 = self.disc.radius_m * self.disc.radius_m;
                each(Change::Anew);
                self.candidates.all(self.loaded, self.disc.bound, |light, d2| {
                    each(Change::In(light, 2.0 * (1.0 - f64::from(d2) / radius2).max(0.0)));
                });
            }
        }
    }
}

/// Query points of a tile, by number, that load their photons together.
#[derive(Clone, Debug)]
struct Group {
    numbers: Vec<u32>,
    /// How far the photons reach that were loaded for it, m.
    reach_m: f32,
}

/// Query points that are still to be answered, and how far to reach, if that is known.
struct Job {
    numbers: Vec<u32>,
    reach_m: Option<f32>,
}

/// What was done for a tile, so that it can be done again for other timesteps.
#[derive(Clone, Debug, Default)]
pub(in crate::render) struct Recorded {
    groups: Vec<Group>,
    /// For each point its disc and the group that found it.
    discs: Vec<Option<(Disc, u32)>>,
}

/// What is known of a query point's disc.
enum Known {
    /// Nothing: it is to be found.
    Nothing,
    /// It was found before.
    Disc(Disc),
    /// Another group answers the point.
    Elsewhere,
}

/// A query point, sorted by plane, then by piece of the surface there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Sorted {
    /// Bits of the normal.
    normal: [u32; 3],
    /// The plane's offset in steps; once a raster is drawn, the piece, -1 on slivers without one.
    offset_or_piece: i32,
    /// Index in the group.
    at: u32,
}

/// A query point of a group to answer, and its disc where that was found before.
struct Todo {
    at: u32,
    known: Option<Disc>,
}

/// Buffers, kept from tile to tile.
#[derive(Default)]
pub(in crate::render) struct Scratch {
    pilot: Neighbours,
    loaded: PhotonSet,
    own: PhotonSet,
    tile: PhotonSet,
    candidates: Candidates,
    mask: Mask,
    places: Vec<Vec3>,
    todo: Vec<Todo>,
    sorted: Vec<Sorted>,
}

/// Finds the photons of pixels.
pub(in crate::render) struct Shared<'a> {
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

    /// Calls `each` with the disc and the candidates of every point. `value` turns photons into
    /// what is summed.
    pub fn tile(
        &self,
        points: &[QueryPoint],
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> [i64; 2],
        recorded: Option<&mut Recorded>,
        mut each: impl FnMut(&QueryPoint, Found<'_>),
    ) -> Result<(), Error> {
        let mut jobs = vec![Job { numbers: (0..points.len() as u32).collect(), reach_m: None }];
        let mut record = Recorded { groups: Vec::new(), discs: vec![None; points.len()] };
        while let Some(Job { numbers, reach_m }) = jobs.pop() {
            if numbers.is_empty() {
                continue;
            }
            let middle = numbers.len() / 2;
            let halves = |jobs: &mut Vec<Job>, reach_m| {
                jobs.push(Job { numbers: numbers[middle..].to_vec(), reach_m });
                jobs.push(Job { numbers: numbers[..middle].to_vec(), reach_m });
            };
            let group: Vec<QueryPoint> = numbers.iter().map(|&n| points[n as usize]).collect();
            let reach_m = match reach_m {
                Some(reach_m) => reach_m,
                None => {
                    if group.len() <= FEW && self.is_open() {
                        for (&number, point) in numbers.iter().zip(&group) {
                            let found = self.alone(point, scratch, value)?;
                            let by = record.groups.len() as u32;
                            record.discs[number as usize] = Some((found.disc, by));
                            let reach_m = found.disc.bound.reach_m();
                            record.groups.push(Group { numbers: vec![number], reach_m });
                            each(point, found);
                        }
                        continue;
                    }
                    let (radius_m, found) = self.pilot(&group[middle], scratch)?;
                    let reach_m = (radius_m * AHEAD).min(self.max_radius_m);
                    if group.len() > 1 && !self.worth(&group, reach_m, found)? {
                        halves(&mut jobs, None);
                        continue;
                    }
                    reach_m
                }
            };
            if !self.load(&group, (reach_m, &ALWAYS), scratch, value)? {
                halves(&mut jobs, Some(reach_m));
                continue;
            }
            let number = record.groups.len() as u32;
            let mut failed = Vec::new();
            let mut answer = |at: usize, found: Option<Found<'_>>| match found {
                Some(found) => {
                    record.discs[numbers[at] as usize] = Some((found.disc, number));
                    each(&group[at], found);
                }
                None => failed.push(numbers[at]),
            };
            self.group(&group, reach_m, scratch, |_| Known::Nothing, &mut answer);
            record.groups.push(Group { numbers, reach_m });
            // What didn't find enough looks farther, still together, in the order of the tile.
            failed.sort_unstable();
            let farther_m = (reach_m * FARTHER).min(self.max_radius_m);
            jobs.push(Job { numbers: failed, reach_m: Some(farther_m) });
        }
        if let Some(out) = recorded {
            *out = record;
        }
        Ok(())
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

    /// Does again what was recorded, for the photons of some timesteps.
    pub fn again(
        &self,
        points: &[QueryPoint],
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> [i64; 2],
        (recorded, timesteps): (&Recorded, &Range<u32>),
        mut each: impl FnMut(&QueryPoint, Found<'_>),
    ) -> Result<(), Error> {
        // Groups of a tile look at much the same photons: few timesteps are read once for all.
        let reached = |group: &Group| {
            let members = group.numbers.iter().map(|&n| &points[n as usize]);
            grown(around(members), wider(group.reach_m))
        };
        let region = recorded.groups.iter().map(reached).reduce(|all, one| all.union(one));
        let mut tile = std::mem::take(&mut scratch.tile);
        let whole = match region {
            Some(region) => {
                let most = self.most_loaded();
                self.read((region, timesteps), most, |_, _| true, (&mut tile, value))?
            }
            None => false,
        };
        for (number, Group { numbers, reach_m }) in recorded.groups.iter().enumerate() {
            let group: Vec<QueryPoint> = numbers.iter().map(|&n| points[n as usize]).collect();
            if whole {
                let reach = Reach::of(&group, *reach_m, self.tolerance);
                scratch.loaded.take_in(&tile, reach.region, |p, n| reach.holds(p, n));
            // No more photons than last time: they fit.
            } else if !self.load(&group, (*reach_m, timesteps), scratch, value)? {
                continue;
            }
            let known = |at: usize| match recorded.discs[numbers[at] as usize] {
                Some((disc, by)) if by as usize == number => Known::Disc(disc),
                _ => Known::Elsewhere,
            };
            let mut answer = |at: usize, found: Option<Found<'_>>| {
                if let Some(found) = found {
                    each(&group[at], found);
                }
            };
            self.group(&group, *reach_m, scratch, known, &mut answer);
        }
        scratch.tile = tile;
        Ok(())
    }

    fn most_loaded(&self) -> usize {
        MOST_LOADED.max(8 * self.gather.bandwidth)
    }

    /// Whether a group is better off together.
    fn worth(&self, group: &[QueryPoint], reach_m: f32, found: usize) -> Result<bool, Error> {
        let around = Aabb::around(group.iter().map(|s| s.position));
        let extent = around.size().max_element();
        if self.surfaces.is_some() && extent > MOST_REACHES * reach_m {
            return Ok(false);
        }
        let most = WORTH * (found as f32 + SEARCH) * group.len() as f32;
        let most = most.min(0.8 * self.most_loaded() as f32);
        Ok(self.store.about_in_box(grown(around, reach_m), most)? <= most)
    }

    /// Whether discs end nowhere and take what the store's own search finds.
    fn is_open(&self) -> bool {
        self.surfaces.is_none() && self.gather.is_open()
    }

    fn query(&self, point: &QueryPoint) -> Query {
        Query {
            point: point.position,
            normal: point.normal,
            count: self.gather.bandwidth,
            max_radius_m: self.max_radius_m,
        }
    }

    /// Radius that a pixel needs on an open surface, m, and the photons within.
    fn pilot(&self, point: &QueryPoint, scratch: &mut Scratch) -> Result<(f32, usize), Error> {
        let found = &mut scratch.pilot;
        self.store.nearest(&self.query(point), found)?;
        let radius_m = match found.farthest().filter(|_| found.full()) {
            Some(at) => found.items()[at].distance2_m2.sqrt().max(MIN_RADIUS_M as f32),
            None => self.max_radius_m,
        };
        Ok((radius_m, found.items().len()))
    }

    /// The disc of a pixel on an open surface, by a search of its own.
    fn alone<'s>(
        &self,
        point: &QueryPoint,
        scratch: &'s mut Scratch,
        value: &impl Fn(Beam) -> [i64; 2],
    ) -> Result<Found<'s>, Error> {
        let Scratch { pilot: found, loaded, candidates, .. } = scratch;
        self.store.nearest(&self.query(point), found)?;
        loaded.clear();
        for n in found.items() {
            let beam = Beam { flux_w: n.flux_w, cos: n.cos, timestep: n.timestep };
            let [e, e_n] = value(beam);
            let light = Light { surface: e, facing: e_n, index: n.index, timestep: n.timestep };
            loaded.push(point.position, point.normal, light);
        }
        candidates.found(found.items().iter().map(|n| n.distance2_m2));
        let bound = match found.farthest().filter(|_| found.full()) {
            Some(last) => {
                let Neighbour { distance2_m2, index, .. } = found.items()[last];
                let index = index + self.gather.estimator.keeps_last();
                Bound { distance2_m2, index, full: true }
            }
            None => {
                let distance2_m2 = self.max_radius_m * self.max_radius_m;
                Bound { distance2_m2, index: u64::MAX, full: false }
            }
        };
        Ok(Found { disc: self.disc(bound, |_| 1.0), loaded, candidates })
    }

    /// Loads the photons of some timesteps within reach of a group; false where they are too many.
    fn load(
        &self,
        group: &[QueryPoint],
        (reach_m, timesteps): (f32, &Range<u32>),
        scratch: &mut Scratch,
        value: &impl Fn(Beam) -> [i64; 2],
    ) -> Result<bool, Error> {
        let reach = Reach::of(group, reach_m, self.tolerance);
        let most = if group.len() == 1 { usize::MAX } else { self.most_loaded() };
        let accept = |position, normal| reach.holds(position, normal);
        self.read((reach.region, timesteps), most, accept, (&mut scratch.loaded, value))
    }

    /// Reads the photons of some timesteps in a region; false where they are more than `most`.
    fn read(
        &self,
        (region, timesteps): (Aabb, &Range<u32>),
        most: usize,
        accept: impl Fn(Vec3, Vec3) -> bool,
        (out, value): (&mut PhotonSet, &impl Fn(Beam) -> [i64; 2]),
    ) -> Result<bool, Error> {
        out.clear();
        let mut too_many = false;
        self.store.lit_in_box(region, timesteps, |index, position, normal, light| {
            if accept(position, normal) {
                too_many = out.len() >= most;
                if too_many {
                    return false;
                }
                let timestep = light.timestep;
                let beam = Beam { flux_w: light.flux_w, cos: light.cos, timestep };
                let [surface, facing] = value(beam);
                out.push(position, normal, Light { surface, facing, index, timestep });
            }
            true
        })?;
        Ok(!too_many)
    }
}
