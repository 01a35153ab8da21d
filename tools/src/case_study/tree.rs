//! Trees as closed shapes: a displaced icosphere on a trunk, or stacked cones.

use glam::{DVec2, DVec3};

use super::shape::{Face, Model, Stand, chance, prism};
use super::site_plan::{Kind, Planting, TREES};
use super::terrain;

/// All trees.
pub(super) fn model() -> Model {
    let mut model = Model::default();
    for (number, planting) in TREES.iter().enumerate() {
        let at = DVec2::from_array(planting.at);
        let foot = at.extend(terrain::height_m(at));
        grow(&mut model, &format!("tree_{:02}", number + 1), number as u64, foot, planting);
    }
    // The one in the courtyard.
    let small = Planting { at: [6.0, 0.5], height_m: 5.5, kind: Kind::Broadleaf };
    grow(&mut model, "tree_courtyard", 1000, DVec3::new(6.0, 0.5, 0.0), &small);
    model
}

fn grow(model: &mut Model, name: &str, number: u64, foot: DVec3, planting: &Planting) {
    let stand = Stand { at: foot, turn_deg: 360.0 * chance(number, 1) };
    let height = planting.height_m;
    match planting.kind {
        Kind::Broadleaf | Kind::Spreading => {
            let half = height * 0.385;
            let middle = foot + DVec3::Z * (height - half);
            let across = half * (0.86 + 0.16 * chance(number, 2));
            trunk(model, name, &stand, 0.024 * height, height - half);
            model.add(name, crown(middle, DVec3::new(across, across, half), number));
            if planting.kind == Kind::Spreading {
                for lobe in 0..2_u64 {
                    let angle = std::f64::consts::PI * (lobe as f64 + 0.8 * chance(number, 5));
                    let aside = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0) * across * 0.55;
                    let up = DVec3::Z * half * (0.35 - 0.6 * lobe as f64);
                    let size = DVec3::splat(across * 0.68);
                    model.add(name, crown(middle + aside + up, size, number + 2000 * (lobe + 1)));
                }
            }
        }
        Kind::Conifer => {
            trunk(model, name, &stand, 0.018 * height, height * 0.3);
            let wide = height * (0.20 + 0.03 * chance(number, 3));
            for (tier, (from, to)) in [(0.12, 0.58), (0.36, 0.80), (0.60, 1.0)].iter().enumerate() {
                let radius = wide * (1.0 - 0.28 * tier as f64);
                model.add(name, tier_of(&stand, radius, height * from, height * to));
            }
        }
    }
}

fn ring(radius: f64, corners: u32) -> Vec<DVec2> {
    (0..corners)
        .map(|i| {
            let angle = f64::from(i) * std::f64::consts::TAU / f64::from(corners);
            DVec2::new(libm::cos(angle), libm::sin(angle)) * radius
        })
        .collect()
}

/// From below the ground into the crown.
fn trunk(model: &mut Model, name: &str, stand: &Stand, radius: f64, top: f64) {
    model.add(name, prism(stand, "bark", &ring(radius, 5), |_| -1.5, |_| top));
}

fn tier_of(stand: &Stand, radius: f64, from: f64, to: f64) -> Vec<Face> {
    let base: Vec<DVec3> = ring(radius, 8).iter().map(|p| stand.world(p.extend(from))).collect();
    let tip = stand.world(DVec3::Z * to);
    let mut faces: Vec<Face> = (0..base.len())
        .map(|i| vec![base[i], base[(i + 1) % base.len()], tip])
        .map(|points| Face { modifier: "foliage", points })
        .collect();
    faces.push(Face { modifier: "foliage", points: base.into_iter().rev().collect() });
    faces
}

/// An icosahedron, each face cut in four, on an ellipsoid with bumps.
fn crown(middle: DVec3, half: DVec3, number: u64) -> Vec<Face> {
    let long = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut corners: Vec<DVec3> = Vec::with_capacity(42);
    for s in [-1.0, 1.0] {
        for t in [-long, long] {
            corners.push(DVec3::new(s, t, 0.0));
            corners.push(DVec3::new(0.0, s, t));
            corners.push(DVec3::new(t, 0.0, s));
        }
    }
    for corner in &mut corners {
        *corner = corner.normalize();
    }
    // Neighbours of an icosahedron of radius 1 are 1.0515 apart.
    let near = |a: DVec3, b: DVec3| (a - b).length() < 1.2;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [corners[i], corners[j], corners[k]];
                if near(a, b) && near(b, c) && near(c, a) {
                    let out = (b - a).cross(c - a).dot(a) > 0.0;
                    triangles.push(if out { [i, j, k] } else { [i, k, j] });
                }
            }
        }
    }
    let mut halves: Vec<((usize, usize), usize)> = Vec::new();
    let mut faces = Vec::with_capacity(80);
    for [i, j, k] in triangles {
        let mut between = |a: usize, b: usize| {
            let key = (a.min(b), a.max(b));
            if let Some((_, found)) = halves.iter().find(|(edge, _)| *edge == key) {
                return *found;
            }
            corners.push(((corners[a] + corners[b]) / 2.0).normalize());
            halves.push((key, corners.len() - 1));
            corners.len() - 1
        };
        let (ij, jk, ki) = (between(i, j), between(j, k), between(k, i));
        faces.extend([[i, ij, ki], [ij, j, jk], [ki, jk, k], [ij, jk, ki]]);
    }
    let turn = Stand { at: middle, turn_deg: 360.0 * chance(number, 4) };
    let placed: Vec<DVec3> = corners
        .iter()
        .enumerate()
        .map(|(i, corner)| {
            let bump = 0.84 + 0.30 * chance(number, 100 + i as u64);
            // Crowns are flatter below than above.
            let shape = if corner.z < 0.0 { DVec3::new(1.0, 1.0, 0.85) } else { DVec3::ONE };
            turn.world(*corner * half * shape * bump)
        })
        .collect();
    faces
        .into_iter()
        .map(|face| Face { modifier: "foliage", points: face.map(|i| placed[i]).to_vec() })
        .collect()
}
