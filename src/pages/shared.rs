//! Neighbouring queries, answered from one set of candidates.
//!
//! Queries that lie within a distance `s` of a centre `c`, whose k-th photon is `r` away, share
//! most of their answers. By the triangle inequality the k-th photon of each lies between `r - s`
//! and `r + s` from it, so the tree is walked once, for all photons within `r + 2 s` of `c`. The
//! same holds from one query to the next: what is nearer than the k-th photon before, less the
//! step, need not be sorted, nor what lies beyond it by more than the step.

use glam::Vec3;

use super::Error;
use super::page::Page;
use super::query::{ALWAYS, Last, Neighbour, Neighbours, Query, SAME_SIDE};
use super::store::Store;
use super::tree::{node_box, page_box};
use crate::base::Aabb;

/// Queries share candidates as long as they lie within this part of the search radius around
/// their middle.
const SPREAD: f32 = 0.15;
/// Fewer queries aren't worth the walk for more than the nearest.
const QUERIES_MIN: usize = 4;
/// Bound on the queries that are looked ahead.
const QUERIES_MAX: usize = 256;
/// Cosine between normals of queries that may share.
const ALIKE: f32 = 0.9;
/// More than rounding moves a distance, relative.
const SLACK: f32 = 1e-4;
/// Standard deviations, roughly, by which the k-th distance changes seldom.
const CHANCE: f32 = 1.0;
/// More candidates than this, times k, wait outside of the answers where density jumps: then each
/// query is better off by itself.
const CANDIDATES_MAX: usize = 8;

/// Candidates that are looked at together.
const LANES: usize = 16;

/// Candidates in store order, and the scratch of one query.
#[derive(Default)]
pub(super) struct Shared {
    /// Coordinates, filled up to whole lanes with NaN, which is near nothing.
    places: Vec<[[f32; LANES]; 3]>,
    photons: Vec<Neighbour>,
    distance2: Vec<[f32; LANES]>,
    /// Of each of `distance2`: how many surely win, how many may.
    counts: Vec<[u8; 2]>,
    selected: Vec<u32>,
    /// Where they were gathered, and how far away the k-th is from there; infinite where there are
    /// less than k.
    centre: Vec3,
    radius_m: f32,
}

/// Some queries around a point.
struct Cluster<'a> {
    queries: &'a [Query],
    centre: Query,
    spread_m: f32,
}

impl Store {
    /// Answers each of `queries` as [`nearest`](Self::nearest) does, in their order: `each` gets
    /// the number of the query and the answer. Queries that follow each other and lie close
    /// together share one walk through the store, which is several times faster; the answers are
    /// the same to the last bit.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises, or what `each` says.
    pub fn nearest_each<E: From<Error>>(
        &self,
        queries: &[Query],
        found: &mut Neighbours,
        mut each: impl FnMut(usize, &Neighbours) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut shared = std::mem::take(&mut found.shared);
        let mut next = 0;
        while next < queries.len() {
            let cluster = Cluster::of(&queries[next..], found.reach_m);
            let end = next + cluster.queries.len();
            let sharing =
                cluster.queries.len() >= QUERIES_MIN && self.share(&cluster, found, &mut shared)?;
            for (number, query) in (next..end).zip(cluster.queries) {
                if sharing {
                    shared.answer(query, found);
                } else {
                    self.nearest(query, found)?;
                }
                each(number, found)?;
            }
            next = end;
        }
        found.shared = shared;
        Ok(())
    }

    /// Gathers what the queries share; false where they had better go alone.
    fn share(
        &self,
        cluster: &Cluster<'_>,
        found: &mut Neighbours,
        shared: &mut Shared,
    ) -> Result<bool, Error> {
        let Cluster { centre, spread_m, .. } = cluster;
        let (most_m, spread_m) = (centre.max_radius_m, *spread_m);
        let slack = |radius_m: f32| radius_m + SLACK * radius_m + 1e-12;
        // What was near the query before is near this one, but for the step between the two.
        let likely_m = match &found.last {
            Some(last) if last.count == centre.count => {
                slack(last.radius_m + last.point.distance(centre.point))
            }
            _ => f32::INFINITY,
        };
        let walked_m = slack((likely_m + spread_m).min(most_m) + spread_m);
        if !self.within(cluster, walked_m * walked_m, found)? {
            return Ok(false);
        }
        let candidates = &mut found.candidates;
        let used = candidates.used;
        let radius_m = if used < centre.count {
            walked_m
        } else {
            candidates.selected.clear();
            candidates.selected.extend_from_slice(&candidates.distance[..used]);
            let (_, &mut kth, _) = candidates.selected.select_nth_unstable(centre.count - 1);
            f32::from_bits(kth).sqrt()
        };
        let outer_m = slack((radius_m + spread_m).min(most_m) + spread_m);
        // Other normals than before, so that the likely radius wasn't: or a leap in density.
        if outer_m > walked_m || spread_m > 0.5 * radius_m.min(most_m) {
            return Ok(false);
        }
        shared.take(found, outer_m);
        shared.centre = centre.point;
        shared.radius_m = if used < centre.count { f32::INFINITY } else { radius_m };
        Ok(true)
    }

    /// Candidates within a distance of the centre. False for too many, and where the normals of
    /// the queries are on different sides of a photon's.
    fn within(
        &self,
        cluster: &Cluster<'_>,
        distance2: f32,
        found: &mut Neighbours,
    ) -> Result<bool, Error> {
        let Neighbours { candidates, .. } = found;
        candidates.clear();
        let centre = &cluster.centre;
        let limit = centre.count.saturating_mul(CANDIDATES_MAX).saturating_add(1024);
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0u32] };
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number as usize];
            if node_box(node).distance_squared(centre.point) > distance2 {
                continue;
            }
            stack.extend(node.first_child..node.first_child + node.children);
            if node.children > 0 {
                continue;
            }
            for number in node.first_page..node.first_page + node.pages {
                let entry = &self.pages[number as usize];
                if page_box(entry).distance_squared(centre.point) > distance2 {
                    continue;
                }
                let page = self.page(number as usize)?;
                if !cluster.agrees(&page) {
                    return Ok(false);
                }
                candidates.gather(
                    (centre, &ALWAYS),
                    &page,
                    (number, entry.first_photon),
                    distance2,
                );
                if candidates.used > limit {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }
}

impl<'a> Cluster<'a> {
    /// The first of some queries and those that follow it closely; `reach_m`: the radius of the
    /// answer before.
    fn of(queries: &'a [Query], reach_m: f32) -> Self {
        let first = queries[0];
        let mut centre = first;
        let usable = first.count > 0 && first.max_radius_m >= 0.0 && first.point.is_finite();
        let mut bounds = Aabb::around([first.point]);
        let mut length = 1;
        for query in queries.iter().skip(1).take(QUERIES_MAX - 1) {
            let alike = query.normal == first.normal || query.normal.dot(first.normal) >= ALIKE;
            let grown = bounds.union(Aabb::around([query.point]));
            let near = 0.5 * grown.size().length() <= SPREAD * reach_m && reach_m.is_finite();
            let fits = (query.count, query.max_radius_m) == (first.count, first.max_radius_m);
            if !(usable && alike && near && fits && query.point.is_finite()) {
                break;
            }
            bounds = grown;
            length += 1;
        }
        let queries = &queries[..length];
        centre.point = 0.5 * (bounds.min + bounds.max);
        let spread_m = queries.iter().map(|q| q.point.distance(centre.point)).fold(0.0, f32::max);
        Self { queries, centre, spread_m }
    }

    /// Whether all queries take or leave the same photons of a page for their normals.
    fn agrees(&self, page: &Page) -> bool {
        let mut before = self.centre.normal;
        self.queries.iter().all(|query| {
            if query.normal == before {
                return true;
            }
            before = query.normal;
            page.normals.iter().all(|n| {
                (n.dot(query.normal) >= SAME_SIDE) == (n.dot(self.centre.normal) >= SAME_SIDE)
            })
        })
    }
}

impl Shared {
    /// Takes the candidates within `outer_m` over, in store order.
    fn take(&mut self, found: &mut Neighbours, outer_m: f32) {
        let outer = outer_m * outer_m;
        self.places.clear();
        self.photons.clear();
        let candidates = &mut found.candidates;
        for (run, range) in candidates.in_order() {
            let run = &candidates.runs[run];
            for at in range {
                let distance2_m2 = f32::from_bits(candidates.distance[at]);
                if distance2_m2 > outer {
                    continue;
                }
                let lane = self.photons.len() % LANES;
                if lane == 0 {
                    self.places.push([[f32::NAN; LANES]; 3]);
                }
                let place = candidates.place[at];
                if let Some(places) = self.places.last_mut() {
                    for (axis, from) in [&run.page.x, &run.page.y, &run.page.z].iter().enumerate() {
                        places[axis][lane] = from[place as usize];
                    }
                }
                self.photons.push(run.photon(place, distance2_m2));
            }
        }
        candidates.clear();
        self.distance2.resize(self.places.len(), [0.0; LANES]);
        self.counts.resize(self.places.len(), [0; 2]);
    }

    /// The answer to one of the queries.
    fn answer(&mut self, query: &Query, found: &mut Neighbours) {
        let most = query.max_radius_m * query.max_radius_m;
        let bounds = self.likely(query, found.last.as_ref());
        let kth = bounds
            .and_then(|(least, beyond)| self.select(query, (least, beyond.min(most))))
            .or_else(|| self.select(query, (0.0, most)));
        let (far, tie) = kth.unwrap_or_else(|| {
            let kept = self.distance2.as_flattened().iter().copied().filter(|d| *d <= most);
            (kept.fold(0.0, f32::max), usize::MAX)
        });
        self.emit((far, tie), found);
        found.full = found.count == query.count;
        found.reach_m = if found.full { far.sqrt() } else { query.max_radius_m };
        let (point, count, radius_m) = (query.point, query.count, found.reach_m);
        found.last = found.full.then_some(Last { point, count, radius_m });
    }

    /// Square distances between which the k-th photon most likely lies: not nearer or farther than
    /// before by more than the step, nor by more than chance usually has it.
    fn likely(&self, query: &Query, last: Option<&Last>) -> Option<(f32, f32)> {
        let (from, radius_m) = match last {
            Some(last) if last.count == query.count => (last.point, last.radius_m),
            _ if self.radius_m.is_finite() => (self.centre, self.radius_m),
            _ => return None,
        };
        let chance = radius_m * CHANCE / (query.count as f32).sqrt();
        let step = query.point.distance(from).min(chance) + SLACK * radius_m;
        let (least_m, most_m) = ((radius_m - step).max(0.0), radius_m + step);
        Some((least_m * least_m, most_m * most_m))
    }

    /// The k-th distance, and the last place that wins at exactly that distance; `None` where it
    /// isn't within bounds.
    fn select(&mut self, query: &Query, (least, most): (f32, f32)) -> Option<(f32, usize)> {
        let Self { places, distance2, counts, selected, .. } = self;
        pulp::Arch::new()
            .dispatch(|| measure(places, query.point, (least, most), distance2, counts));
        let below: usize = counts.iter().map(|c| usize::from(c[0])).sum();
        let mut kept = 0;
        for (distance2, counts) in distance2.iter().zip(counts.iter()) {
            if counts[0] == counts[1] {
                continue;
            }
            if selected.len() < kept + LANES {
                selected.resize(2 * kept + LANES, 0);
            }
            let room = &mut selected[kept..kept + LANES];
            let mut n = 0;
            for &d in distance2 {
                // For floats that aren't negative the bits are in the same order.
                room[n % LANES] = d.to_bits();
                n += usize::from(d >= least && d <= most);
            }
            kept += n;
        }
        let selected = &mut selected[..kept];
        let wanted = query.count.checked_sub(below).filter(|n| (1..=kept).contains(n))?;
        let (nearer, &mut kth, farther) = selected.select_nth_unstable(wanted - 1);
        let kth_m2 = f32::from_bits(kth);
        if farther.iter().all(|&d| d > kth) {
            return Some((kth_m2, usize::MAX));
        }
        let ties = wanted - nearer.iter().filter(|&&d| d < kth).count();
        let places = distance2.as_flattened().iter().enumerate().filter(|(_, d)| **d == kth_m2);
        Some((kth_m2, places.map(|(at, _)| at).nth(ties - 1)?))
    }

    /// Writes what is nearer than `far`, and up to place `tie` also what is as far.
    fn emit(&self, (far, tie): (f32, usize), found: &mut Neighbours) {
        let items = &mut found.items;
        if let Some(&any) = self.photons.first().filter(|_| items.len() < self.photons.len()) {
            items.resize(self.photons.len(), any);
        }
        let mut kept = 0;
        found.farthest = None;
        let photons = self.photons.chunks(LANES);
        for (number, ((distance2, counts), photons)) in
            self.distance2.iter().zip(&self.counts).zip(photons).enumerate()
        {
            if usize::from(counts[0]) == LANES {
                let items = &mut items[kept..kept + LANES];
                items.copy_from_slice(photons);
                for (item, &d) in items.iter_mut().zip(distance2) {
                    item.distance2_m2 = d;
                }
                kept += LANES;
                continue;
            }
            if counts[1] == 0 {
                continue;
            }
            for (i, (photon, &d)) in photons.iter().zip(distance2).enumerate() {
                let ties = d == far && number * LANES + i <= tie;
                if ties {
                    found.farthest = Some(kept);
                }
                items[kept] = Neighbour { distance2_m2: d, ..*photon };
                kept += usize::from((d < far) | ties);
            }
        }
        found.count = kept;
    }
}

/// Square distances, and of each [`LANES`] how many are less than `least`, and how many at most
/// `most`.
#[inline(always)]
fn measure(
    places: &[[[f32; LANES]; 3]],
    point: Vec3,
    (least, most): (f32, f32),
    distance2: &mut [[f32; LANES]],
    counts: &mut [[u8; 2]],
) {
    for ((places, distance2), counts) in places.iter().zip(distance2).zip(counts) {
        let [x, y, z] = places;
        for i in 0..LANES {
            let (dx, dy, dz) = (x[i] - point.x, y[i] - point.y, z[i] - point.z);
            distance2[i] = dx * dx + dy * dy + dz * dz;
        }
        let (mut below, mut within) = (0u32, 0u32);
        for &d in distance2.iter() {
            // At most 16; an addition that may panic isn't vectorised.
            below = below.wrapping_add(u32::from(d < least));
            within = within.wrapping_add(u32::from(d <= most));
        }
        *counts = [below as u8, within as u8];
    }
}
