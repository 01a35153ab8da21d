//! From a value to a place on a palette, and the ticks of the legend.

use super::{Error, Palette};
use crate::base::Grid;

/// How values are spread over the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    /// Evenly between the scale's ends.
    Linear,
    /// By their logarithm.
    Logarithmic,
    /// Around 1, which takes the middle: below it evenly from 0, above it evenly to the maximum.
    Ratio,
}

/// What becomes of values between 0 and the lower end of a scale. Exactly 0 is always
/// transparent: nothing arrives there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below {
    /// The lowest colour.
    Lowest,
    /// The lowest colour, thin.
    Faint,
    /// No colour.
    Transparent,
}

/// A falsecolour scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// How values are spread.
    pub spread: Spread,
    /// Value of the palette's lower end.
    pub min: f64,
    /// Value of the palette's upper end.
    pub max: f64,
    /// Unit as people write it (`Wh/m²`), may be empty.
    pub unit: String,
    /// The colours.
    pub palette: Palette,
    /// What becomes of values below `min`.
    pub below: Below,
    /// Number of equal parts that the legend marks (Radiance's `-n`); `None`: round numbers.
    pub divisions: Option<usize>,
}

/// A mark on the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Place between 0 and 1.
    pub position: f64,
    /// The value there.
    pub value: f64,
    /// The value as people write it, without unit.
    pub label: String,
}

impl Scale {
    /// 0 to `max`, evenly.
    pub fn linear(max: f64, unit: &str) -> Self {
        Self {
            spread: Spread::Linear,
            min: 0.0,
            max,
            unit: unit.to_owned(),
            palette: Palette::Plasma,
            below: Below::Lowest,
            divisions: None,
        }
    }

    /// The last `decades` decades below `max`.
    pub fn logarithmic(max: f64, decades: f64, unit: &str) -> Self {
        Self {
            spread: Spread::Logarithmic,
            min: round_digits(max / libm::pow(10.0, decades), 9),
            below: Below::Faint,
            ..Self::linear(max, unit)
        }
    }

    /// A scale for pictures that are to be compared: up to `max`, or else to a round number that
    /// 99.9 % of their values don't exceed; logarithmic where a number of decades is given.
    pub fn fitted<'a>(
        grids: impl IntoIterator<Item = &'a Grid<f32>>,
        max: Option<f64>,
        decades: Option<f64>,
        unit: &str,
    ) -> Self {
        let max = max.unwrap_or_else(|| nice_ceiling(percentile(grids, 0.999)));
        match decades {
            Some(decades) => Self::logarithmic(max, decades, unit),
            None => Self::linear(max, unit),
        }
    }

    /// [`Self::ratio`] up to `max`, or else to a round number that 99.9 % of the values don't
    /// exceed, at least 2.
    pub fn fitted_ratio<'a>(
        grids: impl IntoIterator<Item = &'a Grid<f32>>,
        max: Option<f64>,
    ) -> Self {
        Self::ratio(max.unwrap_or_else(|| nice_ceiling(percentile(grids, 0.999)).max(2.0)))
    }

    /// 0 to `max` (1.1 at least) with 1 in the middle, blue below and yellow to red above.
    pub fn ratio(max: f64) -> Self {
        let max = max.max(1.1);
        Self { spread: Spread::Ratio, palette: Palette::Diverging, ..Self::linear(max, "") }
    }

    /// Whether the scale can be used.
    ///
    /// # Errors
    /// [`Error::Setting`] where an end is not finite, the ends are not in order, a logarithmic
    /// scale begins at 0, a ratio ends below 1.1, or there are more than 50 divisions.
    pub fn check(&self) -> Result<(), Error> {
        let wrong = |what: &str| {
            Err(Error::Setting {
                option: "scale",
                value: format!("{} to {}", self.min, self.max),
                what: what.into(),
            })
        };
        if !(self.min.is_finite() && self.max.is_finite() && self.max - self.min > 0.0) {
            return wrong("expected two finite numbers, the larger one last");
        }
        if self.divisions.is_some_and(|n| !(1..=50).contains(&n)) {
            return wrong("expected 1 to 50 divisions");
        }
        match self.spread {
            Spread::Linear => Ok(()),
            Spread::Logarithmic if self.min > 0.0 => Ok(()),
            Spread::Logarithmic => wrong("a logarithmic scale begins above 0"),
            Spread::Ratio if self.min == 0.0 && self.max >= 1.1 => Ok(()),
            Spread::Ratio => wrong("a ratio goes from 0 to 1.1 or more"),
        }
    }

    /// The place of a value on the palette, 0 to 1, clamped.
    pub fn position(&self, value: f64) -> f64 {
        let place = match self.spread {
            Spread::Linear => (value - self.min) / (self.max - self.min),
            Spread::Logarithmic if value <= self.min => 0.0,
            Spread::Logarithmic => libm::log(value / self.min) / libm::log(self.max / self.min),
            Spread::Ratio if value <= 1.0 => 0.5 * value,
            Spread::Ratio => 0.5 + 0.5 * (value - 1.0) / (self.max - 1.0),
        };
        if place > 0.0 { place.min(1.0) } else { 0.0 }
    }

    /// The value at a place on the palette.
    pub fn value(&self, position: f64) -> f64 {
        let t = position.clamp(0.0, 1.0);
        match self.spread {
            Spread::Linear => self.min + t * (self.max - self.min),
            Spread::Logarithmic => self.min * libm::pow(self.max / self.min, t),
            Spread::Ratio if t <= 0.5 => 2.0 * t,
            Spread::Ratio => 1.0 + (2.0 * t - 1.0) * (self.max - 1.0),
        }
    }

    /// The colour of a value, whatever its opacity.
    pub fn color(&self, value: f64) -> [u8; 3] {
        self.palette.color(self.position(value))
    }

    /// How much of the colour shows: 0 for exactly 0, NaN and, as chosen, values below the
    /// scale.
    pub fn opacity(&self, value: f64) -> f64 {
        if value == 0.0 || value.is_nan() {
            return 0.0;
        }
        match self.below {
            Below::Lowest => 1.0,
            _ if value >= self.min => 1.0,
            Below::Faint => 0.35,
            Below::Transparent => 0.0,
        }
    }

    /// The marks of the legend, rising: round numbers (or the given number of equal parts).
    pub fn ticks(&self) -> Vec<Tick> {
        if self.check().is_err() {
            return Vec::new();
        }
        let values = match (self.divisions, self.spread) {
            (Some(n), _) => {
                (0..=n).map(|i| round_digits(self.value(i as f64 / n as f64), 3)).collect()
            }
            (None, Spread::Linear) => linear_ticks(self.min, self.max, 7.0),
            (None, Spread::Logarithmic) => log_ticks(self.min, self.max),
            (None, Spread::Ratio) => {
                let mut values = vec![0.0, 0.25, 0.5, 0.75];
                values.extend(ratio_ticks(self.max));
                values
            }
        };
        values
            .into_iter()
            .map(|value| Tick { position: self.position(value), value, label: format_value(value) })
            .collect()
    }
}

/// The end of a scale that fits values: the smallest of 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times
/// a power of ten that is not below `value`; 1 for what is not positive.
pub fn nice_ceiling(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let exponent = libm::floor(libm::log10(value)) as i32;
    for exponent in [exponent - 1, exponent, exponent + 1] {
        for digits in [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0] {
            let candidate = round_digits(digits * power_of_ten(exponent), 2);
            if candidate >= value {
                return candidate;
            }
        }
    }
    value
}

/// The value that a share (0 to 1) of all positive values does not exceed; 0 where there is none.
/// Used to choose one scale for several pictures: single hot pixels don't decide.
pub fn percentile<'a>(grids: impl IntoIterator<Item = &'a Grid<f32>>, share: f64) -> f64 {
    let mut values: Vec<f32> = grids
        .into_iter()
        .flat_map(|grid| grid.data().iter().copied())
        .filter(|v| *v > 0.0 && v.is_finite())
        .collect();
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * share.clamp(0.0, 1.0)) as usize;
    let (_, value, _) = values.select_nth_unstable_by(at, f32::total_cmp);
    f64::from(*value)
}

/// A number as people write it: up to six digits, thousands apart from 10 000 on, powers of ten
/// beyond a million and below a thousandth.
pub fn format_value(value: f64) -> String {
    let value = round_digits(value, 6);
    let magnitude = value.abs();
    let sign = if value < 0.0 { "−" } else { "" };
    if magnitude == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e7).contains(&magnitude) {
        let text = format!("{magnitude:e}");
        let Some((digits, exponent)) = text.split_once('e') else { return text };
        let raised: String = exponent
            .chars()
            .map(|c| match c {
                '-' => '⁻',
                '1' => '¹',
                '2' => '²',
                '3' => '³',
                c => c.to_digit(10).and_then(|d| char::from_u32(0x2070 + d)).unwrap_or(c),
            })
            .collect();
        let factor = if digits == "1" { String::new() } else { format!("{digits}×") };
        return format!("{sign}{factor}10{raised}");
    }
    let text = format!("{magnitude}");
    let (whole, rest) = match text.split_once('.') {
        Some((whole, rest)) => (whole, format!(".{rest}")),
        None => (text.as_str(), String::new()),
    };
    let mut grouped = String::new();
    for (at, digit) in whole.chars().enumerate() {
        if whole.len() > 4 && at > 0 && (whole.len() - at).is_multiple_of(3) {
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    format!("{sign}{grouped}{rest}")
}

/// Rounds to significant decimal digits, to the double that is nearest to that decimal.
fn round_digits(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

fn power_of_ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::MAX)
}

/// The step 1, 2, 2.5 or 5 times a power of ten that parts `length` into at most `most` pieces.
pub(super) fn nice_step(length: f64, most: f64) -> f64 {
    let least = length / most;
    let exponent = libm::floor(libm::log10(least)) as i32;
    for exponent in [exponent - 1, exponent, exponent + 1] {
        for digits in [1.0, 2.0, 2.5, 5.0] {
            let step = round_digits(digits * power_of_ten(exponent), 2);
            if step >= least * (1.0 - 1e-9) {
                return step;
            }
        }
    }
    least
}

fn linear_ticks(min: f64, max: f64, most: f64) -> Vec<f64> {
    let step = nice_step(max - min, most);
    let first = libm::ceil(min / step - 1e-9);
    let last = libm::floor(max / step + 1e-9);
    let count = (last - first).clamp(0.0, 100.0) as usize;
    (0..=count).map(|i| round_digits((first + i as f64) * step, 9)).collect()
}

fn ratio_ticks(max: f64) -> Vec<f64> {
    let mut out = vec![1.0];
    out.extend(linear_ticks(1.0, max, 4.0).into_iter().filter(|v| *v > 1.0));
    // A step that doesn't meet 1 must not crowd it.
    out.retain(|v| *v == 1.0 || (v - 1.0) / (max - 1.0) > 0.12);
    out
}

fn log_ticks(min: f64, max: f64) -> Vec<f64> {
    let decades = libm::log10(max / min);
    if decades < 0.7 {
        return linear_ticks(min, max, 6.0).into_iter().filter(|v| *v > 0.0).collect();
    }
    let digits: &[f64] = match decades {
        d if d <= 2.2 => &[1.0, 2.0, 5.0],
        d if d <= 4.2 => &[1.0, 3.0],
        _ => &[1.0],
    };
    let every = if decades > 9.0 { libm::ceil(decades / 8.0) as i32 } else { 1 };
    let (first, last) = (libm::floor(libm::log10(min)) as i32, libm::ceil(libm::log10(max)) as i32);
    let mut out = Vec::new();
    for exponent in (first..=last).filter(|e| e.rem_euclid(every) == 0) {
        for digit in digits {
            let value = round_digits(digit * power_of_ten(exponent), 2);
            if value >= min * (1.0 - 1e-9) && value <= max * (1.0 + 1e-9) {
                out.push(value);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads a label back as a reader would.
    fn parse(label: &str) -> f64 {
        let plain: String = label.replace('\u{202f}', "").replace('−', "-");
        let Some((digits, raised)) = plain.split_once("10").filter(|(d, r)| {
            (d.is_empty() || d.ends_with('×'))
                && !r.is_empty()
                && r.chars().all(|c| "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".contains(c))
        }) else {
            return plain.parse().expect("a number");
        };
        let exponent: String = raised
            .chars()
            .map(|c| {
                if c == '⁻' {
                    '-'
                } else {
                    "⁰¹²³⁴⁵⁶⁷⁸⁹"
                        .chars()
                        .position(|r| r == c)
                        .map_or('?', |d| (b'0' + d as u8) as char)
                }
            })
            .collect();
        let digits = digits.trim_end_matches('×');
        let digits = if digits.is_empty() { "1" } else { digits };
        format!("{digits}e{exponent}").parse().expect("a number")
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn ticks_rise_lie_on_the_scale_and_say_what_they_mean(
            exponent in -9i32..12, digits in 1.0f64..10.0, decades in 0.2f64..12.0, kind in 0..3,
        ) {
            let max = digits * libm::pow(10.0, f64::from(exponent));
            let scale = match kind {
                0 => Scale::linear(max, "W/m²"),
                1 => Scale::logarithmic(max, decades, "W/m²"),
                _ => Scale::ratio(1.0 + max),
            };
            let ticks = scale.ticks();
            prop_assert!((2..=14).contains(&ticks.len()), "{} ticks", ticks.len());
            for pair in ticks.windows(2) {
                prop_assert!(pair[0].value < pair[1].value);
                prop_assert!(pair[1].position - pair[0].position > 0.02, "{pair:?}");
                prop_assert!(pair[0].label != pair[1].label);
            }
            for tick in &ticks {
                prop_assert!((scale.min * 0.999_999..=scale.max * 1.000_001).contains(&tick.value));
                let read = parse(&tick.label);
                prop_assert!((read - tick.value).abs() <= 1e-5 * tick.value.abs(), "{tick:?}");
                prop_assert!((scale.value(tick.position) - tick.value).abs() <= 1e-6 * scale.max);
                // Round: at most three digits.
                let text = format!("{:e}", tick.value);
                let digits = text.split('e').next().unwrap_or("").replace(['.', '-'], "");
                prop_assert!(digits.len() <= 3 || kind == 2, "{tick:?}");
            }
        }

        #[test]
        fn positions_are_monotone_and_invert(a in 0.0f64..1.0, b in 0.0f64..1.0, kind in 0..3) {
            let scale = match kind {
                0 => Scale::linear(730.0, ""),
                1 => Scale::logarithmic(730.0, 3.0, ""),
                _ => Scale::ratio(4.0),
            };
            prop_assert!((scale.position(scale.value(a)) - a).abs() < 1e-9);
            prop_assert!((scale.value(a) < scale.value(b)) == (a < b) || (a - b).abs() < 1e-12);
        }

        #[test]
        fn nice_ceilings_are_just_above(exponent in -12i32..12, digits in 1.0f64..10.0) {
            let value = digits * libm::pow(10.0, f64::from(exponent));
            let nice = nice_ceiling(value);
            prop_assert!(nice >= value && nice <= value * 1.34, "{value} {nice}");
        }
    }

    #[test]
    fn zero_is_transparent_and_the_range_below_as_chosen() {
        let mut scale = Scale::logarithmic(3000.0, 3.0, "Wh/m²");
        assert_eq!(scale.min, 3.0);
        assert_eq!([0.0, 1.0, 3.0].map(|v| scale.opacity(v)), [0.0, 0.35, 1.0]);
        scale.below = Below::Transparent;
        assert_eq!([0.0, 1.0, 3.0, f64::NAN].map(|v| scale.opacity(v)), [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(Scale::linear(10.0, "").opacity(1e-30), 1.0);
    }

    #[test]
    fn numbers_are_written_as_people_do() {
        let cases = [
            (0.0, "0"),
            (3000.0, "3000"),
            (30000.0, "30\u{202f}000"),
            (2.5, "2.5"),
            (0.30000000000000004, "0.3"),
            (-1.5, "−1.5"),
            (1e7, "10⁷"),
            (2.5e-5, "2.5×10⁻⁵"),
            (1_234_567.0, "1\u{202f}234\u{202f}570"),
        ];
        for (value, text) in cases {
            assert_eq!(format_value(value), text);
        }
    }

    #[test]
    fn unusable_scales_are_refused_and_have_no_ticks() {
        let wrong = [
            Scale::linear(0.0, ""),
            Scale::linear(f64::NAN, ""),
            Scale { max: 1.0, ..Scale::ratio(2.0) },
            Scale { min: 0.0, ..Scale::logarithmic(1.0, 2.0, "") },
            Scale { divisions: Some(0), ..Scale::linear(1.0, "") },
        ];
        for scale in wrong {
            assert!(scale.check().is_err(), "{scale:?}");
            assert!(scale.ticks().is_empty());
        }
    }

    #[test]
    fn the_percentile_ignores_what_is_not_lit() {
        let a = Grid::from_vec(5, 1, vec![0.0, 1.0, 2.0, f32::NAN, 3.0]);
        let b = Grid::from_vec(2, 1, vec![4.0, 5.0]);
        assert_eq!(percentile([&a, &b], 1.0), 5.0);
        assert_eq!(percentile([&a, &b], 0.5), 3.0);
        assert_eq!(percentile([&Grid::filled(2, 2, 0.0)], 0.5), 0.0);
    }
}
