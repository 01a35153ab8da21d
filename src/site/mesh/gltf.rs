//! glTF 2.0 and GLB: nodes with their transforms, meshes of triangles, materials without textures.
//!
//! The file's JSON is parsed by the crate `gltf`; buffers and accessors are read by our own
//! [`super::accessor`], which bounds every offset before it is believed.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{DMat4, DVec3};
use gltf::mesh::Mode;

use super::accessor::Buffers;
use super::model::{Colour, Mesh};
use super::patches::MeshTriangle;
use crate::base::{Place, limits};
use crate::site::Files;
use crate::site::log::Log;

/// Reads a glTF or GLB file (metres, y up); `None` where faults were logged.
pub(in crate::site) fn read(
    files: &Files,
    file: &Path,
    bytes: &[u8],
    log: &mut Log,
) -> Option<Mesh> {
    let place = || Place { file: file.to_owned(), ..Place::default() };
    let document = match parse(bytes) {
        Ok(document) => document,
        Err(why) => {
            log.fault(place(), format!("not glTF 2.0 that can be read: {why}"));
            return None;
        }
    };
    let mut reader = Reader {
        buffers: Buffers(Vec::new()),
        mesh: Mesh::default(),
        objects: HashMap::new(),
        materials: HashMap::new(),
        seen: HashSet::new(),
        left_out: 0,
        textured: 0,
    };
    let read = buffers(files, file, &document).and_then(|buffers| {
        reader.buffers = Buffers(buffers);
        reader.scene(&document)
    });
    if let Err(message) = read {
        log.fault(place(), message);
        return None;
    }
    if reader.left_out > 0 {
        let message = format!("{} primitives of points or lines are left out", reader.left_out);
        log.warn("files with points or lines", place(), message);
    }
    if reader.textured > 0 {
        let message = format!(
            "{} materials have a texture, which isn't followed; taken as diffuse with the default reflectance",
            reader.textured
        );
        log.warn("files with textures", place(), message);
    }
    Some(reader.mesh)
}

/// Bytes of a GLB file's header: magic, version, length of the file.
const GLB_HEADER_BYTES: u32 = 12;

/// Parses and validates. gltf 1.4.1 looks positions up while it validates their index, and takes a
/// GLB's length less its header's without a look: those are checked before.
fn parse(bytes: &[u8]) -> Result<gltf::Gltf, String> {
    if bytes.starts_with(b"glTF")
        && let Some(length) = bytes.get(8..12).and_then(|b| b.try_into().ok())
        && u32::from_le_bytes(length) < GLB_HEADER_BYTES
    {
        return Err(format!(
            "its header claims {} bytes in all, it has {}",
            u32::from_le_bytes(length),
            bytes.len()
        ));
    }
    let words = |e: gltf::Error| e.to_string();
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice_without_validation(bytes).map_err(words)?;
    let mut json = document.into_json();
    if let Some(name) = json.extensions_required.iter().find(|name| name.contains("compression")) {
        return Err(format!(
            "it requires {name}: compressed meshes aren't read; export it without compression"
        ));
    }
    // The library doesn't know it, we do.
    json.extensions_required.retain(|name| name != "KHR_mesh_quantization");
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    for index in primitives.flat_map(|primitive| primitive.attributes.values()) {
        if index.value() >= json.accessors.len() {
            let count = json.accessors.len();
            return Err(format!("a primitive names accessor {} of {count}", index.value()));
        }
    }
    Ok(gltf::Gltf { document: gltf::Document::from_json(json).map_err(words)?, blob })
}

/// The bytes of every buffer.
fn buffers(files: &Files, file: &Path, document: &gltf::Gltf) -> Result<Vec<Vec<u8>>, String> {
    let mut out = Vec::new();
    for buffer in document.buffers() {
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => document.blob.clone().unwrap_or_default(),
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let (_, text) =
                        data.split_once(";base64,").ok_or("a buffer's data URI isn't base64")?;
                    base64(text).ok_or("a buffer's base64 text is damaged")?
                }
                None => external(files, file, uri)?,
            },
        };
        if bytes.len() < buffer.length() {
            return Err(format!(
                "buffer {} should have {} bytes, found {}",
                buffer.index(),
                buffer.length(),
                bytes.len()
            ));
        }
        out.push(bytes);
    }
    Ok(out)
}

fn external(files: &Files, file: &Path, uri: &str) -> Result<Vec<u8>, String> {
    let path = file.parent().unwrap_or(Path::new("")).join(unescaped(uri));
    let read = files.read(&path, limits::MAX_TEXT_FILE_BYTES);
    let failed = |why| format!("can't read the buffer `{}`: {why}", path.display());
    Ok(read.map_err(failed)?.into_owned())
}

/// Replaces %20 and the like.
fn unescaped(uri: &str) -> String {
    let mut out = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&b, after)) = rest.split_first() {
        let hex = after.get(..2).filter(|_| b == b'%').and_then(|h| std::str::from_utf8(h).ok());
        match hex.and_then(|h| u8::from_str_radix(h, 16).ok()) {
            Some(value) => {
                out.push(value);
                rest = &after[2..];
            }
            None => {
                out.push(b);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for b in text.bytes() {
        let value = match b {
            b'A'..=b'Z' => b - b'A',
            b'a'..=b'z' => b - b'a' + 26,
            b'0'..=b'9' => b - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => break,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            out.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Some(out)
}

struct Reader {
    buffers: Buffers,
    mesh: Mesh,
    objects: HashMap<String, u32>,
    /// By index; `None` is the material of primitives without one.
    materials: HashMap<Option<usize>, u32>,
    /// Nodes that were met: they form trees.
    seen: HashSet<usize>,
    left_out: usize,
    textured: usize,
}

impl Reader {
    fn scene(&mut self, document: &gltf::Gltf) -> Result<(), String> {
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let roots: Vec<_> = match scene {
            Some(scene) => scene.nodes().collect(),
            None => document.nodes().collect(),
        };
        let mut open: Vec<(gltf::Node<'_>, DMat4)> =
            roots.into_iter().rev().map(|n| (n, DMat4::IDENTITY)).collect();
        while let Some((node, parent)) = open.pop() {
            if !self.seen.insert(node.index()) {
                return Err(format!("node {} has two parents or is its own", node.index()));
            }
            let own = node.transform().matrix().map(|c| c.map(f64::from));
            let world = parent * DMat4::from_cols_array_2d(&own);
            if let Some(mesh) = node.mesh() {
                let name = node.name().or(mesh.name()).map(str::to_owned);
                let name = name.unwrap_or_else(|| format!("node{}", node.index()));
                for primitive in mesh.primitives() {
                    self.primitive(&primitive, world, &name)?;
                }
            }
            let children: Vec<_> = node.children().map(|c| (c, world)).collect();
            open.extend(children.into_iter().rev());
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        world: DMat4,
        name: &str,
    ) -> Result<(), String> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.left_out += 1;
            return Ok(());
        }
        let Some(accessor) = primitive.get(&gltf::Semantic::Positions) else { return Ok(()) };
        let first = self.mesh.points.len() as u32;
        let points = self.buffers.positions(&accessor)?;
        let count = points.len();
        if count + self.mesh.points.len() > 3 * limits::MAX_TRIANGLES {
            return Err(format!("more than {} vertices", 3 * limits::MAX_TRIANGLES));
        }
        for (i, &p) in points.iter().enumerate() {
            let p = world * p.extend(1.0);
            let p = DVec3::new(p.x, p.y, p.z);
            if !p.is_finite() {
                return Err(format!("accessor {}: vertex {i} lies at {p}", accessor.index()));
            }
            self.mesh.points.push(p);
        }
        let order: Vec<u32> = match primitive.indices() {
            None => (0..count as u32).collect(),
            Some(indices) => self.buffers.indices(&indices, count)?,
        };
        let object = self.mesh.object(&mut self.objects, name);
        let material = self.material(&primitive.material());
        // Mirroring nodes turn faces round; glTF says that they keep their front.
        let mirrored = world.determinant() < 0.0;
        let n = order.len();
        let triangles = if mode == Mode::Triangles { n / 3 } else { n.saturating_sub(2) };
        for t in 0..triangles {
            let [a, mut b, mut c] = match mode {
                Mode::Triangles => [3 * t, 3 * t + 1, 3 * t + 2],
                Mode::TriangleStrip => [t, t + 1 + t % 2, t + 2 - t % 2],
                _ => [0, t + 1, t + 2],
            };
            if mirrored {
                (b, c) = (c, b);
            }
            if self.mesh.full() {
                return Err(format!("more than {} triangles", limits::MAX_TRIANGLES));
            }
            let corners = [a, b, c].map(|i| first + order[i]);
            self.mesh.triangles.push(MeshTriangle { corners, object, material, line: 0 });
        }
        Ok(())
    }

    fn material(&mut self, material: &gltf::Material<'_>) -> u32 {
        if let Some(&i) = self.materials.get(&material.index()) {
            return i;
        }
        let i = self.mesh.materials.len() as u32;
        self.materials.insert(material.index(), i);
        let pbr = material.pbr_metallic_roughness();
        let textured = pbr.base_color_texture().is_some();
        self.textured += usize::from(textured);
        let [r, g, b, _] = pbr.base_color_factor();
        let known = material.index().is_some() && !textured;
        let reflectance =
            known.then(|| [r, g, b].map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.0 }));
        let name = match (material.name(), material.index()) {
            (Some(name), _) => name.to_owned(),
            (None, Some(index)) => format!("material{index}"),
            (None, None) => "default".to_owned(),
        };
        self.mesh.materials.push(Colour { name, reflectance });
        i
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_that_holds_bytes() {
        assert_eq!(base64("AAECAw==").as_deref(), Some(&[0, 1, 2, 3][..]));
        assert_eq!(base64("aGk").as_deref(), Some(&b"hi"[..]));
        assert_eq!(base64("a!"), None);
        assert_eq!(unescaped("a%20b%2"), "a b%2");
    }
}
