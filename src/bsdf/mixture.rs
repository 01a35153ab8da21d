use glam::DVec3;

use super::Bsdf;
use crate::base::Stream;

/// Several materials side by side, finer than anyone sees: each takes its share of the light.
/// What is left of 1 is absorbed.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    /// Share of the area, and what it is made of.
    parts: Vec<(f64, Bsdf)>,
}

impl Mixture {
    pub(super) fn new(parts: Vec<(f64, Bsdf)>) -> Self {
        Self { parts }
    }

    /// Shares and what they are made of.
    pub(super) fn parts(&self) -> &[(f64, Bsdf)] {
        &self.parts
    }

    fn sum(&self, of: impl Fn(&Bsdf) -> f64) -> f64 {
        self.parts.iter().map(|(share, part)| share * of(part)).sum()
    }

    #[inline]
    pub(super) fn bound(&self, incident: DVec3) -> f64 {
        self.sum(|b| b.bound(incident))
    }

    pub(super) fn bound_between(&self, low: f64, high: f64) -> f64 {
        self.sum(|b| b.bound_between(low, high))
    }

    /// `stake`, from 0 to [`Self::bound`], chooses the part.
    #[inline]
    pub(super) fn sample(
        &self,
        incident: DVec3,
        mut stake: f64,
        random: &mut Stream,
    ) -> Option<DVec3> {
        for (share, part) in &self.parts {
            let bound = part.bound(incident);
            if stake < share * bound {
                return part.sample_within(incident, bound, random).map(|s| s.direction);
            }
            stake -= share * bound;
        }
        None
    }

    pub(super) fn evaluate(&self, incident: DVec3, out: DVec3) -> f64 {
        self.sum(|b| b.evaluate(incident, out))
    }

    pub(super) fn mirrored(&self, incident: DVec3) -> f64 {
        self.sum(|b| b.mirrored(incident))
    }

    pub(super) fn reflectance(&self, incident: DVec3) -> f64 {
        self.sum(|b| b.reflectance(incident))
    }
}
