use glam::Vec3;

/// A triangle, metres from the local origin; counter-clockwise seen from its front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Its corners.
    pub corners: [Vec3; 3],
    /// Index into [`Site::faces`](super::Site::faces): the surface of the source that it is part
    /// of.
    pub face: u32,
}

impl Triangle {
    /// Unit normal of the front; zero for a degenerate triangle.
    pub fn normal(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Area, m2.
    pub fn area_m2(&self) -> f32 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a).length() * 0.5
    }
}
