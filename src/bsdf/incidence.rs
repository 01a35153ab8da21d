//! A measured reflection, for those who ask many outgoing directions of the same light.
//!
//! A file is piecewise constant on both sides. All light from one of its incident cells scatters
//! alike, so what the sun's disc scatters is a sum over the few cells that it touches ([`Incidence`]);
//! and how far values differ over a set of outgoing directions can be said exactly, by looking at
//! the cells that the set touches ([`Measured::values_within`]). Whoever integrates a file needs both:
//! points alone can't tell whether a bright cell lies between them.

use glam::DVec3;

use super::{Cone, Measured, Table};

/// An incident cell of a file that light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incidence {
    cell: u32,
    /// Cosine and sine by which outgoing directions are turned back before they are looked up: the
    /// azimuth of the light where a file is isotropic, else 0.
    turn: [f64; 2],
}

impl Incidence {
    /// Whether light of both scatters alike, but for its azimuth where a file is isotropic.
    pub fn is_like(&self, other: &Self) -> bool {
        self.cell == other.cell
    }
}

impl Measured {
    /// Where light from a direction above the surface comes from; `None` beyond the file's last
    /// patch.
    #[inline]
    pub fn incidence(&self, from: DVec3) -> Option<Incidence> {
        let from = self.turned(from);
        match self.table() {
            Table::Matrix(matrix) => {
                let cell = matrix.incident_patch(from)? as u32;
                Some(Incidence { cell, turn: [1.0, 0.0] })
            }
            Table::Tree(tree) => {
                let (cos, sin) = tree.turn(from);
                Some(Incidence { cell: tree.root_number(from), turn: [cos, sin] })
            }
        }
    }

    /// Width of the finest outgoing cells, as a part of the unit disc that the hemisphere looks like
    /// from above, where values turn with the azimuth of the light (an isotropic tree).
    pub fn turning_cell(&self) -> Option<f64> {
        match self.table() {
            Table::Tree(tree) if tree.rank() == 3 => Some(2.0 / f64::from(1_u32 << tree.levels())),
            _ => None,
        }
    }

    /// What light from an incident cell scatters to a direction above the surface, 1/sr.
    #[inline]
    pub fn value(&self, of: &Incidence, out: DVec3) -> f64 {
        let to = self.turned(out);
        match self.table() {
            Table::Matrix(matrix) => {
                let patch = matrix.outgoing.patch(to);
                patch.map_or(0.0, |o| matrix.value(of.cell as usize, o))
            }
            Table::Tree(tree) => tree.value(of.cell, of.turn, to),
        }
    }

    /// Smallest and largest value of an incident cell among the outgoing directions of a cone,
    /// 1/sr: those of all cells that it may touch.
    pub fn values_within(&self, of: &Incidence, out: &Cone) -> [f64; 2] {
        let mut span = [f64::INFINITY, 0.0_f64];
        let out = out.about(self.turned(out.axis));
        match self.table() {
            Table::Matrix(_) => self.each_patch(&out, |o| {
                let value = self.patch_value(of, o);
                span = [span[0].min(value), span[1].max(value)];
            }),
            Table::Tree(tree) => {
                let [cos, sin] = of.turn;
                let axis = out.axis;
                let turned =
                    DVec3::new(axis.x * cos + axis.y * sin, axis.y * cos - axis.x * sin, axis.z);
                tree.values_within(of.cell, &out.about(turned), &mut span);
            }
        }
        span
    }

    /// Largest value, 1/sr, from any direction of a cone to any direction of another one.
    pub fn most_between(&self, from: &Cone, out: &Cone) -> f64 {
        let [from, out] = [from, out].map(|cone| cone.about(self.turned(cone.axis)));
        match self.table() {
            Table::Matrix(matrix) => {
                let mut patches = Vec::new();
                self.each_patch(&out, |o| patches.push(o));
                matrix.most_among(&patches, &from)
            }
            Table::Tree(tree) => tree.most_between(&from, &out),
        }
    }

    /// Outgoing patches of a file that has patches (Klems), else 0.
    pub fn patches(&self) -> usize {
        match self.table() {
            Table::Matrix(matrix) => matrix.outgoing.len(),
            Table::Tree(_) => 0,
        }
    }

    /// The value of an incident cell and an outgoing patch, 1/sr; 0 where the file has none.
    pub fn patch_value(&self, of: &Incidence, outgoing: usize) -> f64 {
        match self.table() {
            Table::Matrix(matrix) => matrix.value(of.cell as usize, outgoing),
            Table::Tree(_) => 0.0,
        }
    }

    /// Number of the outgoing patch of a direction, where the file has patches.
    pub fn outgoing_patch(&self, out: DVec3) -> Option<usize> {
        match self.table() {
            Table::Matrix(matrix) => matrix.outgoing.patch(self.turned(out)),
            Table::Tree(_) => None,
        }
    }

    /// All outgoing patches that directions of a cone may lie in.
    pub fn patches_within(&self, out: &Cone, each: impl FnMut(usize)) {
        self.each_patch(&out.about(self.turned(out.axis)), each);
    }

    /// The same for a cone in the file's own frame.
    fn each_patch(&self, out: &Cone, each: impl FnMut(usize)) {
        if let Table::Matrix(matrix) = self.table() {
            let ([low, high], (centre, spread)) = (out.radii().into(), out.turns());
            let turns = [centre - spread, centre + spread];
            matrix.outgoing.patches_touching([low * low, high * high], turns, each);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Frame, Purpose, Stream};
    use crate::bsdf::{Bsdf, chart::samples, on_circle, on_hemisphere};

    /// A direction of a cone.
    fn within(cone: &Cone, random: &mut Stream) -> DVec3 {
        let frame = Frame::around(cone.axis);
        let angle = cone.angle_rad * random.uniform().sqrt();
        let (x, y) = on_circle(random.uniform());
        let sin = libm::sin(angle);
        frame.z * libm::cos(angle) + frame.x * (sin * x) + frame.y * (sin * y)
    }

    #[test]
    fn incidences_say_what_the_file_says_and_cones_hold_all_values() {
        let mut random = Stream::new(11, Purpose::Survey, 0);
        let mut narrow = 0;
        for bsdf in samples() {
            let Bsdf::Measured(measured) = &bsdf else { continue };
            for _ in 0..400 {
                let from = on_hemisphere(random.uniform(), random.uniform());
                let axis = on_hemisphere(random.uniform(), random.uniform());
                let out = Cone::new(axis, 0.3 * random.uniform().powi(3));
                let light = Cone::new(from, 0.1 * random.uniform());
                let most = measured.most_between(&light, &out);
                let Some(incidence) = measured.incidence(from) else { continue };
                let [low, high] = measured.values_within(&incidence, &out);
                narrow += usize::from(low == high);
                for _ in 0..40 {
                    let to = within(&out, &mut random);
                    let sun = within(&light, &mut random);
                    if to.z <= 0.0 || sun.z <= 0.0 {
                        continue;
                    }
                    let value = measured.value(&incidence, to);
                    assert_eq!(value, measured.evaluate(from, to));
                    assert!(low <= value && value <= high, "{value} of {low} to {high}");
                    assert!(measured.evaluate(sun, to) <= most, "{most}");
                }
            }
        }
        // A bound that holds everything would hold, too.
        assert!(narrow > 300, "{narrow}");
    }
}
