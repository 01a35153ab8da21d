//! A yard in which things hide each other: a sloping PV roof beside a gable, with a chimney on it, a
//! fence and a tree before it, a wall behind which nothing arrives, and a bunker that is closed.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// One polygon of a Radiance file.
fn polygon(material: &str, name: &str, corners: &[[f64; 3]], out: &mut String) {
    let _ = writeln!(out, "{material} polygon {name}\n0\n0\n{}", 3 * corners.len());
    for [x, y, z] in corners {
        let _ = writeln!(out, "{x} {y} {z}");
    }
}

/// Six faces that look outwards.
fn block(material: &str, name: &str, low: [f64; 3], high: [f64; 3], out: &mut String) {
    for axis in 0..3 {
        for up in [false, true] {
            let corner = |u: bool, v: bool| {
                let mut at = low;
                for (i, far) in [(axis, up), ((axis + 1) % 3, u), ((axis + 2) % 3, v)] {
                    at[i] = if far { high[i] } else { low[i] };
                }
                at
            };
            let mut around = [(false, false), (true, false), (true, true), (false, true)];
            if !up {
                around.reverse();
            }
            polygon(material, name, &around.map(|(u, v)| corner(u, v)), out);
        }
    }
}

/// The scene, metres: x east, y north, z up. The roof rises from the west to the east.
pub fn scene() -> String {
    let mut out = String::new();
    for material in ["grey", "leaves", "pv"] {
        let _ = writeln!(out, "void plastic {material}\n0\n0\n5 .25 .25 .25 0 0\n");
    }
    let ground = [[-20.0, -15.0, 0.0], [20.0, -15.0, 0.0], [20.0, 15.0, 0.0], [-20.0, 15.0, 0.0]];
    polygon("grey", "ground", &ground, &mut out);
    let roof = [[2.0, 4.0, 2.0], [2.0, -4.0, 2.0], [6.0, -4.0, 3.4], [6.0, 4.0, 3.4]];
    polygon("pv", "roof", &roof, &mut out);
    block("grey", "wall", [-14.0, -12.0, 0.0], [-13.5, 12.0, 6.0], &mut out);
    block("grey", "fence", [-6.0, -4.0, 0.0], [-5.8, 1.0, 3.0], &mut out);
    block("grey", "chimney", [3.0, 1.0, 1.8], [3.6, 1.6, 4.6], &mut out);
    block("grey", "gable", [1.9, 4.05, 0.0], [6.2, 4.3, 5.0], &mut out);
    block("leaves", "tree", [-10.0, 3.0, 1.0], [-8.0, 6.0, 5.0], &mut out);
    block("grey", "bunker", [10.0, -12.0, 0.0], [14.0, -8.0, 3.0], &mut out);
    let cellar = [[11.0, -11.0, 1.0], [13.0, -11.0, 1.0], [13.0, -9.0, 1.0], [11.0, -9.0, 1.0]];
    polygon("grey", "cellar", &cellar, &mut out);
    out
}

/// Points of a file of sensors: four on surfaces, two in free air, two where nothing arrives.
pub const SENSORS: [[f64; 6]; 8] = [
    [-13.5, 2.0, 3.0, 1.0, 0.0, 0.0],
    [-13.5, -4.0, 2.0, 1.0, 0.0, 0.0],
    [-4.0, 3.0, 0.0, 0.0, 0.0, 1.0],
    [4.0, 4.05, 4.0, 0.0, -1.0, 0.0],
    [4.0, 0.0, 6.0, 0.0, 0.0, -1.0],
    [-1.0, 1.0, 5.0, 1.0, 0.0, -0.3],
    [12.0, -10.0, 1.0, 0.0, 0.0, 1.0],
    [-17.0, 0.0, 3.0, -1.0, 0.0, 0.0],
];

/// Where nothing arrives, among [`SENSORS`].
pub const DARK: [usize; 2] = [6, 7];

/// Writes `scene.rad` and `sensors.txt`.
pub fn write(folder: &Path) {
    fs::create_dir_all(folder).expect("makes a folder");
    fs::write(folder.join("scene.rad"), scene()).expect("writes");
    let line = |s: &[f64; 6]| s.map(|v| v.to_string()).join(" ") + "\n";
    let text: String = SENSORS.iter().map(line).collect();
    fs::write(folder.join("sensors.txt"), text).expect("writes");
}
