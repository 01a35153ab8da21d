//! The terms of a scattering function over the suns of a facet: what a place of the PV sends to a
//! direction, for many suns at once.

use glam::DVec3;
use rayon::prelude::*;

use super::lobe::Lobe;
use super::suns::Suns;
use crate::bsdf::{Cone, FacetTerm, Measured, Term};
use crate::render::reflect::disc::Disc;
use crate::render::reflect::lobe::FacetLobe;
use crate::render::reflect::sunlit::{DiscPart, disc_parts, span_of};

/// A term of a scattering function over the suns of a facet, in the form that is evaluated for
/// many suns at once: in single precision, one array for each number.
#[derive(Debug)]
pub(super) enum Kernel<'a> {
    /// The ground alone: a factor of the sun times one of the outgoing direction.
    Ground { term: Option<FacetTerm<'a>>, from: Vec<f32> },
    /// GGX facets over a ground.
    Lobe(Box<Lobe>),
    /// Patches of a file: the mean over the disc by outgoing patch, then sun.
    Patches { measured: &'a Measured, rows: Vec<f32>, suns: usize },
    /// Cells of a file, one sun after the other: the parts of each sun's disc, from `first[sun]` on.
    Cells { measured: &'a Measured, share: f64, parts: Vec<DiscPart>, first: Vec<u32> },
}

/// Suns to be evaluated: gathered from [`Suns`] and a kernel.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    pub strength: Vec<f32>,
    pub from: Vec<f32>,
    pub hidden: Vec<f32>,
}

/// A point of a rule on a cell, as the receiver sees it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Point {
    /// Towards the receiver, in the facet's frame.
    pub out: DVec3,
    /// Irradiance of the surface, and of a plane that faces the beam, for each unit of radiance.
    pub surface: f64,
    pub normal: f64,
}

impl<'a> Kernel<'a> {
    pub(super) fn of(share: f64, term: Term<'a>, suns: &Suns, disc: &Disc) -> Self {
        let by_sun = |of: &dyn Fn(f64) -> f64| -> Vec<f32> {
            let all = suns.direction.iter().zip(&suns.strength);
            all.map(|(d, s)| (share * f64::from(*s) * of(d.z)) as f32).collect()
        };
        match term {
            Term::Even(per_sr) => Self::Ground { term: None, from: by_sun(&|cos| cos * per_sr) },
            Term::Lobe(term) => {
                let ground = term.ground_per_sr();
                let from = by_sun(&|cos| cos * ground * term.ground(cos));
                let Some(alpha) = term.alpha() else {
                    return Self::Ground { term: Some(term), from };
                };
                Self::Lobe(Box::new(Lobe::of(FacetLobe::of(share, alpha, &term), from, suns)))
            }
            Term::Measured(measured) => Self::measured(share, measured, suns, disc),
        }
    }

    fn measured(share: f64, measured: &'a Measured, suns: &Suns, disc: &Disc) -> Self {
        let of_sun = |sun: &DVec3| disc_parts(measured, *sun, disc);
        let by_sun: Vec<Vec<DiscPart>> = suns.direction.par_iter().map(of_sun).collect();
        let patches = measured.patches();
        if patches > 0 {
            let mut rows = Vec::with_capacity(patches * suns.len());
            for out in 0..patches {
                rows.extend(by_sun.iter().zip(&suns.strength).map(|(parts, strength)| {
                    let value = |p: &DiscPart| p.weight * measured.patch_value(&p.of, out);
                    let sum: f64 = parts.iter().map(value).sum();
                    (share * f64::from(*strength) * sum) as f32
                }));
            }
            return Self::Patches { measured, rows, suns: suns.len() };
        }
        let mut first = vec![0];
        let mut parts = Vec::new();
        for own in by_sun {
            parts.extend(own);
            first.push(parts.len() as u32);
        }
        Self::Cells { measured, share, parts, first }
    }

    /// Half-width of the lobe; `None` for what is smooth.
    pub(super) fn alpha(&self) -> Option<f64> {
        match self {
            Self::Lobe(lobe) => Some(lobe.shape.alpha),
            Self::Ground { .. } | Self::Patches { .. } | Self::Cells { .. } => None,
        }
    }

    /// Whether it jumps from one value to another.
    pub(super) fn jumps(&self) -> bool {
        matches!(self, Self::Patches { .. } | Self::Cells { .. })
    }

    /// Sums over `points` of radiance times what it is worth, for the suns of a list: irradiance
    /// on the surface and facing the beam, W/m2. Element by element, so that it doesn't depend on
    /// how many are computed at once.
    pub(super) fn add_all(&self, points: &[Point], suns: &Suns, list: &[u32], into: &mut Sums) {
        into.clear(list.len());
        let Sums { surface, normal, .. } = into;
        match self {
            Self::Ground { term, from } => {
                let leaving = |p: &Point| term.map_or(1.0, |t| t.ground(p.out.z));
                let (mut s, mut n) = (0.0, 0.0);
                for point in points {
                    s += leaving(point) * point.surface;
                    n += leaving(point) * point.normal;
                }
                let (s, n) = (s as f32, n as f32);
                for ((&i, a), b) in list.iter().zip(surface).zip(normal) {
                    let value = from[i as usize];
                    (*a, *b) = (value * s, value * n);
                }
            }
            Self::Lobe(lobe) => {
                into.gathered.fill(suns, lobe, list);
                lobe.add_suns(points, into);
            }
            Self::Patches { measured, rows, suns } => {
                for point in points {
                    let Some(patch) = measured.outgoing_patch(point.out) else { continue };
                    let row = &rows[patch * suns..(patch + 1) * suns];
                    let (s, n) = (point.surface as f32, point.normal as f32);
                    for ((&i, a), b) in list.iter().zip(&mut *surface).zip(&mut *normal) {
                        *a += row[i as usize] * s;
                        *b += row[i as usize] * n;
                    }
                }
            }
            Self::Cells { measured, share, parts, first } => {
                for point in points {
                    for ((&i, a), b) in list.iter().zip(&mut *surface).zip(&mut *normal) {
                        let own =
                            &parts[first[i as usize] as usize..first[i as usize + 1] as usize];
                        let of = |p: &DiscPart| p.weight * measured.value(&p.of, point.out);
                        let value = share * own.iter().map(of).sum::<f64>();
                        let value = value * f64::from(suns.strength[i as usize]);
                        *a += (value * point.surface) as f32;
                        *b += (value * point.normal) as f32;
                    }
                }
            }
        }
    }

    /// Smallest and largest radiance of a file among the directions of a cone, for the suns of a list.
    pub(super) fn spans(&self, out: &Cone, suns: &Suns, list: &[u32], into: &mut Spans) {
        let [low, high] = [&mut into.low, &mut into.high].map(|values| {
            values.clear();
            values.resize(list.len(), 0.0);
            values
        });
        match self {
            Self::Patches { measured, rows, suns } => {
                let mut met = 0;
                measured.patches_within(out, |patch| {
                    let row = &rows[patch * suns..(patch + 1) * suns];
                    for ((&i, low), high) in list.iter().zip(&mut *low).zip(&mut *high) {
                        let value = row[i as usize];
                        *low = if met == 0 { value } else { low.min(value) };
                        *high = high.max(value);
                    }
                    met += 1;
                });
            }
            Self::Cells { measured, share, parts, first } => {
                for ((&i, low), high) in list.iter().zip(low).zip(high) {
                    let own = &parts[first[i as usize] as usize..first[i as usize + 1] as usize];
                    let factor = share * f64::from(suns.strength[i as usize]);
                    let span = span_of(measured, own, out).map(|v| (factor * v) as f32);
                    (*low, *high) = span.into();
                }
            }
            Self::Ground { .. } | Self::Lobe(_) => {}
        }
    }
}

/// Smallest and largest radiances by sun, W/m2/sr.
#[derive(Debug, Default)]
pub(super) struct Spans {
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Spans {
    /// How far those of the k-th sun are apart.
    pub(super) fn width(&self, k: usize) -> f32 {
        self.high[k] - self.low[k]
    }
}

/// Results of a list of suns, and buffers for them.
#[derive(Debug, Default)]
pub(super) struct Sums {
    pub surface: Vec<f32>,
    pub normal: Vec<f32>,
    pub gathered: Gathered,
}

impl Sums {
    pub(super) fn clear(&mut self, count: usize) {
        for list in [&mut self.surface, &mut self.normal] {
            list.clear();
            list.resize(count, 0.0);
        }
    }
}

impl Gathered {
    fn lists(&mut self) -> [&mut Vec<f32>; 6] {
        [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.strength,
            &mut self.from,
            &mut self.hidden,
        ]
    }

    pub(super) fn fill(&mut self, suns: &Suns, lobe: &Lobe, list: &[u32]) {
        let sources = [&suns.x, &suns.y, &suns.z, &suns.strength, &lobe.from, &lobe.hidden];
        for (into, source) in self.lists().into_iter().zip(sources) {
            into.clear();
            into.extend(list.iter().map(|&i| source[i as usize]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Purpose, Stream};
    use crate::bsdf::{Bsdf, PRESETS, on_hemisphere};

    fn suns(count: u32) -> Suns {
        let mut random = Stream::new(1, Purpose::Survey, 0);
        let mut suns = Suns::default();
        for step in 0..count {
            let sun = on_hemisphere(random.uniform(), random.uniform());
            suns.step.push(step);
            suns.direction.push(sun);
            suns.x.push(sun.x as f32);
            suns.y.push(sun.y as f32);
            suns.z.push(sun.z as f32);
            suns.across.push([0.0; 6]);
            suns.strength.push(700.0);
        }
        suns
    }

    #[test]
    fn many_at_once_are_what_one_at_a_time_is() {
        let suns = suns(1000);
        let list: Vec<u32> = (0..1000).collect();
        for preset in PRESETS {
            let bsdf = Bsdf::from_model(&preset.model()).expect("valid");
            let mut random = Stream::new(2, Purpose::Survey, 0);
            for i in 0..100 {
                // Half of them close to the mirrored direction of some sun.
                let out = if i % 2 == 0 {
                    on_hemisphere(random.uniform(), random.uniform())
                } else {
                    let s = suns.direction[i];
                    (DVec3::new(-s.x, -s.y, s.z) + DVec3::X * 0.01).normalize()
                };
                let point = Point { out, surface: 0.5, normal: 1.0 };
                let mut values = vec![0.0; 1000];
                let mut fit = 0.0;
                for (share, term) in bsdf.terms() {
                    let mut sums = Sums::default();
                    let kernel = Kernel::of(share, term, &suns, &Disc::new(0.0));
                    kernel.add_all(&[point], &suns, &list, &mut sums);
                    if let Kernel::Lobe(lobe) = &kernel {
                        fit = lobe.shape.fit;
                    }
                    for ((value, s), n) in values.iter_mut().zip(&sums.surface).zip(&sums.normal) {
                        assert!((s - 0.5 * n).abs() <= 1e-6 * n);
                        *value += f64::from(*n);
                    }
                }
                for (sun, value) in suns.direction.iter().zip(&values) {
                    let slow = bsdf.evaluate(*sun, out) * sun.z * 700.0;
                    let miss = (value - slow).abs();
                    assert!(miss <= (1e-4 + fit) * slow, "{}: {value} {slow}", preset.name);
                    assert!(fit < 2e-3, "{}: {fit}", preset.name);
                }
            }
        }
    }
}
