use glam::DVec3;

use super::disc::Disc;
use super::emitter::Emitter;
use crate::base::Frame;
use crate::bsdf::Bsdf;

/// Degrees between the angles that a reflectance is tabulated at.
const STEP_DEG: f64 = 1.5;
/// Points of the sun's disc: along the radius and around, for a disc that is seen as a whole and
/// for one that the horizon or the PV's plane cuts.
const WHOLE: (u32, u32) = (2, 4);
const CUT: (u32, u32) = (12, 32);

/// How much of the sun's light falls onto an emitter, and how much of that it scatters: the
/// integrals over the sun's disc that a tally is closed with. Good to about 1e-3.
#[derive(Clone, Debug)]
pub(super) struct Yields {
    /// Reflectance by angle of incidence; empty where the azimuth counts as well.
    by_angle: Vec<f64>,
}

impl Yields {
    /// Of all emitters. Those with the same BSDF share the work.
    pub(super) fn of(emitters: &[Emitter]) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::with_capacity(emitters.len());
        for (i, emitter) in emitters.iter().enumerate() {
            let same = emitters[..i].iter().position(|e| std::ptr::eq(e.bsdf, emitter.bsdf));
            let yields = same.map_or_else(|| Self::of_bsdf(emitter.bsdf), |j| out[j].clone());
            out.push(yields);
        }
        out
    }

    fn of_bsdf(bsdf: &Bsdf) -> Self {
        if matches!(bsdf, Bsdf::Measured(_)) {
            return Self { by_angle: Vec::new() };
        }
        let count = (90.0 / STEP_DEG) as u32;
        let at = |i: u32| {
            // Light along the surface has no reflectance: the last angle is a little less.
            let angle = (STEP_DEG * f64::from(i)).min(89.999).to_radians();
            bsdf.reflectance(DVec3::new(libm::sin(angle), 0.0, libm::cos(angle)))
        };
        Self { by_angle: (0..=count).map(at).collect() }
    }

    fn reflectance(&self, bsdf: &Bsdf, incident: DVec3) -> f64 {
        let Some(last) = self.by_angle.len().checked_sub(2) else {
            return bsdf.reflectance(incident);
        };
        let at = libm::acos(incident.z.clamp(-1.0, 1.0)).to_degrees() / STEP_DEG;
        let i = (at as usize).min(last);
        self.by_angle[i] + (self.by_angle[i + 1] - self.by_angle[i]) * (at - i as f64)
    }

    /// Means over the sun's disc of the cosine to the emitter, and of cosine * reflectance; what
    /// lies below the horizon or behind the emitter counts as 0.
    pub(super) fn over(&self, emitter: &Emitter, disc: &Disc, sun: DVec3) -> [f64; 2] {
        let (low, high) = disc.cosines(emitter.frame.z.dot(sun));
        if high <= 0.0 || disc.cosines(sun.z).1 <= 0.0 {
            return [0.0; 2];
        }
        let cut = low < 0.0 || disc.cosines(sun.z).0 < 0.0;
        let (outward, around) = if cut { CUT } else { WHOLE };
        let frame = Frame::around(sun);
        let mut sums = [0.0; 2];
        for i in 0..outward {
            for j in 0..around {
                let u = (f64::from(i) + 0.5) / f64::from(outward);
                let v = (f64::from(j) + 0.5 * f64::from(1 + i % 2)) / f64::from(around);
                let to_sun = disc.direction(&frame, u, v);
                let incident = emitter.frame.local_from_world(to_sun);
                if incident.z > 0.0 && to_sun.z > 0.0 {
                    sums[0] += incident.z;
                    sums[1] += incident.z * self.reflectance(emitter.bsdf, incident);
                }
            }
        }
        sums.map(|s| s / f64::from(outward * around))
    }
}
