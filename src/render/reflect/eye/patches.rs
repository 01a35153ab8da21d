use glam::DVec3;

use crate::render::reflect::facet::{Facet, facets};
use crate::site::Site;

/// Edge of the cells of PV that are asked what they see, m: shadows and hidden parts are known to
/// that.
const CELL_M: f64 = 0.5;
/// Levels that a triangle is halved at most before it is asked: a million cells.
const MOST_LEVELS: u32 = 10;
/// Eyes on surfaces are lifted off them by this much, m.
const LIFT_M: f64 = 2e-3;

/// An eye, or a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where, m from the local origin.
    pub position: DVec3,
    /// Unit vector: where it looks. Nothing behind it is seen.
    pub direction: DVec3,
}

/// A triangle of PV or a part of one: each splits into four of a quarter of the area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub corners: [DVec3; 3],
    /// Halvings since the whole triangle.
    pub level: u32,
    /// Number among the patches of its level; its four parts are `4 index ..`.
    pub index: usize,
}

impl Patch {
    pub(super) fn parts(&self) -> [Self; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
        let triangles = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
        [0, 1, 2, 3].map(|part| Self {
            corners: triangles[part],
            level: self.level + 1,
            index: 4 * self.index + part,
        })
    }

    pub(super) fn middle(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }

    /// Largest distance of a corner from the middle, m.
    pub(super) fn radius_m(&self) -> f64 {
        let middle = self.middle();
        self.corners.iter().fold(0.0, |r: f64, c| r.max(c.distance(middle)))
    }

    /// Solid angle from a place, sr (Van Oosterom and Strackee 1983).
    pub(super) fn solid_angle_sr(&self, from: DVec3) -> f64 {
        let [a, b, c] = self.corners.map(|p| p - from);
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let volume = a.dot(b.cross(c)).abs();
        let across = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
        2.0 * libm::atan2(volume, across).abs()
    }
}

/// A triangle of PV, cut into `4^level` cells.
#[derive(Debug)]
pub(super) struct Root {
    /// Index of the facet.
    pub facet: usize,
    pub whole: Patch,
    pub level: u32,
    /// Its first cell's number among all.
    pub first: usize,
}

impl Root {
    fn cells(&self) -> usize {
        1 << (2 * self.level)
    }

    /// The numbers of the cells that make up a patch, or of the one that it lies in.
    pub(super) fn range(&self, patch: &Patch) -> std::ops::Range<usize> {
        if patch.level <= self.level {
            let shift = 2 * (self.level - patch.level);
            self.first + (patch.index << shift)..self.first + ((patch.index + 1) << shift)
        } else {
            let at = self.first + (patch.index >> (2 * (patch.level - self.level)));
            at..at + 1
        }
    }
}

/// The PV, cut into cells of half a metre.
#[derive(Debug)]
pub struct EyePv<'a> {
    pub(super) site: &'a Site,
    pub(super) facets: Vec<Facet>,
    pub(super) roots: Vec<Root>,
    /// Middle of each cell.
    middles: Vec<DVec3>,
    /// The same in the frame of its facet.
    local_middles: Vec<DVec3>,
}

/// How much of each cell something sees, 0 to 1.
pub type Shares = Vec<f32>;

/// What an eye has in sight.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Whose.
    pub eye: Eye,
    pub(super) shares: Shares,
    /// Of all PV in sight, sr.
    pub solid_angle_sr: f64,
    /// To the nearest cell in sight, m; infinite where there is none.
    pub nearest_m: f64,
}

/// What a sun lights.
#[derive(Clone, Debug)]
pub struct LitPv {
    pub(super) shares: Shares,
}

impl LitPv {
    /// As if nothing stood between PV and sun.
    pub fn open(pv: &EyePv<'_>) -> Self {
        Self { shares: vec![1.0; pv.middles.len()] }
    }
}

impl<'a> EyePv<'a> {
    /// Cuts the PV into cells.
    pub fn new(site: &'a Site) -> Self {
        let facets = facets(site);
        let (mut roots, mut middles) = (Vec::new(), Vec::new());
        let mut local_middles: Vec<DVec3> = Vec::new();
        for (number, facet) in facets.iter().enumerate() {
            for &corners in &facet.triangles {
                let longest =
                    (0..3).map(|i| corners[i].distance(corners[(i + 1) % 3])).fold(0.0, f64::max);
                let mut level = 0;
                while longest / f64::from(1_u32 << level) > CELL_M && level < MOST_LEVELS {
                    level += 1;
                }
                let whole = Patch { corners, level: 0, index: 0 };
                let first = middles.len();
                let mut cells = vec![whole];
                for _ in 0..level {
                    cells = cells.iter().flat_map(Patch::parts).collect();
                }
                middles.extend(cells.iter().map(Patch::middle));
                let local = middles[first..].iter().map(|m| facet.frame.local_from_world(*m));
                local_middles.extend(local);
                roots.push(Root { facet: number, whole, level, first });
            }
        }
        Self { site, facets, roots, middles, local_middles }
    }

    /// Whether crowns let light through in some months, so that what is seen depends on them.
    pub fn has_seasons(&self) -> bool {
        self.site.crowns.is_some()
    }

    /// What an eye sees of the PV in a month from 0 (January).
    pub fn seen(&self, eye: Eye, month: usize) -> Seen {
        let place = eye.position + eye.direction * LIFT_M;
        let mut shares = vec![0.0; self.middles.len()];
        let (mut solid_angle_sr, mut nearest_m) = (0.0, f64::INFINITY);
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            if facet.before_m(place) <= 0.0 {
                continue;
            }
            let mut count = 0.0;
            let cells = root.first..root.first + root.cells();
            for (own, middle) in shares[cells.clone()].iter_mut().zip(&self.middles[cells]) {
                let start = facet.lifted(*middle);
                let way = place - start;
                let length = way.length();
                let behind = eye.direction.dot(way) >= 0.0;
                let end = (length - 0.5 * LIFT_M).max(0.0) as f32;
                let towards = (way / length).as_vec3();
                if behind {
                    continue;
                }
                let share = self.site.transmittance(start.as_vec3(), towards, end, month);
                if share > 0.0 {
                    *own = share;
                    count += f64::from(share);
                    nearest_m = nearest_m.min(length);
                }
            }
            solid_angle_sr += self.in_sight_sr(root, &root.whole, place, &shares, count);
        }
        Seen { eye: Eye { position: place, ..eye }, shares, solid_angle_sr, nearest_m }
    }

    /// Solid angle of the cells in sight of a triangle.
    fn in_sight_sr(
        &self,
        root: &Root,
        patch: &Patch,
        place: DVec3,
        shares: &Shares,
        count: f64,
    ) -> f64 {
        let range = root.range(patch);
        if count <= 0.0 {
            return 0.0;
        }
        if count == range.len() as f64 || patch.level >= root.level {
            return patch.solid_angle_sr(place) * count / range.len() as f64;
        }
        let of = |part: &Patch| shares[root.range(part)].iter().map(|s| f64::from(*s)).sum();
        patch.parts().iter().map(|p| self.in_sight_sr(root, p, place, shares, of(p))).sum()
    }

    /// How near half vectors come to the PV's normal with a sun: the smallest tilt of any cell in
    /// sight, rad (at most that), and the smallest cosine between half vectors and the directions
    /// to the sun.
    pub(super) fn least_tilt(&self, seen: &Seen, sun: DVec3) -> (f64, f64) {
        let (mut tilt, mut cos) = (f64::INFINITY, 1.0_f64);
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            if facet.before_m(seen.eye.position) <= 0.0 {
                continue;
            }
            let to_sun = facet.frame.local_from_world(sun);
            let eye = facet.frame.local_from_world(seen.eye.position);
            let radius_m = root.whole.radius_m() / f64::from(1_u32 << root.level);
            for i in root.first..root.first + root.cells() {
                if seen.shares[i] > 0.0 {
                    let way = eye - self.local_middles[i];
                    let away_m = way.length();
                    let half = to_sun + way / away_m;
                    let length = half.length().max(1e-12);
                    let across = (half.x * half.x + half.y * half.y).sqrt() / length;
                    let spread = 0.5 * radius_m / (away_m * (0.5 * length).max(0.05));
                    tilt = tilt.min(across - spread);
                    cos = cos.min(0.5 * length);
                }
            }
        }
        (tilt, cos)
    }

    /// Whether one of the facets before the eye has one of two suns before it, but not the other.
    pub(super) fn passes_a_plane(&self, seen: &Seen, suns: [DVec3; 2]) -> bool {
        let before = |facet: &&Facet| facet.before_m(seen.eye.position) > 0.0;
        self.facets.iter().filter(before).any(|facet| {
            let [a, b] = suns.map(|sun| facet.frame.z.dot(sun) > 0.0);
            a != b
        })
    }

    /// Which of the cells a sun lights in a month; only those are asked that `seen` has in sight.
    pub fn lit(&self, sun: DVec3, seen: &Seen, month: usize) -> LitPv {
        let mut shares = vec![0.0; self.middles.len()];
        for root in &self.roots {
            let facet = &self.facets[root.facet];
            if facet.frame.z.dot(sun) <= 0.0 {
                continue;
            }
            let cells = root.first..root.first + root.cells();
            let asked = self.middles[cells.clone()].iter().zip(&seen.shares[cells.clone()]);
            for (own, (middle, in_sight)) in shares[cells].iter_mut().zip(asked) {
                if *in_sight > 0.0 {
                    let start = facet.lifted(*middle).as_vec3();
                    *own = self.site.transmittance(start, sun.as_vec3(), f32::INFINITY, month);
                }
            }
        }
        LitPv { shares }
    }
}
