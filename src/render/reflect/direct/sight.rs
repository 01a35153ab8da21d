//! Which suns each part of the PV sees: all that depends neither on materials nor on where light
//! goes, so that it is asked once for all receivers and materials.
//!
//! Every node of a triangle's lattice is asked for every sun. A cell whose corners agree sees what they
//! see; of one that a shadow's border crosses 16 parts are asked. Coarser cells have the mean of their
//! four, and a bit that says whether it is the same all over, so that whoever descends knows at once
//! where no border is.

use glam::DVec3;
use rayon::prelude::*;

use super::suns::Suns;
use crate::base::{Progress, Timeline};
use crate::render::reflect::facet::{Facet, facets};
use crate::render::reflect::pv::{Cell, PvTriangle, levels};
use crate::render::view::error::Error;
use crate::site::Site;

/// Edge of the cells between whose corners the PV is asked what it sees, m.
const CELL_M: f64 = 0.5;
/// Cells times suns; with more, cells are larger.
const MOST_ANSWERS: usize = 1 << 27;
/// Parts that a cell on a shadow's border is asked in.
const PARTS: usize = 16;
/// Levels between a cell and those parts.
const PART_LEVELS: u32 = 2;
/// Part of a cell that a sun lights: in 32,767ths, and a bit where it isn't the same all over the
/// cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LitPart(u16);

const ALL: u16 = 0x7fff;
const UNEVEN: u16 = 0x8000;

impl LitPart {
    /// The mean of several; even if all of them are the same.
    fn of<const N: usize>(parts: [Self; N]) -> Self {
        if parts.iter().all(|p| *p == parts[0]) {
            return parts[0];
        }
        let sum: u32 = parts.iter().map(|p| u32::from(p.0 & ALL)).sum();
        let n = N as u32;
        let mean = (sum + n / 2) / n;
        // Not dark where anything is lit.
        Self(mean.max(u32::from(sum > 0)) as u16 | if sum > 0 { UNEVEN } else { 0 })
    }

    fn even(share: f32) -> Self {
        Self((share.clamp(0.0, 1.0) * f32::from(ALL)).round() as u16)
    }

    #[inline]
    pub(super) fn is_dark(self) -> bool {
        self.0 == 0
    }

    /// 0 to 1.
    #[inline]
    pub(super) fn part(self) -> f32 {
        f32::from(self.0 & ALL) / f32::from(ALL)
    }

    #[inline]
    pub(super) fn is_even(self) -> bool {
        self.0 & UNEVEN == 0
    }
}

/// The PV, and which suns each part of it sees: all that depends neither on materials nor on where
/// light goes.
#[derive(Debug)]
pub struct PvSight {
    pub(super) facets: Vec<Facet>,
    /// By facet.
    pub(super) suns: Vec<Suns>,
    pub(super) roots: Vec<Rooted>,
}

/// A triangle of PV and the suns that its cells see.
#[derive(Debug)]
pub(super) struct Rooted {
    pub triangle: PvTriangle,
    /// Middles of the asked cells.
    pub middles: Vec<DVec3>,
    /// Suns of the facet.
    suns: usize,
    /// By level up to the asked one: for each cell and sun the part that sees it.
    lit: Vec<Vec<LitPart>>,
}

impl PvSight {
    /// Asks every cell of the PV for every sun.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn new(
        site: &Site,
        timeline: &Timeline,
        sun_visibility: bool,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let facets = facets(site);
        let alike = site.months_alike();
        let suns: Vec<Suns> = facets.iter().map(|f| Suns::of(f, timeline, &alike)).collect();
        let cell_m = cell_m(&facets, &suns);
        if cell_m > CELL_M {
            progress.say(&format!(
                "{} suns: the PV is asked what it sees of them every {cell_m} m instead of every {CELL_M} m, so that the answers fit; the bound of the error counts that",
                timeline.steps.len()
            ));
        }
        let mut roots: Vec<Rooted> = Vec::new();
        for (number, facet) in facets.iter().enumerate() {
            let count = suns[number].len();
            roots.extend(facet.triangles.iter().map(|t| Rooted::new(number, *t, cell_m, count)));
        }
        let nodes: u64 = roots.iter().map(|r| r.triangle.lattice.len() as u64).sum();
        progress.begin("sun on the PV", nodes, "places");
        for root in &mut roots {
            let facet = &facets[root.triangle.facet];
            let directions: Vec<DVec3> = suns[root.triangle.facet]
                .direction
                .iter()
                .map(|d| facet.frame.world_from_local(*d))
                .collect();
            let months = &suns[root.triangle.facet].month;
            let passes = |place: DVec3, sun: usize| {
                let start = facet.ray_start(place, directions[sun]).as_vec3();
                let way = directions[sun].as_vec3();
                let month = usize::from(months[sun]);
                LitPart::even(if sun_visibility {
                    site.transmittance(start, way, f32::INFINITY, month)
                } else {
                    1.0
                })
            };
            root.ask(&passes, progress)?;
        }
        progress.finish();
        Ok(Self { facets, suns, roots })
    }
}

/// Edge of the asked cells: so small that all answers fit.
fn cell_m(facets: &[Facet], suns: &[Suns]) -> f64 {
    let mut cell_m = CELL_M;
    loop {
        let answers: usize = facets
            .iter()
            .zip(suns)
            .flat_map(|(f, suns)| f.triangles.iter().map(move |t| (t, suns)))
            .map(|(t, suns)| (1_usize << (2 * levels(t, cell_m))) * suns.len())
            .fold(0, usize::saturating_add);
        if answers <= MOST_ANSWERS || cell_m > 100.0 {
            return cell_m;
        }
        cell_m *= 2.0;
    }
}

impl Rooted {
    fn new(facet: usize, corners: [DVec3; 3], cell_m: f64, suns: usize) -> Self {
        Self {
            triangle: PvTriangle::new(facet, corners, cell_m),
            middles: Vec::new(),
            suns,
            lit: Vec::new(),
        }
    }

    /// What part of a cell each sun lights; below the asked level what its asked cell says.
    #[inline]
    pub(super) fn lit(&self, cell: &Cell) -> &[LitPart] {
        let level = cell.level.min(self.triangle.asked);
        let row = cell.index >> (2 * (cell.level - level));
        &self.lit[level as usize][row * self.suns..(row + 1) * self.suns]
    }

    /// Asks the lattice's nodes for every sun; a cell whose corners agree sees what they see, else
    /// its parts are asked.
    fn ask(
        &mut self,
        passes: &(impl Fn(DVec3, usize) -> LitPart + Sync),
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let (suns, nodes) = (self.suns, self.triangle.lattice.nodes());
        if suns == 0 {
            return Ok(());
        }
        let mut at_node = vec![LitPart::default(); nodes.len() * suns];
        at_node.par_chunks_mut(suns).zip(&nodes).try_for_each(|(row, node)| {
            progress.check()?;
            let place = self.triangle.lattice.place(*node);
            for (sun, answer) in row.iter_mut().enumerate() {
                *answer = passes(place, sun);
            }
            progress.advance(1);
            Ok::<(), Error>(())
        })?;
        let cells = self.triangle.cell.below(self.triangle.asked);
        self.middles = cells.iter().map(Cell::middle).collect();
        let mut lit = vec![LitPart::default(); cells.len() * suns];
        lit.par_chunks_mut(suns).zip(&cells).try_for_each(|(row, cell)| {
            progress.check()?;
            let corners = cell.nodes.map(|node| self.triangle.lattice.number(node) * suns);
            let mut parts = Vec::new();
            for (sun, answer) in row.iter_mut().enumerate() {
                let said = corners.map(|at| at_node[at + sun]);
                *answer = if said.iter().all(|s| *s == said[0]) {
                    said[0]
                } else {
                    if parts.is_empty() {
                        parts = cell.below(PART_LEVELS);
                    }
                    LitPart::of::<PARTS>(std::array::from_fn(|i| passes(parts[i].middle(), sun)))
                };
            }
            Ok::<(), Error>(())
        })?;
        self.lit = vec![lit];
        for level in 0..self.triangle.asked as usize {
            let coarser = self.lit[level].chunks_exact(4 * suns).flat_map(|rows| {
                (0..suns)
                    .map(move |sun| LitPart::of([0, 1, 2, 3].map(|part| rows[part * suns + sun])))
            });
            self.lit.push(coarser.collect());
        }
        self.lit.reverse();
        Ok(())
    }
}
