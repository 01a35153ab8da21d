//! From a position between 0 and 1 to a colour.

use super::Error;

/// A ramp of colours. The first five are tables of 17 colours of published maps, read with linear
/// interpolation; the next four are the formulas of Radiance's `falsecolor`, in display values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Palette {
    /// Blue over magenta and orange to yellow, lightness rises evenly; saturated throughout, so
    /// that no colour is taken for the grey of a background. By N. Smith and S. van der Walt
    /// (matplotlib, CC0). The default, and what Radiance's name `def` means here.
    Plasma,
    /// Black over red to pale yellow (Smith and van der Walt, CC0).
    Inferno,
    /// Violet over green to yellow (Smith, van der Walt and E. Firing, CC0).
    Viridis,
    /// Blue to yellow, the same for people with red-green blindness (Nuñez, Anderton and Renslow,
    /// PLOS ONE 13(7), 2018).
    Cividis,
    /// A rainbow with even steps; not for red-green blindness (A. Mikhailov, Google, 2019,
    /// Apache-2.0).
    Turbo,
    /// Radiance's old spectrum.
    Spectral,
    /// Black over red and yellow to white.
    Hot,
    /// Gnuplot's black, blue, red, yellow.
    Pm3d,
    /// Blue over dark to yellow.
    Eco,
    /// Grey.
    Grey,
    /// Diverging: blue below the middle, near white in the middle, yellow to red above it. Its
    /// lightness falls on both sides, blue against yellow stays apart in every common colour
    /// blindness.
    Diverging,
}

const PLASMA: [u32; 17] = [
    0x0d0887, 0x310597, 0x4c02a1, 0x6600a7, 0x7e03a8, 0x9511a1, 0xaa2395, 0xbc3587, 0xcc4778,
    0xd9586a, 0xe56b5d, 0xf07f4f, 0xf89441, 0xfdab33, 0xfdc328, 0xf9dd25, 0xf0f921,
];
const INFERNO: [u32; 17] = [
    0x000004, 0x0b0724, 0x210c4a, 0x3d0965, 0x57106e, 0x71196e, 0x8a226a, 0xa32c61, 0xbc3754,
    0xd04545, 0xe35933, 0xf1711f, 0xf98c0a, 0xfcaa0f, 0xf9c932, 0xf2e865, 0xfcffa4,
];
const VIRIDIS: [u32; 17] = [
    0x440154, 0x48186a, 0x472d7b, 0x424086, 0x3b528b, 0x33638d, 0x2c728e, 0x26828e, 0x21918c,
    0x1f9f88, 0x27ad81, 0x3dbc74, 0x5cc863, 0x81d34d, 0xaadc32, 0xd5e21a, 0xfde725,
];
const CIVIDIS: [u32; 17] = [
    0x00224e, 0x002e6a, 0x1a386f, 0x32436d, 0x434e6c, 0x535a6d, 0x61656f, 0x6f7073, 0x7d7c78,
    0x8b8778, 0x9a9376, 0xaaa073, 0xbbad6d, 0xccba64, 0xddc858, 0xefd748, 0xfee838,
];
const TURBO: [u32; 17] = [
    0x30123b, 0x4040a2, 0x466be3, 0x4294ff, 0x28bceb, 0x18ddc2, 0x32f298, 0x6dfe62, 0xa4fc3c,
    0xcbed34, 0xecd13a, 0xfdae35, 0xfb8122, 0xec530f, 0xd23105, 0xac1701, 0x7a0403,
];
/// Own choice: the two halves mirror each other in lightness (within some percent).
const DIVERGING: [u32; 9] =
    [0x0b2f8a, 0x2a62c9, 0x6fa3e6, 0xb9d3ee, 0xf3f1e8, 0xfbdf86, 0xf6a63f, 0xdd5f22, 0xa3141b];

impl Palette {
    /// All palettes with the names that `-pal` takes.
    pub const NAMES: [(&'static str, Self); 12] = [
        ("plasma", Self::Plasma),
        ("def", Self::Plasma),
        ("inferno", Self::Inferno),
        ("viridis", Self::Viridis),
        ("cividis", Self::Cividis),
        ("turbo", Self::Turbo),
        ("spec", Self::Spectral),
        ("hot", Self::Hot),
        ("pm3d", Self::Pm3d),
        ("eco", Self::Eco),
        ("grey", Self::Grey),
        ("diverging", Self::Diverging),
    ];

    /// The palette of that name.
    ///
    /// # Errors
    /// [`Error::Setting`] with the names there are.
    pub fn parse(name: &str) -> Result<Self, Error> {
        Self::NAMES.iter().find(|(n, _)| *n == name).map(|(_, palette)| *palette).ok_or_else(|| {
            let names: Vec<_> = Self::NAMES.iter().map(|(n, _)| *n).collect();
            Error::Setting {
                option: "palette",
                value: name.to_owned(),
                what: format!("expected one of {}", names.join(", ")),
            }
        })
    }

    /// The colour at a position, 0 to 1 (clamped; NaN is taken for 0), as 8-bit display values.
    pub fn color(self, position: f64) -> [u8; 3] {
        let t = if position > 0.0 { position.min(1.0) } else { 0.0 };
        match self {
            Self::Plasma => interpolate(&PLASMA, t),
            Self::Inferno => interpolate(&INFERNO, t),
            Self::Viridis => interpolate(&VIRIDIS, t),
            Self::Cividis => interpolate(&CIVIDIS, t),
            Self::Turbo => interpolate(&TURBO, t),
            Self::Diverging => interpolate(&DIVERGING, t),
            // The formulas of spec are linear light, the others are raised to the display's gamma
            // by falsecolor itself, so they are display values here.
            Self::Spectral => {
                let green = if t > 0.375 { 1.6 - 1.6 * t } else { 8.0 / 3.0 * t };
                let linear = [1.6 * t - 0.6, green, 1.0 - 8.0 / 3.0 * t];
                display(linear.map(|v| libm::pow(v.clamp(0.0, 1.0), 1.0 / 2.2)))
            }
            Self::Hot => display([3.0 * t, 3.0 * t - 1.0, 3.0 * t - 2.0]),
            Self::Pm3d => display([t.sqrt(), t * t * t, libm::sin(2.0 * std::f64::consts::PI * t)]),
            Self::Eco => display([2.0 * t, 2.0 * (t - 0.5), 2.0 * (0.5 - t)]),
            Self::Grey => display([t; 3]),
        }
    }
}

fn display(rgb: [f64; 3]) -> [u8; 3] {
    rgb.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

fn interpolate(table: &[u32], t: f64) -> [u8; 3] {
    let place = t * (table.len() - 1) as f64;
    let low = (place as usize).min(table.len() - 2);
    let part = place - low as f64;
    let channel = |hex: u32, at: usize| f64::from(hex.to_be_bytes()[at + 1]);
    [0, 1, 2].map(|at| {
        let (a, b) = (channel(table[low], at), channel(table[low + 1], at));
        (a + (b - a) * part + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE L* of an sRGB colour.
    fn lightness(color: [u8; 3]) -> f64 {
        let linear = color.map(|c| {
            let v = f64::from(c) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
        });
        let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        if y > 0.008856 { 116.0 * libm::cbrt(y) - 16.0 } else { 903.3 * y }
    }

    #[test]
    fn sequential_palettes_grow_lighter_step_by_step() {
        use Palette::{Cividis, Grey, Hot, Inferno, Plasma, Viridis};
        for palette in [Plasma, Inferno, Viridis, Cividis, Hot, Grey] {
            let steps: Vec<f64> =
                (0..=64).map(|i| lightness(palette.color(f64::from(i) / 64.0))).collect();
            assert!(steps.windows(2).all(|w| w[1] > w[0]), "{palette:?} {steps:?}");
            assert!(steps[64] - steps[0] > 60.0, "{palette:?}");
        }
    }

    #[test]
    fn the_diverging_palette_is_lightest_in_the_middle_and_even_on_both_sides() {
        let at = |t: f64| lightness(Palette::Diverging.color(t));
        for i in 0..32 {
            let (a, b) = (f64::from(i) / 64.0, f64::from(i + 1) / 64.0);
            assert!(at(a) < at(b), "rises at {a}");
            assert!(at(1.0 - a) < at(1.0 - b), "falls at {}", 1.0 - a);
            assert!((at(a) - at(1.0 - a)).abs() < 14.0, "{a}: {} {}", at(a), at(1.0 - a));
        }
        let [r, _, b] = Palette::Diverging.color(0.2);
        assert!(b > r);
        let [r, _, b] = Palette::Diverging.color(0.7);
        assert!(r > b);
    }

    #[test]
    fn no_two_neighbouring_steps_of_any_palette_jump() {
        for (name, palette) in Palette::NAMES {
            // Roots start steeply: Radiance's spec and pm3d jump in their darkest colours.
            let steep = matches!(palette, Palette::Spectral | Palette::Pm3d);
            for i in 0..512 {
                let [a, b] = [i, i + 1].map(|i| palette.color(f64::from(i) / 512.0));
                let jump = a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max();
                assert!(steep || jump < Some(12), "{name} jumps at {i}: {a:?} {b:?}");
            }
            assert_eq!(palette.color(f64::NAN), palette.color(0.0));
            assert_eq!(palette.color(7.0), palette.color(1.0));
        }
    }

    #[test]
    fn unknown_names_are_answered_with_the_known() {
        let message = Palette::parse("rainbow").expect_err("unknown").to_string();
        assert!(message.contains("rainbow") && message.contains("plasma, def"), "{message}");
    }
}
