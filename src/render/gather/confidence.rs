//! What the number of photons lets one say about thresholds.

/// How many standard errors a decision needs: 2 are right in 95 of 100 cases.
pub const DECIDED: f64 = 2.0;

/// The irradiances between which noise decides whether a threshold is exceeded, W/m2: below the
/// first a pixel isn't above the threshold even with [`DECIDED`] standard errors added, above the
/// second it is even with them taken off.
///
/// A value E is made of `E / photon_w_m2` photons ([`super::series::Series::photon_w_m2`]), so its
/// standard error is `sqrt(E * photon_w_m2)`, and `E -+ c sqrt(E p) = threshold` has the roots
/// `(sqrt(t + q) -+ sqrt(q))^2` with `q = p c^2 / 4`.
pub fn undecided(threshold_w_m2: f64, photon_w_m2: f32) -> (f32, f32) {
    let q = f64::from(photon_w_m2) * DECIDED * DECIDED / 4.0;
    let (far, near) = ((threshold_w_m2 + q).sqrt(), q.sqrt());
    let square = |v: f64| (v * v) as f32;
    (square(far - near), square(far + near))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_borders_are_two_standard_errors_from_the_threshold() {
        for (threshold, photon) in [(10.0f64, 0.5f32), (30.0, 7.0), (0.5, 100.0), (0.0, 1.0)] {
            let (low, high) = undecided(threshold, photon);
            let error = |e: f32| (f64::from(e) * f64::from(photon)).sqrt();
            let close = |a: f64| assert!((a - threshold).abs() < 1e-4 * threshold.max(1.0), "{a}");
            close(f64::from(low) + 2.0 * error(low));
            close(f64::from(high) - 2.0 * error(high));
        }
        assert_eq!(undecided(10.0, 0.0), (10.0, 10.0), "without noise all is decided");
    }
}
