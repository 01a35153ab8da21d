//! PLY: text or binary of either byte order, vertices and faces of any size.
//!
//! The header says which properties an element has, in which order and of which type, so a body can
//! only be read value by value. Counts are claims: nothing is allocated by them, and reading ends
//! where the file ends. After Turk 1994, "The PLY polygon file format".

use std::path::Path;

use glam::DVec3;

use super::model::{Colour, Mesh, Polygon};
use super::patches::MeshTriangle;
use crate::base::{Place, limits};
use crate::site::log::Log;

/// Lines of header that are read.
const MAX_HEADER_LINES: usize = 10_000;

/// Reads a PLY file, text or binary of either byte order; `None` where faults were logged.
pub(in crate::site) fn read(file: &Path, bytes: &[u8], log: &mut Log) -> Option<Mesh> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let read = header(bytes).and_then(|(header, rest)| body(&header, rest, stem));
    match read {
        Ok(mesh) => Some(mesh),
        Err((line, message)) => {
            log.fault(Place { file: file.to_owned(), line, ..Place::default() }, message);
            None
        }
    }
}

type Wrong = (usize, String);

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property {
    name: String,
    /// For a list: of what type its length is.
    length: Option<Scalar>,
    scalar: Scalar,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

fn scalar(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

fn header(bytes: &[u8]) -> Result<(Header, &[u8]), Wrong> {
    let mut rest = bytes;
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 1..=MAX_HEADER_LINES {
        let end = rest.iter().position(|&b| b == b'\n');
        let end = end.ok_or((number, "the file ends within its header".to_owned()))?;
        let line = String::from_utf8_lossy(&rest[..end]).trim().to_owned();
        rest = &rest[end + 1..];
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let wrong = || (number, format!("`{line}` isn't a line of a PLY header"));
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => {
                return Err((1, "expected `ply` on the first line: is it a PLY file?".to_owned()));
            }
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Text,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong())?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", length, of, name] => {
                let element = elements.last_mut().ok_or_else(wrong)?;
                let (length, scalar) = (scalar(length), scalar(of).ok_or_else(wrong)?);
                length.ok_or_else(wrong)?;
                element.properties.push(Property { name: name.to_owned(), length, scalar });
            }
            ["property", of, name] => {
                let element = elements.last_mut().ok_or_else(wrong)?;
                let scalar = scalar(of).ok_or_else(wrong)?;
                element.properties.push(Property { name: name.to_owned(), length: None, scalar });
            }
            ["end_header"] => {
                let encoding = encoding.ok_or((number, "no `format` in the header".to_owned()))?;
                return Ok((Header { encoding, elements }, rest));
            }
            [] | ["comment" | "obj_info", ..] => {}
            _ => return Err(wrong()),
        }
    }
    Err((MAX_HEADER_LINES, "the header never ends".to_owned()))
}

/// The values of the body, one after another.
struct Values<'a> {
    encoding: Encoding,
    bytes: &'a [u8],
}

impl Values<'_> {
    fn next(&mut self, scalar: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Text {
            let start = self.bytes.iter().position(|b| !b.is_ascii_whitespace())?;
            let rest = &self.bytes[start..];
            let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
            self.bytes = &rest[end..];
            return std::str::from_utf8(&rest[..end]).ok()?.parse().ok();
        }
        match scalar {
            Scalar::I8 => self.take().map(|b| f64::from(i8::from_le_bytes(b))),
            Scalar::U8 => self.take().map(|b: [u8; 1]| f64::from(b[0])),
            Scalar::I16 => self.take().map(|b| f64::from(i16::from_le_bytes(b))),
            Scalar::U16 => self.take().map(|b| f64::from(u16::from_le_bytes(b))),
            Scalar::I32 => self.take().map(|b| f64::from(i32::from_le_bytes(b))),
            Scalar::U32 => self.take().map(|b| f64::from(u32::from_le_bytes(b))),
            Scalar::F32 => self.take().map(|b| f64::from(f32::from_le_bytes(b))),
            Scalar::F64 => self.take().map(f64::from_le_bytes),
        }
    }

    /// The next bytes, least significant first.
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (mut first, rest) = self.bytes.split_first_chunk::<N>().map(|(a, b)| (*a, b))?;
        self.bytes = rest;
        if self.encoding == Encoding::Big {
            first.reverse();
        }
        Some(first)
    }
}

/// What the body's elements are read into.
struct Body<'a> {
    values: Values<'a>,
    mesh: Mesh,
}

fn body(header: &Header, bytes: &[u8], stem: String) -> Result<Mesh, Wrong> {
    let material = Colour { name: "default".to_owned(), reflectance: None };
    let mesh = Mesh { objects: vec![stem], materials: vec![material], ..Mesh::default() };
    let mut body = Body { values: Values { encoding: header.encoding, bytes }, mesh };
    for element in &header.elements {
        let axes = ["x", "y", "z"].map(|a| element.properties.iter().position(|p| p.name == a));
        let is_vertex = element.name == "vertex";
        if is_vertex && axes.contains(&None) {
            return Err((0, "element vertex lacks x, y or z".to_owned()));
        }
        // Without properties there is nothing to read, however many there are.
        if element.properties.is_empty() {
            continue;
        }
        for number in 1..=element.count {
            if body.mesh.full() {
                return Err((0, format!("more than {} faces", limits::MAX_TRIANGLES)));
            }
            if is_vertex {
                body.vertex(element, number, axes)?;
            } else {
                body.face(element, number)?;
            }
        }
    }
    Ok(body.mesh)
}

impl Body<'_> {
    /// The next value of the `number`-th element of a kind.
    fn value(&mut self, element: &Element, number: u64, scalar: Scalar) -> Result<f64, Wrong> {
        self.values.next(scalar).ok_or_else(|| {
            let Element { name, count, .. } = element;
            let what = format!(
                "the header claims {count} times {name}; number {number} is cut short or no number"
            );
            (0, what)
        })
    }

    /// The values of a property: one, or as many as the list says.
    fn values(
        &mut self,
        (element, number): (&Element, u64),
        property: &Property,
        mut take: impl FnMut(&mut Mesh, f64) -> Result<(), Wrong>,
    ) -> Result<(), Wrong> {
        let length = match property.length {
            None => 1.0,
            Some(scalar) => self.value(element, number, scalar)?,
        };
        if is_corners(element, property)
            && !(0.0..=limits::MAX_POLYGON_VERTICES as f64).contains(&length)
        {
            return Err((0, format!("face {number} claims {length} vertices")));
        }
        // The length is a claim: values are taken one by one until the file ends.
        for _ in 0..length.max(0.0) as u64 {
            let value = self.value(element, number, property.scalar)?;
            take(&mut self.mesh, value)?;
        }
        Ok(())
    }

    fn vertex(
        &mut self,
        element: &Element,
        number: u64,
        axes: [Option<usize>; 3],
    ) -> Result<(), Wrong> {
        let mut at = [0.0; 3];
        for (p, property) in element.properties.iter().enumerate() {
            let axis =
                axes.iter().position(|&a| a == Some(p)).filter(|_| property.length.is_none());
            self.values((element, number), property, |_, value| {
                if let Some(axis) = axis {
                    at[axis] = value;
                }
                Ok(())
            })?;
        }
        let at = DVec3::from(at);
        if !at.is_finite() {
            return Err((0, format!("vertex {number} lies at {at}")));
        }
        self.mesh.points.push(at);
        Ok(())
    }

    /// A face, or anything else, of which nothing is kept.
    fn face(&mut self, element: &Element, number: u64) -> Result<(), Wrong> {
        let first = self.mesh.corners.len();
        for property in &element.properties {
            let corners = is_corners(element, property);
            self.values((element, number), property, |mesh, value| {
                let count = mesh.points.len();
                if corners && !(0.0..count as f64).contains(&value) {
                    return Err((0, format!("face {number} names vertex {value} of {count}")));
                }
                mesh.corners.extend(corners.then_some(value as u32));
                Ok(())
            })?;
        }
        let mesh = &mut self.mesh;
        match mesh.corners[first..] {
            [a, b, c] => {
                let corners = [a, b, c];
                mesh.triangles.push(MeshTriangle { corners, object: 0, material: 0, line: 0 });
                mesh.corners.truncate(first);
            }
            [_, _, _, _, ..] => {
                let corners = first as u32..mesh.corners.len() as u32;
                mesh.polygons.push(Polygon { corners, object: 0, material: 0, line: 0 });
            }
            _ => mesh.corners.truncate(first),
        }
        Ok(())
    }
}

/// Whether a property lists the corners of faces.
fn is_corners(element: &Element, property: &Property) -> bool {
    element.name == "face" && property.name.starts_with("vertex_ind") && property.length.is_some()
}
