//! The church: exposed concrete around a courtyard. Two halls whose roofs rise to the east (27 %),
//! a south wing whose roof rises to the north (35 %), low wings with flat roofs, a free-standing
//! tower. Metres; the courtyard's floor is 0.
//!
//! Heights are such that no part shades another's photovoltaics while it mirrors the sun onto the
//! hillside: what lies east of the halls stays below their roofs' planes.

use glam::{DVec2, DVec3};

use super::shape::{Face, Model, Stand, cuboid, prism, rectangle};

const HERE: Stand = Stand::ORIGIN;
const FOOT_M: f64 = -4.0;
/// Thickness of a sloping roof, m.
const ROOF_M: f64 = 0.4;

/// A sloping roof with its photovoltaic section.
struct Roof {
    name: &'static str,
    modifier: &'static str,
    /// The roof's outline, with eaves.
    x: [f64; 2],
    y: [f64; 2],
    /// The section inside it.
    pv_x: [f64; 2],
    pv_y: [f64; 2],
    /// Height at the outline's south-west corner.
    z: f64,
    /// Rise to the east and to the north.
    rise: DVec2,
}

impl Roof {
    fn plane(&self, p: DVec2) -> f64 {
        self.z + self.rise.dot(p - DVec2::new(self.x[0], self.y[0]))
    }

    fn top(&self, p: DVec2) -> DVec3 {
        p.extend(self.plane(p))
    }

    /// The slab without its section; with it, it is closed.
    fn slab(&self) -> Vec<Face> {
        let outer = rectangle(self.x, self.y);
        let inner = rectangle(self.pv_x, self.pv_y);
        let mut faces =
            prism(&HERE, "roof_tile", &outer, |p| self.plane(p) - ROOF_M, |p| self.plane(p));
        faces.remove(0);
        for i in 0..4 {
            let j = (i + 1) % 4;
            let points = [outer[i], outer[j], inner[j], inner[i]].map(|p| self.top(p)).to_vec();
            faces.push(Face { modifier: "roof_tile", points });
        }
        faces
    }

    fn section(&self) -> Face {
        let points = rectangle(self.pv_x, self.pv_y).map(|p| self.top(p)).to_vec();
        Face { modifier: self.modifier, points }
    }
}

const ROOFS: [Roof; 3] = [
    Roof {
        name: "roof_west_lower",
        modifier: "pv_west_lower",
        x: [-14.6, -2.6],
        y: [-6.5, 7.1],
        pv_x: [-13.4, -3.8],
        pv_y: [-5.7, 6.3],
        z: 8.9,
        rise: DVec2::new(0.27, 0.0),
    },
    Roof {
        name: "roof_west_upper",
        modifier: "pv_west_upper",
        x: [-14.6, -2.6],
        y: [8.1, 21.7],
        pv_x: [-13.4, -3.8],
        pv_y: [8.9, 20.9],
        z: 10.4,
        rise: DVec2::new(0.27, 0.0),
    },
    Roof {
        name: "roof_south",
        modifier: "pv_south",
        x: [-0.6, 13.0],
        y: [-19.6, -7.8],
        pv_x: [0.2, 12.2],
        pv_y: [-18.5, -9.1],
        z: 8.6,
        rise: DVec2::new(0.0, 0.35),
    },
];

/// The three sections, a rectangle each.
pub(super) fn pv() -> Model {
    let mut model = Model::default();
    for roof in &ROOFS {
        model.add(roof.name, vec![roof.section()]);
    }
    model
}

/// Everything but the sections.
pub(super) fn building() -> Model {
    let mut m = Model::default();
    podium(&mut m);
    halls(&mut m);
    courtyard(&mut m);
    tower(&mut m);
    m
}

fn block(m: &mut Model, name: &str, x: [f64; 2], y: [f64; 2], z: [f64; 2]) {
    m.add(name, cuboid(&HERE, "concrete", x, y, z));
}

/// A block with a flat roof behind a parapet.
fn flat(m: &mut Model, name: &str, x: [f64; 2], y: [f64; 2], z: f64) {
    block(m, name, x, y, [FOOT_M, z]);
    let (thick, high) = (0.35, [z - 0.1, z + 0.6]);
    block(m, name, x, [y[0], y[0] + thick], high);
    block(m, name, x, [y[1] - thick, y[1]], high);
    let between = [y[0] + thick, y[1] - thick];
    block(m, name, [x[0], x[0] + thick], between, high);
    block(m, name, [x[1] - thick, x[1]], between, high);
}

fn podium(m: &mut Model) {
    block(m, "podium", [-16.5, 20.0], [-20.6, 30.0], [FOOT_M, 0.0]);
    // Steps down to the village street.
    for step in 0..5 {
        let x = -16.5 - 0.9 * f64::from(step + 1);
        let z = -0.25 * f64::from(step + 1);
        block(m, "podium", [x, x + 1.0], [-2.0, 12.0], [FOOT_M, z]);
    }
}

fn halls(m: &mut Model) {
    for roof in &ROOFS {
        m.add(roof.name, roof.slab());
        // Walls stand back from the eaves and end inside the slab.
        let inset = 0.6;
        let x = [roof.x[0] + inset, roof.x[1] - inset * 0.5];
        let y = [roof.y[0] + inset * 0.5, roof.y[1] - inset * 0.5];
        let base = rectangle(x, y);
        let walls = prism(&HERE, "concrete", &base, |_| FOOT_M, |p| roof.plane(p) - ROOF_M / 2.0);
        m.add("church_hall", walls);
    }
    // Fins along the west fronts and the south front.
    for (y0, z) in [(-6.2, 8.3), (8.4, 9.8)] {
        for i in 0..7 {
            let y = y0 + 2.1 * f64::from(i);
            block(m, "church_hall", [-14.45, -13.9], [y, y + 0.4], [-0.5, z]);
        }
    }
    for i in 0..7 {
        let x = -0.2 + 2.1 * f64::from(i);
        block(m, "church_hall", [x, x + 0.4], [-19.45, -18.9], [-0.5, 8.0]);
    }
    // Between the two halls, and the choir behind the upper one.
    block(m, "church_hall", [-13.2, -3.2], [6.5, 8.7], [FOOT_M, 8.2]);
    flat(m, "choir", [-3.1, 19.0], [8.6, 21.2], 8.8);
    for x in [1.0, 5.5, 10.0, 14.5] {
        block(m, "choir", [x, x + 1.6], [11.0, 18.6], [8.7, 9.9]);
    }
    // The link under the south wing's west end, and the parish house in the east.
    flat(m, "parish", [-8.5, -0.2], [-17.5, -6.0], 4.2);
    flat(m, "parish", [13.0, 19.0], [-19.0, 8.8], 6.4);
    for i in 0..12 {
        let y = -17.8 + 2.1 * f64::from(i);
        block(m, "parish", [18.9, 19.35], [y, y + 0.4], [-0.5, 5.6]);
    }
}

fn courtyard(m: &mut Model) {
    // A cloister's roof along all four sides, on slender columns.
    let z = [3.1, 3.5];
    block(m, "cloister", [-3.0, -0.4], [-7.9, 8.7], z);
    block(m, "cloister", [10.6, 13.1], [-7.9, 8.7], z);
    block(m, "cloister", [-0.4, 10.6], [-8.0, -5.6], z);
    block(m, "cloister", [-0.4, 10.6], [6.4, 8.7], z);
    for i in 0..5 {
        let x = -0.75 + 2.9 * f64::from(i);
        for y in [-5.95, 6.45] {
            block(m, "cloister", [x, x + 0.3], [y, y + 0.3], [-0.5, 3.2]);
        }
    }
    for i in 0..3 {
        let y = -2.9 + 3.1 * f64::from(i);
        for x in [-0.75, 10.65] {
            block(m, "cloister", [x, x + 0.3], [y, y + 0.3], [-0.5, 3.2]);
        }
    }
    // A well.
    block(m, "cloister", [2.0, 3.6], [-2.6, -1.0], [-0.5, 0.7]);
}

fn tower(m: &mut Model) {
    let (x, y) = ([-2.2, 2.8], [23.6, 28.6]);
    block(m, "tower", x, y, [FOOT_M, 18.5]);
    // The belfry: four piers, bells, a slab.
    for px in [[x[0], x[0] + 1.1], [x[1] - 1.1, x[1]]] {
        for py in [[y[0], y[0] + 1.1], [y[1] - 1.1, y[1]]] {
            block(m, "tower", px, py, [18.0, 23.2]);
        }
    }
    block(m, "tower", [-0.5, 1.1], [25.3, 26.9], [18.0, 21.0]);
    block(m, "tower", [x[0] - 0.3, x[1] + 0.3], [y[0] - 0.3, y[1] + 0.3], [23.0, 24.0]);
    // The cross.
    block(m, "tower", [0.17, 0.43], [25.97, 26.23], [23.8, 27.2]);
    block(m, "tower", [-0.65, 1.25], [25.98, 26.22], [25.9, 26.15]);
    // The porch between tower and choir.
    block(m, "tower", [-1.4, 2.0], [21.0, 23.8], [FOOT_M, 3.6]);
}
