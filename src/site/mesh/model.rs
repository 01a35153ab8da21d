use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::patches::{MeshTriangle, patches};
use crate::base::{Place, limits};
use crate::site::Object;
use crate::site::draft::{Draft, Full, Surface, in_reach};
use crate::site::log::Log;

/// What a mesh file holds, in its own coordinates.
#[derive(Debug, Default)]
pub(in crate::site) struct Mesh {
    pub points: Vec<DVec3>,
    /// Names of objects or groups.
    pub objects: Vec<String>,
    /// Groups of objects: parent, child.
    pub parts: Vec<(String, String)>,
    pub materials: Vec<Colour>,
    pub triangles: Vec<MeshTriangle>,
    /// Faces of more than three corners: where their corners lie in `corners`.
    pub polygons: Vec<Polygon>,
    pub corners: Vec<u32>,
}

/// A material's name and diffuse reflectance, where the file says it.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::site) struct Colour {
    pub name: String,
    pub reflectance: Option<[f32; 3]>,
}

#[derive(Clone, Debug)]
pub(in crate::site) struct Polygon {
    pub corners: std::ops::Range<u32>,
    pub object: u32,
    pub material: u32,
    pub line: u32,
}

/// What a mesh becomes part of.
pub(in crate::site) struct Owner<'a> {
    pub source: u32,
    /// The line of the scene file that includes the mesh; 0: lines are the mesh's own.
    pub line: u32,
    /// One object for all; else the mesh's own.
    pub object: Option<u32>,
    /// For each of the mesh's materials the draft's, and the modifier's number.
    pub materials: &'a [(u32, Option<u32>)],
    /// Whether fronts become backs.
    pub mirrored: bool,
}

impl Mesh {
    /// Index of an object of this name.
    pub fn object(&mut self, known: &mut HashMap<String, u32>, name: &str) -> u32 {
        if let Some(&i) = known.get(name) {
            return i;
        }
        let i = self.objects.len() as u32;
        self.objects.push(name.to_owned());
        known.insert(name.to_owned(), i);
        i
    }

    /// Whether there is room for one more face.
    pub fn full(&self) -> bool {
        self.triangles.len() + self.corners.len() >= limits::MAX_TRIANGLES
            || self.points.len() >= 3 * limits::MAX_TRIANGLES
    }

    /// Adds the mesh's surfaces to the draft.
    pub fn add(
        mut self,
        place: impl Fn(DVec3) -> DVec3,
        owner: &Owner<'_>,
        draft: &mut Draft,
        log: &mut Log,
        file: &Path,
    ) -> Result<(), Full> {
        for p in &mut self.points {
            *p = place(*p);
        }
        if let Some(i) = self.points.iter().position(|&p| !in_reach(p)) {
            let message =
                format!("vertex {} lies at {}, which is no place in metres", i + 1, self.points[i]);
            log.fault(Place { file: file.to_owned(), ..Place::default() }, message);
            return Ok(());
        }
        let first_object = draft.objects.len() as u32;
        if owner.object.is_none() {
            let objects = self.objects.drain(..).map(|id| Object { id, kind: "mesh".to_owned() });
            draft.objects.extend(objects);
        }
        for (parent, child) in self.parts.drain(..) {
            draft.children.entry(parent).or_default().push(child);
        }
        let object = |own: u32| owner.object.unwrap_or(first_object + own);
        let line = |own: u32| if owner.line > 0 { owner.line } else { own };
        let surface = |shape, o, m: u32, l| {
            let (material, modifier) = owner.materials[m as usize];
            Surface {
                shape,
                object: object(o),
                material,
                modifier,
                source: owner.source,
                line: line(l),
            }
        };
        for polygon in std::mem::take(&mut self.polygons) {
            let corners =
                &self.corners[polygon.corners.start as usize..polygon.corners.end as usize];
            let n = corners.len();
            let at = |i: usize| {
                let i = if owner.mirrored { n - 1 - i } else { i };
                self.points[corners[i] as usize]
            };
            let first = draft.rings.len();
            draft.add_ring((0..n).map(at))?;
            let shape = draft.planar_since(first);
            draft.add_surface(surface(shape, polygon.object, polygon.material, polygon.line))?;
        }
        for patch in patches(&self.points, &self.triangles) {
            let first_triangle = self.triangles[patch[0] as usize];
            let points = (0..3 * patch.len()).map(|i| {
                let corner = match (owner.mirrored, i % 3) {
                    (true, 1) => 2,
                    (true, 2) => 1,
                    (_, k) => k,
                };
                self.points[self.triangles[patch[i / 3] as usize].corners[corner] as usize]
            });
            let shape = draft.add_flat(points)?;
            draft.add_surface(surface(
                shape,
                first_triangle.object,
                first_triangle.material,
                first_triangle.line,
            ))?;
        }
        Ok(())
    }
}
