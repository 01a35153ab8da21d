use glam::DVec3;
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, SolarPositions};

use super::calendar::julian_date_of_year;
use super::gensky::{self, Declination};
use super::{Place, SunModel};

/// Unit vector to the sun's centre, also below the horizon; x east, y north, z up. Geometric:
/// without refraction.
///
/// `day` counts from 0 (1 January), `hour` is local standard time; hours before 0 and after 24
/// mean the days before and after for [`SunModel::Spa`]. Only SPA depends on the year and the
/// elevation.
///
/// NaN in all components for a place or a year that [`timeline`](super::timeline) refuses.
pub fn sun_direction(place: &Place, model: SunModel, year: i32, day: u32, hour: f64) -> DVec3 {
    let declination = match model {
        SunModel::Gensky2018 => Declination::Over368,
        SunModel::Gensky => Declination::Over365,
        SunModel::Spa => return spa(place, year, day, hour).unwrap_or(DVec3::NAN),
    };
    DVec3::from_array(gensky::direction(
        declination,
        place.latitude_deg,
        place.longitude_deg,
        place.meridian_deg,
        day,
        hour,
    ))
}

/// NREL's SPA. TT - UT1 is taken as zero, as in NREL's reference data: it moves the sun by less
/// than 0.0009 degrees (0.2 s of the clock), is not known for years to come, and every revision of
/// its estimate would change results.
fn spa(place: &Place, year: i32, day: u32, hour: f64) -> Option<DVec3> {
    let utc_h = hour - place.meridian_deg / 15.0;
    let julian = julian_date_of_year(year) + f64::from(day) + utc_h / 24.0;
    let time = JulianDate::new(julian, 0.0).ok()?;
    let location = Location { latitude: place.latitude_deg, longitude: place.longitude_deg };
    let found =
        SolarPositions::new().at_from_julian(time, location, place.elevation_m, None).ok()?;
    let (azimuth, zenith) = (found.azimuth().to_radians(), found.zenith_angle().to_radians());
    let sin_zenith = libm::sin(zenith);
    Some(DVec3::new(
        libm::sin(azimuth) * sin_zenith,
        libm::cos(azimuth) * sin_zenith,
        libm::cos(zenith),
    ))
}

/// Altitude above the horizon and azimuth clockwise from north (0 to below 360) of a direction,
/// degrees.
pub fn altitude_azimuth_deg(direction: DVec3) -> (f64, f64) {
    let DVec3 { x, y, z } = direction;
    let altitude = libm::atan2(z, (x * x + y * y).sqrt()).to_degrees();
    let azimuth = libm::atan2(x, y).to_degrees();
    // A tiny negative azimuth plus 360 rounds to 360 itself.
    let azimuth = if azimuth < 0.0 { azimuth + 360.0 } else { azimuth };
    (altitude, if azimuth >= 360.0 { 0.0 } else { azimuth })
}
