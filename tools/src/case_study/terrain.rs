//! The ground: a rise under the church, a hillside in the west, streets cut into it.

use std::sync::OnceLock;

use glam::{DVec2, DVec3};

use super::shape::{Face, Model, Stand, prism, smooth};
use super::site_plan::{HEDGES, STREET_HALF_WIDTH_M, STREETS};

/// The ground reaches so far from the middle, m.
const REACH_M: f64 = 100.0;
/// Cells along an edge.
const CELLS: u32 = 54;

/// Height of the ground without streets, m; the church's courtyard is 0.
fn natural_m(p: DVec2) -> f64 {
    let hill_start = -29.0 + 3.0 * libm::sin(p.y / 31.0);
    let hill = ((hill_start - p.x) / 71.0).max(0.0);
    let rise = 19.0 * libm::pow(hill, 1.35) * (1.0 + 0.06 * libm::sin(p.y / 23.0 + 1.0));
    let from_church = (p - DVec2::new(2.0, 3.0)) / DVec2::new(34.0, 40.0);
    let knoll = 1.35 * libm::exp(-libm::pow(from_church.length_squared(), 2.0));
    let valley = -0.03 * (p.x - 22.0).max(0.0);
    let swell = 0.35
        * libm::sin(p.x / 17.0 + 0.6)
        * libm::sin(p.y / 21.0 + 2.0)
        * smooth(30.0, 50.0, p.length());
    -2.1 + rise + knoll + valley + swell
}

/// The ground of a street lies this far below what was there, m; its surface lies above that.
const CUT_M: f64 = 0.4;

/// Height of a street's surface at its middle, m.
pub(super) fn street_m(p: DVec2) -> f64 {
    natural_m(p) - CUT_M + 0.25
}

/// The streets as they are built: with rounded bends.
fn rounded() -> &'static [Vec<DVec2>] {
    static ROUNDED: OnceLock<Vec<Vec<DVec2>>> = OnceLock::new();
    ROUNDED.get_or_init(|| {
        STREETS
            .iter()
            .map(|s| dense(&s.iter().map(|&p| DVec2::from_array(p)).collect::<Vec<_>>()))
            .collect()
    })
}

/// Distance to the nearest street's middle and the point on it.
fn nearest_street(p: DVec2) -> (f64, DVec2) {
    let mut best = (f64::INFINITY, p);
    for street in rounded() {
        for pair in street.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            let on = a + (b - a) * t;
            let distance = (p - on).length();
            if distance < best.0 {
                best = (distance, on);
            }
        }
    }
    best
}

/// Height of the ground at any point, m.
fn ground_m(p: DVec2) -> f64 {
    let (distance, on) = nearest_street(p);
    let keep = smooth(STREET_HALF_WIDTH_M + 0.6, STREET_HALF_WIDTH_M + 5.0, distance);
    let street = natural_m(on) - CUT_M;
    street + (natural_m(p) - street) * keep
}

fn grid(i: u32) -> f64 {
    -REACH_M + 2.0 * REACH_M * f64::from(i) / f64::from(CELLS)
}

fn corner(i: u32, j: u32) -> DVec3 {
    let p = DVec2::new(grid(i), grid(j));
    p.extend(ground_m(p))
}

/// The two triangles of a cell; diagonals alternate, so that no direction is favoured.
fn cell(i: u32, j: u32) -> [[DVec3; 3]; 2] {
    let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
    if (i + j).is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Height of the triangles at a point, m: what things stand on.
pub(super) fn height_m(p: DVec2) -> f64 {
    let index = |c: f64| {
        let cell = ((c + REACH_M) / (2.0 * REACH_M) * f64::from(CELLS)).floor();
        (cell.max(0.0) as u32).min(CELLS - 1)
    };
    for [a, b, c] in cell(index(p.x), index(p.y)) {
        let flat = |v: DVec3| v.truncate();
        let area = (flat(b) - flat(a)).perp_dot(flat(c) - flat(a));
        let u = (flat(c) - flat(b)).perp_dot(p - flat(b)) / area;
        let v = (flat(a) - flat(c)).perp_dot(p - flat(c)) / area;
        let w = 1.0 - u - v;
        if u >= -1e-9 && v >= -1e-9 && w >= -1e-9 {
            return a.z * u + b.z * v + c.z * w;
        }
    }
    ground_m(p)
}

/// The ground as triangles, and what lies on it.
pub(super) fn model() -> Model {
    let faces = (0..CELLS)
        .flat_map(|j| (0..CELLS).flat_map(move |i| cell(i, j)))
        .map(|points| Face { modifier: "meadow", points: points.to_vec() })
        .collect();
    let mut model = Model::default();
    model.add("meadow", faces);
    for street in rounded() {
        model.add("street", ribbon(street));
    }
    for hedge in HEDGES {
        for pair in hedge.windows(2) {
            model.add("hedge", row(DVec2::from_array(pair[0]), DVec2::from_array(pair[1])));
        }
    }
    model
}

/// A street: a ribbon 0.8 m thick, closed, its surface level from side to side.
fn ribbon(middles: &[DVec2]) -> Vec<Face> {
    let rows: Vec<[DVec3; 4]> = (0..middles.len())
        .map(|i| {
            let ahead = middles[(i + 1).min(middles.len() - 1)];
            let behind = middles[i.saturating_sub(1)];
            let left = (ahead - behind).normalize().perp() * STREET_HALF_WIDTH_M;
            let (middle, z) = (middles[i], street_m(middles[i]));
            let [l, r] = [middle + left, middle - left];
            [r.extend(z - 0.8), r.extend(z), l.extend(z), l.extend(z - 0.8)]
        })
        .collect();
    let mut faces = Vec::new();
    let mut add = |points: Vec<DVec3>| faces.push(Face { modifier: "asphalt", points });
    for pair in rows.windows(2) {
        for i in 0..4 {
            let j = (i + 1) % 4;
            // Triangles, since a ribbon that climbs a bend is not planar.
            add(vec![pair[0][i], pair[1][i], pair[1][j]]);
            add(vec![pair[0][i], pair[1][j], pair[0][j]]);
        }
    }
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    add(first.to_vec());
    add(last.iter().rev().copied().collect());
    faces
}

/// Points along a line, bends rounded (Chaikin's corner cutting, ends kept).
fn dense(corners: &[DVec2]) -> Vec<DVec2> {
    let mut points = corners.to_vec();
    for _ in 0..2 {
        let mut finer = vec![points[0]];
        for pair in points.windows(2) {
            finer.push(pair[0] * 0.75 + pair[1] * 0.25);
            finer.push(pair[0] * 0.25 + pair[1] * 0.75);
        }
        finer.push(points[points.len() - 1]);
        points = finer;
    }
    points
}

/// A hedge between two points, cut to follow the ground.
fn row(from: DVec2, to: DVec2) -> Vec<Face> {
    let length = (to - from).length();
    let left = (to - from).normalize().perp() * 0.4;
    let base = [from - left, to - left, to + left, from + left];
    let (z0, z1) = (height_m(from), height_m(to));
    let along = (to - from) / length;
    let ground = |p: DVec2| z0 + (z1 - z0) * (p - from).dot(along) / length;
    prism(&Stand::ORIGIN, "foliage", &base, |p| ground(p) - 1.0, |p| ground(p) + 1.2)
}
