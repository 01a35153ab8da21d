//! Wavefront OBJ and MTL: faces by object or group, diffuse colours by material.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::DVec3;

use super::model::{Colour, Mesh, Polygon};
use super::patches::MeshTriangle;
use crate::base::{Place, limits};
use crate::site::Files;
use crate::site::log::Log;

/// Largest material file, bytes.
const MAX_LIBRARY_BYTES: u64 = 1 << 28;

/// Reads a Wavefront OBJ file and the MTL files that it names; `None` where faults were logged.
pub(in crate::site) fn read(
    files: &Files,
    file: &Path,
    bytes: &[u8],
    log: &mut Log,
) -> Option<Mesh> {
    let faults = log.faults.len();
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut reader = Reader {
        files,
        file,
        mesh: Mesh::default(),
        objects: HashMap::new(),
        materials: HashMap::new(),
        colours: BTreeMap::new(),
        used: (None, None),
        thing: stem.clone(),
        group: None,
        stem,
        log,
    };
    reader.all(&String::from_utf8_lossy(bytes));
    let Reader { mut mesh, colours, log, .. } = reader;
    for material in &mut mesh.materials {
        material.reflectance = colours.get(&material.name).copied();
    }
    (log.faults.len() == faults).then_some(mesh)
}

struct Reader<'a> {
    files: &'a Files,
    file: &'a Path,
    mesh: Mesh,
    objects: HashMap<String, u32>,
    materials: HashMap<String, u32>,
    /// What MTL files say.
    colours: BTreeMap<String, [f32; 3]>,
    /// Object and material of the faces to come.
    used: (Option<u32>, Option<u32>),
    thing: String,
    group: Option<String>,
    stem: String,
    log: &'a mut Log,
}

impl Reader<'_> {
    fn all(&mut self, text: &str) {
        let mut lines = text.lines().enumerate();
        while let Some((number, line)) = lines.next() {
            if self.log.full() {
                return;
            }
            let number = number as u32 + 1;
            let wrong = if line.trim_end().ends_with('\\') {
                // A backslash joins the next line to this one.
                let mut joined = line.trim_end().trim_end_matches('\\').to_owned();
                for (_, more) in lines.by_ref() {
                    joined.push(' ');
                    joined.push_str(more.trim_end().trim_end_matches('\\'));
                    if !more.trim_end().ends_with('\\') {
                        break;
                    }
                }
                self.line(number, &joined)
            } else {
                self.line(number, line)
            };
            if let Err(message) = wrong {
                self.log.fault(self.place(number), message);
            }
        }
    }

    fn place(&self, line: u32) -> Place {
        Place { file: self.file.to_owned(), line: line as usize, ..Place::default() }
    }

    fn line(&mut self, number: u32, line: &str) -> Result<(), String> {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match key {
            "v" => self.vertex(rest),
            "f" | "fo" => self.face(number, rest),
            "o" => {
                self.thing = named(rest, &self.stem);
                (self.group, self.used.0) = (None, None);
                Ok(())
            }
            "g" => {
                self.group = (!rest.is_empty() && rest != "default").then(|| named(rest, ""));
                self.used.0 = None;
                Ok(())
            }
            "usemtl" => {
                self.used.1 = Some(self.material(rest));
                Ok(())
            }
            "mtllib" => {
                self.library(number, rest);
                Ok(())
            }
            "curv" | "curv2" | "surf" | "call" | "csh" => {
                let message = format!("`{key}` isn't followed: only faces (f) are read");
                self.log.warn("lines that aren't followed", self.place(number), message);
                Ok(())
            }
            // Texture coordinates, normals, smoothing, points, lines and display settings.
            _ => Ok(()),
        }
    }

    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        if self.mesh.full() {
            return Err(format!("more than {} vertices", 3 * limits::MAX_TRIANGLES));
        }
        let mut words = rest.split_ascii_whitespace();
        let mut point = [0.0; 3];
        for value in &mut point {
            let word = words.next().unwrap_or("nothing");
            let read = word.parse::<f64>().ok().filter(|v| v.is_finite());
            *value = read.ok_or_else(|| format!("v needs three numbers, found `{word}`"))?;
        }
        self.mesh.points.push(DVec3::from(point));
        Ok(())
    }

    fn face(&mut self, number: u32, rest: &str) -> Result<(), String> {
        if self.mesh.full() {
            return Err(format!("more than {} faces", limits::MAX_TRIANGLES));
        }
        let object = self.owner();
        let material = match self.used.1 {
            Some(material) => material,
            None => self.material("default"),
        };
        self.used = (Some(object), Some(material));
        let known = self.mesh.points.len();
        let first = self.mesh.corners.len();
        let mut wrong = None;
        for word in rest.split_ascii_whitespace() {
            let text = word.split('/').next().unwrap_or_default();
            let index = match text.parse::<i64>() {
                Ok(i) if i > 0 => usize::try_from(i - 1).ok(),
                Ok(i) if i < 0 => usize::try_from(known as i64 + i).ok(),
                _ => None,
            };
            match index.filter(|&i| i < known) {
                Some(i) => self.mesh.corners.push(i as u32),
                None => {
                    wrong = Some(format!(
                        "f names vertex `{text}`; expected 1 to {known} (or negative, counted back)"
                    ));
                    break;
                }
            }
        }
        let corners = &self.mesh.corners[first..];
        let count = corners.len();
        if count < 3 {
            wrong = wrong.or(Some(format!("f needs three vertices at least, found {count}")));
        } else if count > limits::MAX_POLYGON_VERTICES {
            wrong = Some(format!(
                "f of {count} vertices; {} at most: divide it",
                limits::MAX_POLYGON_VERTICES
            ));
        } else if let &[a, b, c] = corners {
            self.mesh.triangles.push(MeshTriangle {
                corners: [a, b, c],
                object,
                material,
                line: number,
            });
        }
        if let Some(message) = wrong {
            self.mesh.corners.truncate(first);
            return Err(message);
        }
        if count == 3 {
            self.mesh.corners.truncate(first);
        } else {
            let corners = first as u32..self.mesh.corners.len() as u32;
            self.mesh.polygons.push(Polygon { corners, object, material, line: number });
        }
        Ok(())
    }

    /// The object that faces belong to: the group in its object, where both are named.
    fn owner(&mut self) -> u32 {
        if let Some(object) = self.used.0 {
            return object;
        }
        let name = self.group.clone().unwrap_or_else(|| self.thing.clone());
        if self.group.is_some() && name != self.thing {
            let link = (self.thing.clone(), name.clone());
            if !self.objects.contains_key(&name) {
                self.mesh.parts.push(link);
            }
        }
        self.mesh.object(&mut self.objects, &name)
    }

    fn material(&mut self, name: &str) -> u32 {
        let name = named(name, "default");
        if let Some(&i) = self.materials.get(&name) {
            return i;
        }
        let i = self.mesh.materials.len() as u32;
        self.mesh.materials.push(Colour { name: name.clone(), reflectance: None });
        self.materials.insert(name, i);
        i
    }

    /// MTL files only colour the picture: what is wrong with one is a warning.
    fn library(&mut self, number: u32, rest: &str) {
        // Names with blanks are written as they are; several names stand side by side.
        let folder = self.file.parent().unwrap_or(Path::new(""));
        let whole = folder.join(rest);
        let names: Vec<_> = if whole.is_file() {
            vec![whole]
        } else {
            rest.split_ascii_whitespace().map(|n| folder.join(n)).collect()
        };
        for path in names {
            match self.files.read(&path, MAX_LIBRARY_BYTES) {
                Ok(bytes) => self.colours(&String::from_utf8_lossy(&bytes)),
                Err(_) => {
                    let message = format!(
                        "can't read the material file `{}`; its materials get the default reflectance",
                        path.display()
                    );
                    self.log.warn("material files that can't be read", self.place(number), message);
                }
            }
        }
    }

    fn colours(&mut self, text: &str) {
        let mut name = None;
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            match (key, &name) {
                ("newmtl", _) => name = Some(named(rest.trim(), "default")),
                ("Kd", Some(name)) => {
                    let rgb: Vec<f32> =
                        rest.split_ascii_whitespace().filter_map(|w| w.parse().ok()).collect();
                    let rgb = match rgb[..] {
                        // Green and blue may be left out: they equal red.
                        [grey] => [grey; 3],
                        [r, g, b] => [r, g, b],
                        _ => continue,
                    };
                    if rgb.iter().all(|v| v.is_finite()) {
                        self.colours.insert(name.clone(), rgb.map(|v| v.clamp(0.0, 1.0)));
                    }
                }
                _ => {}
            }
        }
    }
}

fn named(text: &str, default: &str) -> String {
    if text.is_empty() { default.to_owned() } else { text.to_owned() }
}
