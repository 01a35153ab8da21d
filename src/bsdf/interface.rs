//! What a facet reflects: bare glass, coated glass, metal.

use std::f64::consts::PI;

use super::curve::Curve;
use super::fresnel;

/// A film on glass: `{ index = 1.27, thickness_nm = 118.0 }`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coating {
    /// Refractive index of the film, 1.01..3 (porous silica: 1.22 to 1.35).
    pub index: f64,
    /// Thickness, 1..2000 nm.
    pub thickness_nm: f64,
}

/// Share of unpolarised light of one wavelength that a film on a dielectric reflects, from air:
/// Airy's sum of all reflections inside the film, by polarisation (Born and Wolf, "Principles of
/// Optics", section 1.6.4, equations 57 to 60). `cos` is the incident cosine.
pub fn film_reflectance(cos: f64, index: f64, film: Coating, wavelength_nm: f64) -> f64 {
    if cos <= 0.0 {
        // Grazing light is reflected whole, whatever lies below.
        return 1.0;
    }
    let cos = cos.min(1.0);
    let sin2 = 1.0 - cos * cos;
    let inside = |n: f64| (1.0 - sin2 / (n * n)).max(0.0).sqrt();
    let (cos_film, cos_glass) = (inside(film.index), inside(index));
    // Twice the phase that the light gathers on its way through the film.
    let turns = 2.0 * film.index * film.thickness_nm * cos_film / wavelength_nm;
    let swing = libm::cos(2.0 * PI * turns);
    let both = |first: f64, second: f64| {
        let (product, squares) = (first * second, first * first + second * second);
        (squares + 2.0 * product * swing) / (1.0 + product * product + 2.0 * product * swing)
    };
    let across = |n1: f64, c1: f64, n2: f64, c2: f64| (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2);
    let along = |n1: f64, c1: f64, n2: f64, c2: f64| (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2);
    0.5 * (both(
        across(1.0, cos, film.index, cos_film),
        across(film.index, cos_film, index, cos_glass),
    ) + both(
        along(1.0, cos, film.index, cos_film),
        along(film.index, cos_film, index, cos_glass),
    ))
}

/// [`film_reflectance`] as sunlight sees it: the mean over 380 to 1,100 nm, where cells work and
/// eyes see, weighted with the energy of a black body of 5,778 K (Planck).
pub fn coated_reflectance(cos: f64, index: f64, film: Coating) -> f64 {
    const BANDS: u32 = 36;
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..BANDS {
        let wavelength_nm = 380.0 + 20.0 * (f64::from(i) + 0.5);
        // hc / (k T) is 2,490 nm at 5,778 K.
        let weight = libm::pow(wavelength_nm / 500.0, -5.0)
            / (libm::exp(14_387_769.0 / 5778.0 / wavelength_nm) - 1.0);
        sum += weight * film_reflectance(cos, index, film, wavelength_nm);
        weights += weight;
    }
    sum / weights
}

/// Share of unpolarised light that a metal reflects, from air: Fresnel's equations with the
/// complex index `index - i extinction` (Born and Wolf, section 14.2; in the real form of
/// Lagarde 2013, "Memo on Fresnel equations").
pub fn metal_reflectance(cos: f64, index: f64, extinction: f64) -> f64 {
    let cos = cos.clamp(0.0, 1.0);
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let (n2, k2) = (index * index, extinction * extinction);
    let t0 = n2 - k2 - sin2;
    let a2b2 = (t0 * t0 + 4.0 * n2 * k2).sqrt();
    let a = (0.5 * (a2b2 + t0)).max(0.0).sqrt();
    let (t1, t2) = (a2b2 + cos2, 2.0 * cos * a);
    let across = (t1 - t2) / (t1 + t2);
    let (t3, t4) = (cos2 * a2b2 + sin2 * sin2, t2 * sin2);
    let along = across * (t3 - t4) / (t3 + t4);
    0.5 * (across + along)
}

/// Reflectance of a facet by its cosine, with bounds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Interface {
    curve: Curve,
}

impl Interface {
    pub(super) fn glass(index: f64, coating: Option<Coating>) -> Self {
        Self {
            curve: Curve::new(|cos| match coating {
                None => fresnel::reflectance(cos, index),
                Some(film) => coated_reflectance(cos, index, film),
            }),
        }
    }

    pub(super) fn metal(index: f64, extinction: f64) -> Self {
        Self { curve: Curve::new(|cos| metal_reflectance(cos, index, extinction)) }
    }

    #[inline]
    pub(super) fn at(&self, cos: f64) -> f64 {
        self.curve.at(cos)
    }

    /// Upper bound of the reflectance at any microfacet that reflects light from `cos` into the upper
    /// hemisphere.
    ///
    /// Proof: the angle between the incident direction i and the outgoing o is at most angle(i, n) +
    /// angle(n, o) <= theta + 90 degrees, and the half vector halves it, so the angle of incidence at
    /// the microfacet is at most (theta + 90 degrees) / 2, and the largest reflectance up to there
    /// is known. The cosine of that half angle
    /// is sqrt((1 + cos(theta + 90 degrees)) / 2) = sqrt((1 - sin theta) / 2), and 1 - sin = cos^2 /
    /// (1 + sin) without cancellation.
    #[inline]
    pub(super) fn facet_bound(&self, cos: f64) -> f64 {
        let cos = cos.clamp(0.0, 1.0);
        let sin = (1.0 - cos * cos).sqrt();
        self.curve.most_above(cos * (0.5 / (1.0 + sin)).sqrt())
    }

    /// Largest reflectance between two cosines.
    pub(super) fn most(&self, low: f64, high: f64) -> f64 {
        self.curve.most(low, high)
    }

    /// Mean over a hemisphere of even radiance.
    pub(super) fn mean(&self) -> f64 {
        self.curve.mean()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILM: Coating = Coating { index: 1.27, thickness_nm: 118.0 };

    #[test]
    fn a_film_that_is_not_there_changes_nothing() {
        for i in 0..=100 {
            let cos = f64::from(i) / 100.0;
            let bare = fresnel::reflectance(cos, 1.52);
            for film in [
                Coating { index: 1.52, thickness_nm: 118.0 },
                Coating { index: 1.0, thickness_nm: 300.0 },
                Coating { index: 1.3, thickness_nm: 0.0 },
            ] {
                let seen = film_reflectance(cos, 1.52, film, 550.0);
                assert!((seen - bare).abs() < 1e-12, "{film:?} at {cos}: {seen}, {bare}");
            }
        }
    }

    #[test]
    fn a_quarter_wave_is_the_textbooks() {
        // ((n - f^2) / (n + f^2))^2 at normal incidence (Born and Wolf, equation 1.6.67).
        let film = Coating { index: 1.38, thickness_nm: 550.0 / (4.0 * 1.38) };
        let expected = ((1.52 - 1.38 * 1.38) / (1.52_f64 + 1.38 * 1.38)).powi(2);
        assert!((film_reflectance(1.0, 1.52, film, 550.0) - expected).abs() < 1e-12);
        let ideal = Coating { index: 1.52_f64.sqrt(), thickness_nm: 137.5 / 1.52_f64.sqrt() };
        assert!(film_reflectance(1.0, 1.52, ideal, 550.0) < 1e-12);
    }

    #[test]
    fn a_coating_helps_at_the_normal_and_hardly_at_grazing_incidence() {
        let ratio = |degrees: f64| {
            let cos = libm::cos(degrees.to_radians());
            coated_reflectance(cos, 1.52, FILM) / fresnel::reflectance(cos, 1.52)
        };
        assert!(ratio(0.0) < 0.35, "{}", ratio(0.0));
        assert!((0.6..0.95).contains(&ratio(75.0)), "{}", ratio(75.0));
        assert!(ratio(85.0) > 0.8, "{}", ratio(85.0));
    }

    #[test]
    fn a_metal_without_extinction_is_glass_and_aluminium_is_aluminium() {
        for i in 1..=100 {
            let cos = f64::from(i) / 100.0;
            assert!(
                (metal_reflectance(cos, 1.52, 0.0) - fresnel::reflectance(cos, 1.52)).abs() < 1e-12
            );
        }
        // ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        let normal = (0.04_f64 * 0.04 + 6.69 * 6.69) / (1.96 * 1.96 + 6.69 * 6.69);
        assert!((metal_reflectance(1.0, 0.96, 6.69) - normal).abs() < 1e-12);
    }

    #[test]
    fn bounds_hold_and_the_curve_follows() {
        for interface in [
            Interface::glass(1.52, Some(FILM)),
            Interface::glass(1.52, None),
            Interface::metal(0.96, 6.69),
        ] {
            let mut most = 0.0_f64;
            for i in (0..=5000).rev() {
                let cos = f64::from(i) / 5000.0;
                most = most.max(interface.at(cos));
                assert!(interface.curve.most_above(cos) >= most - 1e-12);
            }
        }
        let (curve, film) = (Interface::glass(1.52, Some(FILM)), FILM);
        for i in 0..=777 {
            let cos = f64::from(i) / 777.0;
            assert!((curve.at(cos) - coated_reflectance(cos, 1.52, film)).abs() < 2e-5);
        }
        assert!((Interface::glass(1.5, None).mean() - fresnel::diffuse_mean(1.5)).abs() < 1e-5);
    }
}
