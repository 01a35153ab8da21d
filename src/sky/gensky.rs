//! Radiance's own sun: where it stands (sun.c) and how strong it is (gensky.c).

use std::f64::consts::PI;

/// Which denominator the declination has: 368 in the gensky of 2018, 365 today.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Declination {
    Over368,
    Over365,
}

/// Unit vector to the sun.
///
/// Radiance's sun.c (after IES LM-83 and ASHRAE): declination, equation of time, altitude and
/// azimuth; the day counts from 1 there. Longitudes are east here.
pub(super) fn direction(
    declination: Declination,
    latitude_deg: f64,
    longitude_deg: f64,
    meridian_deg: f64,
    day: u32,
    hour: f64,
) -> [f64; 3] {
    let jd = f64::from(day) + 1.0;
    let period = match declination {
        Declination::Over368 => 368.0,
        Declination::Over365 => 365.0,
    };
    let d = 0.4093 * libm::sin(2.0 * PI / period * (jd - 81.0));
    let equation_of_time_h = 0.170 * libm::sin(4.0 * PI / 373.0 * (jd - 80.0))
        - 0.129 * libm::sin(2.0 * PI / 355.0 * (jd - 8.0));
    let st = hour + equation_of_time_h + (longitude_deg - meridian_deg) / 15.0;
    let angle = PI * st / 12.0;
    let lat = latitude_deg.to_radians();
    let (sin_lat, cos_lat) = (libm::sin(lat), libm::cos(lat));
    let (sin_d, cos_d) = (libm::sin(d), libm::cos(d));
    let (sin_st, cos_st) = (libm::sin(angle), libm::cos(angle));
    let altitude = libm::asin((sin_lat * sin_d - cos_lat * cos_d * cos_st).clamp(-1.0, 1.0));
    let azimuth = -libm::atan2(cos_d * sin_st, -cos_lat * sin_d - sin_lat * cos_d * cos_st);
    let cos_altitude = libm::cos(altitude);
    [-libm::sin(azimuth) * cos_altitude, -libm::cos(azimuth) * cos_altitude, libm::sin(altitude)]
}

/// Diameter of gensky's disc, degrees.
pub(super) const DIAMETER_DEG: f64 = 0.5;

/// Direct normal irradiance, visible W/m2: gensky's radiance times the solid angle of its disc.
pub(super) fn irradiance_w_m2(sin_altitude: f64) -> f64 {
    let radiance = 1.5e9 / 208.0 * (1.147 - 0.147 / sin_altitude.max(0.16));
    let disc_sr = 2.0 * PI * (1.0 - libm::cos((DIAMETER_DEG / 2.0).to_radians()));
    radiance * disc_sr
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strength_of_the_handbook() {
        assert!((irradiance_w_m2(0.0) - 98.3).abs() < 0.5, "{}", irradiance_w_m2(0.0));
        assert!((irradiance_w_m2(1.0) - 431.3).abs() < 0.5, "{}", irradiance_w_m2(1.0));
        assert_eq!(irradiance_w_m2(0.0), irradiance_w_m2(0.16));
        // Radiance's 7.11e6 W/sr/m2 at the paper's highest sun, 66 degrees.
        assert!((irradiance_w_m2(0.9137) - 425.0).abs() < 3.0, "{}", irradiance_w_m2(0.9137));
    }
}
