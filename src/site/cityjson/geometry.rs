//! Boundaries of CityJSON geometries: nested arrays of vertex numbers, with semantics beside them.
//!
//! The nesting depends on the type (a solid has shells of surfaces of rings); semantics are nested
//! the same way but for the rings. One descent goes through both.

use std::collections::HashMap;
use std::path::Path;

use glam::{DMat4, DVec3, DVec4};

use super::model::{Geometry, Nest, Semantics};
use crate::base::{Place, limits};
use crate::site::draft::{Draft, Full, Surface};
use crate::site::log::Log;
use crate::site::{Material, Object};

/// How many arrays lie around a surface in a geometry's boundaries; `None` for what has no
/// surfaces.
pub(super) fn depth_of(kind: &str) -> Option<usize> {
    match kind {
        "MultiSurface" | "CompositeSurface" => Some(1),
        "Solid" => Some(2),
        "MultiSolid" | "CompositeSolid" => Some(3),
        _ => None,
    }
}

/// The place of a template: `transformationMatrix` (row by row), then the reference point.
pub(super) fn template_matrix(numbers: &[f64], at: DVec3) -> Option<DMat4> {
    let rows: [f64; 16] = numbers.try_into().ok()?;
    let matrix = DMat4::from_cols_array(&rows).transpose();
    (matrix.row(3) == DVec4::W).then(|| DMat4::from_translation(at) * matrix)
}

/// Puts the surfaces of one city object into the draft.
pub(super) struct Builder<'a> {
    pub file: &'a Path,
    pub line: usize,
    pub source: u32,
    /// Index of the draft's material of what nothing is said about.
    pub material: u32,
    /// The draft's materials by name.
    pub materials: &'a mut HashMap<String, u32>,
    pub id: &'a str,
    /// The city object's type, the kind of surfaces without semantics.
    pub kind: &'a str,
    /// Draft objects of this city object, one for each kind of surface, and their materials.
    pub known: Vec<(u32, u32)>,
    pub draft: &'a mut Draft,
    pub log: &'a mut Log,
}

/// What goes with a level of the boundaries.
#[derive(Clone, Copy)]
enum Meaning<'a> {
    None,
    Index(u32),
    Nest(&'a Nest),
}

impl<'a> Meaning<'a> {
    fn child(self, i: usize) -> Self {
        match self {
            Self::Nest(Nest::List(items)) => items.get(i).map_or(Self::None, Self::Nest),
            Self::Nest(Nest::Row(row)) => match row.get(i) {
                Some(&v) if v != Nest::NULL => Self::Index(v),
                _ => Self::None,
            },
            _ => Self::None,
        }
    }

    fn index(self) -> Option<u32> {
        match self {
            Self::Index(v) | Self::Nest(&Nest::One(v)) => Some(v),
            _ => None,
        }
    }
}

/// A geometry, and where its vertices lie.
pub(super) struct Shell<'a> {
    pub geometry: &'a Geometry,
    /// Where it stands in the JSON, below the object: `geometry[0]`.
    pub path: String,
    /// A vertex by its index.
    pub vertex: &'a dyn Fn(u32) -> Option<DVec3>,
    /// How many vertices there are.
    pub vertices: usize,
}

impl Builder<'_> {
    pub fn place(&self) -> Place {
        Place { file: self.file.to_owned(), line: self.line, column: 0, item: self.id.to_owned() }
    }

    pub fn fault(&mut self, path: &str, message: &str) {
        let message = format!("CityObjects/{}/{path}: {message}", self.id);
        self.log.fault(self.place(), message);
    }

    /// Adds all surfaces of a geometry.
    pub fn add(&mut self, shell: &Shell<'_>) -> Result<(), Full> {
        let Some(depth) = depth_of(&shell.geometry.kind) else { return Ok(()) };
        let semantics = shell.geometry.semantics.as_ref();
        let meaning = semantics.map_or(Meaning::None, |s| Meaning::Nest(&s.values));
        self.level(shell, depth, &shell.geometry.boundaries, meaning, &mut Vec::new())
    }

    fn level(
        &mut self,
        shell: &Shell<'_>,
        depth: usize,
        nest: &Nest,
        meaning: Meaning<'_>,
        path: &mut Vec<usize>,
    ) -> Result<(), Full> {
        if self.log.full() {
            return Ok(());
        }
        let items = match nest {
            Nest::List(items) => items,
            Nest::Row(row) if row.is_empty() && depth > 0 => return Ok(()),
            _ => {
                let message = format!(
                    "expected {} nested arrays in the boundaries of a {}",
                    depth + 2,
                    shell.geometry.kind
                );
                self.fault(&spelt(shell, path), &message);
                return Ok(());
            }
        };
        if depth == 0 {
            return self.surface(shell, items, meaning.index(), path);
        }
        for (i, item) in items.iter().enumerate() {
            path.push(i);
            self.level(shell, depth - 1, item, meaning.child(i), path)?;
            path.pop();
        }
        Ok(())
    }

    fn surface(
        &mut self,
        shell: &Shell<'_>,
        rings: &[Nest],
        meaning: Option<u32>,
        path: &[usize],
    ) -> Result<(), Full> {
        let first = self.draft.rings.len();
        let mut count = 0;
        for (r, ring) in rings.iter().enumerate() {
            let Nest::Row(row) = ring else {
                let message = "expected a ring: an array of vertex indices";
                self.fault(&format!("{}[{r}]", spelt(shell, path)), message);
                return Ok(());
            };
            count += row.len();
            if let Some(at) = row.iter().position(|&v| (shell.vertex)(v).is_none()) {
                let found = match row[at] {
                    Nest::NULL => "null".to_owned(),
                    v => v.to_string(),
                };
                let message = format!(
                    "vertex index {found}; expected one below {}, the number of vertices",
                    shell.vertices
                );
                self.fault(&format!("{}[{r}][{at}]", spelt(shell, path)), &message);
                return Ok(());
            }
            self.draft.add_ring(row.iter().map(|&v| (shell.vertex)(v).unwrap_or_default()))?;
        }
        if count > limits::MAX_POLYGON_VERTICES {
            let message =
                format!("a surface of {count} vertices; {} at most", limits::MAX_POLYGON_VERTICES);
            self.fault(&spelt(shell, path), &message);
            return Ok(());
        }
        let (object, material) =
            self.object(shell.geometry.semantics.as_ref(), meaning, shell, path);
        let shape = self.draft.planar_since(first);
        self.draft.add_surface(Surface {
            shape,
            object,
            material,
            modifier: None,
            source: self.source,
            line: self.line as u32,
        })
    }

    /// The draft object for surfaces of a kind of this city object, and its material.
    fn object(
        &mut self,
        semantics: Option<&Semantics>,
        meaning: Option<u32>,
        shell: &Shell<'_>,
        path: &[usize],
    ) -> (u32, u32) {
        let surfaces = semantics.map_or(&[][..], |s| &s.surfaces);
        let named = meaning.and_then(|m| surfaces.get(m as usize));
        if let (Some(m), None) = (meaning, named) {
            let message = format!(
                "CityObjects/{}/{}: semantics name surface {m}, there are {}; taken as `{}`",
                self.id,
                spelt(shell, path),
                surfaces.len(),
                self.kind
            );
            self.log.warn("semantics that name a surface that isn't there", self.place(), message);
        }
        let kind = named.map(|s| s.kind.as_str()).filter(|k| !k.is_empty()).unwrap_or(self.kind);
        let same = |&&(o, _): &&(u32, u32)| self.draft.objects[o as usize].kind == kind;
        if let Some(&known) = self.known.iter().find(same) {
            return known;
        }
        let object = self.draft.objects.len() as u32;
        self.draft.objects.push(Object { id: self.id.to_owned(), kind: kind.to_owned() });
        let material = self.material(kind);
        self.known.push((object, material));
        (object, material)
    }

    /// The material named after a kind of surface: an earlier file's, or as what nothing is said
    /// about.
    fn material(&mut self, kind: &str) -> u32 {
        if let Some(&known) = self.materials.get(kind) {
            return known;
        }
        let plain = self.draft.materials[self.material as usize].clone();
        let new = self.draft.materials.len() as u32;
        self.draft.materials.push(Material { name: kind.to_owned(), ..plain });
        self.materials.insert(kind.to_owned(), new);
        new
    }
}

fn spelt(shell: &Shell<'_>, path: &[usize]) -> String {
    use std::fmt::Write;
    let mut out = format!("{}/boundaries", shell.path);
    for i in path {
        let _ = write!(out, "[{i}]");
    }
    out
}
