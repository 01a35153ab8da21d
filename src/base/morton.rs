//! Morton codes: the bits of three integers woven into one, so that cells that lie close together
//! in space have numbers that lie close together. The photon store orders its octree by them, a
//! view its tiles.

/// Bits of each integer, which are the levels of an octree: three times 21 fill 63 bits.
pub const LEVELS: u32 = 21;

/// Spreads the low 21 bits so that two zero bits lie between each two.
fn spread(v: u64) -> u64 {
    let mut v = v & 0x1F_FFFF;
    v = (v | v << 32) & 0x001F_0000_0000_FFFF;
    v = (v | v << 16) & 0x001F_0000_FF00_00FF;
    v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
    v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

/// The inverse of [`spread`].
fn compact(v: u64) -> u64 {
    let mut v = v & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10C3_0C30_C30C_30C3;
    v = (v | v >> 4) & 0x100F_00F0_0F00_F00F;
    v = (v | v >> 8) & 0x001F_0000_FF00_00FF;
    v = (v | v >> 16) & 0x001F_0000_0000_FFFF;
    (v | v >> 32) & 0x1F_FFFF
}

/// One code from three integers of up to 21 bits, x lowest.
pub fn interleave(x: u64, y: u64, z: u64) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// The inverse of [`interleave`].
pub fn deinterleave(code: u64) -> [u64; 3] {
    [compact(code), compact(code >> 1), compact(code >> 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_what_a_loop_over_bits_gives() {
        let mut random = crate::base::Stream::new(1, crate::base::Purpose::Survey, 0);
        for _ in 0..1000 {
            let axes: [u64; 3] = std::array::from_fn(|_| u64::from(random.bits() >> 11));
            let mut slow = 0u64;
            for bit in 0..21 {
                for (axis, v) in axes.iter().enumerate() {
                    slow |= (v >> bit & 1) << (3 * bit + axis);
                }
            }
            let code = interleave(axes[0], axes[1], axes[2]);
            assert_eq!(code, slow);
            assert_eq!(deinterleave(code), axes);
        }
    }
}
