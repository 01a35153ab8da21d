//! The k nearest photons, exactly.
//!
//! The tree is walked nearest child first, within a bound that shrinks. Candidates are gathered a
//! block of 128 at a time; when there are twice as many as asked for, the k-th distance is
//! selected and becomes the bound. Neighbouring queries have similar answers, so a search begins
//! with the distance that the one before needed, and is repeated with a larger one where that was
//! too small: the answer is exact either way.

use std::sync::Arc;

use glam::Vec3;

use super::Error;
use super::page::{BLOCK, Page};
use super::store::Store;
use super::tree::{node_box, page_box};

/// What to look for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// Where, metres.
    pub point: Vec3,
    /// Unit normal of the surface there: only photons whose normal is within 60 degrees of it
    /// count. Zero: any photon counts.
    pub normal: Vec3,
    /// How many photons at most.
    pub count: usize,
    /// How far they may lie at most, metres.
    pub max_radius_m: f32,
}

/// Cosine of the largest angle between the normals of query and photon.
pub(super) const SAME_SIDE: f32 = 0.5;

/// A photon that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour {
    /// Its index in the store.
    pub index: u64,
    /// Square of its distance, m2.
    pub distance2_m2: f32,
    /// Flux, W.
    pub flux_w: f32,
    /// Cosine of incidence: its normal times its direction.
    pub cos: f32,
    /// Index of its timestep.
    pub timestep: u32,
    /// The PV surface that sent it.
    pub surface: u16,
}

/// The answer to a query, and the scratch of the search: keep it from query to query.
#[derive(Default)]
pub struct Neighbours {
    items: Vec<Neighbour>,
    farthest: Option<usize>,
    full: bool,
    candidates: Candidates,
    stack: Vec<(f32, u32)>,
    last: Option<Last>,
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

/// Candidates of a search, page by page in the order in which they were met.
#[derive(Default)]
struct Candidates {
    runs: Vec<Run>,
    /// Squares of distances, as bits: for floats that aren't negative these are in order.
    distance: Vec<u32>,
    /// Number in the page.
    place: Vec<u32>,
    selected: Vec<u32>,
    used: usize,
}

struct Run {
    number: u32,
    first_photon: u64,
    page: Arc<Page>,
    start: usize,
}

/// A distance, and the highest store index that may still win at exactly that distance.
#[derive(Clone, Copy)]
struct Bound {
    distance2: f32,
    index: u64,
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
        let mut distance2 = match &found.last {
            Some(last) => {
                // All that were near then are near now, but for the step between the points.
                let share = (query.count as f32 / last.count as f32).max(1.0).sqrt();
                let guess = (last.radius_m * share + last.point.distance(query.point)) * 1.0001;
                most.min(guess * guess)
            }
            None => most,
        };
        loop {
            self.search(query, Bound { distance2, index: u64::MAX }, found)?;
            if found.candidates.used >= query.count || distance2 >= most {
                break;
            }
            // Too small a guess: at least a millimetre, so that it grows.
            distance2 = most.min((distance2 * 4.0).max(1e-6));
        }
        found.candidates.keep(query.count);
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
        stack.push((node_box(&self.nodes[0]).distance_squared(query.point), 0));
        while let Some((near, number)) = stack.pop() {
            if near > bound.distance2 {
                continue;
            }
            let node = &self.nodes[number as usize];
            if node.children > 0 {
                let before = stack.len();
                for child in node.first_child..node.first_child + node.children {
                    let near = node_box(&self.nodes[child as usize]).distance_squared(query.point);
                    if near <= bound.distance2 {
                        stack.push((near, child));
                    }
                }
                // Nearest last, so that it comes first; of several the lowest index first.
                stack[before..]
                    .sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then_with(|| b.1.cmp(&a.1)));
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
                candidates.gather(query, &page, (number, entry.first_photon), bound.distance2);
                if candidates.used > limit {
                    bound = candidates.keep(query.count);
                }
            }
        }
        Ok(())
    }
}

/// Which normals of a page lie on the query's side.
enum Side {
    All,
    None,
    /// One bit for each of up to 64 normals.
    Some(u64),
    /// Too many to tell beforehand.
    Each,
}

fn side(page: &Page, normal: Vec3) -> Side {
    if normal == Vec3::ZERO {
        return Side::All;
    }
    if page.normals.len() > 64 {
        return Side::Each;
    }
    let mut bits = 0u64;
    for (i, n) in page.normals.iter().enumerate() {
        bits |= u64::from(n.dot(normal) >= SAME_SIDE) << i;
    }
    match bits.count_ones() as usize {
        0 => Side::None,
        n if n == page.normals.len() => Side::All,
        _ => Side::Some(bits),
    }
}

impl Candidates {
    fn clear(&mut self) {
        self.runs.clear();
        self.used = 0;
    }

    /// Adds the photons of a page within `most`.
    fn gather(&mut self, query: &Query, page: &Arc<Page>, (number, first): (u32, u64), most: f32) {
        let side = side(page, query.normal);
        if matches!(side, Side::None) {
            return;
        }
        let start = self.used;
        for (block, bounds) in page.blocks.iter().enumerate() {
            if bounds.distance_squared(query.point) > most {
                continue;
            }
            let base = block * BLOCK;
            let from = self.used;
            self.block(query.point, page, base, most);
            let accept = |i: u32| {
                let normal = usize::from(page.normal[i as usize]);
                match side {
                    Side::Some(bits) => bits >> normal & 1 == 1,
                    _ => page.normals[normal].dot(query.normal) >= SAME_SIDE,
                }
            };
            if matches!(side, Side::Some(_) | Side::Each) {
                let mut kept = from;
                for at in from..self.used {
                    let i = self.place[at];
                    self.place[kept] = i;
                    self.distance[kept] = self.distance[at];
                    kept += usize::from(accept(i));
                }
                self.used = kept;
            }
        }
        if self.used > start {
            let page = Arc::clone(page);
            self.runs.push(Run { number, first_photon: first, page, start });
        }
    }

    /// Adds the photons of a block within `most`, without a branch that depends on them.
    fn block(&mut self, point: Vec3, page: &Page, base: usize, most: f32) {
        if self.distance.len() < self.used + BLOCK {
            let room = (self.used + BLOCK) * 2;
            self.distance.resize(room, 0);
            self.place.resize(room, 0);
        }
        let end = base + BLOCK;
        let (x, y, z) = (&page.x[base..end], &page.y[base..end], &page.z[base..end]);
        let mut near = [0f32; BLOCK];
        for i in 0..BLOCK {
            let (dx, dy, dz) = (x[i] - point.x, y[i] - point.y, z[i] - point.z);
            near[i] = dx * dx + dy * dy + dz * dz;
        }
        let distance = &mut self.distance[self.used..self.used + BLOCK];
        let place = &mut self.place[self.used..self.used + BLOCK];
        let mut kept = 0;
        for (i, &near) in near.iter().enumerate() {
            distance[kept] = near.to_bits();
            place[kept] = (base + i) as u32;
            // The filling up to whole blocks is NaN and fails here.
            kept += usize::from(near <= most);
        }
        self.used += kept;
    }

    /// Keeps the `count` nearest; what lies beyond the bound it returns can't be among them.
    fn keep(&mut self, count: usize) -> Bound {
        if self.used <= count {
            return Bound { distance2: f32::INFINITY, index: u64::MAX };
        }
        self.selected.clear();
        self.selected.extend_from_slice(&self.distance[..self.used]);
        let (_, &mut farthest, _) = self.selected.select_nth_unstable(count - 1);
        let mut nearer = 0;
        let mut ties = 0;
        for &d in &self.distance[..self.used] {
            nearer += usize::from(d < farthest);
            ties += usize::from(d == farthest);
        }
        let highest =
            if nearer + ties == count { u64::MAX } else { self.tie(farthest, count - nearer) };
        let mut kept = 0;
        let mut runs = 0;
        for r in 0..self.runs.len() {
            let end = self.runs.get(r + 1).map_or(self.used, |next| next.start);
            let (start, first) = (self.runs[r].start, self.runs[r].first_photon);
            let new_start = kept;
            for at in start..end {
                let (d, place) = (self.distance[at], self.place[at]);
                self.distance[kept] = d;
                self.place[kept] = place;
                let wins = d < farthest || d == farthest && first + u64::from(place) <= highest;
                kept += usize::from(wins);
            }
            if kept > new_start {
                self.runs.swap(runs, r);
                self.runs[runs].start = new_start;
                runs += 1;
            }
        }
        // Pages of which nothing is left are let go.
        self.runs.truncate(runs);
        self.used = kept;
        let index = if highest == u64::MAX { self.highest_at(farthest) } else { highest };
        Bound { distance2: f32::from_bits(farthest), index }
    }

    /// The `rank`-th lowest store index (from 1) among the candidates at a distance.
    fn tie(&self, distance: u32, rank: usize) -> u64 {
        let mut indices: Vec<u64> = self.at(distance).collect();
        let (_, &mut index, _) = indices.select_nth_unstable(rank - 1);
        index
    }

    fn highest_at(&self, distance: u32) -> u64 {
        self.at(distance).max().unwrap_or(u64::MAX)
    }

    fn at(&self, distance: u32) -> impl Iterator<Item = u64> {
        self.runs.iter().enumerate().flat_map(move |(r, run)| {
            let end = self.runs.get(r + 1).map_or(self.used, |next| next.start);
            (run.start..end)
                .filter(move |&at| self.distance[at] == distance)
                .map(move |at| run.first_photon + u64::from(self.place[at]))
        })
    }
}

impl Neighbours {
    /// Candidates to items: in a page they are in order, so the pages only must be.
    fn collect(&mut self) {
        let Candidates { runs, distance, place, used, .. } = &mut self.candidates;
        let mut ranges: Vec<(u32, usize, usize)> = Vec::with_capacity(runs.len());
        for (r, run) in runs.iter().enumerate() {
            let end = runs.get(r + 1).map_or(*used, |next| next.start);
            ranges.push((run.number, r, end));
        }
        ranges.sort_unstable();
        let mut far = 0;
        for (_, r, end) in ranges {
            let run = &runs[r];
            for at in run.start..end {
                if distance[at] >= far {
                    far = distance[at];
                    self.farthest = Some(self.items.len());
                }
                let light = run.page.light[place[at] as usize];
                self.items.push(Neighbour {
                    index: run.first_photon + u64::from(place[at]),
                    distance2_m2: f32::from_bits(distance[at]),
                    flux_w: light.flux_w,
                    cos: light.cos,
                    timestep: light.timestep,
                    surface: light.surface,
                });
            }
        }
        // The pages themselves belong to the cache again.
        runs.clear();
        *used = 0;
    }
}
