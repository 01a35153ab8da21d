//! The clear sky of Ineichen and Perez 2002, broadband, as pvlib computes it.

use std::f64::consts::PI;

use super::calendar::{date_of_day, days_in_year};

/// Diameter of the sun, degrees.
pub(super) const DIAMETER_DEG: f64 = 0.533;

/// Linke turbidity unless the site knows its own.
pub(super) const LINKE: f64 = 3.0;

/// Direct normal irradiance, W/m2, for a sun above the horizon.
///
/// Ineichen and Perez, "A new airmass independent formulation for the Linke turbidity
/// coefficient", Solar Energy 73 (2002) 151-157, in the form of `pvlib.clearsky.ineichen` without
/// the Perez enhancement, fed as `pvlib.location.Location.get_clearsky` feeds it: the apparent
/// zenith (SPA's refraction at 12 degrees C and the pressure of the elevation), the air mass of
/// Kasten and Young 1989 times pressure / 101325 Pa, Spencer's distance to the sun.
///
/// `day` counts from 0.
pub(super) fn direct_normal_w_m2(altitude_deg: f64, elevation_m: f64, linke: f64, day: u32) -> f64 {
    let pressure_pa = pressure_pa(elevation_m);
    let apparent_deg = altitude_deg + refraction_deg(altitude_deg, pressure_pa);
    let cos_zenith = libm::cos((90.0 - apparent_deg).to_radians()).max(0.0);
    let air_mass = relative_air_mass(apparent_deg, cos_zenith) * pressure_pa / 101_325.0;
    let outside_w_m2 = extraterrestrial_w_m2(day);

    let fh1 = libm::exp(-elevation_m / 8000.0);
    let fh2 = libm::exp(-elevation_m / 1250.0);
    let cg1 = 5.09e-5 * elevation_m + 0.868;
    let cg2 = 3.92e-5 * elevation_m + 0.0387;
    let global_w_m2 =
        cg1 * outside_w_m2 * cos_zenith * libm::exp(-cg2 * air_mass * (fh1 + fh2 * (linke - 1.0)));
    let b = 0.664 + 0.163 / fh1;
    let beam_w_m2 = outside_w_m2 * (b * libm::exp(-0.09 * air_mass * (linke - 1.0))).max(0.0);
    // The empirical correction keeps the beam below the global irradiance.
    let share = (1.0 - (0.1 - 0.2 * libm::exp(-linke)) / (0.1 + 0.882 / fh1)) / cos_zenith;
    beam_w_m2.min(global_w_m2 * share.clamp(0.0, 1e20))
}

/// Linke turbidity of a day from the values of the months, linear between their middles, as
/// pvlib's `_interpolate_turbidity` does.
pub(super) fn linke_of_day(monthly: &[f64; 12], year: i32, day: u32) -> f64 {
    let middle = |month: usize| -> f64 {
        let first = (0..days_in_year(year))
            .find(|&d| date_of_day(year, d).0 as usize == month + 1)
            .unwrap_or(0);
        let length = (first..days_in_year(year))
            .take_while(|&d| date_of_day(year, d).0 as usize == month + 1)
            .count();
        f64::from(first) + length as f64 / 2.0
    };
    let year_days = f64::from(days_in_year(year));
    let at = f64::from(day) + 1.0;
    let (month, _) = date_of_day(year, day);
    let here = month as usize - 1;
    let (left, right) =
        if at < middle(here) { ((here + 11) % 12, here) } else { (here, (here + 1) % 12) };
    let mut from = middle(left);
    let mut to = middle(right);
    if left > right {
        if here == right { from -= year_days } else { to += year_days }
    }
    let t = (at - from) / (to - from);
    monthly[left] + t * (monthly[right] - monthly[left])
}

/// Standard atmosphere, pvlib's `alt2pres`, Pa.
fn pressure_pa(elevation_m: f64) -> f64 {
    100.0 * libm::pow((44_331.514 - elevation_m) / 11_880.516, 1.0 / 0.190_263_2)
}

/// Atmospheric refraction, degrees: NREL's SPA, equation 42, at 12 degrees C.
fn refraction_deg(altitude_deg: f64, pressure_pa: f64) -> f64 {
    let phase = altitude_deg + 10.3 / (altitude_deg + 5.11);
    (pressure_pa / 100.0 / 1010.0) * (283.0 / (273.0 + 12.0)) * 1.02
        / (60.0 * libm::tan(phase.to_radians()))
}

/// Kasten and Young 1989, at sea level.
fn relative_air_mass(apparent_altitude_deg: f64, cos_zenith: f64) -> f64 {
    1.0 / (cos_zenith + 0.505_72 * libm::pow(6.079_95 + apparent_altitude_deg, -1.6364))
}

/// Spencer 1971 with a solar constant of 1366.1 W/m2, as pvlib's `get_extra_radiation`.
fn extraterrestrial_w_m2(day: u32) -> f64 {
    let b = 2.0 * PI / 365.0 * f64::from(day);
    let distance = 1.00011
        + 0.034221 * libm::cos(b)
        + 0.00128 * libm::sin(b)
        + 0.000719 * libm::cos(2.0 * b)
        + 7.7e-5 * libm::sin(2.0 * b);
    1366.1 * distance
}

#[cfg(test)]
mod tests {
    use super::*;

    /// pvlib 0.16.1: `pvlib.clearsky._interpolate_turbidity(months, times)`.
    #[test]
    fn turbidity_between_the_months_is_pvlibs() {
        let months = [2.6, 2.9, 3.1, 3.4, 3.6, 3.8, 3.9, 3.7, 3.3, 3.0, 2.7, 2.5];
        for (year, day, theirs) in [
            (2018, 0, 2.553225806451613),
            (2018, 15, 2.6050847457627118),
            (2018, 16, 2.6152542372881356),
            (2018, 58, 2.9949152542372883),
            (2018, 184, 3.862295081967213),
            (2018, 349, 2.5016129032258063),
            (2018, 364, 2.55),
            (2024, 59, 2.9966666666666666),
            (2024, 365, 2.55),
        ] {
            let ours = linke_of_day(&months, year, day);
            assert!((ours - theirs).abs() < 1e-12, "{year} day {day}: {ours}, pvlib {theirs}");
        }
    }
}
