/// Share of unpolarised light that a smooth interface reflects, from air (index 1) to a
/// dielectric of `index`: Fresnel's equations, exact. `cos` is the incident cosine, 0..1.
#[inline]
pub fn reflectance(cos: f64, index: f64) -> f64 {
    let cos = cos.clamp(0.0, 1.0);
    let sin2_inside = (1.0 - cos * cos) / (index * index);
    let inside = (1.0 - sin2_inside).max(0.0).sqrt();
    let across = (cos - index * inside) / (cos + index * inside);
    let parallel = (index * cos - inside) / (index * cos + inside);
    0.5 * (across * across + parallel * parallel)
}

/// Mean of the reflectance over a hemisphere of even radiance, `2 integral F cos dcos`.
#[cfg(test)]
pub(super) fn diffuse_mean(index: f64) -> f64 {
    const STEPS: u32 = 20_000;
    let sum: f64 = (0..STEPS)
        .map(|i| {
            let cos = (f64::from(i) + 0.5) / f64::from(STEPS);
            reflectance(cos, index) * cos
        })
        .sum();
    2.0 * sum / f64::from(STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(degrees: f64) -> f64 {
        reflectance(libm::cos(degrees.to_radians()), 1.52)
    }

    #[test]
    fn glass_reflects_what_the_textbooks_say() {
        let normal = (0.52_f64 / 2.52) * (0.52 / 2.52);
        assert!((at(0.0) - normal).abs() < 1e-15);
        assert!((at(0.0) - 0.0426).abs() < 1e-4);
        assert!((at(75.0) - 0.2567).abs() < 1e-3, "{}", at(75.0));
        assert!((at(85.0) - 0.613).abs() < 2e-3, "{}", at(85.0));
        assert!((at(90.0) - 1.0).abs() < 1e-12);
        // Brewster's angle: only the perpendicular half, ((n2 - 1) / (n2 + 1))^2 / 2.
        let n2 = 1.52 * 1.52;
        let brewster = libm::atan(1.52).to_degrees();
        let half = (n2 - 1.0) / (n2 + 1.0);
        assert!((at(brewster) - 0.5 * half * half).abs() < 1e-12);
    }

    #[test]
    fn grows_with_the_angle_for_every_index_that_models_accept() {
        for step in 0..=199 {
            let index = 1.01 + 0.01 * f64::from(step);
            let mut last = reflectance(1.0, index);
            for i in 1..=9000 {
                let now = reflectance(libm::cos((f64::from(i) * 0.01).to_radians()), index);
                assert!(now >= last - 1e-12, "index {index} at {}", f64::from(i) * 0.01);
                last = now;
            }
        }
    }

    #[test]
    fn the_diffuse_mean_is_the_known_one() {
        // Duntley / Judd: 0.0918 for 1.5.
        assert!((diffuse_mean(1.5) - 0.0918).abs() < 2e-4, "{}", diffuse_mean(1.5));
    }
}
