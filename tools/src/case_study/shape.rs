//! Solids of planar faces. Each is closed: every edge is used once in each direction.

use glam::{DVec2, DVec3};

/// A planar polygon, counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub(super) struct Face {
    pub(super) modifier: &'static str,
    pub(super) points: Vec<DVec3>,
}

/// A thing with a name.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    pub(super) name: String,
    pub(super) faces: Vec<Face>,
}

/// Some solids; those of one building share its name.
#[derive(Clone, Debug, Default)]
pub(super) struct Model {
    pub(super) solids: Vec<Solid>,
}

impl Model {
    pub(super) fn add(&mut self, name: &str, faces: Vec<Face>) {
        self.solids.push(Solid { name: name.to_owned(), faces });
    }

    pub(super) fn polygons(&self) -> usize {
        self.solids.iter().map(|solid| solid.faces.len()).sum()
    }
}

/// Where a building stands: local x, y, z are turned by `turn_deg` (counter-clockwise from east)
/// and moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stand {
    pub(super) at: DVec3,
    pub(super) turn_deg: f64,
}

impl Stand {
    pub(super) const ORIGIN: Self = Self { at: DVec3::ZERO, turn_deg: 0.0 };

    pub(super) fn world(&self, local: DVec3) -> DVec3 {
        let angle = self.turn_deg.to_radians();
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        self.at + DVec3::new(local.x * cos - local.y * sin, local.x * sin + local.y * cos, local.z)
    }
}

/// An upright prism over a base (counter-clockwise seen from above) with planar, perhaps sloping,
/// top and bottom.
pub(super) fn prism(
    stand: &Stand,
    modifier: &'static str,
    base: &[DVec2],
    bottom: impl Fn(DVec2) -> f64,
    top: impl Fn(DVec2) -> f64,
) -> Vec<Face> {
    let low = |p: DVec2| stand.world(p.extend(bottom(p)));
    let high = |p: DVec2| stand.world(p.extend(top(p)));
    let mut faces = vec![
        Face { modifier, points: base.iter().map(|&p| high(p)).collect() },
        Face { modifier, points: base.iter().rev().map(|&p| low(p)).collect() },
    ];
    for (i, &p) in base.iter().enumerate() {
        let q = base[(i + 1) % base.len()];
        faces.push(Face { modifier, points: vec![low(p), low(q), high(q), high(p)] });
    }
    faces
}

/// The corners of a rectangle, counter-clockwise.
pub(super) fn rectangle(x: [f64; 2], y: [f64; 2]) -> [DVec2; 4] {
    [DVec2::new(x[0], y[0]), DVec2::new(x[1], y[0]), DVec2::new(x[1], y[1]), DVec2::new(x[0], y[1])]
}

/// A box along the local axes.
pub(super) fn cuboid(
    stand: &Stand,
    modifier: &'static str,
    x: [f64; 2],
    y: [f64; 2],
    z: [f64; 2],
) -> Vec<Face> {
    prism(stand, modifier, &rectangle(x, y), |_| z[0], |_| z[1])
}

/// A deterministic number in [0, 1) from two integers (splitmix64's finaliser).
pub(super) fn chance(item: u64, what: u64) -> f64 {
    let mut z = item.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ what.wrapping_mul(0xD1B5_4A32_D192_ED03);
    z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z >> 11) as f64 / 9_007_199_254_740_992.0
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(super) fn smooth(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
