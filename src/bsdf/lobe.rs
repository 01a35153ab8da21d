use glam::DVec3;

use super::Bsdf;

/// Angles of outgoing directions that a lobe is looked for at, degrees apart.
const STEP_DEG: f64 = 0.02;

/// What light from one angle is reflected into, in the plane of incidence.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Lobe {
    /// Where the radiant intensity `f cos` is largest, degrees from the normal, positive on the
    /// mirror's side.
    pub peak_deg: f64,
    /// Largest value of f, 1/sr, delta lobes left out.
    pub peak_per_sr: f64,
    /// Full width at half maximum of the radiant intensity, degrees: 120 for an even surface, 0
    /// where most of the light goes into a delta lobe.
    pub width_deg: f64,
}

/// A direction in the plane of incidence, degrees from the normal.
pub(super) fn in_plane(angle_deg: f64) -> DVec3 {
    let angle = angle_deg.to_radians();
    DVec3::new(libm::sin(angle), 0.0, libm::cos(angle))
}

impl Bsdf {
    /// The scattering function in the plane of incidence, 1/sr; light comes from the left (negative
    /// x) at `polar_deg`, and leaves at `out_deg`, positive on the mirror's side.
    pub fn in_plane(&self, polar_deg: f64, out_deg: f64) -> f64 {
        self.evaluate(in_plane(-polar_deg), in_plane(out_deg))
    }

    /// The lobe of light from a polar angle.
    pub fn lobe(&self, polar_deg: f64) -> Lobe {
        let from = in_plane(-polar_deg);
        if self.mirrored(from) > 0.5 * self.reflectance(from) {
            return Lobe { peak_deg: polar_deg, peak_per_sr: f64::INFINITY, width_deg: 0.0 };
        }
        let count = (180.0 / STEP_DEG) as usize - 1;
        let at = |i: usize| -90.0 + STEP_DEG * (i + 1) as f64;
        let mut most = 0.0_f64;
        let intensity: Vec<f64> = (0..count)
            .map(|i| {
                let out = in_plane(at(i));
                let f = self.evaluate(from, out);
                most = most.max(f);
                f * out.z
            })
            .collect();
        let peak = (0..count).fold(0, |p, i| if intensity[i] > intensity[p] { i } else { p });
        let half = 0.5 * intensity[peak];
        // Where it falls below half, between two steps.
        let edge = |mut i: usize, up: bool| loop {
            let next = if up { i + 1 } else { i.wrapping_sub(1) };
            let Some(&below) = intensity.get(next) else { return at(i) };
            if below < half {
                let part = (intensity[i] - half) / (intensity[i] - below);
                return at(i) + if up { part } else { -part } * STEP_DEG;
            }
            i = next;
        };
        let width_deg = if half > 0.0 { edge(peak, true) - edge(peak, false) } else { 0.0 };
        Lobe { peak_deg: at(peak), peak_per_sr: most, width_deg }
    }
}
