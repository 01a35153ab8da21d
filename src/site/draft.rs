//! The scene as its files have it, before it is moved, turned and triangulated.
//!
//! All readers fill one draft in f64 and in the coordinates of the source: map coordinates have
//! millions of metres, of which f32 keeps decimetres, and where the local origin lies is known only
//! when all files were read.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use super::{Material, Object};
use crate::base::limits;

/// The surfaces of all files in the coordinates of their sources, before they are moved, turned
/// and triangulated. Points lie in one array, so that a million faces cost no million allocations.
#[derive(Debug, Default)]
pub(super) struct Draft {
    /// Points of rings and of triangles.
    pub points: Vec<DVec3>,
    /// The rings of planar surfaces: where each lies in `points`.
    pub rings: Vec<Range<u32>>,
    /// The surfaces.
    pub surfaces: Vec<Surface>,
    /// Named things.
    pub objects: Vec<Object>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Names that surfaces use as their modifier (Radiance).
    pub modifiers: Vec<String>,
    /// Which objects are parts of which, by id.
    pub children: HashMap<String, Vec<String>>,
}

/// A file of the scene while it is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct SourceFile<'a> {
    /// Its number among the scene's files.
    pub number: u32,
    /// Where it lies.
    pub path: &'a Path,
}

/// A surface as its source has it.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    pub shape: Shape,
    /// Index into the draft's objects.
    pub object: u32,
    /// Index into the draft's materials.
    pub material: u32,
    /// Index into the draft's modifiers.
    pub modifier: Option<u32>,
    /// Which file.
    pub source: u32,
    /// Line in the file; 0 where lines mean nothing.
    pub line: u32,
}

/// The geometry of a surface.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// An outer ring and its holes: indices into the draft's rings.
    Planar(Range<u32>),
    /// Triangles, three points each: indices into the draft's points.
    Curved(Range<u32>),
    /// Triangles of one plane, three points each: indices into the draft's points.
    Flat(Range<u32>),
}

/// Whether a point is one on Earth, in whatever coordinates. Numbers beyond would overflow in
/// products and squares.
pub(super) fn in_reach(point: DVec3) -> bool {
    point.abs().cmplt(DVec3::splat(1e9)).all()
}

/// The draft is full.
#[derive(Debug)]
pub(super) struct Full;

impl Draft {
    /// Most points: three for each triangle that a scene may have.
    const MAX_POINTS: usize = 3 * limits::MAX_TRIANGLES;

    fn room(&self, points: usize) -> Result<(), Full> {
        (self.points.len() + points <= Self::MAX_POINTS).then_some(()).ok_or(Full)
    }

    /// Adds a ring.
    pub fn add_ring(&mut self, ring: impl ExactSizeIterator<Item = DVec3>) -> Result<(), Full> {
        self.room(ring.len())?;
        let first = self.points.len() as u32;
        self.points.extend(ring);
        self.rings.push(first..self.points.len() as u32);
        Ok(())
    }

    /// The shape of all rings that were added since there were `first`.
    pub fn planar_since(&self, first: usize) -> Shape {
        Shape::Planar(first as u32..self.rings.len() as u32)
    }

    /// Adds triangles, three points each.
    pub fn add_curved(&mut self, corners: &[DVec3]) -> Result<Shape, Full> {
        self.room(corners.len())?;
        let first = self.points.len() as u32;
        self.points.extend_from_slice(corners);
        Ok(Shape::Curved(first..self.points.len() as u32))
    }

    /// Adds triangles that lie in one plane.
    pub fn add_flat(
        &mut self,
        corners: impl ExactSizeIterator<Item = DVec3>,
    ) -> Result<Shape, Full> {
        self.room(corners.len())?;
        let first = self.points.len() as u32;
        self.points.extend(corners);
        Ok(Shape::Flat(first..self.points.len() as u32))
    }

    /// Adds a surface.
    pub fn add_surface(&mut self, surface: Surface) -> Result<(), Full> {
        if self.surfaces.len() >= limits::MAX_TRIANGLES {
            return Err(Full);
        }
        self.surfaces.push(surface);
        Ok(())
    }

    /// The points of a ring.
    pub fn ring(&self, ring: u32) -> &[DVec3] {
        let Range { start, end } = self.rings[ring as usize];
        &self.points[start as usize..end as usize]
    }

    /// All ids that count as `id`: itself and its parts, theirs, and so on.
    pub fn with_parts<'a>(&'a self, id: &'a str) -> Vec<&'a str> {
        let mut known = std::collections::HashSet::from([id]);
        let mut out = vec![id];
        let mut next = 0;
        while next < out.len() {
            for child in self.children.get(out[next]).into_iter().flatten() {
                if known.insert(child) {
                    out.push(child);
                }
            }
            next += 1;
        }
        out
    }
}

const _: () = assert!(Draft::MAX_POINTS < u32::MAX as usize);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_parts_count_and_circles_end() {
        let mut draft = Draft::default();
        draft.children.insert("a".into(), vec!["b".into(), "c".into()]);
        draft.children.insert("c".into(), vec!["d".into(), "a".into()]);
        assert_eq!(draft.with_parts("a"), ["a", "b", "c", "d"]);
        assert_eq!(draft.with_parts("x"), ["x"]);
    }
}
