//! What an eye has in sight of the PV, and what a sun lights of that.
//!
//! Both are asked at the nodes of the PV's lattices and followed along borders inside of cells
//! ([`crate::render::reflect::pv`]). For an instant [`Shining`] joins them: how much solid angle of
//! each cell is in sight and lit, summed up along the order of cells, so that for any part of a
//! triangle the solid angle and its middle are differences of two sums. Cells that a border crosses
//! keep the pieces on its bright side. So a strip of which the eye sees a hundredth counts with its own
//! solid angle and direction, not with the mean share of a patch that is larger.

use std::ops::Range;

use glam::DVec3;

use super::glint::Eye;
use super::instant::EyeInstant;
use super::material::EyeMaterial;
use crate::bsdf::Cone;
use crate::render::reflect::facet::{Facet, facets};
use crate::render::reflect::pv::{
    Cell, NOT_ASKED, Piece, PvTriangle, SEEN, common, seen_share, solid_angle_sr,
};
use crate::site::Site;

/// Edge of the cells between whose corners PV is asked what it sees, m.
const CELL_M: f64 = 0.5;
/// How often a cell on a border of what an eye sees is split before the border is taken for
/// straight: corners of what hides it are known to 0.1 m.
const SEEN_SPLITS: u32 = 2;
/// The same for shadows, which are asked for anew with each sun.
const LIT_SPLITS: u32 = 0;
/// Where an eye sees no more cells than that, shadows are asked for as finely as sight.
const FEW_CELLS: usize = 64;
/// Eyes on surfaces are lifted off them by this much, m.
const LIFT_M: f64 = 2e-3;
/// Angle of the blocks for which the most that they may send is looked up, rad: about as wide as
/// cells of files.
const BLOCK_RAD: f64 = 0.06;
/// A cell across which a border runs.
const BORDER: u16 = NOT_ASKED;

/// A triangle of PV and its cells among those of all.
#[derive(Debug)]
pub(super) struct Root {
    pub triangle: PvTriangle,
    /// Its asked cells.
    cells: Vec<Cell>,
    /// Their middles in the frame of the facet.
    local_middles: Vec<DVec3>,
    /// The number of the first of them.
    first: usize,
}

impl Root {
    /// Numbers of its cells among all.
    fn range(&self) -> Range<usize> {
        self.first..self.first + self.cells.len()
    }
}

/// The PV, cut into cells of half a metre.
#[derive(Debug)]
pub struct EyePv<'a> {
    pub(super) site: &'a Site,
    pub(super) facets: Vec<Facet>,
    pub(super) roots: Vec<Root>,
    cells: usize,
}

/// Shares of all cells that something sees, in [`SEEN`]ths.
#[derive(Clone, Debug)]
struct Shares {
    /// [`BORDER`]: see the pieces.
    of: Vec<u16>,
    /// By cell, in their order.
    pieces: Vec<(u32, Piece)>,
}

impl Shares {
    fn none(cells: usize) -> Self {
        Self { of: vec![0; cells], pieces: Vec::new() }
    }

    fn pieces(&self, cell: usize) -> &[(u32, Piece)] {
        let from = self.pieces.partition_point(|(c, _)| (*c as usize) < cell);
        let count = self.pieces[from..].iter().take_while(|(c, _)| *c as usize == cell).count();
        &self.pieces[from..from + count]
    }

    /// Asks the corners of a triangle's cells that are `wanted`.
    fn ask(
        &mut self,
        root: &Root,
        splits: u32,
        wanted: &impl Fn(usize) -> bool,
        sees: &impl Fn(DVec3) -> u16,
    ) {
        let lattice = &root.triangle.lattice;
        let mut at_node = vec![NOT_ASKED; lattice.len()];
        for (cell, number) in root.cells.iter().zip(root.range()).filter(|(_, i)| wanted(*i)) {
            let said = lattice.corners_see(cell, &mut at_node, sees);
            if said[0] == said[1] && said[1] == said[2] {
                self.of[number] = said[0];
                continue;
            }
            self.of[number] = BORDER;
            let pieces = &mut self.pieces;
            let each = &mut |piece| pieces.push((number as u32, piece));
            lattice.cut(cell.corners, said, splits, sees, each);
        }
    }
}

/// What an eye has in sight.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Whose.
    pub eye: Eye,
    shares: Shares,
    /// Of each cell, whole, sr; 0 where nothing of it is in sight.
    solid_sr: Vec<f64>,
    /// Roots of which something is in sight, as if the sun lit all of them.
    pub(super) open: Vec<Shining>,
    cells: usize,
    blocks: Vec<Block>,
    /// Of all PV in sight, sr.
    pub solid_angle_sr: f64,
    /// To the nearest cell in sight, m; infinite where there is none.
    pub nearest_m: f64,
}

/// A part of a triangle of which something is in sight.
#[derive(Clone, Debug)]
struct Block {
    root: usize,
    /// Holds the directions from all of it to the eye, in the frame of the PV.
    outs: Cone,
    solid_sr: f64,
}

/// What a sun lights.
#[derive(Clone, Debug)]
pub struct LitPv {
    /// `None`: all.
    shares: Option<Shares>,
}

impl LitPv {
    /// As if nothing stood between PV and sun.
    pub fn open() -> Self {
        Self { shares: None }
    }
}

/// What of a triangle is in sight and lit.
#[derive(Clone, Debug, Default)]
pub(super) struct Shining {
    /// Index of the root.
    pub root: usize,
    /// Sums up to each cell.
    before: Vec<Sum>,
    /// Pieces of cells across which a border runs, by the cell's number in the triangle.
    pub pieces: Vec<(u32, Piece)>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    solid_sr: f64,
    /// Solid angle times place as seen from the eye, sr m.
    moment: DVec3,
    /// Cells that aren't wholly in sight and lit.
    partly: u32,
}

/// What of some cells is in sight and lit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    /// Solid angle, sr.
    pub solid_sr: f64,
    /// The middle of it as seen from the eye, m; meaningless where it is all.
    pub middle: DVec3,
    /// Whether it is all of them.
    pub whole: bool,
}

impl Shining {
    fn clear(&mut self, root: usize) {
        self.root = root;
        self.before.clear();
        self.before.push(Sum::default());
        self.pieces.clear();
    }

    fn any(&self) -> bool {
        self.before.last().is_some_and(|sum| sum.solid_sr > 0.0)
    }

    fn push(&mut self, solid_sr: f64, middle: DVec3, whole: bool) {
        let last = self.before.last().copied().unwrap_or_default();
        self.before.push(Sum {
            solid_sr: last.solid_sr + solid_sr,
            moment: last.moment + middle * solid_sr,
            partly: last.partly + u32::from(!whole),
        });
    }

    /// Of cells by their number in the triangle.
    #[inline]
    pub(super) fn part(&self, cells: &Range<usize>) -> Part {
        let (from, to) = (&self.before[cells.start], &self.before[cells.end]);
        let solid_sr = to.solid_sr - from.solid_sr;
        let middle = (to.moment - from.moment) / solid_sr.max(f64::MIN_POSITIVE);
        Part { solid_sr, middle, whole: to.partly == from.partly }
    }

    /// Pieces of a cell, by its number in the triangle.
    pub(super) fn pieces(&self, cell: usize) -> &[(u32, Piece)] {
        let from = self.pieces.partition_point(|(c, _)| (*c as usize) < cell);
        let count = self.pieces[from..].iter().take_while(|(c, _)| *c as usize == cell).count();
        &self.pieces[from..from + count]
    }
}

fn middle(corners: &[DVec3; 3]) -> DVec3 {
    (corners[0] + corners[1] + corners[2]) / 3.0
}

impl<'a> EyePv<'a> {
    /// Cuts the PV into cells.
    pub fn new(site: &'a Site) -> Self {
        let facets = facets(site);
        let mut roots: Vec<Root> = Vec::new();
        let mut first = 0;
        for (number, facet) in facets.iter().enumerate() {
            for &corners in &facet.triangles {
                let triangle = PvTriangle::new(number, corners, CELL_M);
                let cells = triangle.cell.below(triangle.asked);
                let local = |cell: &Cell| facet.frame.local_from_world(cell.middle());
                let local_middles = cells.iter().map(local).collect();
                first += cells.len();
                roots.push(Root { triangle, first: first - cells.len(), cells, local_middles });
            }
        }
        Self { site, facets, roots, cells: first }
    }

    /// Whether crowns let light through in some months, so that what is seen depends on them.
    pub fn has_seasons(&self) -> bool {
        self.site.crowns.is_some()
    }

    pub(super) fn facet(&self, root: &Root) -> &Facet {
        &self.facets[root.triangle.facet]
    }

    /// What an eye sees of the PV in a month from 0 (January).
    pub fn seen(&self, eye: Eye, month: usize) -> Seen {
        let place = eye.position + eye.direction * LIFT_M;
        let mut shares = Shares::none(self.cells);
        let mut solid_sr = vec![0.0; self.cells];
        for root in &self.roots {
            let facet = self.facet(root);
            if facet.before_m(place) <= 0.0 {
                continue;
            }
            let sees = |from: DVec3| {
                let way = place - from;
                let length = way.length();
                if eye.direction.dot(way) >= 0.0 {
                    return 0;
                }
                let start = facet.ray_start(from, way / length);
                let (way, length) = (place - start, place.distance(start));
                let end = (length - 0.5 * LIFT_M).max(0.0) as f32;
                let towards = (way / length).as_vec3();
                seen_share(self.site.transmittance(start.as_vec3(), towards, end, month))
            };
            shares.ask(root, SEEN_SPLITS, &|_| true, &sees);
            for (cell, i) in root.cells.iter().zip(root.range()) {
                if shares.of[i] > 0 {
                    solid_sr[i] = solid_angle_sr(&cell.corners, place);
                }
            }
        }
        let mut seen = Seen {
            eye: Eye { position: place, ..eye },
            shares,
            solid_sr,
            open: Vec::new(),
            cells: 0,
            blocks: Vec::new(),
            solid_angle_sr: 0.0,
            nearest_m: f64::INFINITY,
        };
        let mut open = Vec::new();
        for number in 0..self.roots.len() {
            let mut shining = Shining::default();
            self.shine(number, &seen, &LitPv::open(), &mut shining);
            if shining.any() {
                let all = self.roots[number].range();
                seen.cells += all.clone().filter(|i| seen.shares.of[*i] > 0).count();
                seen.solid_angle_sr += shining.part(&(0..all.len())).solid_sr;
                for (cell, i) in self.roots[number].cells.iter().zip(all) {
                    if seen.shares.of[i] > 0 {
                        seen.nearest_m = seen.nearest_m.min(cell.middle().distance(place));
                    }
                }
                open.push(shining);
            }
        }
        for shining in &open {
            let whole = self.roots[shining.root].triangle.cell;
            self.add_blocks(shining, &whole, place, &mut seen.blocks);
        }
        seen.open = open;
        seen
    }

    /// Splits what is in sight of a triangle into blocks.
    fn add_blocks(&self, shining: &Shining, cell: &Cell, eye: DVec3, into: &mut Vec<Block>) {
        let root = &self.roots[shining.root];
        let part = shining.part(&root.triangle.asked_cells(cell));
        if part.solid_sr <= 0.0 {
            return;
        }
        let outs = self.cone(root, &cell.corners, cell.middle(), eye);
        if outs.angle_rad <= BLOCK_RAD || cell.level == root.triangle.asked {
            return into.push(Block { root: shining.root, outs, solid_sr: part.solid_sr });
        }
        cell.parts().iter().for_each(|part| self.add_blocks(shining, part, eye, into));
    }

    /// A cone around the direction from a place to an eye that holds those from a triangle, in the
    /// frame of the PV.
    fn cone(&self, root: &Root, corners: &[DVec3; 3], middle: DVec3, eye: DVec3) -> Cone {
        let towards = (eye - middle).normalize();
        let cos = |c: &DVec3| (eye - *c).normalize().dot(towards);
        let least = corners.iter().map(cos).fold(1.0, f64::min);
        let axis = self.facet(root).frame.local_from_world(towards);
        Cone::new(axis, libm::acos(least.max(-1.0)))
    }

    /// Upper bound of what measured surfaces send to an eye, for a sun of 1 W/m2 anywhere in a cone
    /// (which holds its disc) and without shadows.
    pub(super) fn most_measured(
        &self,
        seen: &Seen,
        suns: &Cone,
        materials: &[EyeMaterial<'_>],
    ) -> EyeInstant {
        let mut out = EyeInstant::default();
        if !materials.iter().any(EyeMaterial::is_measured) {
            return out;
        }
        for block in &seen.blocks {
            let facet = self.facet(&self.roots[block.root]);
            let Some(material) = materials.get(usize::from(facet.surface)) else { continue };
            let local = suns.about(facet.frame.local_from_world(suns.axis));
            if local.heights().1 > 0.0 {
                let radiance = material.most_measured(&local, &block.outs);
                out.normal_w_m2 += radiance * block.solid_sr;
                out.peak.radiance_w_m2_sr = out.peak.radiance_w_m2_sr.max(radiance);
            }
        }
        out.surface_w_m2 = out.normal_w_m2;
        out
    }

    /// Joins what an eye sees of a triangle with what a sun lights of it.
    fn shine(&self, number: usize, seen: &Seen, lit: &LitPv, into: &mut Shining) {
        into.clear(number);
        let root = &self.roots[number];
        let normal = self.facet(root).frame.z;
        let eye = seen.eye.position;
        for (cell, i) in root.cells.iter().zip(root.range()) {
            let in_sight = seen.shares.of[i];
            let in_light = lit.shares.as_ref().map_or(SEEN, |shares| shares.of[i]);
            if in_sight == 0 || in_light == 0 {
                into.push(0.0, DVec3::ZERO, false);
                continue;
            }
            let both =
                |a: u16, b: u16| (u32::from(a) * u32::from(b)).div_ceil(u32::from(SEEN)) as u16;
            if in_sight != BORDER && in_light != BORDER {
                let share = both(in_sight, in_light);
                let solid_sr = seen.solid_sr[i] * f64::from(share) / f64::from(SEEN);
                into.push(solid_sr, cell.middle() - eye, share == SEEN);
                if share < SEEN {
                    into.pieces
                        .push(((i - root.first) as u32, Piece { corners: cell.corners, share }));
                }
                continue;
            }
            let (mut solid_sr, mut moment) = (0.0, DVec3::ZERO);
            let mut add = |corners: [DVec3; 3], share: u16| {
                let own_sr = solid_angle_sr(&corners, eye) * f64::from(share) / f64::from(SEEN);
                if own_sr > 0.0 {
                    solid_sr += own_sr;
                    moment += (middle(&corners) - eye) * own_sr;
                    into.pieces.push(((i - root.first) as u32, Piece { corners, share }));
                }
            };
            let whole = |share| [(0, Piece { corners: cell.corners, share })];
            let (own, other);
            let seen_pieces = if in_sight == BORDER {
                seen.shares.pieces(i)
            } else {
                own = whole(in_sight);
                &own
            };
            let lit_pieces = match lit.shares.as_ref().filter(|_| in_light == BORDER) {
                Some(shares) => shares.pieces(i),
                None => {
                    other = whole(in_light);
                    &other
                }
            };
            for (_, a) in seen_pieces {
                for (_, b) in lit_pieces {
                    let share = both(a.share, b.share);
                    if in_sight == BORDER && in_light == BORDER {
                        common(&a.corners, &b.corners, normal, &mut |c| add(c, share));
                    } else {
                        add(if in_sight == BORDER { a.corners } else { b.corners }, share);
                    }
                }
            }
            into.push(solid_sr, moment / solid_sr.max(f64::MIN_POSITIVE), false);
        }
    }

    /// For each triangle of which something is in sight and lit.
    pub(super) fn each_shining(
        &self,
        seen: &Seen,
        lit: &LitPv,
        wanted: impl Fn(&Root) -> bool,
        mut each: impl FnMut(&Root, &Shining),
    ) {
        let mut joined = Shining::default();
        for open in &seen.open {
            let root = &self.roots[open.root];
            if !wanted(root) {
                continue;
            }
            if lit.shares.is_none() {
                each(root, open);
                continue;
            }
            self.shine(open.root, seen, lit, &mut joined);
            if joined.any() {
                each(root, &joined);
            }
        }
    }

    /// How near half vectors come to the PV's normal with a sun: the smallest tilt of any cell in
    /// sight, rad (at most that), and the smallest cosine between half vectors and the directions
    /// to the sun.
    pub(super) fn least_tilt(&self, seen: &Seen, sun: DVec3) -> (f64, f64) {
        let (mut tilt, mut cos) = (f64::INFINITY, 1.0_f64);
        for open in &seen.open {
            let root = &self.roots[open.root];
            let facet = self.facet(root);
            let to_sun = facet.frame.local_from_world(sun);
            let eye = facet.frame.local_from_world(seen.eye.position);
            let radius_m = root.triangle.cell.radius_m() / f64::from(1_u32 << root.triangle.asked);
            for (i, middle) in root.range().zip(&root.local_middles) {
                if seen.shares.of[i] > 0 {
                    let way = eye - *middle;
                    let away_m = way.length();
                    let half = to_sun + way / away_m;
                    let length = half.length().max(1e-12);
                    let across = (half.x * half.x + half.y * half.y).sqrt() / length;
                    let spread = 0.5 * radius_m / (away_m * (0.5 * length).max(0.05));
                    tilt = tilt.min(across - spread);
                    cos = cos.min(0.5 * length);
                }
            }
        }
        (tilt, cos)
    }

    /// Whether one of the facets before the eye has one of two suns before it, but not the other.
    pub(super) fn passes_a_plane(&self, seen: &Seen, suns: [DVec3; 2]) -> bool {
        let before = |facet: &&Facet| facet.before_m(seen.eye.position) > 0.0;
        self.facets.iter().filter(before).any(|facet| {
            let [a, b] = suns.map(|sun| facet.frame.z.dot(sun) > 0.0);
            a != b
        })
    }

    /// Which of the cells a sun lights in a month; only those are asked that `seen` has in sight.
    pub fn lit(&self, sun: DVec3, seen: &Seen, month: usize) -> LitPv {
        let mut shares = Shares::none(self.cells);
        let splits = if seen.cells > FEW_CELLS { LIT_SPLITS } else { SEEN_SPLITS };
        for open in &seen.open {
            let root = &self.roots[open.root];
            let facet = self.facet(root);
            if facet.frame.z.dot(sun) <= 0.0 {
                continue;
            }
            let way = sun.as_vec3();
            let sees = |from: DVec3| {
                let start = facet.ray_start(from, sun).as_vec3();
                seen_share(self.site.transmittance(start, way, f32::INFINITY, month))
            };
            shares.ask(root, splits, &|i| seen.shares.of[i] > 0, &sees);
        }
        LitPv { shares: Some(shares) }
    }
}
