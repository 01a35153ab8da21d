use glam::DVec3;

/// The direction in which the sun is seen, from where it stands: lifted by the air. Saemundsson
/// 1986 ("Astronomical refraction", Sky and Telescope 72), the inverse of Bennett's formula, for
/// 1010 hPa and 10 degrees Celsius; nothing below -1 degree, where it loses its meaning.
pub fn refracted(sun: DVec3) -> DVec3 {
    let level = (sun.x * sun.x + sun.y * sun.y).sqrt();
    let altitude_deg = libm::atan2(sun.z, level).to_degrees();
    if altitude_deg < -1.0 || level == 0.0 {
        return sun;
    }
    let at = (altitude_deg + 10.3 / (altitude_deg + 5.11)).to_radians();
    let lift_deg = (1.02 / 60.0 / libm::tan(at)).max(0.0);
    let seen = (altitude_deg + lift_deg).to_radians();
    let scale = libm::cos(seen) / level;
    DVec3::new(sun.x * scale, sun.y * scale, libm::sin(seen))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifts_the_sun_as_the_almanacs_say() {
        // Meeus, Astronomical Algorithms: 34' at the (apparent) horizon, 5.3' at 10 degrees,
        // 1' at 45 degrees, nothing overhead.
        for (altitude, minutes, within) in
            [(-0.5667, 34.0, 1.0), (0.0, 28.98, 0.2), (10.0, 5.41, 0.1), (45.0, 1.01, 0.02)]
        {
            let a = f64::to_radians(altitude);
            let sun = DVec3::new(0.6 * libm::cos(a), 0.8 * libm::cos(a), libm::sin(a));
            let seen = refracted(sun);
            let lift = (libm::asin(seen.z).to_degrees() - altitude) * 60.0;
            assert!((lift - minutes).abs() < within, "{lift} at {altitude}");
            assert!((seen.length() - 1.0).abs() < 1e-12);
            assert!((seen.x * sun.y - seen.y * sun.x).abs() < 1e-12, "the azimuth stays");
        }
        assert_eq!(refracted(DVec3::Z), DVec3::Z);
    }
}
