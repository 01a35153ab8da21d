use glam::{DVec3, Vec3};

use super::Aabb;

/// A receiver in free air: a disc that light crosses without being stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualSensor {
    /// Its middle, m from the local origin.
    pub centre: DVec3,
    /// Unit normal of the side that light is counted on.
    pub normal: DVec3,
    /// Radius, m.
    pub radius_m: f64,
}

/// Where the photons that cross virtual sensors are kept. Virtual sensors may overlap, and a photon
/// belongs to each that it crosses: so their discs lie side by side on a plane of their own, row by
/// row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorSheet {
    columns: usize,
    rows: usize,
    pitch_m: f64,
}

impl SensorSheet {
    /// The sheet of `count` virtual sensors of at most `radius_m`.
    pub fn new(count: usize, radius_m: f64) -> Self {
        let columns = ((count as f64).sqrt().ceil() as usize).max(1);
        Self { columns, rows: count.div_ceil(columns).max(1), pitch_m: 4.0 * radius_m }
    }

    fn middle(&self, sensor: usize) -> [f64; 2] {
        [sensor % self.columns, sensor / self.columns].map(|i| (i as f64 + 0.5) * self.pitch_m)
    }

    /// Where a crossing is kept: `u` and `v` are metres from the virtual sensor's middle in its
    /// plane.
    pub fn place(&self, sensor: usize, [u, v]: [f64; 2]) -> Vec3 {
        let [x, y] = self.middle(sensor);
        Vec3::new((x + u) as f32, (y + v) as f32, 0.0)
    }

    /// What holds all crossings of a virtual sensor and no others.
    pub fn cell(&self, sensor: usize) -> Aabb {
        let [x, y] = self.middle(sensor);
        let half = 0.45 * self.pitch_m;
        let corner = |by: f64| Vec3::new((x + by) as f32, (y + by) as f32, by as f32);
        Aabb { min: corner(-half), max: corner(half) }
    }

    /// What holds all virtual sensors.
    pub fn bounds(&self) -> Aabb {
        let far = |n: usize| (n as f64 * self.pitch_m) as f32;
        let half = 0.5 * self.pitch_m as f32;
        Aabb {
            min: Vec3::new(0.0, 0.0, -half),
            max: Vec3::new(far(self.columns), far(self.rows), half),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_crossing_lies_in_the_cell_of_its_gate_alone() {
        for count in [1, 2, 7, 50] {
            let sheet = SensorSheet::new(count, 0.25);
            for sensor in 0..count {
                for uv in [[0.0, 0.0], [0.25, 0.0], [-0.25, 0.0], [0.0, 0.25], [0.0, -0.25]] {
                    let place = sheet.place(sensor, uv);
                    assert!(sheet.bounds().contains(place));
                    for other in 0..count {
                        assert_eq!(sheet.cell(other).contains(place), other == sensor);
                    }
                }
            }
        }
    }
}
