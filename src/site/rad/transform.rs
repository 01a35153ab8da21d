use glam::{DMat3, DVec3};

/// A similarity: what `xform`'s `-t -rx -ry -rz -s -mx -my -mz` make together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    linear: DMat3,
    shift: DVec3,
    /// Lengths grow by its size; negative where the scene is mirrored.
    scale: f64,
}

impl Transform {
    pub const IDENTITY: Self = Self { linear: DMat3::IDENTITY, shift: DVec3::ZERO, scale: 1.0 };

    pub fn translation(shift: DVec3) -> Self {
        Self { shift, ..Self::IDENTITY }
    }

    /// Turns about a coordinate axis (0 is x), counter-clockwise seen from its end.
    pub fn rotation(axis: usize, angle_deg: f64) -> Self {
        let (sin, cos) = libm::sincos(angle_deg * (std::f64::consts::PI / 180.0));
        let linear = match axis {
            0 => DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::new(0.0, -sin, cos)),
            1 => DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos)),
            _ => DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z),
        };
        Self { linear, ..Self::IDENTITY }
    }

    pub fn scaling(scale: f64) -> Self {
        Self { linear: DMat3::from_diagonal(DVec3::splat(scale)), scale, ..Self::IDENTITY }
    }

    /// Mirrors along a coordinate axis.
    pub fn mirror(axis: usize) -> Self {
        let mut diagonal = DVec3::ONE;
        diagonal[axis] = -1.0;
        Self { linear: DMat3::from_diagonal(diagonal), scale: -1.0, ..Self::IDENTITY }
    }

    /// This one, then `next`.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        Self {
            linear: next.linear * self.linear,
            shift: next.linear * self.shift + next.shift,
            scale: self.scale * next.scale,
        }
    }

    /// This one `count` times.
    #[must_use]
    pub fn repeated(self, mut count: u64) -> Self {
        let (mut out, mut power) = (Self::IDENTITY, self);
        while count > 0 {
            if count & 1 == 1 {
                out = out.then(power);
            }
            power = power.then(power);
            count >>= 1;
        }
        out
    }

    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.shift
    }

    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.linear * v
    }

    pub fn length(&self, l: f64) -> f64 {
        l * self.scale.abs()
    }

    pub fn mirrors(&self) -> bool {
        self.scale < 0.0
    }
}
