//! All that shines at an eye at an instant, patch by patch.
//!
//! A triangle of PV is split until what a patch sends is known from its middle. For models that is
//! where its half vectors spread less than a part of the length over which the lobe changes. A
//! measured BSDF has beams wherever its makers found them, and cells with sharp borders: there the
//! smallest and the largest value of all cells that the patch may touch are known, and the patch that
//! leaves most in doubt is split, again and again, until all doubt together is small beside what
//! arrives. So a face that lies within one cell is one patch, and a beam's border gets many, however
//! far it lies from the mirrored direction.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::glint::{Glint, SunAt};
use super::material::{EyeMaterial, UnderSun, WAYS};
use super::patches::{EyePv, LitPv, Root, Seen, Shining};
use super::shine::Waiting;
use crate::base::Frame;
use crate::bsdf::Cone;
use crate::render::reflect::pv::{Cell, SEEN, radius_m, solid_angle_sr};

/// A patch is looked at through its middle once its half vectors spread less than this share of
/// the length over which the lobe changes: `sqrt(width^2 + tilt^2)`.
const FINE: f64 = 0.15;
/// A patch is at least as fine as that as seen from the eye, rad.
const WIDEST: f64 = 0.1;
/// Patches that are partly in sight or in shadow are split within so many widths of the lobe;
/// farther off it hardly matters which part it is.
const NEAR_WIDTHS: f64 = 4.0;
/// Halvings below the cells.
const DEEPER: u32 = 9;
/// What is left in doubt of measured patches, beside what they send; and beside the sun, where they
/// send next to nothing: a thousandth of a W/m2.
const DOUBT: f64 = 0.01;
const DOUBT_OF_SUN: f64 = 1e-6;
/// A straight border between two values, through a patch of which four parts are looked at, is missed by
/// less than that part of their difference (by trial).
const BORDER_MISSES: f64 = 0.31;
/// Patches of measured surfaces in which an instant is looked at, at most; the bound says what that
/// leaves.
const MOST_PATCHES: usize = 1 << 13;

/// What is being looked at: one triangle of PV.
struct Looking<'a> {
    eye: DVec3,
    sun: &'a SunAt,
    under: &'a UnderSun<'a>,
    root: &'a Root,
    shining: &'a Shining,
    frame: Frame,
    surface: u16,
}

/// A part of a triangle.
#[derive(Clone, Copy, Debug)]
enum Patch {
    /// Cells, of which some may be hidden or dark.
    Cells(Cell),
    /// A piece that is in sight and lit by the same share all over, and its halvings below the
    /// cells.
    Piece { corners: [DVec3; 3], share: f64, halvings: u32 },
}

/// A patch as the eye sees it.
#[derive(Clone, Copy, Debug)]
struct Look {
    patch: Patch,
    /// What of it is in sight and lit, sr.
    solid_sr: f64,
    /// From its middle to the eye, a unit vector; the same in the frame of the PV.
    towards_eye: DVec3,
    out: DVec3,
    /// Its radius as seen from the eye, rad.
    angle: f64,
    /// Whether the same share of all of it shines.
    even: bool,
}

/// A patch whose measured values aren't known from its middle.
#[derive(Clone, Copy, Debug)]
struct Doubt {
    /// What it leaves in doubt, and what it sends, beside the sun's irradiance.
    doubt: f64,
    sends: f64,
    /// Order of patches, so that equal doubts have one.
    number: usize,
    look: Look,
}

impl PartialEq for Doubt {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Doubt {}

impl PartialOrd for Doubt {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Doubt {
    fn cmp(&self, other: &Self) -> Ordering {
        self.doubt.total_cmp(&other.doubt).then(other.number.cmp(&self.number))
    }
}

/// The patches of a triangle that are in doubt.
#[derive(Debug, Default)]
struct Doubts {
    heap: BinaryHeap<Doubt>,
    count: usize,
    /// Sums of what all patches, settled or not, leave in doubt and send.
    doubt: f64,
    sends: f64,
}

impl EyePv<'_> {
    /// All that shines at an eye; `materials` by PV surface. Finest where the sun is mirrored.
    /// `into` is written over. Gives a bound of the error that the jumps of measured surfaces leave in
    /// the irradiance, W/m2.
    pub fn look(
        &self,
        seen: &Seen,
        lit: &LitPv,
        sun: &SunAt,
        materials: &[EyeMaterial<'_>],
        into: &mut Vec<Glint>,
    ) -> f64 {
        into.clear();
        let mut waiting: [Waiting; WAYS] = Default::default();
        let mut doubt = 0.0;
        // The triangles of a facet follow one another.
        let mut last: Option<(usize, UnderSun<'_>)> = None;
        let wanted = |root: &Root| {
            let facet = self.facet(root);
            usize::from(facet.surface) < materials.len() && facet.frame.z.dot(sun.direction) > 0.0
        };
        self.each_shining(seen, lit, wanted, |root, shining| {
            let number = root.triangle.facet;
            let facet = &self.facets[number];
            if last.as_ref().is_none_or(|(last, _)| *last != number) {
                let to_sun = facet.frame.local_from_world(sun.direction);
                last = Some((number, materials[usize::from(facet.surface)].under(sun, to_sun)));
            }
            let Some((_, under)) = &last else { return };
            let (frame, surface, eye) = (facet.frame, facet.surface, seen.eye.position);
            let looking = Looking { eye, sun, under, root, shining, frame, surface };
            let mut doubts = Doubts::default();
            if let Some(whole) = looking.look(Patch::Cells(root.triangle.cell)) {
                looking.descend(whole, &mut doubts, &mut waiting);
                let floor = DOUBT_OF_SUN * whole.solid_sr / seen.solid_angle_sr;
                doubt += looking.settle(doubts, floor, &mut waiting);
            }
            for (way, waiting) in waiting.iter_mut().enumerate().filter(|(_, w)| !w.is_empty()) {
                under.light(way, waiting, into);
            }
        });
        doubt * sun.irradiance_w_m2
    }
}

impl Looking<'_> {
    /// A patch as the eye sees it; `None` where nothing of it shines.
    fn look(&self, patch: Patch) -> Option<Look> {
        let middle = |[a, b, c]: &[DVec3; 3]| (*a + *b + *c) / 3.0 - self.eye;
        let (corners, way, solid_sr, even);
        match &patch {
            Patch::Cells(cell) => {
                corners = cell.corners;
                let part = self.shining.part(&self.root.triangle.asked_cells(cell));
                if part.solid_sr <= 0.0 {
                    return None;
                }
                even = part.whole;
                (way, solid_sr) = match even {
                    true => (middle(&corners), solid_angle_sr(&corners, self.eye)),
                    false => (part.middle, part.solid_sr),
                };
            }
            Patch::Piece { corners: own, share, .. } => {
                corners = *own;
                (way, solid_sr) = (middle(own), share * solid_angle_sr(own, self.eye));
                even = true;
            }
        }
        let away_m = way.length();
        let towards_eye = -way / away_m;
        let out = self.frame.local_from_world(towards_eye);
        let angle = radius_m(&corners) / away_m;
        Some(Look { patch, solid_sr, towards_eye, out, angle, even })
    }

    /// The four parts of a patch, or the pieces of a cell across which a border runs.
    fn parts(&self, patch: &Patch, mut each: impl FnMut(Patch)) {
        let mut quarters = |[a, b, c]: [DVec3; 3], share, halvings| {
            let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
            for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                each(Patch::Piece { corners, share, halvings });
            }
        };
        match patch {
            Patch::Piece { corners, share, halvings } => quarters(*corners, *share, halvings + 1),
            Patch::Cells(cell) if cell.level < self.root.triangle.asked => {
                cell.parts().into_iter().for_each(|part| each(Patch::Cells(part)));
            }
            Patch::Cells(cell) => {
                let range = self.root.triangle.asked_cells(cell);
                if self.shining.part(&range).whole {
                    return quarters(cell.corners, 1.0, 1);
                }
                for (_, piece) in self.shining.pieces(range.start) {
                    let share = f64::from(piece.share) / f64::from(SEEN);
                    each(Patch::Piece { corners: piece.corners, share, halvings: 0 });
                }
            }
        }
    }

    /// Whether a patch is too large for its middle to stand for it, as far as that is known without
    /// asking what is measured.
    fn is_coarse(&self, look: &Look) -> bool {
        match look.patch {
            Patch::Piece { halvings, .. } if halvings >= DEEPER => return false,
            _ if look.angle > WIDEST => return true,
            _ => {}
        }
        let material = &self.under.material;
        if !material.is_modelled() {
            return false;
        }
        let (length, across) = self.half(look);
        let cos = (0.5 * length).max(0.1);
        let spread = 0.5 * look.angle / cos;
        let tilt = (across - spread).max(0.0);
        let disc = 0.5 * self.sun.radius_rad() / cos;
        let width = material.width();
        let own = (width * width + disc * disc).sqrt();
        let scale = (own * own + tilt * tilt).sqrt();
        (width.is_finite() && spread > FINE * scale)
            || (!look.even && self.is_block(look) && tilt < NEAR_WIDTHS * own.min(0.1))
    }

    /// Length of the sum of both directions, and the tilt of the half vector.
    fn half(&self, look: &Look) -> (f64, f64) {
        let half = self.under.to_sun + look.out;
        let length = half.length();
        (length, (half.x * half.x + half.y * half.y).sqrt() / length.max(1e-12))
    }

    /// Whether it is more than one cell.
    fn is_block(&self, look: &Look) -> bool {
        matches!(look.patch, Patch::Cells(cell) if cell.level < self.root.triangle.asked)
    }

    fn descend(&self, look: Look, doubts: &mut Doubts, into: &mut [Waiting; WAYS]) {
        if self.is_coarse(&look) {
            return self.parts(&look.patch, |part| {
                if let Some(look) = self.look(part) {
                    self.descend(look, doubts, into);
                }
            });
        }
        if self.under.material.is_measured() {
            doubts.push(self.doubt(look));
        } else {
            self.wait(&look, into);
        }
    }

    /// How much a patch leaves in doubt.
    fn doubt(&self, look: Look) -> Doubt {
        let corners = match &look.patch {
            Patch::Cells(cell) => &cell.corners,
            Patch::Piece { corners, .. } => corners,
        };
        let cos = |c: &DVec3| (self.eye - *c).normalize().dot(look.towards_eye);
        let least = corners.iter().map(cos).fold(1.0, f64::min);
        let cone = Cone::new(look.out, libm::acos(least.max(-1.0)));
        let [low, high] = self.under.measured_span(&cone);
        let value = self.under.measured(look.out);
        let (doubt, sends) = (BORDER_MISSES * (high - low) * look.solid_sr, value * look.solid_sr);
        Doubt { doubt, sends, number: 0, look }
    }

    /// Splits the patches that leave most in doubt until little is left, and hands all on; gives what
    /// is left.
    fn settle(&self, mut doubts: Doubts, floor: f64, into: &mut [Waiting; WAYS]) -> f64 {
        let mut done = Vec::new();
        while doubts.doubt > (DOUBT * doubts.sends).max(floor) && doubts.count < MOST_PATCHES {
            let Some(worst) = doubts.heap.pop() else { break };
            if worst.doubt <= 0.0 {
                doubts.heap.push(worst);
                break;
            }
            if matches!(worst.look.patch, Patch::Piece { halvings, .. } if halvings >= DEEPER) {
                done.push(worst);
                continue;
            }
            doubts.doubt -= worst.doubt;
            doubts.sends -= worst.sends;
            self.parts(&worst.look.patch, |part| {
                if let Some(look) = self.look(part) {
                    doubts.push(self.doubt(look));
                }
            });
        }
        done.extend(doubts.heap);
        for doubt in &done {
            if doubt.doubt <= 0.0 {
                self.wait(&doubt.look, into);
                continue;
            }
            self.parts(&doubt.look.patch, |part| {
                if let Some(look) = self.look(part) {
                    self.wait(&look, into);
                }
            });
        }
        done.iter().map(|doubt| doubt.doubt).sum()
    }

    fn wait(&self, look: &Look, into: &mut [Waiting; WAYS]) {
        let glint = Glint {
            towards: -look.towards_eye,
            solid_angle_sr: look.solid_sr,
            radiance_w_m2_sr: 0.0,
            surface: self.surface,
        };
        let (length, across) = self.half(look);
        into[self.under.way(length, across)].push(glint, look.out);
    }
}

impl Doubts {
    fn push(&mut self, doubt: Doubt) {
        self.doubt += doubt.doubt;
        self.sends += doubt.sends;
        self.count += 1;
        self.heap.push(Doubt { number: self.count, ..doubt });
    }
}
