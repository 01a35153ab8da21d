//! Virtual sensors: discs in free air through which photons are counted.
//!
//! An observer on a balcony is no surface, so nothing lands on them. A small disc in the air is
//! crossed instead, and the flux through it over its area is the irradiance. Of a year's photons
//! few cross a disc of half a metre, hence a run of its own: everything is aimed at the discs
//! alone. A ray must find all that it crosses, not the first, so they lie in a small tree of boxes
//! of their own.

use glam::{DVec3, Vec3};

use super::horizon::{Span, span_of};
use crate::base::{Frame, SensorSheet, VirtualSensor};

/// What photons are sent through.
#[derive(Clone, Copy, Debug)]
pub struct Through<'a> {
    /// The virtual sensors. Crossings lie on `sheet`, numbered as the virtual sensors are.
    pub sensors: &'a [VirtualSensor],
    /// Where crossings are kept.
    pub sheet: SensorSheet,
    /// Photons to send at most; 2^24 may always be sent.
    pub most: u64,
}

/// Virtual sensors of a leaf at most.
const LEAF: usize = 4;
/// Levels of the tree, which halves its virtual sensors at each: more than 2^60 virtual sensors
/// would need.
const LEVELS: usize = 64;

/// Virtual sensors in a tree of boxes, for rays that must find all that they cross.
#[derive(Debug)]
pub(super) struct SensorTree {
    sensors: Vec<VirtualSensor>,
    frames: Vec<Frame>,
    sheet: SensorSheet,
    most: u64,
    /// Their numbers, in the order of the leaves.
    order: Vec<u32>,
    nodes: Vec<Node>,
}

/// A box around `order[first..last]`; its halves, if any, are the nodes at `parts` and after it.
#[derive(Debug)]
struct Node {
    around: Span,
    first: usize,
    last: usize,
    parts: Option<usize>,
}

impl SensorTree {
    pub(super) fn of(through: &Through<'_>) -> Self {
        let sensors = through.sensors.to_vec();
        let mut out = Self {
            frames: sensors.iter().map(|g| Frame::around(g.normal)).collect(),
            sheet: through.sheet,
            most: through.most,
            order: (0..sensors.len() as u32).collect(),
            nodes: Vec::new(),
            sensors,
        };
        let whole = out.node(0, out.sensors.len());
        out.nodes.push(whole);
        let mut next = 0;
        while next < out.nodes.len() {
            let (first, last) = (out.nodes[next].first, out.nodes[next].last);
            if last - first > LEAF {
                let (low, high) = out.nodes[next].around;
                let size = high - low;
                let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
                let middle = (first + last) / 2;
                let at = |&i: &u32| out.sensors[i as usize].centre[axis];
                out.order[first..last].sort_by(|a, b| at(a).total_cmp(&at(b)).then(a.cmp(b)));
                out.nodes[next].parts = Some(out.nodes.len());
                let halves = [out.node(first, middle), out.node(middle, last)];
                out.nodes.extend(halves);
            }
            next += 1;
        }
        out
    }

    fn node(&self, first: usize, last: usize) -> Node {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let around = self.order[first..last].iter().fold(none, |(a, b), &i| {
            let (low, high) = span_of(&self.sensors[i as usize]);
            // The slab test rounds.
            (a.min(low - 1e-6), b.max(high + 1e-6))
        });
        Node { around, first, last, parts: None }
    }

    /// All of them.
    pub(super) fn all(&self) -> &[VirtualSensor] {
        &self.sensors
    }

    /// Photons to send at most.
    pub(super) fn most(&self) -> u64 {
        self.most
    }

    /// Whether a ray crosses any within `reach_m`, from the side that counts.
    #[inline]
    pub(super) fn crossed(&self, start: DVec3, direction: DVec3, reach_m: f32) -> bool {
        let mut any = false;
        self.visit(start, direction, reach_m, |_, _| {
            any = true;
            false
        });
        any
    }

    /// Calls `each` with the place on the sheet and the normal of each crossing.
    pub(super) fn each_crossed(
        &self,
        start: DVec3,
        direction: DVec3,
        reach_m: f32,
        mut each: impl FnMut(Vec3, Vec3),
    ) {
        self.visit(start, direction, reach_m, |i, off| {
            let frame = &self.frames[i];
            let place = self.sheet.place(i, [frame.x.dot(off), frame.y.dot(off)]);
            each(place, self.sensors[i].normal.as_vec3());
            true
        });
    }

    /// Calls `each` with the number of each virtual sensor that is crossed, and how far from its
    /// middle, until it says false.
    #[inline]
    fn visit(
        &self,
        start: DVec3,
        direction: DVec3,
        reach_m: f32,
        mut each: impl FnMut(usize, DVec3) -> bool,
    ) {
        let reach_m = f64::from(reach_m);
        let inverse = direction.recip();
        let mut stack = [0_usize; LEVELS];
        let mut open = 1;
        while open > 0 {
            open -= 1;
            let node = &self.nodes[stack[open]];
            if !meets(&node.around, start, inverse, reach_m) {
                continue;
            }
            if let Some(parts) = node.parts {
                stack[open] = parts + 1;
                stack[open + 1] = parts;
                open += 2;
                continue;
            }
            for &i in &self.order[node.first..node.last] {
                let i = i as usize;
                let sensor = &self.sensors[i];
                let slope = sensor.normal.dot(direction);
                // From behind, or along it.
                if slope >= 0.0 {
                    continue;
                }
                let along = sensor.normal.dot(sensor.centre - start) / slope;
                if !(along > 0.0 && along <= reach_m) {
                    continue;
                }
                let off = start + direction * along - sensor.centre;
                let within = off.length_squared() <= sensor.radius_m * sensor.radius_m;
                if within && !each(i, off) {
                    return;
                }
            }
        }
    }
}

/// Whether a ray meets a box. One that runs exactly in the plane of a face may be missed: faces lie
/// off the virtual sensors.
#[inline]
fn meets((low, high): &Span, start: DVec3, inverse: DVec3, reach_m: f64) -> bool {
    let (a, b) = ((*low - start) * inverse, (*high - start) * inverse);
    let (near, far) = (a.min(b), a.max(b));
    let enter = near.x.max(near.y).max(near.z).max(0.0);
    let leave = far.x.min(far.y).min(far.z).min(reach_m);
    enter <= leave
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};

    /// The tree against a look at each virtual sensor; virtual sensors lie in each other, some in
    /// one plane.
    #[test]
    fn rays_find_every_gate_that_they_cross() {
        let mut random = Stream::new(7, Purpose::Survey, 0);
        let mut one = |low: f64, high: f64| low + (high - low) * random.uniform();
        let mut sensors: Vec<VirtualSensor> = (0..300)
            .map(|_| VirtualSensor {
                centre: DVec3::new(one(-3.0, 3.0), one(-3.0, 3.0), one(-1.0, 1.0)),
                normal: DVec3::new(one(-1.0, 1.0), one(-1.0, 1.0), one(-1.0, 1.0)).normalize(),
                radius_m: one(0.1, 0.8),
            })
            .collect();
        sensors.extend((0..100).map(|i| VirtualSensor {
            centre: DVec3::new(f64::from(i % 10) * 0.1, f64::from(i / 10) * 0.1, 0.5),
            normal: DVec3::Z,
            radius_m: 0.25,
        }));
        let sheet = SensorSheet::new(sensors.len(), 0.8);
        let tree = SensorTree::of(&Through { sensors: &sensors, sheet, most: 0 });
        let mut crossings = 0;
        for ray in 0..2000 {
            let start = DVec3::new(one(-5.0, 5.0), one(-5.0, 5.0), one(-5.0, 5.0));
            let away = DVec3::new(one(-3.0, 3.0), one(-3.0, 3.0), one(-1.0, 1.0)) - start;
            let direction = if ray % 10 == 0 { DVec3::NEG_Z } else { away.normalize() };
            let reach_m = one(1.0, 12.0) as f32;
            let mut expected: Vec<usize> = Vec::new();
            for (i, sensor) in sensors.iter().enumerate() {
                let slope = direction.dot(sensor.normal);
                let along = (sensor.centre - start).dot(sensor.normal) / slope;
                let off = start + direction * along - sensor.centre;
                let here = along > 0.0 && along <= f64::from(reach_m) && slope < 0.0;
                if here && off.length() <= sensor.radius_m {
                    expected.push(i);
                }
            }
            let mut found = Vec::new();
            tree.visit(start, direction, reach_m, |i, _| {
                found.push(i);
                true
            });
            found.sort_unstable();
            assert_eq!(found, expected);
            assert_eq!(tree.crossed(start, direction, reach_m), !expected.is_empty());
            tree.each_crossed(start, direction, reach_m, |place, _| {
                let cell = expected.iter().find(|&&i| sheet.cell(i).contains(place));
                assert!(cell.is_some());
            });
            crossings += found.len();
        }
        assert!(crossings > 2000, "{crossings}");
    }
}
