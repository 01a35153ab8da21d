//! A scattering function as a sum of few forms, for those who evaluate many directions at once.

use std::f64::consts::FRAC_1_PI;

use super::{Bsdf, Facets, Measured};

/// A part of a scattering function without its delta lobes; the function is the sum of its terms,
/// each times its share ([`Bsdf::terms`]).
#[derive(Clone, Copy, Debug)]
pub enum Term<'a> {
    /// The same value everywhere, 1/sr.
    Even(f64),
    /// A lobe of facets over a ground.
    Lobe(FacetTerm<'a>),
    /// Values of a file, piecewise constant.
    Measured(&'a Measured),
}

/// `f = D(h) G2(i, o) R(i.h) / (4 cos_i cos_o) + k a(i) a(o) / pi`: GGX facets with Smith's
/// height-correlated G2 (`D` is 0 where [`Self::alpha`] is `None`), see [`Facets`].
#[derive(Clone, Copy, Debug)]
pub struct FacetTerm<'a>(&'a Facets);

impl FacetTerm<'_> {
    /// GGX roughness; `None` for a smooth front, whose lobe is a delta.
    pub fn alpha(&self) -> Option<f64> {
        self.0.alpha()
    }

    /// R: what a facet reflects, by the cosine on it.
    pub fn reflectance(&self, cos: f64) -> f64 {
        self.0.facet_reflectance(cos)
    }

    /// a: the ground's factor, by the cosine of a direction.
    pub fn ground(&self, cos: f64) -> f64 {
        self.0.ground(cos)
    }

    /// `k / pi`, 1/sr.
    pub fn ground_per_sr(&self) -> f64 {
        self.0.ground_strength() * FRAC_1_PI
    }
}

impl Bsdf {
    /// The terms with their shares; empty where all light goes into a delta lobe.
    pub fn terms(&self) -> Vec<(f64, Term<'_>)> {
        match self {
            Self::Lambertian { reflectance } => vec![(1.0, Term::Even(reflectance * FRAC_1_PI))],
            Self::Mirror { .. } | Self::Glass { .. } => Vec::new(),
            Self::Facets(facets) => vec![(1.0, Term::Lobe(FacetTerm(facets)))],
            Self::Mixture(mixture) => mixture
                .parts()
                .iter()
                .flat_map(|(share, part)| {
                    part.terms().into_iter().map(move |(s, t)| (share * s, t))
                })
                .collect(),
            Self::Measured(measured) => vec![(1.0, Term::Measured(measured))],
        }
    }

    /// Whether some light goes into a delta lobe, see [`Bsdf::mirrored`].
    pub fn has_delta(&self) -> bool {
        match self {
            Self::Mirror { .. } | Self::Glass { .. } => true,
            Self::Facets(facets) => facets.alpha().is_none(),
            Self::Mixture(mixture) => mixture.parts().iter().any(|(_, part)| part.has_delta()),
            Self::Lambertian { .. } | Self::Measured(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::base::{Purpose, Stream};
    use crate::bsdf::{PRESETS, on_hemisphere};

    /// The formula in the term's documentation.
    fn by_terms(bsdf: &Bsdf, i: DVec3, o: DVec3) -> f64 {
        let value = |term: Term<'_>| match term {
            Term::Even(f) => f,
            Term::Measured(measured) => measured.evaluate(i, o),
            Term::Lobe(term) => {
                let ground = term.ground_per_sr() * term.ground(i.z) * term.ground(o.z);
                let Some(alpha) = term.alpha() else { return ground };
                let h = (i + o).normalize();
                let a2 = alpha * alpha;
                let root = 1.0 + (a2 - 1.0) * h.z * h.z;
                let hidden =
                    |v: DVec3| 0.5 * (libm::sqrt(1.0 + a2 * (1.0 - v.z * v.z) / (v.z * v.z)) - 1.0);
                let density = a2 * FRAC_1_PI / (root * root);
                let both = 1.0 / (1.0 + hidden(i) + hidden(o));
                ground + density * both * term.reflectance(i.dot(h)) / (4.0 * i.z * o.z)
            }
        };
        bsdf.terms().into_iter().map(|(share, term)| share * value(term)).sum()
    }

    #[test]
    fn terms_add_up_to_the_function() {
        let mut random = Stream::new(1, Purpose::Survey, 0);
        for preset in PRESETS {
            let bsdf = Bsdf::from_model(&preset.model()).expect("valid");
            for _ in 0..300 {
                let [i, o] = [0, 1].map(|_| on_hemisphere(random.uniform(), random.uniform()));
                let (found, expected) = (by_terms(&bsdf, i, o), bsdf.evaluate(i, o));
                assert!((found - expected).abs() <= 1e-6 * expected, "{}: {found}", preset.name);
            }
        }
    }
}
