//! A time series with fewer bits of mantissa: it compresses better, and the largest relative error
//! is known.

use crate::base::limits::EXACT_MANTISSA_BITS;
use crate::base::{SeriesEntry, SinkError, TileRect, TileSink};

/// Hands a series on with its numbers rounded: whatever made them (photons, direct integration)
/// and wherever they go (a volume, an analysis that keeps none), they are the same.
pub struct Rounded<'a> {
    sink: &'a dyn TileSink,
    mantissa_bits: u32,
}

impl<'a> Rounded<'a> {
    /// `mantissa_bits`: how many are kept, 1 to 23 (all).
    pub fn new(sink: &'a dyn TileSink, mantissa_bits: u32) -> Self {
        Self { sink, mantissa_bits }
    }

    /// The largest relative error of a number, in words; `None` where all bits are kept.
    pub fn largest_relative_error(mantissa_bits: u32) -> Option<String> {
        (mantissa_bits < EXACT_MANTISSA_BITS).then(|| format!("2^-{}", mantissa_bits + 1))
    }
}

impl TileSink for Rounded<'_> {
    fn has(&self, tile: TileRect) -> bool {
        self.sink.has(tile)
    }

    fn put(&self, tile: TileRect, entries: &[SeriesEntry]) -> Result<(), SinkError> {
        if self.mantissa_bits >= EXACT_MANTISSA_BITS {
            return self.sink.put(tile, entries);
        }
        let rounded: Vec<SeriesEntry> = entries
            .iter()
            .map(|e| SeriesEntry {
                irradiance_w_m2: rounded(e.irradiance_w_m2, self.mantissa_bits),
                ..*e
            })
            .collect();
        self.sink.put(tile, &rounded)
    }

    fn note(&self, tile: TileRect, numbers: &[f32]) -> Result<(), SinkError> {
        self.sink.note(tile, numbers)
    }

    fn noted(&self, tile: TileRect) -> Option<Vec<f32>> {
        self.sink.noted(tile)
    }
}

/// A number with fewer bits of mantissa, to the nearest, ties to even.
fn rounded(value: f32, mantissa_bits: u32) -> f32 {
    let drop = EXACT_MANTISSA_BITS.saturating_sub(mantissa_bits);
    if drop == 0 || !value.is_finite() {
        return value;
    }
    let bits = value.to_bits();
    let half = (1 << (drop - 1)) - 1 + (bits >> drop & 1);
    f32::from_bits((bits + half) >> drop << drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_bits_err_by_no_more_than_is_said() {
        for bits in [1, 7, 12, 22, 23] {
            let mut worst = 0.0f64;
            for i in 1..20_000u32 {
                let exact = i as f32 * 0.37;
                let found = rounded(exact, bits);
                worst = worst.max((f64::from(found) / f64::from(exact) - 1.0).abs());
                assert_eq!(found.to_bits() & ((1 << (EXACT_MANTISSA_BITS - bits)) - 1), 0);
            }
            let most = libm::exp2(-f64::from(bits) - 1.0);
            assert!(worst <= most, "{bits}: {worst}");
            assert!(bits == 23 || worst > 0.5 * most, "{bits}: {worst}");
        }
        assert_eq!(rounded(0.0, 5).to_bits(), 0);
        assert_eq!(rounded(f32::MAX, 5), f32::INFINITY);
    }
}
