use std::f64::consts::PI;

use glam::DVec3;

/// Linke turbidity that gensky assumes.
const TURBIDITY: f64 = 2.45;
/// Above that altitude the zenith's formula grows without end, degrees.
const HIGHEST_DEG: f64 = 75.0;
/// Reflectance of the ground beyond the scene.
const GROUND: f64 = 0.2;

/// The CIE clear sky as Radiance's gensky has it (Kittler 1967; CIE 22, 1973): the zenith's
/// luminance by the sun's altitude, the pattern by the angles to the sun and to the zenith.
#[derive(Clone, Copy, Debug)]
pub struct ClearSky {
    sun: DVec3,
    /// Luminance over pattern, cd/m2.
    scale: f64,
    /// Luminance of the ground beyond the scene, cd/m2.
    ground_cd_m2: f64,
}

impl ClearSky {
    /// The sky under a sun (unit vector) that gives `sun_lx` on a plane that faces it.
    pub fn new(sun: DVec3, sun_lx: f64) -> Self {
        let altitude = libm::asin(sun.z.clamp(0.0, 1.0)).min(HIGHEST_DEG.to_radians());
        let zenith = 1000.0 * ((1.376 * TURBIDITY - 1.81) * libm::tan(altitude) + 0.38);
        let plain = Self { sun, scale: 1.0, ground_cd_m2: 0.0 };
        let mut out = Self { scale: zenith / plain.luminance_cd_m2(DVec3::Z), ..plain };
        let lx = out.horizontal_lx() + sun_lx * sun.z.max(0.0);
        out.ground_cd_m2 = GROUND / PI * lx;
        out
    }

    /// Luminance of the sky (without the sun's disc) or of the ground in a direction, cd/m2.
    pub fn luminance_cd_m2(&self, direction: DVec3) -> f64 {
        if direction.z <= 0.0 {
            return self.ground_cd_m2;
        }
        let cos = direction.dot(self.sun).clamp(-1.0, 1.0);
        let near = 0.91 + 10.0 * libm::exp(-3.0 * libm::acos(cos)) + 0.45 * cos * cos;
        self.scale * near * (1.0 - libm::exp(-0.32 / direction.z.max(1e-3)))
    }

    /// What the sky gives on a level plane, lx.
    pub fn horizontal_lx(&self) -> f64 {
        const RINGS: u32 = 40;
        const AROUND: u32 = 160;
        let mut sum = 0.0;
        for ring in 0..RINGS {
            let r2 = (f64::from(ring) + 0.5) / f64::from(RINGS);
            let r = r2.sqrt();
            for i in 0..AROUND {
                let turn = 2.0 * PI * (f64::from(i) + 0.5) / f64::from(AROUND);
                let up = (1.0 - r2).sqrt();
                sum +=
                    self.luminance_cd_m2(DVec3::new(r * libm::cos(turn), r * libm::sin(turn), up));
            }
        }
        PI * sum / f64::from(RINGS * AROUND)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `gensky 6 21 12 -a 47 -o 0 -m 0`'s orders of magnitude: some 10 to 20 klx from a clear sky.
    #[test]
    fn the_sky_is_as_bright_as_skies_are() {
        for (altitude_deg, low, high) in [(10.0_f64, 4e3, 1.2e4), (40.0, 8e3, 2.5e4)] {
            let a = altitude_deg.to_radians();
            let sky = ClearSky::new(DVec3::new(libm::cos(a), 0.0, libm::sin(a)), 8e4);
            let lx = sky.horizontal_lx();
            assert!((low..high).contains(&lx), "{altitude_deg}: {lx}");
            let zenith = 1000.0 * ((1.376 * 2.45 - 1.81) * libm::tan(a) + 0.38);
            assert!((sky.luminance_cd_m2(DVec3::Z) / zenith - 1.0).abs() < 1e-12);
            let at = DVec3::new(libm::cos(a + 0.1), 0.0, libm::sin(a + 0.1));
            assert!(sky.luminance_cd_m2(at) > 3.0 * zenith);
            assert!(sky.luminance_cd_m2(DVec3::NEG_Z) > 1000.0);
        }
    }
}
