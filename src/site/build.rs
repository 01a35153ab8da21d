//! From the draft to triangles: polygons are cut, slivers left out, PV outlines cut into faces.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};

use super::draft::{Draft, Shape};
use super::log::Log;
use super::select::{Candidate, Cut};
use super::source::Source;
use super::triangulate::{Flaw, MIN_AREA_M2, Triangulator, keeps_its_normal};
use super::{Error, Face, Triangle};
use crate::base::{Place, limits};

/// Roof faces that look down are broken up to this area, m2; larger ones may be undersides.
const SMALL_DOWNWARD_M2: f64 = 0.1;
/// Points further than this from their polygon's plane are worth a warning, m.
const WARP_M: f64 = 0.05;

/// Cuts the draft's surfaces into the scene's faces and triangles.
pub(super) struct Builder<'a> {
    /// Polygons of `[[pv]]` entries, at which faces are cut.
    cuts: Vec<Cut<'a>>,
    draft: &'a Draft,
    log: &'a mut Log,
    sources: &'a mut [Source],
    pub triangles: Vec<Triangle>,
    pub faces: Vec<Face>,
    /// What selections see of each face.
    pub candidates: Vec<Candidate>,
    cutter: Triangulator,
    cut: Vec<[DVec3; 3]>,
    /// Faces that were left out for want of area, by source and kind.
    flat: BTreeMap<(u32, String), Vec<u32>>,
    /// Small roof faces that look down, and large ones, by source.
    down: BTreeMap<(u32, bool), Vec<u32>>,
}

impl<'a> Builder<'a> {
    pub fn new(
        draft: &'a Draft,
        log: &'a mut Log,
        sources: &'a mut [Source],
        cuts: Vec<Cut<'a>>,
    ) -> Self {
        Self {
            cuts,
            draft,
            log,
            sources,
            triangles: Vec::new(),
            faces: Vec::new(),
            candidates: Vec::new(),
            cutter: Triangulator::default(),
            cut: Vec::new(),
            flat: BTreeMap::new(),
            down: BTreeMap::new(),
        }
    }

    /// Cuts them all, and says what was left out.
    pub fn build(&mut self) -> Result<(), Error> {
        for i in 0..self.draft.surfaces.len() as u32 {
            self.surface(i);
            if self.triangles.len() > limits::MAX_TRIANGLES {
                return Err(Error::TooManyTriangles { limit: limits::MAX_TRIANGLES });
            }
        }
        self.report();
        Ok(())
    }

    fn surface(&mut self, i: u32) {
        let draft = self.draft;
        let surface = &draft.surfaces[i as usize];
        self.cut.clear();
        let kind = &draft.objects[surface.object as usize].kind;
        let normal = match &surface.shape {
            Shape::Curved(points) => {
                let points = &draft.points[points.start as usize..points.end as usize];
                self.cut.extend(points.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
                self.cut.retain(|t| as_f32(t).area_m2() > 0.0);
                DVec3::ZERO
            }
            Shape::Flat(points) => {
                let points = &draft.points[points.start as usize..points.end as usize];
                self.cut.extend(points.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
                let sum: DVec3 = self.cut.iter().map(|[a, b, c]| (b - a).cross(c - a)).sum();
                let normal = sum.normalize_or_zero();
                // Rounded to f32 a sliver may turn to any side; light that meets it would too.
                self.cut.retain(|t| keeps_its_normal(t, normal));
                normal
            }
            Shape::Planar(rings) => {
                let rings: Vec<&[DVec3]> = rings.clone().map(|r| draft.ring(r)).collect();
                let plane = match self.cutter.cut(&rings, &mut self.cut) {
                    Ok(plane) => plane,
                    Err(Flaw::Points | Flaw::Area) => {
                        self.flat.entry((surface.source, kind.clone())).or_default().push(i);
                        return;
                    }
                };
                let looks_down = kind == "RoofSurface" && plane.normal.z < -1e-3;
                if looks_down {
                    let small = plane.area_m2 < SMALL_DOWNWARD_M2;
                    self.down.entry((surface.source, small)).or_default().push(i);
                    if small {
                        return;
                    }
                }
                if (plane.covered_m2 - plane.area_m2).abs() > 1e-3 * plane.area_m2 + 1e-4 {
                    let message = format!(
                        "its edges cross: {:.3} m2 by its outline, {:.3} m2 in triangles",
                        plane.area_m2, plane.covered_m2
                    );
                    let place = self.place_of(i);
                    self.log.warn("polygons whose edges cross", place, message);
                }
                if plane.warp_m > WARP_M {
                    let message = format!(
                        "not flat: points lie up to {:.2} m beside its plane",
                        plane.warp_m
                    );
                    let place = self.place_of(i);
                    self.log.warn("polygons that aren't flat", place, message);
                }
                plane.normal
            }
        };
        self.parts(i, normal);
        self.push(i, normal, None);
    }

    /// Makes the parts of a surface that lie within polygons faces of their own.
    fn parts(&mut self, i: u32, normal: DVec3) {
        for c in 0..self.cuts.len() {
            let cut = &self.cuts[c];
            if self.cut.is_empty() || normal == DVec3::ZERO || !cut.matcher.takes(i, normal) {
                continue;
            }
            let (within, without) = cut.region.split(&self.cut);
            if within.is_empty() {
                continue;
            }
            let entry = cut.entry;
            let whole = without.is_empty();
            let keep = |part: Vec<[DVec3; 3]>| {
                let kept = |t: &[DVec3; 3]| whole || keeps_its_normal(t, normal);
                part.into_iter().filter(kept).collect()
            };
            self.cut = keep(within);
            self.push(i, normal, Some(entry));
            self.cut = keep(without);
        }
    }

    /// Adds a face of the triangles in `cut`; `part`: within the polygon of which entry.
    fn push(&mut self, i: u32, normal: DVec3, part: Option<usize>) {
        // All of it lies within polygons.
        if self.cut.is_empty() && self.candidates.last().is_some_and(|c| c.surface == i) {
            return;
        }
        let surface = &self.draft.surfaces[i as usize];
        let kind = &self.draft.objects[surface.object as usize].kind;
        let first_triangle = self.triangles.len() as u32;
        let face = self.faces.len() as u32;
        let mut area_m2 = 0.0;
        for corners in &self.cut {
            let triangle = Triangle { face, ..as_f32(corners) };
            area_m2 += f64::from(triangle.area_m2());
            self.triangles.push(triangle);
        }
        let triangles = self.triangles.len() as u32 - first_triangle;
        if triangles == 0 {
            self.flat.entry((surface.source, kind.clone())).or_default().push(i);
            return;
        }
        let source = &mut self.sources[surface.source as usize];
        source.faces += 1;
        source.triangles += triangles as usize;
        self.faces.push(Face { object: surface.object, material: surface.material, pv: None });
        self.candidates.push(Candidate {
            surface: i,
            normal,
            area_m2,
            first_triangle,
            triangles,
            part,
        });
    }

    fn place_of(&self, i: u32) -> Place {
        let surface = &self.draft.surfaces[i as usize];
        Place {
            file: self.sources[surface.source as usize].file.clone(),
            line: surface.line as usize,
            column: 0,
            item: self.draft.objects[surface.object as usize].id.clone(),
        }
    }

    /// Says what was left out: one line for each file and kind, with the first few names.
    fn report(&mut self) {
        for ((source, kind), faces) in std::mem::take(&mut self.flat) {
            self.sources[source as usize].degenerate += faces.len();
            let message = format!(
                "{} {kind} faces have no area (below {MIN_AREA_M2} m2) and are left out: {}",
                faces.len(),
                self.named(&faces)
            );
            self.warn_file(source, message);
        }
        for ((source, small), faces) in std::mem::take(&mut self.down) {
            let message = if small {
                format!(
                    "{} RoofSurface faces look downward, have less than {SMALL_DOWNWARD_M2} m2 and are left out: {}",
                    faces.len(),
                    self.named(&faces)
                )
            } else {
                format!(
                    "{} RoofSurface faces look downward; kept as obstacles (undersides, or vertices in the wrong order): {}",
                    faces.len(),
                    self.named(&faces)
                )
            };
            self.warn_file(source, message);
        }
    }

    fn warn_file(&mut self, source: u32, message: String) {
        let file = self.sources[source as usize].file.clone();
        self.log.warn_each(Place { file, ..Place::default() }, message);
    }

    fn named(&self, faces: &[u32]) -> String {
        let mut names: Vec<String> = Vec::new();
        for &i in faces {
            let surface = &self.draft.surfaces[i as usize];
            let mut name = self.draft.objects[surface.object as usize].id.clone();
            if surface.line > 0 {
                name = format!("{name} (line {})", surface.line);
            }
            if !names.contains(&name) {
                names.push(name);
            }
            if names.len() == 4 {
                names[3] = "…".to_owned();
                break;
            }
        }
        names.join(", ")
    }
}

fn as_f32(corners: &[DVec3; 3]) -> Triangle {
    Triangle { corners: corners.map(|c| -> Vec3 { c.as_vec3() }), face: 0 }
}
