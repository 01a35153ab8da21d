//! A side of a PV surface as photons start from it, cut into pieces.
//!
//! A horizon for the whole of a long roof would be too careful: one end sees a wall that the other
//! doesn't. So each side is cut into up to 128 pieces, each with a horizon of its own, and a set of
//! pieces is one integer ([`Pieces`]).

use glam::{DVec3, Vec3};

use super::clip::Polygon;
use crate::base::{Frame, Stream};
use crate::bsdf::Bsdf;
use crate::site::Site;

/// Pieces that an emitter is cut into, at most: each has a bit in a [`Pieces`].
pub(super) const MOST_PIECES: usize = 128;
/// Pieces that all PV together is cut into, about.
const ALL_PIECES: f64 = 512.0;
/// No piece is made smaller than this, m.
const FINEST_PIECE_M: f64 = 0.5;

/// A set of an emitter's pieces: bit i stands for piece i.
pub(super) type Pieces = u128;

/// A part of an emitter: what lies in one cell of a grid over it.
#[derive(Debug, Default)]
pub(super) struct Piece {
    /// Corners of the triangles, metres.
    pub triangles: Vec<[DVec3; 3]>,
    /// Share of the piece's area in the triangles up to and with each one.
    cumulative: Vec<f64>,
    /// Share of the emitter's area.
    pub share: f64,
}

/// One side of a PV surface, as photons start from it.
#[derive(Debug)]
pub(super) struct Emitter<'a> {
    /// The PV surface's number.
    pub surface: u16,
    /// Its frame; z is the normal of this side.
    pub frame: Frame,
    /// How it scatters.
    pub bsdf: &'a Bsdf,
    /// Area, m2.
    pub area_m2: f64,
    /// Height along the normal from which photons start. All of the surface lies below, however
    /// uneven its corners are, so that it never shades or hits itself.
    pub start_m: f64,
    /// Height along the normal below which nothing can be hit by what leaves this side.
    pub floor_m: f64,
    /// The parts that photons start from; together all of it.
    pub pieces: Vec<Piece>,
    /// Share of the area in the pieces up to and with each one.
    cumulative: Vec<f64>,
}

/// Farthest coordinate of the scene from the local origin, m: what f32 rounding scales with.
pub(super) fn reach_m(site: &Site) -> f64 {
    if site.bounds.is_empty() {
        return 0.0;
    }
    f64::from(site.bounds.min.abs().max(site.bounds.max.abs()).max_element())
}

/// How far above its surface a photon starts, m: above all rounding of f32 positions and directions
/// over the scene (one part in 16 million, some 30 times over), and a millimetre at least.
fn lift_m(site: &Site) -> f64 {
    (4e-6 * reach_m(site)).max(1e-3)
}

/// All sides that emit, by surface, front before back. Surfaces without area are left out.
pub(super) fn emitters<'a>(site: &Site, bsdfs: &[&'a Bsdf]) -> Vec<Emitter<'a>> {
    let lift = lift_m(site);
    let sides = |two_sided| if two_sided { 2.0 } else { 1.0 };
    let all_m2: f64 = site.pv.iter().map(|pv| sides(pv.two_sided) * pv.area_m2).sum();
    let piece_m2 = (all_m2 / ALL_PIECES).max(FINEST_PIECE_M * FINEST_PIECE_M);
    let mut out = Vec::new();
    for (number, (pv, bsdf)) in site.pv.iter().zip(bsdfs).enumerate() {
        let triangles: Vec<_> = pv
            .triangles
            .iter()
            .map(|&t| site.triangles[t as usize].corners.map(Vec3::as_dvec3))
            .collect();
        let area_m2: f64 = triangles.iter().map(area_of).sum();
        let usable = area_m2 > 0.0 && area_m2.is_finite() && pv.normal.length_squared() > 0.5;
        let Ok(surface) = u16::try_from(number) else { break };
        if !usable {
            continue;
        }
        let sides = if pv.two_sided { 2 } else { 1 };
        for normal in [pv.normal, -pv.normal].into_iter().take(sides) {
            let normal = normal.normalize();
            let top = triangles
                .iter()
                .flatten()
                .fold(f64::NEG_INFINITY, |most, &corner| most.max(normal.dot(corner)));
            let frame = Frame::around(normal);
            let pieces = pieces(&triangles, &frame, area_m2, piece_m2);
            let mut sum = 0.0;
            let cumulative = pieces
                .iter()
                .map(|piece| {
                    sum += piece.share;
                    sum
                })
                .collect();
            out.push(Emitter {
                surface,
                frame,
                bsdf,
                area_m2,
                start_m: top + lift,
                floor_m: top + 0.5 * lift,
                pieces,
                cumulative,
            });
        }
    }
    out
}

fn area_of([a, b, c]: &[DVec3; 3]) -> f64 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

/// Cuts triangles along a grid in their plane, into pieces of about `piece_m2` or larger.
fn pieces(triangles: &[[DVec3; 3]], frame: &Frame, area_m2: f64, piece_m2: f64) -> Vec<Piece> {
    let axes = [frame.x, frame.y];
    let spans = axes.map(|axis| {
        let along = triangles.iter().flatten().map(|p| axis.dot(*p));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), at| (a.min(at), b.max(at)))
    });
    let wide = spans.map(|(a, b)| b - a);
    let mut edge_m = piece_m2.max(area_m2 / MOST_PIECES as f64).sqrt().max(1e-3);
    // What isn't a rectangle fills a part of its grid alone; the grid may have more cells than
    // there may be pieces.
    loop {
        let cells = wide.map(|w| ((w / edge_m).ceil().min(4096.0) as usize).max(1));
        let found = cut(triangles, axes, spans, cells, area_m2);
        if found.len() <= MOST_PIECES || cells == [1, 1] {
            return found;
        }
        edge_m *= 1.1;
    }
}

fn cut(
    triangles: &[[DVec3; 3]],
    axes: [DVec3; 2],
    spans: [(f64, f64); 2],
    cells: [usize; 2],
    area_m2: f64,
) -> Vec<Piece> {
    let line = |axis: usize, i: usize| {
        spans[axis].0 + (spans[axis].1 - spans[axis].0) * i as f64 / cells[axis] as f64
    };
    let mut out: Vec<Piece> = Vec::new();
    let mut slot = vec![usize::MAX; cells[0] * cells[1]];
    for triangle in triangles {
        let shape = Polygon::triangle(*triangle);
        let range = |axis: usize| {
            let along = triangle.map(|p| axes[axis].dot(p));
            let low = along.iter().fold(f64::INFINITY, |a, &b| a.min(b));
            let high = along.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
            let wide = (spans[axis].1 - spans[axis].0).max(f64::MIN_POSITIVE);
            let index = |at: f64| {
                let at = (at - spans[axis].0) / wide * cells[axis] as f64;
                (at as usize).min(cells[axis] - 1)
            };
            // A cell more on either side: rounding must not lose a sliver.
            index(low).saturating_sub(1)..=(index(high) + 1).min(cells[axis] - 1)
        };
        // The outermost cells are open, so that nothing is lost at the ends.
        let between = |shape: &Polygon, axis: usize, i: usize| {
            let low = if i == 0 { f64::NEG_INFINITY } else { line(axis, i) };
            let high = if i + 1 == cells[axis] { f64::INFINITY } else { line(axis, i + 1) };
            let above = if low.is_finite() { shape.above(axes[axis], low) } else { *shape };
            if high.is_finite() { above.above(-axes[axis], -high) } else { above }
        };
        for i in range(0) {
            let slab = between(&shape, 0, i);
            if slab.is_empty() {
                continue;
            }
            for j in range(1) {
                let part = between(&slab, 1, j);
                let points = part.points();
                for k in 2..points.len() {
                    let triangle = [points[0], points[k - 1], points[k]];
                    let area = area_of(&triangle);
                    if area <= 1e-12 * area_m2 {
                        continue;
                    }
                    let number = &mut slot[j * cells[0] + i];
                    if *number == usize::MAX {
                        *number = out.len();
                        out.push(Piece::default());
                    }
                    let piece = &mut out[*number];
                    piece.triangles.push(triangle);
                    piece.share += area / area_m2;
                    piece.cumulative.push(piece.share);
                }
            }
        }
    }
    for piece in &mut out {
        for share in &mut piece.cumulative {
            *share /= piece.share;
        }
    }
    out
}

impl Emitter<'_> {
    /// All of its pieces.
    pub(super) fn all(&self) -> Pieces {
        Pieces::MAX >> (MOST_PIECES - self.pieces.len().clamp(1, MOST_PIECES))
    }

    /// Share of the area in some pieces.
    pub(super) fn share(&self, of: Pieces) -> f64 {
        if of == self.all() {
            return 1.0;
        }
        set(of).filter_map(|i| self.pieces.get(i)).map(|p| p.share).sum()
    }

    /// One of some pieces, in proportion to its area.
    #[inline]
    pub(super) fn piece(&self, of: Pieces, share: f64, random: &mut Stream) -> usize {
        // Where many may be taken, the first try is good more often than not.
        if share > 0.25 {
            for _ in 0..32 {
                let pick = random.uniform();
                let i = self.cumulative.partition_point(|&upto| upto <= pick);
                let i = i.min(self.pieces.len() - 1);
                if of >> i & 1 != 0 {
                    return i;
                }
            }
        }
        let mut left = random.uniform() * share;
        let mut last = 0;
        for i in set(of) {
            last = i;
            left -= self.pieces.get(i).map_or(0.0, |p| p.share);
            if left < 0.0 {
                break;
            }
        }
        last
    }

    /// A point uniform on a piece, moved to where photons start, m.
    #[inline]
    pub(super) fn point(&self, piece: usize, random: &mut Stream) -> DVec3 {
        let piece = &self.pieces[piece];
        let pick = random.uniform();
        let (u, v) = (random.uniform(), random.uniform());
        let i = piece.cumulative.partition_point(|&share| share <= pick);
        let [a, b, c] = piece.triangles[i.min(piece.triangles.len() - 1)];
        // The unit square folded onto the triangle keeps it uniform.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        self.lifted(a + (b - a) * u + (c - a) * v)
    }

    /// Whether any point of a box lies above this side's plane.
    pub(super) fn faces(&self, (low, high): &(DVec3, DVec3)) -> bool {
        let n = self.frame.z;
        n.dot(DVec3::select(n.cmpgt(DVec3::ZERO), *high, *low)) > self.floor_m
    }

    /// `point` moved along the normal to where photons start.
    #[inline]
    pub(super) fn lifted(&self, point: DVec3) -> DVec3 {
        point + self.frame.z * (self.start_m - self.frame.z.dot(point))
    }
}

/// The numbers of the bits that are set, upwards.
fn set(mut of: Pieces) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let i = of.trailing_zeros() as usize;
        of &= of.wrapping_sub(1);
        (i < MOST_PIECES).then_some(i)
    })
}
