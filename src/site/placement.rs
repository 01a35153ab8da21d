use glam::{DMat3, DVec3};

/// Local coordinates of a point in map coordinates: less the origin, then turned about it so that
/// +y is true north.
pub fn local_from_map(point: DVec3, origin: DVec3, north_deg: f64) -> DVec3 {
    turn(north_deg) * (point - origin)
}

/// Map coordinates of a local point; the inverse of [`local_from_map`].
pub fn map_from_local(point: DVec3, origin: DVec3, north_deg: f64) -> DVec3 {
    turn(north_deg).transpose() * point + origin
}

/// The rotation that takes the direction `north_deg` clockwise from +y to +y; exactly nothing at 0.
pub(super) fn turn(north_deg: f64) -> DMat3 {
    if north_deg == 0.0 {
        return DMat3::IDENTITY;
    }
    let (sin, cos) = libm::sincos(north_deg.to_radians());
    DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn true_north_becomes_the_y_axis() {
        let origin = DVec3::new(100.0, 200.0, 5.0);
        // North 90 degrees clockwise of y is the map's +x.
        let north = local_from_map(origin + DVec3::X, origin, 90.0);
        assert!((north - DVec3::Y).length() < 1e-12, "{north}");
        let p = DVec3::new(3.0, -4.0, 7.0);
        let back = map_from_local(local_from_map(p, origin, 33.0), origin, 33.0);
        assert!((back - p).length() < 1e-12);
    }
}
