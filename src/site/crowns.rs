//! Trees that let light through in some months.
//!
//! A crown is modelled as a hull or as some thousand leaves; neither says how much light passes.
//! The user states a transmittance by month for a whole crown, so a ray is weakened once for each
//! crown that it meets, however often it meets its surfaces. That needs all hits along a ray, which
//! the hierarchy doesn't give: leaves have a hierarchy of their own, and a ray is followed through
//! it from hit to hit. Everything opaque has another one, so that scenes without crowns pay
//! nothing.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Bvh, RayHit, Site, Triangle};

/// A material of crowns and how much light a whole crown of it lets through.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Season {
    /// Name of the material (Radiance's modifier).
    pub modifier: String,
    /// Share of the light that passes a crown, for each month from January.
    pub transmittance: [f64; 12],
}

/// Crowns that let light through by season. A crown is what objects of one name have of a season's
/// material: a ray that meets any of its surfaces is weakened once, however many it meets. Trunks,
/// and all that isn't named, are opaque. Rays start and end off surfaces by more than 0.1 mm.
#[derive(Debug)]
pub struct Crowns {
    /// All that is opaque.
    solid: Bvh,
    /// Numbers in the scene of its triangles.
    solid_triangles: Vec<u32>,
    leaves: Bvh,
    leaf_triangles: Vec<u32>,
    /// By triangle of the leaves.
    crown_of: Vec<u32>,
    /// By crown.
    transmittance: Vec<[f32; 12]>,
}

/// How far behind a leaf the next one is looked for, m.
const NEXT_M: f32 = 2e-4;
/// Leaves that a ray is followed through.
const MOST_LEAVES: usize = 10_000;

/// What a ray meets first of a crown.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Crossing {
    crown: u32,
    hit: RayHit,
}

impl Crowns {
    /// The crowns of a scene; `None` where no material is named that it has.
    pub fn of(site: &Site, seasons: &[Season]) -> Option<Self> {
        let mut crowns: BTreeMap<(&str, u32, usize), u32> = BTreeMap::new();
        let mut transmittance = Vec::new();
        let (mut solid, mut solid_triangles) = (Vec::<Triangle>::new(), Vec::new());
        let (mut leaves, mut leaf_triangles, mut crown_of) = (Vec::new(), Vec::new(), Vec::new());
        for (number, triangle) in (0..).zip(&site.triangles) {
            let face = &site.faces[triangle.face as usize];
            let name = &site.materials[face.material as usize].name;
            let season = seasons.iter().position(|s| s.modifier == *name && face.pv.is_none());
            let Some(season) = season else {
                solid.push(*triangle);
                solid_triangles.push(number);
                continue;
            };
            // Radiance's files have an object for each polygon: those of one name are one.
            let id = site.objects[face.object as usize].id.as_str();
            let unnamed = if id.is_empty() { face.object } else { 0 };
            let crown = *crowns.entry((id, unnamed, season)).or_insert_with(|| {
                transmittance.push(seasons[season].transmittance.map(|t| t as f32));
                transmittance.len() as u32 - 1
            });
            leaves.push(*triangle);
            leaf_triangles.push(number);
            crown_of.push(crown);
        }
        (!leaves.is_empty()).then(|| Self {
            solid: Bvh::build(&solid),
            solid_triangles,
            leaves: Bvh::build(&leaves),
            leaf_triangles,
            crown_of,
            transmittance,
        })
    }

    /// How many crowns there are.
    pub fn count(&self) -> usize {
        self.transmittance.len()
    }

    /// Share of the light that passes from `origin` along `direction` as far as `max_m`, in a month
    /// from 0 (January).
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, max_m: f32, month: usize) -> f32 {
        if self.solid.occluded(origin, direction, 0.0, max_m) {
            return 0.0;
        }
        let mut share = 1.0;
        self.each(origin, direction, max_m, |crossing| {
            share *= self.share(crossing.crown, month);
            share > 0.0
        });
        share
    }

    /// Where one of many photons that fly this way ends: at a crown with the share of the light
    /// that the crown keeps, else at what is opaque. `draw` gives uniform numbers, only for crowns
    /// that are neither open nor opaque.
    pub fn closest(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_m: f32,
        month: usize,
        mut draw: impl FnMut() -> f64,
    ) -> Option<RayHit> {
        let solid = self.solid.closest(origin, direction, 0.0, max_m);
        let mut found = solid
            .map(|hit| RayHit { triangle: self.solid_triangles[hit.triangle as usize], ..hit });
        let reach = solid.map_or(max_m, |hit| hit.distance_m);
        self.each(origin, direction, reach, |crossing| {
            let share = self.share(crossing.crown, month);
            let passes = share >= 1.0 || (share > 0.0 && draw() < f64::from(share));
            if !passes {
                let triangle = self.leaf_triangles[crossing.hit.triangle as usize];
                found = Some(RayHit { triangle, ..crossing.hit });
            }
            passes
        });
        found
    }

    /// Whether one of many photons passes this way; see [`Self::closest`].
    pub fn passes(
        &self,
        origin: Vec3,
        direction: Vec3,
        month: usize,
        draw: impl FnMut() -> f64,
    ) -> bool {
        self.closest(origin, direction, f32::INFINITY, month, draw).is_none()
    }

    /// For each month the first one in which all crowns let as much through.
    pub fn alike(&self) -> [usize; 12] {
        std::array::from_fn(|month| {
            let same = |first: &usize| self.transmittance.iter().all(|t| t[*first] == t[month]);
            (0..month).find(same).unwrap_or(month)
        })
    }

    /// What a ray meets before it ends at `solid`, or at `max_m`: the first leaf of each crown, in
    /// order, with the share of the light that passes the crown. The last is what is opaque.
    pub fn along(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_m: f32,
        month: usize,
    ) -> (Vec<(RayHit, f32)>, Option<RayHit>) {
        let solid = self.solid.closest(origin, direction, 0.0, max_m);
        let reach = solid.map_or(max_m, |hit| hit.distance_m);
        let mut leaves = Vec::new();
        self.each(origin, direction, reach, |crossing| {
            let triangle = self.leaf_triangles[crossing.hit.triangle as usize];
            let share = self.share(crossing.crown, month);
            leaves.push((RayHit { triangle, ..crossing.hit }, share));
            share > 0.0
        });
        let end = solid
            .map(|hit| RayHit { triangle: self.solid_triangles[hit.triangle as usize], ..hit });
        (leaves, end)
    }

    fn share(&self, crown: u32, month: usize) -> f32 {
        self.transmittance[crown as usize][month % 12]
    }

    /// Calls `each` with what the ray meets first of each crown, in order, as long as it says so.
    fn each(
        &self,
        origin: Vec3,
        direction: Vec3,
        max_m: f32,
        mut each: impl FnMut(Crossing) -> bool,
    ) {
        let mut met: Vec<u32> = Vec::new();
        let mut from = 0.0;
        for _ in 0..MOST_LEAVES {
            let Some(hit) = self.leaves.closest(origin, direction, from, max_m) else { return };
            let crown = self.crown_of[hit.triangle as usize];
            if !met.contains(&crown) {
                met.push(crown);
                if !each(Crossing { crown, hit }) {
                    return;
                }
            }
            from = hit.distance_m + NEXT_M.max(hit.distance_m * 1e-6);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::{Face, Material, Object};
    use glam::DVec3;

    /// Two trees of two leaves each behind one another on the x axis, a wall behind them, a trunk
    /// beside.
    fn site() -> Site {
        let quad = |x: f32, low: f32, high: f32, face: u32| {
            let at = |y: f32, z: f32| Vec3::new(x, y, z);
            let [a, b, c, d] = [at(low, low), at(high, low), at(high, high), at(low, high)];
            [Triangle { corners: [a, b, c], face }, Triangle { corners: [a, c, d], face }]
        };
        let triangles = [
            quad(1.0, -1.0, 1.0, 0),
            quad(2.0, -1.0, 1.0, 4),
            quad(3.0, -1.0, 1.0, 1),
            quad(4.0, -1.0, 1.0, 1),
            quad(9.0, -5.0, 5.0, 2),
            quad(2.5, 2.0, 3.0, 3),
        ]
        .concat();
        let face = |object, material| Face { object, material, pv: None };
        let object = |id: &str| Object { id: id.into(), kind: String::new() };
        let material =
            |name: &str| Material { name: name.into(), reflectance: [0.2; 3], diffuse: true };
        Site::from_parts(
            triangles,
            vec![face(0, 0), face(1, 0), face(2, 1), face(1, 2), face(3, 0)],
            ["oak", "birch", "wall", "oak"].map(object).to_vec(),
            ["leaves", "plaster", "bark"].map(material).to_vec(),
            Vec::new(),
            DVec3::ZERO,
            Vec::new(),
        )
    }

    fn season(january: f64, july: f64) -> Season {
        let mut transmittance = [january; 12];
        transmittance[6] = july;
        Season { modifier: "leaves".into(), transmittance }
    }

    #[test]
    fn each_crown_weakens_once_and_what_is_opaque_ends_the_way() {
        let site = site();
        let crowns = Crowns::of(&site, &[season(0.5, 0.0)]).expect("crowns");
        assert_eq!(crowns.count(), 2);
        let along = |y: f32, max_m: f32, month| {
            crowns.transmittance(Vec3::new(0.0, y, 0.1), Vec3::X, max_m, month)
        };
        assert_eq!(along(0.0, 8.0, 0), 0.25);
        assert_eq!(along(0.0, 2.5, 0), 0.5);
        assert_eq!(along(0.0, 0.5, 0), 1.0);
        assert_eq!(along(0.0, 8.0, 6), 0.0, "leaves in July");
        assert_eq!(along(0.0, 9.5, 0), 0.0, "the wall");
        assert_eq!(along(1.5, 8.0, 0), 1.0, "past the crowns");
        let bark = crowns.transmittance(Vec3::new(0.0, 2.5, 2.5), Vec3::X, 8.0, 0);
        assert_eq!(bark, 0.0);
        // From between the leaves of the first.
        assert_eq!(crowns.transmittance(Vec3::new(1.5, 0.0, 0.1), Vec3::X, 7.0, 0), 0.25);
        assert!(
            Crowns::of(&site, &[Season { modifier: "fir".into(), ..season(1.0, 1.0) }]).is_none()
        );
    }

    #[test]
    fn photons_stop_as_often_as_the_light_is_kept() {
        let site = site();
        let from = Vec3::new(0.0, 0.3, 0.1);
        let crowns = Crowns::of(&site, &[season(0.3, 0.0)]).expect("crowns");
        let mut random = crate::base::Stream::new(1, crate::base::Purpose::Survey, 0);
        let mut counts = [0_u32; 3];
        let n = 20_000;
        for _ in 0..n {
            let hit = crowns.closest(from, Vec3::X, f32::INFINITY, 0, || random.uniform());
            match site.triangles[hit.expect("the wall at last").triangle as usize].face {
                0 | 4 => counts[0] += 1,
                1 => counts[1] += 1,
                _ => counts[2] += 1,
            }
        }
        for (count, share) in counts.into_iter().zip([0.7, 0.21, 0.09]) {
            let expected = f64::from(n) * share;
            let sigma = (expected * (1.0 - share)).sqrt();
            assert!((f64::from(count) - expected).abs() < 4.0 * sigma, "{counts:?}");
        }
        // Opaque or open crowns draw nothing and are what the whole scene is, or the wall.
        let none = || -> f64 { panic!("drawn") };
        let whole = site.bvh.closest(from, Vec3::X, 0.0, f32::INFINITY);
        assert_eq!(crowns.closest(from, Vec3::X, f32::INFINITY, 6, none), whole);
        let open = Crowns::of(&site, &[season(1.0, 1.0)]).expect("crowns");
        let hit = open.closest(from, Vec3::X, f32::INFINITY, 6, none).expect("the wall");
        assert_eq!(site.triangles[hit.triangle as usize].face, 2);
        assert!(!open.passes(from, Vec3::X, 6, none));
    }
}
