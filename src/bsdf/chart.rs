//! Scattering square by square: how a BSDF is drawn from, bounded and aimed.
//!
//! A photon that leaves the PV should reach something. Drawing a direction from the whole BSDF and
//! throwing away what flies into the sky wastes nearly all photons of a flat roof. So each lobe of
//! a BSDF is a chart ([`super::Chart`]): a map from the unit square to directions. For two even
//! numbers `(u, v)` it gives a direction and a density such that `f * cos(out) dω = density du dv`.
//! A square of a chart ([`super::Square`]) is a set of directions that can be halved, and three
//! things are known of it without drawing anything:
//!
//! - [`Bsdf::reach`]: a cone that holds all its directions, for every incident direction of a cone
//!   (the sun's disc). A square whose cone clears the horizon of what can be hit is left out, and
//!   provably nothing is lost.
//! - [`Bsdf::most`]: an upper bound of `density * cos(in)` over the square and the sun's disc.
//!   Photons are shared out by it, and survive with `density * cos(in) / most`, so that all carry
//!   the same flux.
//! - [`Bsdf::density`]: the density itself.
//!
//! What the square means depends on the kind: for microfacets the two numbers draw a half vector
//! among those that the incident direction sees (Heitz 2018, "Sampling the GGX distribution of
//! visible normals"), for a diffuse base a direction by the square of its sine, for a tensor tree a
//! cell of its outgoing square. With one chart of
//! outgoing directions for all kinds a narrow lobe would lie in one square in ten thousand, and the
//! bounds would say nothing before it was halved seven times.

use std::f64::consts::PI;

use glam::DVec3;

use super::block::Table;
use super::circle::on_hemisphere;
use super::square::{Chart, Square};
use super::{Bsdf, Cone, Measured, Scattered};
use crate::base::Stream;

/// Scattering square by square. For each lobe, `f * cos(out) dω = density(u, v) du dv`, where two
/// numbers from 0 to 1 cover a square of the lobe, and the square's area is a share of the lobe's;
/// the sum of the lobes' integrals is the reflectance.
impl Bsdf {
    /// The parts that it is drawn from.
    pub fn charts(&self) -> &'static [Chart] {
        match self {
            Self::Lambertian { .. } => &[Chart::Hemisphere],
            Self::Mirror { .. } | Self::Glass { .. } => &[Chart::Mirrored],
            Self::Facets(facets) => facets.charts(),
            Self::Measured(measured) => match measured.table() {
                Table::Matrix(_) => &[Chart::Hemisphere],
                Table::Tree(_) => &[Chart::Cells],
            },
            #[allow(unreachable_patterns, reason = "models without lobes are drawn as a whole")]
            _ => &[Chart::Whole],
        }
    }

    /// Direction and density at a point of a square. `None`: nothing goes there, or (for
    /// [`Chart::Whole`]) nobody knows.
    pub fn density(&self, square: Square, incident: DVec3, u: f64, v: f64) -> Option<(DVec3, f64)> {
        self.density_above(square, incident, u, v, 0.0)
    }

    /// [`Self::density`]; may stop early where it finds that it is below `least`.
    #[inline]
    fn density_above(
        &self,
        square: Square,
        incident: DVec3,
        u: f64,
        v: f64,
        least: f64,
    ) -> Option<(DVec3, f64)> {
        let at = square.at(u, v);
        match (self, square.chart) {
            (_, Chart::Whole) => None,
            (_, Chart::Mirrored) => {
                let out = DVec3::new(-incident.x, -incident.y, incident.z);
                Some((out, self.mirrored(incident)))
            }
            (Self::Lambertian { reflectance }, _) => {
                Some((on_hemisphere(at.0, at.1), *reflectance))
            }
            (Self::Facets(facets), chart) => facets.density(chart, incident, at, least),
            (Self::Measured(measured), _) => measured.density(square, incident, u, v),
            #[allow(unreachable_patterns, reason = "models without lobes are drawn as a whole")]
            _ => None,
        }
    }

    /// Draws a direction from a square of a lobe so that, over the unit square, `density of the
    /// draw * survival * weight * bound` is the lobe's density. `None`: the photon dies. A bound
    /// that is too low shows as a weight above 1.
    #[inline]
    pub fn draw(
        &self,
        square: Square,
        incident: DVec3,
        bound: f64,
        random: &mut Stream,
    ) -> Option<Scattered> {
        if square.chart == Chart::Whole {
            return self.sample_within(incident, bound, random);
        }
        if incident.z <= 0.0 || bound <= 0.0 {
            return None;
        }
        let stake = random.uniform() * bound;
        let (u, v) = (random.uniform(), random.uniform());
        let (direction, density) = self.density_above(square, incident, u, v, stake)?;
        (stake < density && direction.z > 0.0)
            .then(|| Scattered { direction, weight: (density / bound).max(1.0) })
    }

    /// A cone that holds every direction of a square, for every incident direction of `from`.
    pub fn reach(&self, square: Square, from: &Cone) -> Cone {
        match (self, square.chart) {
            (_, Chart::Whole) => Cone::ALL,
            (_, Chart::Mirrored) => {
                let axis = from.axis;
                from.about(DVec3::new(-axis.x, -axis.y, axis.z))
            }
            (_, Chart::Hemisphere) => {
                let (low, high) = square.corners();
                let out = Cone::of_patch([low[0].sqrt(), high[0].sqrt()], [low[1], high[1]]);
                match self {
                    Self::Measured(measured) => out.about(measured.turned(out.axis)),
                    _ => out,
                }
            }
            (Self::Measured(measured), Chart::Cells) => measured.reach(square, from),
            (Self::Facets(facets), Chart::Facets) => facets.reach(square, from),
            _ => Cone::ALL,
        }
    }

    /// For lobes whose bound is a product, [`Self::most`] `= scale(incident) * shape(square)`: the
    /// factor. Their squares can be cut once for all suns.
    pub fn scale(&self, chart: Chart, from: &Cone) -> Option<f64> {
        let high = from.heights().1.max(0.0);
        match (self, chart) {
            (Self::Lambertian { .. }, Chart::Hemisphere) => Some(high),
            (Self::Facets(facets), Chart::Hemisphere) => Some(high * facets.entering(from)),
            _ => None,
        }
    }

    /// Upper bound of `density * cos(incident)` over a square and all incident directions of
    /// `from` above the surface.
    pub fn most(&self, square: Square, from: &Cone) -> f64 {
        let (low, high) = from.heights();
        if high <= 0.0 {
            return 0.0;
        }
        let most = match (self, square.chart) {
            (Self::Lambertian { .. }, _) | (_, Chart::Whole) => self.bound_between(low, high),
            (Self::Mirror { .. } | Self::Glass { .. }, Chart::Mirrored) => {
                self.bound_between(low, high)
            }
            (Self::Facets(facets), _) => facets.most(square, from),
            (Self::Measured(measured), _) => measured.density_most(square, from),
            #[allow(unreachable_patterns, reason = "models without lobes are drawn as a whole")]
            _ => self.bound_between(low, high),
        };
        most * high * (1.0 + 1e-9)
    }
}

impl Measured {
    #[inline]
    fn density(&self, square: Square, incident: DVec3, u: f64, v: f64) -> Option<(DVec3, f64)> {
        let from = self.turned(incident);
        let (out, value) = match self.table() {
            Table::Matrix(m) => {
                let (u, v) = square.at(u, v);
                let out = on_hemisphere(u, v);
                (out, m.evaluate(from, out))
            }
            Table::Tree(t) => t.within(from, (square.level, square.x, square.y), u, v),
        };
        (value > 0.0).then(|| (self.turned(out), PI * value))
    }

    fn reach(&self, square: Square, from: &Cone) -> Cone {
        let Table::Tree(tree) = self.table() else { return Cone::ALL };
        let (low, high) = square.corners();
        let out = tree.reach(low, high, &from.about(self.turned(from.axis)));
        out.about(self.turned(out.axis))
    }

    fn density_most(&self, square: Square, from: &Cone) -> f64 {
        let from = from.about(self.turned(from.axis));
        let (low, high) = square.corners();
        PI * match self.table() {
            Table::Matrix(m) => m.most_within([low[0], high[0]], [low[1], high[1]], &from),
            Table::Tree(t) => t.most_within((square.level, square.x, square.y), &from),
        }
    }
}

/// Files of every kind, for tests: a Klems basis and tensor trees of both ranks.
#[cfg(test)]
pub(crate) fn samples() -> Vec<Bsdf> {
    use std::fmt::Write as _;

    use super::{BsdfFile, KlemsBasis, Side};
    use crate::base::Purpose;

    fn tree(rank: u32, depth: u32, random: &mut Stream, out: &mut String) {
        out.push('{');
        if depth == 0 || random.uniform() < 0.15 {
            for _ in 0..if depth == 0 { 1 } else { 1 << rank } {
                let _ = write!(out, "{:.4}, ", 0.6 * random.uniform() * random.uniform());
            }
        } else {
            for _ in 0..1 << rank {
                tree(rank, depth - 1, random, out);
            }
        }
        out.push('}');
    }
    let file = |structure: &str, bases: &str, numbers: &str, way: &str| {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<WindowElement><Optical><Layer><Material><Name>n</Name></Material><DataDefinition><IncidentDataStructure>{structure}</IncidentDataStructure></DataDefinition><WavelengthData><Wavelength>Visible</Wavelength><WavelengthDataBlock><WavelengthDataDirection>Reflection {way}</WavelengthDataDirection>{bases}<ScatteringData>{numbers}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>"
        );
        let side = if way == "Back" { Side::Front } else { Side::Back };
        let file = BsdfFile::parse(&text, "test.xml").expect("a good file");
        Bsdf::Measured(file.reflection(side, None).expect("has it"))
    };
    let mut out = Vec::new();
    for way in ["Back", "Front"] {
        for rank in [3, 4] {
            let mut numbers = String::new();
            let mut random = Stream::new(11, Purpose::Survey, u64::from(rank));
            tree(rank, if rank == 3 { 5 } else { 3 }, &mut random, &mut numbers);
            let bases = "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>";
            out.push(file(&format!("TensorTree{rank}"), bases, &numbers, way));
        }
        let name = "LBNL/Klems Quarter";
        let basis = KlemsBasis::known(name).expect("known");
        let mut random = Stream::new(5, Purpose::Survey, 1);
        let mut numbers = String::new();
        for o in 0..basis.len() {
            for i in 0..basis.len() {
                let lobe = if i == o { 0.3 / basis.projected_sr(o) } else { 0.0 };
                let _ = write!(numbers, "{:.5} ", 0.15 * random.uniform() + lobe);
            }
        }
        let bases = format!(
            "<ColumnAngleBasis>{name}</ColumnAngleBasis><RowAngleBasis>{name}</RowAngleBasis>"
        );
        out.push(file("Columns", &bases, &numbers, way));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Frame, Purpose};
    use crate::bsdf::Coating;
    use crate::bsdf::{Model, on_circle};

    fn coated(ggx_alpha: f64) -> Model {
        let coating = Some(Coating { index: 1.27, thickness_nm: 118.0 });
        Model::CoatedGlass { index: 1.52, ggx_alpha, cell_reflectance: 0.05, coating }
    }

    fn kinds() -> Vec<Bsdf> {
        let mut out: Vec<Bsdf> = [
            Model::Lambertian { reflectance: 0.5 },
            Model::Mirror { reflectance: 0.9 },
            Model::Glass { index: 1.52 },
            Model::PvGlass { index: 1.52, ggx_alpha: 0.001, cell_reflectance: 0.0 },
            Model::PvGlass { index: 1.52, ggx_alpha: 0.05, cell_reflectance: 0.04 },
            Model::PvGlass { index: 1.3, ggx_alpha: 0.5, cell_reflectance: 0.3 },
            coated(0.0),
            coated(0.03),
            coated(0.4),
            Model::Metal { index: 0.96, extinction: 6.69, ggx_alpha: 0.25 },
        ]
        .iter()
        .map(|model| Bsdf::from_model(model).expect("valid"))
        .collect();
        out.extend(samples());
        out
    }

    #[test]
    fn cones_hold_all_directions_and_bounds_all_densities_of_a_square() {
        for (kind, bsdf) in kinds().iter().enumerate() {
            let mut narrow = 0;
            for i in 0..1500 {
                let mut random = Stream::new(2, Purpose::Survey, i);
                let z = random.uniform() * random.uniform();
                let (cos, sin) = on_circle(random.uniform());
                let z = if i % 7 == 0 { 1.0 - 1e-3 * z } else { z };
                let radius = (1.0 - z * z).sqrt();
                let axis = DVec3::new(radius * cos, radius * sin, z);
                let angle_rad = if i % 3 == 0 { 0.05 } else { 0.00465 };
                let from = Cone::new(axis, angle_rad);
                let lobes = bsdf.charts();
                let mut square = Square::whole(lobes[i as usize % lobes.len()]);
                for _ in 0..random.bits() % 9 {
                    if let Some(parts) = square.quarters() {
                        square = parts[(random.bits() % 4) as usize];
                    }
                }
                let (reach, most) = (bsdf.reach(square, &from), bsdf.most(square, &from));
                narrow += u32::from(reach.angle_rad < 0.3);
                let frame = Frame::around(axis);
                for _ in 0..40 {
                    let (cos, sin) = on_circle(random.uniform());
                    let off = angle_rad * random.uniform().sqrt();
                    let across = frame.x * cos + frame.y * sin;
                    let incident = axis * libm::cos(off) + across * libm::sin(off);
                    if incident.z <= 0.0 {
                        continue;
                    }
                    let (u, v) = (random.uniform(), random.uniform());
                    let Some((out, density)) = bsdf.density(square, incident, u, v) else {
                        continue;
                    };
                    assert!((out.length() - 1.0).abs() < 1e-9);
                    assert!(reach.holds(out), "kind {kind}, {square:?} from {from:?}: {out}");
                    assert!(density * incident.z <= most, "kind {kind}, {square:?} from {from:?}");
                    if let Some(scale) = bsdf.scale(square.chart, &from).filter(|_| most > 0.0) {
                        let up = Cone::new(DVec3::Z, 0.0);
                        let shape = bsdf.most(square, &up)
                            / bsdf.scale(square.chart, &up).expect("the same lobe");
                        assert!((scale * shape / most - 1.0).abs() < 1e-9);
                    }
                }
            }
            assert!(narrow > 100, "kind {kind}: {narrow} cones say something");
        }
    }

    #[test]
    fn the_lobes_sum_to_the_reflectance_and_to_the_function() {
        for (kind, bsdf) in kinds().iter().enumerate() {
            for incident in [DVec3::new(0.3, -0.2, 0.9), DVec3::new(-0.9, 0.3, 0.35)] {
                let incident = incident.normalize();
                let (mut sum, mut by_side) = (0.0, [0.0; 4]);
                const N: u32 = 200;
                let side = |d: DVec3| usize::from(d.x > 0.1) + 2 * usize::from(d.y > 0.05);
                for &lobe in bsdf.charts() {
                    for i in 0..N * N {
                        let (u, v) = (f64::from(i % N) + 0.5, f64::from(i / N) + 0.5);
                        let (u, v) = (u / f64::from(N), v / f64::from(N));
                        let square = Square::whole(lobe);
                        if let Some((out, density)) = bsdf.density(square, incident, u, v)
                            && out.z > 0.0
                        {
                            sum += density / f64::from(N * N);
                            by_side[side(out)] += density / f64::from(N * N);
                        }
                    }
                }
                let whole = bsdf.reflectance(incident);
                assert!((sum / whole - 1.0).abs() < 0.02, "kind {kind}: {sum} of {whole}");
                // Drawn as a whole, it goes to the same sides.
                let mut drawn = [0.0; 4];
                const DRAWS: u64 = 40_000;
                let bound = bsdf.bound(incident);
                for n in 0..DRAWS {
                    let mut random = Stream::new(1, Purpose::Photon, n);
                    if let Some(s) = bsdf.sample(incident, &mut random) {
                        drawn[side(s.direction)] += bound * s.weight / DRAWS as f64;
                    }
                }
                for (a, b) in by_side.iter().zip(&drawn) {
                    let sigma = (bound * b.max(1e-9) / DRAWS as f64).sqrt();
                    assert!((a - b).abs() < 5.0 * sigma + 0.02 * b, "kind {kind}: {a} {b}");
                }
            }
        }
    }
}
