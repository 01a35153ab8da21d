use glam::DVec3;

/// A point of a surface where light arrives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReceiverPoint {
    pub position: DVec3,
    /// A little off the surface: where rays end.
    pub ray_end: DVec3,
    /// Of the surface, turned to where light may come from.
    pub normal: DVec3,
}

/// Receivers on surfaces are lifted off them by this much, m.
pub(super) const LIFT_M: f64 = 2e-3;

impl ReceiverPoint {
    pub(super) fn new(position: DVec3, normal: DVec3) -> Self {
        Self { position, ray_end: position + normal * LIFT_M, normal }
    }
}
