//! Gabled houses: walls, two roof slabs, chimney, windows; the chalet's balcony.

use glam::{DVec2, DVec3};

use super::shape::{Face, Model, Stand, chance, cuboid, prism, rectangle};
use super::site_plan::{HOUSES, Plot, Style};
use super::terrain;

/// All houses.
pub(super) fn model() -> Model {
    let mut model = Model::default();
    for (number, plot) in HOUSES.iter().enumerate() {
        build(&mut model, plot, number as u64);
    }
    model
}

/// Height of a house's floor, m.
pub(super) fn floor_m(plot: &Plot) -> f64 {
    let flat = Stand { at: DVec2::from_array(plot.at).extend(0.0), turn_deg: plot.ridge_deg };
    floor_and_foot_m(plot, &flat).0
}

/// Measures of a house, m above its floor.
struct Measures {
    eave: f64,
    pitch: f64,
    overhang: f64,
}

fn measures(style: Style, number: u64) -> Measures {
    match style {
        Style::House => {
            let pitch = 0.75 + 0.2 * chance(number, 1);
            Measures { eave: 5.4 + 0.4 * chance(number, 2), pitch, overhang: 0.6 }
        }
        Style::Chalet => Measures { eave: 5.7, pitch: 0.5, overhang: 1.3 },
        Style::Barn => Measures { eave: 4.6, pitch: 0.62, overhang: 0.8 },
    }
}

/// Height of a house's floor: the middle between the highest and the lowest corner.
fn floor_and_foot_m(plot: &Plot, flat: &Stand) -> (f64, f64) {
    let (l, w) = (plot.length_m / 2.0, plot.width_m / 2.0);
    let heights = rectangle([-l, l], [-w, w])
        .map(|p| terrain::height_m(flat.world(p.extend(0.0)).truncate()));
    let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    ((low + high) / 2.0 + 0.25, low - 1.0)
}

fn build(model: &mut Model, plot: &Plot, number: u64) {
    let at = DVec2::from_array(plot.at);
    let flat = Stand { at: at.extend(0.0), turn_deg: plot.ridge_deg };
    let (floor, foot) = floor_and_foot_m(plot, &flat);
    let stand = Stand { at: at.extend(floor), ..flat };
    let m = measures(plot.style, number);
    let (l, w) = (plot.length_m / 2.0, plot.width_m / 2.0);
    let ridge = m.eave + m.pitch * w;

    model.add(plot.name, walls(&stand, l, w, foot - floor, m.eave, ridge));
    for side in [-1.0, 1.0] {
        model.add(plot.name, slab(&stand, l, w, &m, ridge, side));
    }
    if plot.style != Style::Barn {
        let x = l * (0.2 + 0.3 * chance(number, 3));
        let y = w * 0.3;
        let chimney = [ridge - 2.0, ridge + 0.9];
        model.add(plot.name, cuboid(&stand, "plaster", [x, x + 0.7], [y, y + 0.7], chimney));
        windows(model, plot, &stand, l, w);
    }
    if plot.style == Style::Chalet {
        balcony(model, plot, &stand, l, w);
    }
    if plot.style == Style::House && chance(number, 5) < 0.6 && plot.name != "open_house" {
        // A low shed against one gable.
        let (y, z) = ([-w * 0.7, w * 0.35], [foot - floor, 2.7]);
        model.add(plot.name, cuboid(&stand, "plaster", [-l - 3.2, -l + 0.1], y, z));
    }
}

/// The body: a pentagonal prism along the ridge.
fn walls(stand: &Stand, l: f64, w: f64, foot: f64, eave: f64, ridge: f64) -> Vec<Face> {
    let section = [[-w, foot], [w, foot], [w, eave], [0.0, ridge], [-w, eave]];
    let point = |x: f64, i: usize| stand.world(DVec3::new(x, section[i][0], section[i][1]));
    let end = |x: f64| (0..5).map(|i| point(x, i)).collect::<Vec<_>>();
    let mut back = end(-l);
    back.reverse();
    let mut faces = vec![
        Face { modifier: "plaster", points: end(l) },
        Face { modifier: "plaster", points: back },
    ];
    for i in 0..5 {
        let j = (i + 1) % 5;
        let points = vec![point(-l, i), point(-l, j), point(l, j), point(l, i)];
        faces.push(Face { modifier: "plaster", points });
    }
    faces
}

/// One side of the roof: a sloping slab that lies 5 cm deep in the walls and ends at the ridge.
fn slab(stand: &Stand, l: f64, w: f64, m: &Measures, ridge: f64, side: f64) -> Vec<Face> {
    let out = (w + m.overhang) * side;
    let y = if side < 0.0 { [out, 0.0] } else { [0.0, out] };
    let base = rectangle([-l - m.overhang, l + m.overhang], y);
    let plane = |p: DVec2| ridge - m.pitch * p.y.abs();
    prism(stand, "roof_tile", &base, |p| plane(p) - 0.05, |p| plane(p) + 0.2)
}

/// Window frames stand 7 cm before the walls: enough to be seen.
fn windows(model: &mut Model, plot: &Plot, stand: &Stand, l: f64, w: f64) {
    let depth = 0.07;
    for floor in [0.9, 3.5] {
        for side in [-1.0, 1.0] {
            let y = if side < 0.0 { [-w - depth, -w + 0.1] } else { [w - 0.1, w + depth] };
            for x in [-0.5, 0.5].map(|t| t * l) {
                let z = [floor, floor + 1.4];
                model.add(plot.name, cuboid(stand, "window", [x - 0.6, x + 0.6], y, z));
            }
            let x = if side < 0.0 { [-l - depth, -l + 0.1] } else { [l - 0.1, l + depth] };
            for y in [-0.45, 0.45].map(|t| t * w) {
                let z = [floor, floor + 1.4];
                model.add(plot.name, cuboid(stand, "window", x, [y - 0.6, y + 0.6], z));
            }
        }
    }
}

/// A balcony along the gable that looks east.
fn balcony(model: &mut Model, plot: &Plot, stand: &Stand, l: f64, w: f64) {
    let (from, to) = (l - 0.1, l + 1.4);
    let across = [-w, w];
    model.add(plot.name, cuboid(stand, "timber", [from, to], across, [2.75, 2.95]));
    model.add(plot.name, cuboid(stand, "timber", [to - 0.08, to], across, [2.95, 3.9]));
    for y in [[-w, -w + 0.08], [w - 0.08, w]] {
        model.add(plot.name, cuboid(stand, "timber", [from, to - 0.08], y, [2.95, 3.9]));
    }
}
