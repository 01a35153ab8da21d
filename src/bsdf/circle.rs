use glam::DVec3;

// Kernels of the FreeBSD msun library (k_sin.c, k_cos.c), accurate below 1e-15 on +-pi/4.
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Cosine and sine of `turns` full turns, `turns` in `[0, 1]`. A few multiplications instead of a
/// general argument reduction: every photon needs several of these. The same bits everywhere.
#[inline]
pub fn on_circle(turns: f64) -> (f64, f64) {
    let quarters = turns * 4.0;
    // Rounds to the nearest; `as` saturates, so that a wild argument is wrong, not undefined.
    let quarter = (quarters + 0.5) as i32;
    let x = (quarters - f64::from(quarter)) * std::f64::consts::FRAC_PI_2;
    let z = x * x;
    let sin = x + x
        * z
        * (SIN[0] + z * (SIN[1] + z * (SIN[2] + z * (SIN[3] + z * (SIN[4] + z * SIN[5])))));
    let cos = 1.0 - 0.5 * z
        + z * z * (COS[0] + z * (COS[1] + z * (COS[2] + z * (COS[3] + z * (COS[4] + z * COS[5])))));
    match quarter & 3 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// A direction of the upper hemisphere with density cos/pi, from two uniform numbers.
#[inline]
pub fn on_hemisphere(u: f64, v: f64) -> DVec3 {
    let (cos, sin) = on_circle(v);
    let radius = u.sqrt();
    DVec3::new(radius * cos, radius * sin, (1.0 - u).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm() {
        for i in 0..=100_000 {
            let turns = f64::from(i) / 100_000.0;
            let (cos, sin) = on_circle(turns);
            let angle = turns * std::f64::consts::TAU;
            assert!((cos - libm::cos(angle)).abs() < 1e-15, "cos of {turns}");
            assert!((sin - libm::sin(angle)).abs() < 1e-15, "sin of {turns}");
        }
    }
}
