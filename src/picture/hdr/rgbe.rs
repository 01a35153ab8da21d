/// A colour from its shared-exponent form: `(mantissa + 0.5) * 2^(exponent - 136)`; exponent 0
/// is exactly black (Radiance's `colr_color`).
pub fn color_from_rgbe([r, g, b, e]: [u8; 4]) -> [f32; 3] {
    if e == 0 {
        return [0.0; 3];
    }
    let unit = libm::ldexp(1.0, i32::from(e) - 136);
    [r, g, b].map(|m| ((f64::from(m) + 0.5) * unit) as f32)
}

/// The shared-exponent form of a colour: mantissas are cut, not rounded (Radiance's `setcolr`),
/// because reading adds a half. Negative values and NaN become 0; what is too large becomes the
/// largest number. The error is at most 1/256 of the largest channel.
pub fn rgbe_from_color(color: [f32; 3]) -> [u8; 4] {
    let color = color.map(|v| if v > 0.0 { f64::from(v).min(1.7e38) } else { 0.0 });
    let largest = color[0].max(color[1]).max(color[2]);
    if largest <= 1e-32 {
        return [0; 4];
    }
    let (fraction, exponent) = libm::frexp(largest);
    let scale = fraction * 256.0 / largest;
    let [r, g, b] = color.map(|v| (v * scale).clamp(0.0, 255.0) as u8);
    // 1e-32 < largest <= 1.7e38 keeps exponent + 128 within 22 and 255.
    [r, g, b, (exponent + 128).clamp(1, 255) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_normal_pixel_survives_a_round_trip() {
        // Normal: the largest mantissa has its upper bit, as everything that was written has.
        for e in (24..=254).step_by(5) {
            for m in 128..=255u8 {
                for other in [0, 1, 77, 127, m] {
                    let pixel = [other, m, other / 2, e];
                    assert_eq!(rgbe_from_color(color_from_rgbe(pixel)), pixel);
                }
            }
        }
    }

    #[test]
    fn the_error_stays_below_the_format_s_precision() {
        let mut value = 1.3e-30f32;
        while value < 1e37 {
            for color in [[value; 3], [value, value * 0.3, 0.0], [0.0, value * 0.01, value]] {
                let back = color_from_rgbe(rgbe_from_color(color));
                let largest = color[0].max(color[1]).max(color[2]);
                for (a, b) in color.into_iter().zip(back) {
                    assert!((a - b).abs() <= largest / 255.9, "{color:?} became {back:?}");
                }
            }
            value *= 1.37;
        }
    }

    #[test]
    fn what_has_no_form_becomes_the_nearest() {
        assert_eq!(rgbe_from_color([0.0, -1.0, f32::NAN]), [0; 4]);
        let huge = color_from_rgbe(rgbe_from_color([f32::INFINITY, f32::MAX, 1.0]));
        assert!(huge.iter().all(|v| v.is_finite()) && huge[0] > 1e38);
    }
}
