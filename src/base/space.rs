use glam::{DVec3, Vec3};

/// A box along the axes, metres.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::grown)
    }

    /// This box grown to hold `point`.
    #[must_use]
    pub fn grown(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// This box grown to hold `other`.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether the box holds nothing.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Edge lengths, metres; zero for an empty box.
    pub fn size(&self) -> Vec3 {
        (self.max - self.min).max(Vec3::ZERO)
    }

    /// The middle.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Whether `point` lies inside or on the border.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Square of the distance from `point` to the box, m2; 0 inside.
    pub fn distance_squared(&self, point: Vec3) -> f32 {
        let gap = (self.min - point).max(point - self.max).max(Vec3::ZERO);
        gap.length_squared()
    }
}

/// An orthonormal frame whose third axis is a surface's normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub x: DVec3,
    /// Second tangent.
    pub y: DVec3,
    /// The normal.
    pub z: DVec3,
}

impl Frame {
    /// A frame around a unit normal: x lies horizontal, so that the azimuth of a direction in the
    /// frame has a meaning (y points up the slope). A horizontal surface has x east, y north.
    pub fn around(normal: DVec3) -> Self {
        let across = DVec3::Z.cross(normal);
        let x = if across.length_squared() > 1e-12 { across.normalize() } else { DVec3::X };
        Self { x, y: normal.cross(x), z: normal }
    }

    /// World direction from one in this frame.
    pub fn world_from_local(&self, v: DVec3) -> DVec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// Direction in this frame from one in the world.
    pub fn local_from_world(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_right_handed_and_invert() {
        for n in [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::new(-0.27, 0.0, 1.0).normalize()] {
            let f = Frame::around(n);
            assert!((f.x.cross(f.y) - f.z).length() < 1e-12);
            let v = DVec3::new(0.3, -0.5, 0.8);
            assert!((f.local_from_world(f.world_from_local(v)) - v).length() < 1e-12);
        }
    }
}
