use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::model::{Colour, Mesh};
use super::patches::MeshTriangle;
use crate::base::{Place, limits};
use crate::site::log::Log;

/// Bytes before the triangles of a binary file: 80 of text and their number.
const HEAD_BYTES: usize = 84;
/// Bytes of a triangle: normal, three corners, an attribute.
const TRIANGLE_BYTES: usize = 50;

/// Reads an STL file, binary or text; `None` where faults were logged.
pub(in crate::site) fn read(file: &Path, bytes: &[u8], log: &mut Log) -> Option<Mesh> {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let material = Colour { name: "default".to_owned(), reflectance: None };
    let mut mesh = Mesh { materials: vec![material], ..Mesh::default() };
    let claimed = bytes.get(80..HEAD_BYTES).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let fits =
        |n: u32| HEAD_BYTES as u64 + TRIANGLE_BYTES as u64 * u64::from(n) == bytes.len() as u64;
    // Binary files may begin with "solid" as well: their length tells.
    let read = if claimed.is_some_and(fits) {
        binary(&mut mesh, &bytes[HEAD_BYTES..], stem)
    } else if bytes.trim_ascii_start().starts_with(b"solid") {
        text(&mut mesh, &String::from_utf8_lossy(bytes), &stem)
    } else {
        let found = claimed.map_or_else(
            || format!("{} bytes", bytes.len()),
            |n| format!("{} bytes, which don't hold the {n} triangles that it claims", bytes.len()),
        );
        Err((
            0,
            format!(
                "expected `solid` or {HEAD_BYTES} bytes and {TRIANGLE_BYTES} for each triangle, found {found}: is it an STL file, and whole?"
            ),
        ))
    };
    match read {
        Ok(()) => Some(mesh),
        Err((line, message)) => {
            log.fault(Place { file: file.to_owned(), line, ..Place::default() }, message);
            None
        }
    }
}

fn too_many() -> String {
    format!("more than {} triangles", limits::MAX_TRIANGLES)
}

fn binary(mesh: &mut Mesh, bytes: &[u8], name: String) -> Result<(), (usize, String)> {
    mesh.objects.push(name);
    for (i, triangle) in bytes.chunks_exact(TRIANGLE_BYTES).enumerate() {
        if mesh.full() {
            return Err((0, too_many()));
        }
        let first = mesh.points.len() as u32;
        for corner in triangle[12..48].chunks_exact(12) {
            let mut at = [0.0; 3];
            for (value, raw) in at.iter_mut().zip(corner.chunks_exact(4)) {
                *value = f64::from(f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]));
            }
            let at = DVec3::from(at);
            if !at.is_finite() {
                return Err((0, format!("triangle {} has a corner at {at}", i + 1)));
            }
            mesh.points.push(at);
        }
        let corners = [first, first + 1, first + 2];
        mesh.triangles.push(MeshTriangle { corners, object: 0, material: 0, line: 0 });
    }
    Ok(())
}

fn text(mesh: &mut Mesh, text: &str, stem: &str) -> Result<(), (usize, String)> {
    let mut known = HashMap::new();
    let mut object = 0;
    let mut corners = 0;
    for (number, line) in text.lines().enumerate() {
        let number = number + 1;
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match key {
            "solid" => {
                let name = rest.trim();
                object = mesh.object(&mut known, if name.is_empty() { stem } else { name });
            }
            "vertex" => {
                let mut words = rest.split_ascii_whitespace();
                let mut at = [0.0; 3];
                for value in &mut at {
                    let word = words.next().unwrap_or("nothing");
                    let read = word.parse::<f64>().ok().filter(|v| v.is_finite());
                    let wrong = || (number, format!("vertex needs three numbers, found `{word}`"));
                    *value = read.ok_or_else(wrong)?;
                }
                if mesh.full() {
                    return Err((number, too_many()));
                }
                mesh.points.push(DVec3::from(at));
                corners += 1;
            }
            "endloop" => {
                if corners != 3 {
                    return Err((number, format!("a loop of {corners} vertices; expected 3")));
                }
                let end = mesh.points.len() as u32;
                let corners_of = [end - 3, end - 2, end - 1];
                mesh.triangles.push(MeshTriangle {
                    corners: corners_of,
                    object,
                    material: 0,
                    line: number as u32,
                });
                corners = 0;
            }
            "" | "facet" | "outer" | "endfacet" | "endsolid" => {}
            other => {
                return Err((
                    number,
                    format!("expected facet, vertex or endloop, found `{other}`"),
                ));
            }
        }
    }
    if corners > 0 {
        return Err((text.lines().count(), "the file ends within a loop".to_owned()));
    }
    Ok(())
}
