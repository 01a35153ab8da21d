//! Neighbouring queries, answered from one set of candidates.
//!
//! Queries that lie within a distance `s` of a centre `c`, whose k-th photon is `r` away, share
//! most of their answers. By the triangle inequality the k-th photon of each lies between `r - s`
//! and `r + s` from it. So the tree is walked once, for all photons within `r + 2 s` of `c`; those
//! within `r - 2 s` belong to every answer, and only the rim between is sorted out query by query.

use super::Error;
use super::page::Page;
use super::query::{Last, Neighbour, Neighbours, Query, SAME_SIDE};
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
/// More candidates than this, times k, wait outside of the answers where density jumps: then each
/// query is better off by itself.
const CANDIDATES_MAX: usize = 8;

/// Candidates in store order, and the scratch of one query.
#[derive(Default)]
pub(super) struct Shared {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    photons: Vec<Neighbour>,
    /// Places of those that aren't in every answer.
    rim: Vec<u32>,
    distance2: Vec<f32>,
    selected: Vec<u32>,
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
        let inner_m = (radius_m - spread_m).min(most_m) - spread_m - SLACK * outer_m;
        shared.take(found, inner_m.max(0.0), outer_m);
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
                candidates.gather(centre, &page, (number, entry.first_photon), distance2);
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
    /// Takes the candidates within `outer_m` over, in store order; those within `inner_m` are in
    /// every answer.
    fn take(&mut self, found: &mut Neighbours, inner_m: f32, outer_m: f32) {
        let (inner, outer) = (inner_m * inner_m, outer_m * outer_m);
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.clear();
        }
        self.photons.clear();
        self.rim.clear();
        let candidates = &mut found.candidates;
        for (run, range) in candidates.in_order() {
            let run = &candidates.runs[run];
            let page = &run.page;
            for at in range {
                let distance2_m2 = f32::from_bits(candidates.distance[at]);
                if distance2_m2 > outer {
                    continue;
                }
                let i = candidates.place[at] as usize;
                if distance2_m2 >= inner {
                    self.rim.push(self.photons.len() as u32);
                }
                self.x.push(page.x[i]);
                self.y.push(page.y[i]);
                self.z.push(page.z[i]);
                self.photons.push(run.photon(candidates.place[at], distance2_m2));
            }
        }
        candidates.clear();
        self.distance2.resize(self.photons.len(), 0.0);
    }

    /// The answer to one of the queries.
    fn answer(&mut self, query: &Query, found: &mut Neighbours) {
        let most = query.max_radius_m * query.max_radius_m;
        let count = self.photons.len();
        let point = query.point;
        let (x, y, z) = (&self.x[..count], &self.y[..count], &self.z[..count]);
        let distance2 = &mut self.distance2[..count];
        for i in 0..count {
            let (dx, dy, dz) = (x[i] - point.x, y[i] - point.y, z[i] - point.z);
            distance2[i] = dx * dx + dy * dy + dz * dz;
        }
        self.selected.resize(self.rim.len(), 0);
        let mut rim = 0;
        for &at in &self.rim {
            let d = distance2[at as usize];
            // For floats that aren't negative the bits are in the same order.
            self.selected[rim] = d.to_bits();
            rim += usize::from(d <= most);
        }
        let sure = count - self.rim.len();
        let wanted = query.count - sure.min(query.count);
        // The k-th distance, and the last place that wins at exactly that distance.
        let (kth, last) = if rim <= wanted || wanted == 0 {
            (most, count)
        } else {
            let selected = &mut self.selected[..rim];
            let (nearer, &mut kth, _) = selected.select_nth_unstable(wanted - 1);
            let nearer = nearer.iter().filter(|&&d| d < kth).count();
            let kth = f32::from_bits(kth);
            let ties = (0..count).filter(|&i| distance2[i] == kth);
            (kth, ties.take(wanted - nearer).last().unwrap_or(count))
        };
        if let Some(&any) = self.photons.first() {
            found.items.resize(count, any);
        }
        let items = &mut found.items[..count];
        let mut kept = 0;
        for (i, (photon, &d)) in self.photons.iter().zip(distance2.iter()).enumerate() {
            items[kept] = Neighbour { distance2_m2: d, ..*photon };
            kept += usize::from(d < kth || d == kth && i <= last);
        }
        found.items.truncate(kept);
        found.full = kept == query.count;
        let far = found.items.iter().map(|n| n.distance2_m2).fold(0.0, f32::max);
        found.farthest = found.items.iter().rposition(|n| n.distance2_m2 == far);
        found.last = found.full.then(|| Last { point, count: query.count, radius_m: far.sqrt() });
        found.reach_m = if found.full { far.sqrt() } else { query.max_radius_m };
    }
}
