/// What random numbers are drawn for. Two purposes never share a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// The photons of a run.
    Photon = 1,
    /// The pilot that fixes how many photons are emitted.
    Pilot = 2,
    /// The points on a light source or PV surface that a picture samples.
    Picture = 3,
    /// Samples taken to measure a photon store or a scene.
    Survey = 4,
    /// The photons that cross virtual sensors in free air.
    Sensor = 5,
    /// Their pilot.
    SensorPilot = 6,
}

/// A counter-based stream of random numbers: Philox 4x32-10 (Salmon et al. 2011, "Parallel random
/// numbers: as easy as 1, 2, 3", SC11). The numbers depend on (seed, purpose, number) alone, so
/// any thread may draw for any photon, in any order.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u32; 2],
    counter: [u32; 4],
    block: [u32; 4],
    used: usize,
}

const MULTIPLIER: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];

fn philox(key: [u32; 2], counter: [u32; 4]) -> [u32; 4] {
    let mut k = key;
    let mut c = counter;
    for _ in 0..10 {
        let a = u64::from(MULTIPLIER[0]) * u64::from(c[0]);
        let b = u64::from(MULTIPLIER[1]) * u64::from(c[2]);
        c = [(b >> 32) as u32 ^ c[1] ^ k[0], b as u32, (a >> 32) as u32 ^ c[3] ^ k[1], a as u32];
        k = [k[0].wrapping_add(WEYL[0]), k[1].wrapping_add(WEYL[1])];
    }
    c
}

impl Stream {
    /// The stream of item `number` for `purpose` under `seed`.
    pub fn new(seed: u64, purpose: Purpose, number: u64) -> Self {
        Self {
            key: [seed as u32, (seed >> 32) as u32],
            counter: [0, purpose as u32, number as u32, (number >> 32) as u32],
            block: [0; 4],
            used: 4,
        }
    }

    /// 32 uniform random bits.
    pub fn bits(&mut self) -> u32 {
        if self.used == 4 {
            self.block = philox(self.key, self.counter);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.used = 0;
        }
        let out = self.block[self.used];
        self.used += 1;
        out
    }

    /// Uniform in `[0, 1)` with 32 random bits.
    pub fn uniform(&mut self) -> f64 {
        f64::from(self.bits()) * (1.0 / 4_294_967_296.0)
    }

    /// Uniform in `[0, 1)` with 53 random bits, for choices among very many.
    pub fn uniform_fine(&mut self) -> f64 {
        let high = u64::from(self.bits());
        let low = u64::from(self.bits());
        ((high << 32 | low) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers_of_the_random123_distribution() {
        assert_eq!(philox([0; 2], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox([u32::MAX; 2], [u32::MAX; 4]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox(
                [0xa409_3822, 0x299f_31d0],
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn streams_differ_by_seed_purpose_and_number() {
        let first = |s, p, n| Stream::new(s, p, n).bits();
        let base = first(1, Purpose::Photon, 7);
        assert_ne!(base, first(2, Purpose::Photon, 7));
        assert_ne!(base, first(1, Purpose::Pilot, 7));
        assert_ne!(base, first(1, Purpose::Photon, 8));
        assert_ne!(base, first(1, Purpose::Photon, 7 + (1 << 32)));
        assert_eq!(base, first(1, Purpose::Photon, 7));
    }
}
