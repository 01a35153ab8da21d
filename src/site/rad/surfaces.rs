//! Primitives of Radiance that have geometry, put into the draft.

use glam::DVec3;

use super::command::{self, Command, Copy};
use super::names::Target;
use super::read::{Primitive, Reader, Stop};
use super::shapes;
use crate::base::{Place, limits};
use crate::site::draft::{Shape, Surface, in_reach};
use crate::site::mesh::{self, Owner};
use crate::site::{Material, Object};

/// Primitives that have geometry.
impl Reader<'_, '_, '_> {
    /// `mesh`: its triangles, where the file is one that holds them as text; `instance`: the scene
    /// that it names, where it isn't an octree.
    pub fn nested(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        let file = p.strings.first().copied().unwrap_or_default();
        let is = |end: &str| file.to_ascii_lowercase().ends_with(end);
        if !(is(".obj") && p.kind == "mesh" || is(".rad") && p.kind == "instance") {
            let how = match p.kind {
                "mesh" => "Radiance's binary meshes aren't read: name the .obj that it was made of",
                _ => {
                    "octrees aren't read: name the .rad that it was made of, or include that with `!xform`"
                }
            };
            let message = format!("{} `{}` refers to `{file}`; {how}", p.kind, p.name);
            return Err(self.fault(self.place(p), message));
        }
        let words: Vec<String> = p.strings[1..].iter().map(|&w| w.to_owned()).collect();
        let own = match command::transform(&words) {
            Ok((transform, used)) if used == words.len() => transform,
            Ok((_, used)) => {
                let message = format!("xform doesn't know `{}` here", words[used]);
                return Err(self.fault(self.place(p), message));
            }
            Err(why) => return Err(self.fault(self.place(p), why)),
        };
        if p.kind == "instance" {
            let modifier = (p.modifier != "void").then(|| p.modifier.to_owned());
            let prefix = Some(p.name.to_owned());
            let copy = Copy { transform: own, inverts: false, modifier, prefix };
            let command = Command { files: vec![file.to_owned()], copies: vec![copy] };
            return self.include(&command, p.head.line, self.place(p));
        }
        let (path, bytes) =
            self.included.open(self.file, file).map_err(|why| self.fault(self.place(p), why))?;
        let Some(mesh) = mesh::obj(self.included.files, &path, &bytes, self.log) else {
            return Err(Stop::Resync);
        };
        let transform = own.then(self.copy.transform);
        let modifier = self.copy.modifier.as_deref().unwrap_or(p.modifier);
        let object = self.object(p.name, p.kind);
        let materials = self.mesh_materials(&mesh, modifier, &self.place(p));
        let owner = Owner {
            source: self.source,
            line: self.line.unwrap_or(p.head.line),
            object: Some(object),
            materials: &materials,
            mirrored: transform.mirrors() != self.copy.inverts,
        };
        Ok(mesh.add(|q| transform.point(q), &owner, self.draft, self.log, &path)?)
    }

    /// The material of each of a mesh's: the primitive's, or by name where it says `void`.
    fn mesh_materials(
        &mut self,
        mesh: &mesh::Mesh,
        modifier: &str,
        place: &Place,
    ) -> Vec<(u32, Option<u32>)> {
        let mut out = Vec::new();
        for own in &mesh.materials {
            let name = if modifier == "void" { own.name.as_str() } else { modifier };
            let number = self.names.number(self.draft, name);
            let material = match self.names.find(name) {
                Some(Target::Material(material)) => {
                    self.names.warn_once(name, self.log);
                    material
                }
                _ => {
                    let plain = self.names.plain(name);
                    let reflectance = own.reflectance.unwrap_or(plain.reflectance);
                    let made = Material { reflectance, ..plain };
                    self.names.define_material(self.draft, made, place.clone(), None);
                    self.draft.materials.len() as u32 - 1
                }
            };
            out.push((material, Some(number)));
        }
        out
    }

    /// A new object under the name that `-n` makes of one.
    fn object(&mut self, name: &str, kind: &str) -> u32 {
        let id = match &self.copy.prefix {
            Some(prefix) => format!("{prefix}.{name}"),
            None => name.to_owned(),
        };
        self.draft.objects.push(Object { id, kind: kind.to_owned() });
        self.draft.objects.len() as u32 - 1
    }

    pub fn surface(&mut self, p: &Primitive<'_>) -> Result<(), Stop> {
        if p.kind == "source" {
            let message = "source is ignored: suns and sky come from the project's [time]";
            self.log.warn("sources that are ignored", self.place(p), message);
            return Ok(());
        }
        let modifier = self.copy.modifier.as_deref().unwrap_or(p.modifier);
        let target = self.names.find(modifier);
        if target == Some(Target::Nothing) {
            let message = format!("{} of `{modifier}` is left out: rays pass it", p.kind);
            self.log.warn("surfaces that rays pass", self.place(p), message);
            return Ok(());
        }
        let shape = self.shape(p)?;
        let number = self.names.number(self.draft, modifier);
        let kind = if self.copy.inverts { inside_out(p.kind) } else { p.kind };
        let object = self.object(p.name, kind);
        let material = match target {
            Some(Target::Material(material)) => {
                self.names.warn_once(modifier, self.log);
                material
            }
            _ => {
                self.names.wait(modifier, self.place(p), self.draft.surfaces.len());
                0
            }
        };
        Ok(self.draft.add_surface(Surface {
            shape,
            object,
            material,
            modifier: Some(number),
            source: self.source,
            line: self.line.unwrap_or(p.head.line),
        })?)
    }

    fn shape(&mut self, p: &Primitive<'_>) -> Result<Shape, Stop> {
        let r = &p.reals;
        let wrong = match p.kind {
            "polygon" => polygon_fault(r.len()),
            "sphere" | "bubble" => expects(p, 4, "x y z radius"),
            "cylinder" | "tube" => expects(p, 7, "two ends and a radius"),
            "cone" | "cup" => expects(p, 8, "two ends and two radii"),
            _ => expects(p, 8, "centre, direction and two radii"),
        };
        let far = || r.iter().find(|v| !in_reach(DVec3::splat(**v)));
        let wrong = wrong.or_else(|| far().map(|v| format!("{v} is no coordinate in metres")));
        if let Some(message) = wrong {
            return Err(self.fault(self.place(p), message));
        }
        let placed = &self.copy.transform;
        let inverts = self.copy.inverts;
        let at = |i: usize| placed.point(DVec3::new(r[i], r[i + 1], r[i + 2]));
        let first = self.draft.rings.len();
        let grown = |(radii, negative): ([f64; 2], bool)| {
            (radii.map(|radius| placed.length(radius)), negative != inverts)
        };
        let made = match p.kind {
            "polygon" => {
                let n = r.len() / 3;
                let backward = placed.mirrors() != inverts;
                let order = |i: usize| if backward { n - 1 - i } else { i };
                if let Some(far) = (0..n).map(|i| at(3 * i)).find(|&q| !in_reach(q)) {
                    return Err(self.fault(self.place(p), moved_off(far)));
                }
                self.draft.add_ring((0..n).map(|i| at(3 * order(i))))?;
                return Ok(self.draft.planar_since(first));
            }
            "ring" => {
                let normal = placed.vector(DVec3::new(r[3], r[4], r[5]));
                let normal = if inverts { -normal } else { normal };
                radii(&r[6..8])
                    .map(grown)
                    .and_then(|(radii, _)| shapes::ring(at(0), normal, radii))
                    .map(Ok)
            }
            "sphere" | "bubble" => radii(&[r[3], r[3]])
                .map(grown)
                .map(|(radii, negative)| {
                    shapes::sphere(at(0), radii[0], negative != (p.kind == "bubble"))
                })
                .map(Err),
            "cylinder" | "tube" => radii(&[r[6], r[6]])
                .map(grown)
                .and_then(|(radii, negative)| {
                    shapes::cone([at(0), at(3)], radii, negative != (p.kind == "tube"))
                })
                .map(Err),
            _ => radii(&r[6..8])
                .map(grown)
                .and_then(|(radii, negative)| {
                    shapes::cone([at(0), at(3)], radii, negative != (p.kind == "cup"))
                })
                .map(Err),
        };
        let points = match &made {
            Ok(Ok(rings)) => rings.first().and_then(|ring| ring.first()),
            Ok(Err(corners)) => corners.first(),
            Err(_) => None,
        };
        let reach = points.is_none_or(|&q| in_reach(q)) && placed.length(1.0) < 1e9;
        if !reach {
            return Err(self.fault(self.place(p), moved_off(points.copied().unwrap_or_default())));
        }
        match made {
            Ok(Ok(rings)) => {
                for ring in rings {
                    self.draft.add_ring(ring.into_iter())?;
                }
                Ok(self.draft.planar_since(first))
            }
            Ok(Err(corners)) => Ok(self.draft.add_curved(&corners)?),
            Err(why) => Err(self.fault(self.place(p), format!("{} `{}`: {why}", p.kind, p.name))),
        }
    }
}

fn moved_off(point: DVec3) -> String {
    format!("its transform moves it to {point}, which is no place in metres")
}

/// The type of a surface whose front became its back.
fn inside_out(kind: &str) -> &str {
    let pairs = [("sphere", "bubble"), ("cylinder", "tube"), ("cone", "cup")];
    let other = pairs.iter().find_map(|&(a, b)| {
        if kind == a {
            Some(b)
        } else if kind == b {
            Some(a)
        } else {
            None
        }
    });
    other.unwrap_or(kind)
}

/// What is wrong with a polygon of so many numbers.
fn polygon_fault(numbers: usize) -> Option<String> {
    if numbers < 9 {
        return Some(format!(
            "polygon needs at least 3 vertices (9 numbers), found {numbers}{}",
            if numbers.is_multiple_of(3) {
                format!(" ({} vertices)", numbers / 3)
            } else {
                String::new()
            }
        ));
    }
    if !numbers.is_multiple_of(3) {
        return Some(format!("a polygon's numbers come in threes (x y z), found {numbers}"));
    }
    let vertices = numbers / 3;
    (vertices > limits::MAX_POLYGON_VERTICES).then(|| {
        format!(
            "polygon of {vertices} vertices; {} at most: divide it",
            limits::MAX_POLYGON_VERTICES
        )
    })
}

fn expects(p: &Primitive<'_>, count: usize, what: &str) -> Option<String> {
    (p.reals.len() != count)
        .then(|| format!("{} needs {count} numbers ({what}), found {}", p.kind, p.reals.len()))
}

/// Radii without their sign, and whether they were negative: Radiance then turns the surface
/// inside out.
fn radii(r: &[f64]) -> Result<([f64; 2], bool), &'static str> {
    let (low, high) = (r[0].min(r[1]), r[0].max(r[1]));
    match () {
        () if low == 0.0 && high == 0.0 => Err("radius is 0"),
        () if low < 0.0 && high > 0.0 => Err("one radius is negative, the other isn't"),
        () => Ok(([r[0].abs(), r[1].abs()], low < 0.0)),
    }
}
