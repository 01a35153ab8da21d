//! The k nearest photons of a query point, exactly.
//!
//! The problem: a density estimate asks for the k nearest of some 10^8 photons that lie on the same
//! side, at each of 10^6 pixels, and its answer must depend on the photons alone: not on the cache, nor on
//! the order of queries, nor on what a search happened to meet first.
//!
//! The idea: branch and bound on the octree's boxes, nearest child first, within a bound that shrinks.
//! Pages within the bound give [`Candidates`], a block of 128 at a time, all distances of a block at
//! once. When there are twice as many as asked for, the k-th distance is selected and becomes the
//! bound. Neighbouring queries have similar answers, so a search begins with the distance that the one
//! before needed, and is repeated with a larger one where that was too small: the answer is exact
//! either way. Of photons at the same distance the lowest index wins, so that the answer is one.
//!
//! What lost: a heap of the k best, as most photon maps have it (Jensen 2001, "Realistic Image
//! Synthesis Using Photon Mapping", section 6.3): it sifts at every photon that comes nearer, a branch
//! that is never predicted, where a selection of the k-th of 2k is linear. And one search for several neighbouring
//! points inside of the store: sharing is done where points are known (`render/gather/share`).

use glam::Vec3;

use super::Error;
use super::candidates::{Bound, Candidates, PageOf};
use super::query::{Neighbour, Query};
use super::store::Store;
use super::tree::{node_box, page_box};

/// The answer to a query, and the scratch of the search: keep it from query to query.
#[derive(Default)]
pub struct Neighbours {
    items: Vec<Neighbour>,
    farthest: Option<usize>,
    full: bool,
    candidates: Candidates,
    stack: Vec<Open>,
    last: Option<Last>,
}

/// A node that wasn't looked into, and the square of its distance, m2.
struct Open {
    near: f32,
    node: u32,
}

/// The query before, which tells where to begin.
struct Last {
    point: Vec3,
    count: usize,
    radius_m: f32,
}

impl Neighbours {
    /// The photons that were found, by ascending store index.
    pub fn items(&self) -> &[Neighbour] {
        &self.items
    }

    /// Position in [`items`](Self::items) of the farthest; of several, the one of the highest
    /// index.
    pub fn farthest(&self) -> Option<usize> {
        self.farthest
    }

    /// Whether as many as asked for were found within the radius.
    pub fn full(&self) -> bool {
        self.full
    }
}

impl Store {
    /// Finds the `query.count` nearest photons on the same side within `query.max_radius_m`; of
    /// several at the same distance those of the lowest index.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn nearest(&self, query: &Query, found: &mut Neighbours) -> Result<(), Error> {
        found.items.clear();
        found.farthest = None;
        found.full = false;
        let radius_m = query.max_radius_m;
        let usable = query.count > 0 && radius_m >= 0.0 && query.point.is_finite();
        if !usable || self.nodes.is_empty() {
            found.last = None;
            return Ok(());
        }
        let most = radius_m * radius_m;
        let (mut distance2, likely2) = match &found.last {
            Some(last) => {
                // All that were near then are near now, but for the step between the points.
                let share = (query.count as f32 / last.count as f32).max(1.0).sqrt();
                let step = last.point.distance(query.point);
                let guess = (last.radius_m * share + step) * 1.0001;
                let less = last.radius_m - step.min(last.radius_m / (last.count as f32).sqrt());
                (most.min(guess * guess), (0.9999 * less * less).max(0.0))
            }
            None => (most, 0.0),
        };
        loop {
            self.search(query, Bound { distance2, index: u64::MAX }, found)?;
            if found.candidates.used >= query.count || distance2 >= most {
                break;
            }
            // Too small a guess: at least a millimetre, so that it grows.
            distance2 = most.min((distance2 * 4.0).max(1e-6));
        }
        found.candidates.keep(query.count, likely2);
        found.collect();
        found.full = found.items.len() == query.count;
        found.last = match found.farthest {
            Some(at) if found.full => Some(Last {
                point: query.point,
                count: query.count,
                radius_m: found.items[at].distance2_m2.sqrt(),
            }),
            _ => None,
        };
        Ok(())
    }

    fn search(&self, query: &Query, start: Bound, found: &mut Neighbours) -> Result<(), Error> {
        let Neighbours { candidates, stack, .. } = found;
        candidates.clear();
        let limit = query.count.saturating_mul(2).max(query.count.saturating_add(1024));
        let mut bound = start;
        stack.clear();
        let near = node_box(&self.nodes[0]).distance_squared(query.point);
        stack.push(Open { near, node: 0 });
        while let Some(Open { near, node }) = stack.pop() {
            if near > bound.distance2 {
                continue;
            }
            let node = &self.nodes[node as usize];
            if node.children > 0 {
                let before = stack.len();
                for child in node.first_child..node.first_child + node.children {
                    let near = node_box(&self.nodes[child as usize]).distance_squared(query.point);
                    if near <= bound.distance2 {
                        stack.push(Open { near, node: child });
                    }
                }
                // Nearest last, so that it comes first; of several the lowest index first.
                stack[before..].sort_unstable_by(|a, b| {
                    b.near.total_cmp(&a.near).then_with(|| b.node.cmp(&a.node))
                });
                continue;
            }
            for number in node.first_page..node.first_page + node.pages {
                let entry = &self.pages[number as usize];
                let near = page_box(entry).distance_squared(query.point);
                let too_far = near > bound.distance2
                    || near == bound.distance2 && entry.first_photon > bound.index;
                if too_far {
                    continue;
                }
                let page = self.page(number as usize)?;
                let place = PageOf { number, first_photon: entry.first_photon, page };
                candidates.gather(query, place, bound.distance2);
                if candidates.used > limit {
                    bound = candidates.keep(query.count, 0.0);
                }
            }
        }
        Ok(())
    }
}

impl Neighbours {
    /// Candidates to items.
    fn collect(&mut self) {
        let Candidates { runs, distance, place, .. } = &self.candidates;
        let mut far = 0;
        for (r, range) in self.candidates.in_order() {
            for at in range {
                if distance[at] >= far {
                    far = distance[at];
                    self.farthest = Some(self.items.len());
                }
                self.items.push(runs[r].photon(place[at], f32::from_bits(distance[at])));
            }
        }
        // The pages themselves belong to the cache again.
        self.candidates.clear();
    }
}
