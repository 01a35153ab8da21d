//! Klems matrices: scattering from patches of the hemisphere to patches of the hemisphere.
//!
//! The bases are LBNL's (Klems 1994, "A new method for predicting the solar heat gain of complex
//! fenestration systems"): rings of polar angle, each cut evenly in azimuth. Values are constant
//! over a patch, as Radiance evaluates them, without interpolation: that keeps energy, and a reader
//! who compares with `rtrace` sees the same steps. Patches of 10 to 15 degrees are coarser than any
//! glint; the program warns of that elsewhere.
//!
//! Columns are scaled down where a file scatters more light than came in, and each incident patch
//! has a cumulative distribution over the outgoing ones, so that drawing costs one binary search.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{Cone, on_circle};
use crate::base::Stream;

/// One ring of a Klems basis: patches between two polar angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Polar angle at which it begins, degrees.
    pub from_deg: f64,
    /// Polar angle at which it ends, degrees.
    pub to_deg: f64,
    /// Patches around.
    pub patches: usize,
}

/// A division of the hemisphere into patches (Klems 1994): rings of polar angle, each cut evenly
/// in azimuth, the first patch of a ring centred on azimuth 0.
#[derive(Clone, Debug, PartialEq)]
pub struct KlemsBasis {
    /// As files call it.
    pub name: String,
    rings: Vec<Ring>,
    /// Squared cosine where each ring begins, and where the last one ends.
    cos2: Vec<f64>,
    /// Number of the first patch of each ring.
    first: Vec<usize>,
}

const FULL: [(f64, usize); 9] = [
    (5.0, 1),
    (15.0, 8),
    (25.0, 16),
    (35.0, 20),
    (45.0, 24),
    (55.0, 24),
    (65.0, 24),
    (75.0, 16),
    (90.0, 12),
];
const HALF: [(f64, usize); 7] =
    [(6.5, 1), (19.5, 8), (32.5, 12), (46.5, 16), (61.5, 20), (76.5, 12), (90.0, 4)];
const QUARTER: [(f64, usize); 5] = [(9.0, 1), (27.0, 8), (46.0, 12), (66.0, 12), (90.0, 8)];

impl KlemsBasis {
    /// LBNL's bases by their name in files: full (145 patches), half (73), quarter (41).
    pub fn known(name: &str) -> Option<Self> {
        let ends: &[(f64, usize)] = match name.trim().to_ascii_lowercase().as_str() {
            "lbnl/klems full" => &FULL,
            "lbnl/klems half" => &HALF,
            "lbnl/klems quarter" => &QUARTER,
            _ => return None,
        };
        let mut from_deg = 0.0;
        let rings = ends
            .iter()
            .map(|&(to_deg, patches)| {
                let ring = Ring { from_deg, to_deg, patches };
                from_deg = to_deg;
                ring
            })
            .collect();
        Some(Self::of(name.trim(), rings))
    }

    /// A basis of given rings, which must follow each other from 0 degrees on.
    pub(super) fn of(name: &str, rings: Vec<Ring>) -> Self {
        let cos2_at = |deg: f64| {
            if deg >= 90.0 {
                return 0.0;
            }
            let cos = libm::cos(deg.to_radians());
            cos * cos
        };
        let mut cos2: Vec<f64> = rings.iter().map(|r| cos2_at(r.from_deg)).collect();
        cos2.push(rings.last().map_or(0.0, |r| cos2_at(r.to_deg)));
        let mut total = 0;
        let first = rings
            .iter()
            .map(|r| {
                total += r.patches;
                total - r.patches
            })
            .collect();
        Self { name: name.to_owned(), rings, cos2, first }
    }

    /// The rings from the normal outwards.
    pub fn rings(&self) -> &[Ring] {
        &self.rings
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.rings.iter().map(|r| r.patches).sum()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rings.is_empty()
    }

    fn ring_of(&self, patch: usize) -> usize {
        self.first.partition_point(|&f| f <= patch).saturating_sub(1)
    }

    /// Projected solid angle of a patch, sr.
    pub fn projected_sr(&self, patch: usize) -> f64 {
        let ring = self.ring_of(patch);
        PI * (self.cos2[ring] - self.cos2[ring + 1]) / self.rings[ring].patches as f64
    }

    /// Patch that holds a direction of the upper hemisphere; `None` beyond the last ring.
    #[inline]
    pub fn patch(&self, direction: DVec3) -> Option<usize> {
        let cos2 = direction.z.clamp(0.0, 1.0).powi(2);
        // Inner borders belong to the ring outside of them.
        let ring = self.cos2[1..].iter().take_while(|&&end| cos2 <= end).count();
        let ring = if ring == self.rings.len() && self.cos2[ring] == 0.0 { ring - 1 } else { ring };
        let around = self.rings.get(ring)?.patches;
        if around == 1 {
            return Some(self.first[ring]);
        }
        let turns = libm::atan2(direction.y, direction.x) / TAU;
        let turns = if turns < 0.0 { turns + 1.0 } else { turns };
        let step = (turns * around as f64 + 0.5) as usize;
        Some(self.first[ring] + if step >= around { 0 } else { step })
    }

    /// A direction of a patch, uniform in projected solid angle.
    #[inline]
    pub fn direction(&self, patch: usize, u: f64, v: f64) -> DVec3 {
        let ring = self.ring_of(patch);
        let around = self.rings[ring].patches as f64;
        let turns = ((patch - self.first[ring]) as f64 + v - 0.5) / around;
        let (cos, sin) = on_circle(if turns < 0.0 { turns + 1.0 } else { turns });
        let cos2 = self.cos2[ring] + u * (self.cos2[ring + 1] - self.cos2[ring]);
        let radius = (1.0 - cos2).max(0.0).sqrt();
        DVec3::new(radius * cos, radius * sin, cos2.max(0.0).sqrt())
    }

    /// Calls `each` for every patch that may touch a range of squared sines and one of azimuths.
    pub(super) fn patches_touching(
        &self,
        sin2: [f64; 2],
        turns: [f64; 2],
        mut each: impl FnMut(usize),
    ) {
        let slack = 1e-9;
        let middle = 0.5 * (turns[0] + turns[1]);
        let half = 0.5 * (turns[1] - turns[0]);
        for (ring, r) in self.rings.iter().enumerate() {
            let (from, to) = (1.0 - self.cos2[ring], 1.0 - self.cos2[ring + 1]);
            if from > sin2[1] + slack || to < sin2[0] - slack {
                continue;
            }
            for patch in 0..r.patches {
                let off = (patch as f64 / r.patches as f64 - middle).rem_euclid(1.0);
                if off.min(1.0 - off) <= half + 0.5 / r.patches as f64 + slack {
                    each(self.first[ring] + patch);
                }
            }
        }
    }

    /// Middle of a patch (by its polar angles), degrees of polar angle and azimuth.
    pub fn middle_deg(&self, patch: usize) -> (f64, f64) {
        let ring = self.ring_of(patch);
        let r = &self.rings[ring];
        let polar = if ring == 0 && r.patches == 1 { 0.0 } else { 0.5 * (r.from_deg + r.to_deg) };
        (polar, 360.0 * (patch - self.first[ring]) as f64 / r.patches as f64)
    }

    /// Width of the patches at a polar angle, degrees.
    pub fn width_deg(&self, polar_deg: f64) -> f64 {
        let ring = self.rings.iter().find(|r| polar_deg <= r.to_deg).or(self.rings.last());
        // The cap around the normal is as wide as its whole cone.
        ring.map_or(0.0, |r| if r.from_deg == 0.0 { 2.0 * r.to_deg } else { r.to_deg - r.from_deg })
    }
}

/// Scattering between the patches of two bases. Incident patch i holds light that *travels* with
/// the azimuth of patch i: it comes from the opposite one, and a mirror stays on the diagonal.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Division of the incident hemisphere.
    pub incident: KlemsBasis,
    /// Division of the outgoing hemisphere.
    pub outgoing: KlemsBasis,
    /// 1/sr, by incident patch, then outgoing patch.
    values: Vec<f32>,
    /// Share of the light up to and with each outgoing patch, by incident patch.
    cumulative: Vec<f64>,
}

impl Matrix {
    /// A matrix from `values` by incident patch, then outgoing patch.
    pub(super) fn new(incident: KlemsBasis, outgoing: KlemsBasis, mut values: Vec<f32>) -> Self {
        let count = outgoing.len();
        let projected: Vec<f64> = (0..count).map(|o| outgoing.projected_sr(o)).collect();
        let mut cumulative = Vec::with_capacity(values.len());
        for column in values.chunks_mut(count.max(1)) {
            let mut sum: f64 =
                column.iter().zip(&projected).map(|(&f, sr)| f64::from(f) * sr).sum();
            if sum > 1.0 {
                // More light than came in: scaled down to all of it.
                for f in column.iter_mut() {
                    *f = (f64::from(*f) / sum) as f32;
                }
            }
            sum = 0.0;
            for (&f, sr) in column.iter().zip(&projected) {
                sum += f64::from(f) * sr;
                cumulative.push(sum);
            }
        }
        Self { incident, outgoing, values, cumulative }
    }

    /// The same light on its way back: `f'(a, b) = f(b, a)`.
    pub(super) fn backwards(&self) -> Self {
        let middle = |basis: &KlemsBasis, patch: usize, sign: f64| {
            let (polar_deg, azimuth_deg) = basis.middle_deg(patch);
            let (cos, sin) = on_circle((azimuth_deg / 360.0).rem_euclid(1.0));
            let polar = polar_deg.to_radians();
            let radius = sign * libm::sin(polar);
            DVec3::new(radius * cos, radius * sin, libm::cos(polar))
        };
        // Bases have the same patches whichever way light goes.
        let (incident, outgoing) = (self.outgoing.clone(), self.incident.clone());
        let mut values = Vec::with_capacity(self.values.len());
        for i in 0..incident.len() {
            let from = middle(&incident, i, -1.0);
            for o in 0..outgoing.len() {
                values.push(self.evaluate(middle(&outgoing, o, 1.0), from) as f32);
            }
        }
        Self::new(incident, outgoing, values)
    }

    /// Incident patch of light from a direction.
    #[inline]
    pub fn incident_patch(&self, from: DVec3) -> Option<usize> {
        self.incident.patch(DVec3::new(-from.x, -from.y, from.z))
    }

    /// 1/sr between two patches.
    pub fn value(&self, incident: usize, outgoing: usize) -> f64 {
        f64::from(self.values[incident * self.outgoing.len() + outgoing])
    }

    /// Share of the light of an incident patch that is scattered.
    #[inline]
    pub fn total(&self, incident: usize) -> f64 {
        let count = self.outgoing.len();
        self.cumulative[(incident + 1) * count - 1]
    }

    pub(super) fn evaluate(&self, from: DVec3, to: DVec3) -> f64 {
        match (self.incident_patch(from), self.outgoing.patch(to)) {
            (Some(i), Some(o)) => self.value(i, o),
            _ => 0.0,
        }
    }

    #[inline]
    pub(super) fn sample(&self, incident: usize, random: &mut Stream) -> DVec3 {
        let count = self.outgoing.len();
        let column = &self.cumulative[incident * count..(incident + 1) * count];
        let at = random.uniform() * column[count - 1];
        // The first whose sum lies above: patches without light have no part in it.
        let o = column.partition_point(|&c| c <= at).min(count - 1);
        let (u, v) = (random.uniform(), random.uniform());
        self.outgoing.direction(o, u, v)
    }

    /// Largest share scattered from any incident patch that reaches into a range of cosines.
    pub(super) fn most(&self, cos_low: f64, cos_high: f64) -> f64 {
        let (low, high) = (cos_low * cos_low, cos_high * cos_high);
        let mut most = 0.0_f64;
        for (ring, r) in self.incident.rings.iter().enumerate() {
            let (upper, lower) = (self.incident.cos2[ring], self.incident.cos2[ring + 1]);
            if low <= upper * (1.0 + 1e-12) && high >= lower * (1.0 - 1e-12) {
                let first = self.incident.first[ring];
                most = (first..first + r.patches).fold(most, |m, i| m.max(self.total(i)));
            }
        }
        most
    }

    /// Largest value, 1/sr, for light from a cone into a range of squared sines and azimuths.
    pub(super) fn most_within(&self, sin2: [f64; 2], turns: [f64; 2], from: &Cone) -> f64 {
        let mut outgoing = Vec::new();
        self.outgoing.patches_touching(sin2, turns, |o| outgoing.push(o));
        self.most_among(&outgoing, from)
    }

    /// Largest value, 1/sr, for light from a cone into some outgoing patches.
    pub(super) fn most_among(&self, outgoing: &[usize], from: &Cone) -> f64 {
        let (low, high) = from.radii();
        // Patches hold light by where it travels to.
        let (centre, spread) = from.about(-from.axis).turns();
        let (sin2, turns) = ([low * low, high * high], [centre - spread, centre + spread]);
        let mut most = 0.0_f64;
        self.incident.patches_touching(sin2, turns, |i| {
            most = outgoing.iter().fold(most, |most, &o| most.max(self.value(i, o)));
        });
        most
    }

    /// Share of the light of an incident patch in its brightest outgoing patch.
    pub(super) fn peak_share(&self, incident: usize) -> f64 {
        let count = self.outgoing.len();
        let column = &self.cumulative[incident * count..(incident + 1) * count];
        let mut before = 0.0;
        let mut most = 0.0_f64;
        for &c in column {
            most = most.max(c - before);
            before = c;
        }
        if before > 0.0 { most / before } else { 0.0 }
    }
}
