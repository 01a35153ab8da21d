//! The candidates of neighbouring pixels, and the k nearest among them.
//!
//! Pixels that lie close together have nearly the same photons. They are listed once, in lanes;
//! each pixel measures all of them, sorts out the k-th among the few that lie about as far as the
//! k-th of the pixel before, and says which photons came and went since. Sums are of integers, so
//! adding and taking away leaves what a sum of its own would give.

use glam::Vec3;

use super::estimator::Estimator;
use super::photon_set::{Light, PhotonSet};

/// Candidates that are looked at together.
const LANES: usize = 16;
/// More than rounding moves a distance, relative.
const SLACK: f32 = 1e-4;
/// Standard deviations by which the k-th distance may differ from the one before, before it has to
/// be looked for everywhere.
const CHANCE: f32 = 2.5;
/// What the bits of lanes are worth.
const BIT: [u32; LANES] = {
    let mut bit = [0; LANES];
    let mut i = 0;
    while i < LANES {
        bit[i] = 1 << i;
        i += 1;
    }
    bit
};

/// What bounds a pixel's photons: all that are nearer, and those at exactly this distance whose
/// index is below the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Bound {
    pub distance2_m2: f32,
    pub index: u64,
    /// Whether the k-th photon sets it; if not, the largest radius does.
    pub full: bool,
}

impl Bound {
    /// How far the photons reach that it bounds, a little more than less, m.
    pub fn reach_m(&self) -> f32 {
        self.distance2_m2.sqrt() * (1.0 + SLACK)
    }
}

/// How far away the k-th photon lay from the point before.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Last {
    pub point: Vec3,
    pub radius_m: f32,
}

/// What to look for around a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Wanted {
    pub count: usize,
    pub estimator: Estimator,
    /// How far photons were loaded for it, m.
    pub reach_m: f32,
    /// Whether there are none beyond that count.
    pub last_word: bool,
}

/// The answer to [`Wanted`].
pub(in crate::render) enum Answer {
    /// What bounds the photons.
    Bound(Bound),
    /// The k-th lies farther than the list goes.
    ListMore,
    /// The k-th lies farther than photons were loaded.
    LoadMore,
}

/// How the photons of a pixel differ from those of the one before.
pub(in crate::render) enum Change<'a> {
    /// From the one before nothing is left: sums begin at 0.
    Anew,
    /// A photon that came, and the weight that the kernel gives it.
    In(&'a Light, f64),
    /// A photon that went.
    Out(&'a Light),
}

/// The list of candidates.
#[derive(Debug, Default)]
pub(in crate::render) struct Candidates {
    /// Coordinates, filled up to whole lanes with NaN, which is near nothing.
    places: Vec<[[f32; LANES]; 3]>,
    /// Which of the loaded they are, ascending.
    who: Vec<u32>,
    distance2: Vec<[f32; LANES]>,
    /// Of each of `distance2`: how many surely win, how many may.
    counts: Vec<[u8; 2]>,
    selected: Vec<u64>,
    /// Lanes in which a photon lies exactly at the bound.
    ties: Vec<u32>,
    /// Those inside of the disc of the pixel at work, and of the one before: one bit each.
    inside: Vec<u16>,
    before: Vec<u16>,
    anew: bool,
    centre: Vec3,
    radius_m: f32,
}

impl Candidates {
    /// Lists the photons within `radius_m` of a point.
    pub fn list(
        &mut self,
        loaded: &PhotonSet,
        centre: Vec3,
        radius_m: f32,
        accept: Option<&impl Fn(Vec3, Vec3) -> bool>,
    ) {
        (self.centre, self.radius_m) = (centre, radius_m);
        let wide = radius_m * (1.0 + 2.0 * SLACK) + 1e-6;
        loaded.within(centre, wide * wide, accept, &mut self.who);
        let lanes = self.who.len().div_ceil(LANES);
        self.places.clear();
        self.places.resize(lanes, [[f32::NAN; LANES]; 3]);
        for (who, places) in self.who.chunks(LANES).zip(&mut self.places) {
            for (lane, &i) in who.iter().enumerate() {
                let place = loaded.position(i as usize);
                [places[0][lane], places[1][lane], places[2][lane]] = place.to_array();
            }
        }
        self.distance2.resize(lanes, [0.0; LANES]);
        self.counts.resize(lanes, [0; 2]);
        self.inside.resize(lanes, 0);
        self.before.clear();
        self.before.resize(lanes, 0);
        self.anew = true;
    }

    /// Takes all that was loaded, at square distances that are known.
    pub fn found(&mut self, distances: impl ExactSizeIterator<Item = f32>) {
        let count = distances.len();
        let lanes = count.div_ceil(LANES);
        self.who.clear();
        self.who.extend(0..count as u32);
        self.distance2.clear();
        self.distance2.resize(lanes, [f32::NAN; LANES]);
        for (at, d) in distances.enumerate() {
            self.distance2[at / LANES][at % LANES] = d;
        }
        self.places.clear();
        self.inside.resize(lanes, 0);
        self.before.clear();
        self.before.resize(lanes, 0);
        self.anew = true;
    }

    /// Finds what bounds the k nearest photons of `point`, exactly.
    pub fn bound(
        &mut self,
        loaded: &PhotonSet,
        point: Vec3,
        wanted: &Wanted,
        last: Option<Last>,
    ) -> Answer {
        // All photons this near to the point are listed.
        let sure_m = self.radius_m - self.centre.distance(point);
        let all = sure_m >= wanted.reach_m;
        let most_m = sure_m.min(wanted.reach_m).max(0.0);
        let most = most_m * most_m;
        let likely = last.map(|last| {
            let step_m = last.point.distance(point);
            // Photons that come and go in two discs this far apart are a chance in
            // 4 step k / (pi r); each moves the k-th by r / 2k.
            let share = step_m / (std::f32::consts::PI * last.radius_m * wanted.count as f32);
            let chance_m = CHANCE * last.radius_m * share.sqrt();
            let step_m = step_m.min(chance_m) + SLACK * last.radius_m;
            let (least, most_m) = ((last.radius_m - step_m).max(0.0), last.radius_m + step_m);
            (least * least, most.min(most_m * most_m))
        });
        let kth = likely
            .filter(|(least, most)| least <= most)
            .and_then(|bounds| self.select(loaded, point, wanted.count, bounds))
            .or_else(|| self.select(loaded, point, wanted.count, (0.0, most)));
        match kth {
            Some((distance2_m2, index)) => {
                let index = index + wanted.estimator.keeps_last();
                Answer::Bound(Bound { distance2_m2, index, full: true })
            }
            None if !all => Answer::ListMore,
            None if wanted.last_word => {
                Answer::Bound(Bound { distance2_m2: most, index: u64::MAX, full: false })
            }
            None => Answer::LoadMore,
        }
    }

    /// Whether all photons within a bound are listed.
    pub fn holds(&self, point: Vec3, bound: Bound) -> bool {
        bound.distance2_m2.sqrt() <= self.radius_m - self.centre.distance(point)
    }

    /// Measures how far the listed photons are from a point.
    pub fn look(&mut self, point: Vec3) {
        let Self { places, distance2, counts, .. } = self;
        pulp::Arch::new().dispatch(|| measure(places, point, (0.0, 0.0), distance2, counts));
    }

    /// The k-th distance, and the store index of the k-th photon: of several at that distance
    /// those of the lowest index count. `None` where it isn't within bounds.
    fn select(
        &mut self,
        loaded: &PhotonSet,
        point: Vec3,
        count: usize,
        (least, most): (f32, f32),
    ) -> Option<(f32, u64)> {
        let Self { places, distance2, counts, selected, .. } = self;
        pulp::Arch::new().dispatch(|| measure(places, point, (least, most), distance2, counts));
        let below: usize = counts.iter().map(|c| usize::from(c[0])).sum();
        let within: usize = counts.iter().map(|c| usize::from(c[1])).sum();
        let wanted = count.checked_sub(below).filter(|n| (1..=within - below).contains(n))?;
        let mut kept = 0;
        for (group, (distance2, counts)) in distance2.iter().zip(counts.iter()).enumerate() {
            if counts[0] == counts[1] {
                continue;
            }
            if selected.len() < kept + LANES {
                selected.resize(2 * kept + LANES, 0);
            }
            let room = &mut selected[kept..kept + LANES];
            let mut n = 0;
            for (lane, &d) in distance2.iter().enumerate() {
                // For floats that aren't negative the bits are in the same order; of several at
                // one distance the first in the list, which is the store's order, comes first.
                let at = (group * LANES + lane) as u64;
                room[n % LANES] = u64::from(d.to_bits()) << 32 | at;
                n += usize::from(d >= least && d <= most);
            }
            kept += n;
        }
        let (_, &mut kth, _) = selected[..kept].select_nth_unstable(wanted - 1);
        let index = loaded.light(self.who[kth as u32 as usize]).index;
        Some((f32::from_bits((kth >> 32) as u32), index))
    }

    /// Calls `each` with what changed since the pixel before. Distances are those that were
    /// measured last.
    pub fn changes(&mut self, loaded: &PhotonSet, bound: Bound, mut each: impl FnMut(Change<'_>)) {
        self.sort_out(loaded, bound);
        if std::mem::take(&mut self.anew) {
            each(Change::Anew);
        }
        let lanes = self.inside.iter().zip(&self.before).zip(self.who.chunks(LANES));
        for ((&inside, &before), who) in lanes {
            let mut changed = inside ^ before;
            while changed != 0 {
                let lane = changed.trailing_zeros();
                changed &= changed - 1;
                let light = loaded.light(who[lane as usize]);
                if inside >> lane & 1 == 1 {
                    each(Change::In(light, 1.0));
                } else {
                    each(Change::Out(light));
                }
            }
        }
        std::mem::swap(&mut self.inside, &mut self.before);
    }

    /// Calls `each` for all photons within the bound, with the square of their distance.
    pub fn all(&mut self, loaded: &PhotonSet, bound: Bound, mut each: impl FnMut(&Light, f32)) {
        self.sort_out(loaded, bound);
        let lanes = self.inside.iter().zip(&self.distance2).zip(self.who.chunks(LANES));
        for ((&inside, distance2), who) in lanes {
            let mut left = inside;
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                each(loaded.light(who[lane]), distance2[lane]);
            }
        }
    }

    /// Finds those within a bound.
    fn sort_out(&mut self, loaded: &PhotonSet, bound: Bound) {
        let Self { distance2, inside, who, ties, .. } = self;
        ties.clear();
        pulp::Arch::new().dispatch(|| nearer(distance2, bound.distance2_m2, inside, ties));
        for &group in &self.ties {
            let from = group as usize * LANES;
            for (lane, &i) in who[from..].iter().take(LANES).enumerate() {
                let tie = distance2[group as usize][lane] == bound.distance2_m2;
                let wins = tie && loaded.light(i).index < bound.index;
                inside[group as usize] |= u16::from(wins) << lane;
            }
        }
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
            // As in the store's own search, operation by operation.
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

/// One bit for each square distance below `bound`; in which lanes any is equal to it.
#[inline(always)]
fn nearer(distance2: &[[f32; LANES]], bound: f32, inside: &mut [u16], ties: &mut Vec<u32>) {
    for (group, (distance2, inside)) in distance2.iter().zip(inside).enumerate() {
        let (mut bits, mut equal) = (0u32, 0u32);
        for i in 0..LANES {
            bits = bits.wrapping_add(if distance2[i] < bound { BIT[i] } else { 0 });
            equal |= u32::from(distance2[i] == bound);
        }
        *inside = bits as u16;
        if equal != 0 {
            ties.push(group as u32);
        }
    }
}
