//! Sums that don't depend on their order: what photons add to an irradiance, as integers.
//!
//! Pixels that share their candidates meet the same photons in another order than pixels that
//! search alone. Integers make both the same to the last bit. A value is rounded to
//! [`BITS`] bits below the largest that a store can hold, 3e-11 of it.

use crate::base::{Irradiance, MIN_COS};
use crate::pages::Store;

/// Bits of the largest value.
const BITS: i32 = 35;
/// Bits that squares lose before they are taken, so that millions of them fit.
const SQUARE_SHIFT: u32 = 17;

/// Added to a number, it leaves no room for a fraction: 1.5 times 2^52.
const TO_INTEGER: f64 = 6_755_399_441_055_744.0;

/// Photons in one sum at most: more would leave the 63 bits.
pub(in crate::render) const MOST_PHOTONS: usize = 1 << 22;

/// How values become integers: a power of two.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Scale {
    per_unit: f64,
}

impl Scale {
    /// For values up to `largest`.
    pub fn up_to(largest: f64) -> Self {
        if !(largest.is_finite() && largest > 0.0) {
            return Self { per_unit: 1.0 };
        }
        // frexp: largest < 2^exponent.
        let (_, exponent) = libm::frexp(largest);
        Self { per_unit: libm::ldexp(1.0, (BITS - exponent).clamp(-900, 900)) }
    }

    /// A value as an integer.
    pub fn integer(self, value: f64) -> i64 {
        // Clamped, because a store's header may promise less than its pages hold; clamping keeps
        // the NaN of a damaged store, which `as` makes 0 (`min` would make it the bound).
        let most = (1i64 << (BITS + 1)) as f64;
        let scaled = (value * self.per_unit).clamp(-most, most);
        // Rounds to the nearest, ties to even, without a call into the C library.
        ((scaled + TO_INTEGER) - TO_INTEGER) as i64
    }

    /// A sum of integers as a value.
    pub fn value(self, sum: i64) -> f64 {
        sum as f64 / self.per_unit
    }

    /// A sum of [`square`]s as the value's square.
    pub fn square_value(self, sum: i64) -> f64 {
        let unit = f64::from(1u32 << SQUARE_SHIFT) / self.per_unit;
        sum as f64 * unit * unit
    }
}

/// The square of an integer, in coarser units.
pub(in crate::render) fn square(integer: i64) -> i64 {
    let coarse = (integer + (1 << (SQUARE_SHIFT - 1))) >> SQUARE_SHIFT;
    coarse * coarse
}

/// What of a photon becomes irradiance.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Beam {
    pub flux_w: f32,
    /// Cosine of incidence.
    pub cos: f32,
    pub timestep: u32,
}

/// What photons add to E and E_n, as integers: flux in W times the weight of their timestep.
pub(in crate::render) struct Fluxes {
    pub surface: Scale,
    pub facing: Scale,
}

impl Fluxes {
    pub fn of(store: &Store, largest_weight: f64) -> Self {
        let largest = f64::from(store.info().flux_max_w) * largest_weight;
        Self { surface: Scale::up_to(largest), facing: Scale::up_to(largest / f64::from(MIN_COS)) }
    }

    pub fn integers(&self, beam: Beam, weight: f64) -> [i64; 2] {
        let flux = f64::from(beam.flux_w) * weight;
        let facing = flux / f64::from(beam.cos.max(MIN_COS));
        [self.surface.integer(flux), self.facing.integer(facing)]
    }

    /// The one that is asked for, without a weight.
    pub fn integer(&self, quantity: Irradiance, beam: Beam) -> i64 {
        let flux = f64::from(beam.flux_w);
        match quantity {
            Irradiance::Surface => self.surface.integer(flux),
            Irradiance::FacingBeam => self.facing.integer(flux / f64::from(beam.cos.max(MIN_COS))),
        }
    }

    /// The same as [`Self::integers`] has it; the other is 0.
    pub fn integers_of(&self, quantity: Irradiance, beam: Beam) -> [i64; 2] {
        match quantity {
            Irradiance::Surface => [self.integer(quantity, beam), 0],
            Irradiance::FacingBeam => [0, self.integer(quantity, beam)],
        }
    }

    /// How integers of a quantity become W again.
    pub fn scale(&self, quantity: Irradiance) -> Scale {
        match quantity {
            Irradiance::Surface => self.surface,
            Irradiance::FacingBeam => self.facing,
        }
    }
}

/// An integer under a kernel's weight.
pub(in crate::render) fn weighed(integer: i64, kernel: f64) -> i64 {
    if kernel == 1.0 { integer } else { (integer as f64 * kernel).round_ties_even() as i64 }
}

const _: () = assert!(BITS + 1 + MOST_PHOTONS.ilog2() as i32 <= 62);
const _: () = assert!(2 * (BITS + 2 - SQUARE_SHIFT as i32) + MOST_PHOTONS.ilog2() as i32 <= 62);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_lose_next_to_nothing_and_never_overflow() {
        for largest in [1e-9, 0.3, 1.0, 7.0, 1e12] {
            let scale = Scale::up_to(largest);
            for share in [1.0, 0.5, 0.013, 1e-4] {
                let value = largest * share;
                let back = scale.value(scale.integer(value));
                assert!((back - value).abs() <= 6e-11 * largest, "{value}: {back}");
                let root = libm::sqrt(scale.square_value(square(scale.integer(value))));
                assert!((root - value).abs() <= 4e-6 * largest, "{value}: {root}");
            }
            let most = scale.integer(f64::MAX);
            assert!(most.checked_mul(MOST_PHOTONS as i64).is_some());
            assert!(square(most).checked_mul(MOST_PHOTONS as i64).is_some());
        }
        let scale = Scale::up_to(3.0);
        for i in 0..10_000 {
            let value = f64::from(i) * 0.37 / scale.per_unit;
            let slow = (value * scale.per_unit).round_ties_even() as i64;
            assert_eq!(scale.integer(value), slow);
        }
        let half = |halves: f64| Scale::up_to(0.0).integer(halves / 2.0);
        assert_eq!([half(1.0), half(3.0), half(5.0), half(-1.0)], [0, 2, 2, 0]);
        assert_eq!(Scale::up_to(0.0).integer(f64::NAN), 0);
    }
}
