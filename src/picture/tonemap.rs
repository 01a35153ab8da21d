//! From linear light to a picture for the screen: exposure from the picture itself, a soft
//! shoulder, the sRGB curve. No radiometric meaning is left.

use super::channels::{Rgb, luminance};
use super::scale::percentile;
use crate::base::Grid;

/// Share of the lit pixels that lie below white.
const WHITE_SHARE: f64 = 0.98;

/// How a picture is exposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// From the picture: the brightest two per cent of what is lit turn white.
    Auto,
    /// A factor on the values; 1 is white before the shoulder.
    Factor(f64),
}

/// Maps to 8-bit sRGB; `grey` drops the colours.
pub fn tonemap(picture: &Rgb, exposure: Exposure, grey: bool) -> Grid<[u8; 3]> {
    let factor = match exposure {
        Exposure::Factor(factor) => factor,
        Exposure::Auto => {
            let brightness = picture.map(|&p| luminance(p));
            let white = percentile([&brightness], WHITE_SHARE);
            if white > 0.0 { 1.0 / white } else { 1.0 }
        }
    };
    picture.map(|&pixel| {
        let pixel = if grey { [luminance(pixel); 3] } else { pixel };
        if pixel[0] == pixel[1] && pixel[1] == pixel[2] {
            return [byte(srgb(shoulder(f64::from(pixel[0]) * factor))); 3];
        }
        pixel.map(|v| byte(srgb(shoulder(f64::from(v) * factor))))
    })
}

/// Linear light from 0 to 1 as 8-bit sRGB, without any exposure.
pub fn encode(linear: f32) -> u8 {
    byte(srgb(f64::from(linear)))
}

/// Linear light of an 8-bit sRGB value: the inverse of [`encode`].
pub fn decode(value: u8) -> f32 {
    let v = f64::from(value) / 255.0;
    (if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }) as f32
}

/// Narkowicz's fit to the ACES film curve (2015), scaled so that 1 becomes 1 exactly.
fn shoulder(x: f64) -> f64 {
    let film = |x: f64| (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);
    // The middle is lifted by a half before: plans are mostly diffuse surfaces of one brightness.
    let x = if x > 0.0 { x.min(1e6) } else { 0.0 };
    film(1.5 * x) / film(1.5)
}

fn srgb(linear: f64) -> f64 {
    if linear > 0.003_130_8 {
        1.055 * libm::pow(linear.min(1.0), 1.0 / 2.4) - 0.055
    } else {
        12.92 * linear.max(0.0)
    }
}

fn byte(v: f64) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_a_round_trip() {
        for value in 0..=255 {
            assert_eq!(encode(decode(value)), value);
        }
    }

    #[test]
    fn brighter_stays_brighter_and_scaling_changes_nothing() {
        let ramp: Rgb = Grid::from_vec(200, 1, (0..200).map(|i| [i as f32; 3]).collect());
        let first = tonemap(&ramp, Exposure::Auto, false);
        assert!(first.data().windows(2).all(|w| w[0][0] <= w[1][0]));
        assert_eq!((first[(0, 0)][0], first[(199, 0)][0]), (0, 255));
        let scaled = tonemap(&ramp.map(|p| p.map(|v| v * 1024.0)), Exposure::Auto, false);
        assert_eq!(first, scaled);
    }

    #[test]
    fn strange_values_do_no_harm() {
        let strange = [f32::NAN, f32::INFINITY, -1.0, 0.0];
        let picture: Rgb = Grid::from_vec(4, 1, strange.map(|v| [v, 1.0, v]).to_vec());
        for grey in [true, false] {
            let _ = tonemap(&picture, Exposure::Auto, grey);
        }
        let black: Rgb = Grid::filled(2, 2, [0.0; 3]);
        assert_eq!(tonemap(&black, Exposure::Auto, true)[(0, 0)], [0; 3]);
    }
}
