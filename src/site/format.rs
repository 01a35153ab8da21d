//! Which format a scene file has, by its name, and in which unit and axes its numbers are.
//!
//! OBJ, PLY and STL don't say their unit or which axis points up. A guess would be right most of
//! the time and silently wrong by a factor of 1,000 otherwise, so the project has to state it.

use glam::DVec3;

use super::{Error, SceneFile};

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Format {
    Radiance,
    CityJson,
    CityJsonSequence,
    Obj,
    Gltf,
    Ply,
    Stl,
    AsciiGrid,
    GeoTiff,
}

impl Format {
    pub fn name(self) -> &'static str {
        match self {
            Self::Radiance => "Radiance scene",
            Self::CityJson => "CityJSON",
            Self::CityJsonSequence => "CityJSONSeq",
            Self::Obj => "OBJ",
            Self::Gltf => "glTF",
            Self::Ply => "PLY",
            Self::Stl => "STL",
            Self::AsciiGrid => "ESRI ASCII grid",
            Self::GeoTiff => "GeoTIFF",
        }
    }

    pub fn is_city(self) -> bool {
        matches!(self, Self::CityJson | Self::CityJsonSequence)
    }

    pub fn is_mesh(self) -> bool {
        matches!(self, Self::Obj | Self::Gltf | Self::Ply | Self::Stl)
    }

    pub fn is_terrain(self) -> bool {
        matches!(self, Self::AsciiGrid | Self::GeoTiff)
    }
}

/// Unit and up axis of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axes {
    unit_m: f64,
    up: Up,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Up {
    X,
    Y,
    Z,
}

impl Axes {
    /// A point of the file in metres, z up. The other axes keep their sense and their order.
    pub fn metres(self, p: DVec3) -> DVec3 {
        let p = match self.up {
            Up::Z => p,
            Up::Y => DVec3::new(p.x, -p.z, p.y),
            Up::X => DVec3::new(p.y, p.z, p.x),
        };
        p * self.unit_m
    }
}

fn unit(name: &str) -> Option<f64> {
    Some(match name.to_ascii_lowercase().as_str() {
        "m" | "metre" | "meter" => 1.0,
        "dm" => 0.1,
        "cm" => 0.01,
        "mm" => 0.001,
        "km" => 1000.0,
        "in" | "inch" => 0.0254,
        "ft" | "foot" => 0.3048,
        _ => return None,
    })
}

fn up(name: &str) -> Option<Up> {
    Some(match name.to_ascii_lowercase().as_str() {
        "z" => Up::Z,
        "y" => Up::Y,
        "x" => Up::X,
        _ => return None,
    })
}

impl SceneFile {
    /// Whether it is a mesh, by its name: of those unit and up axis can be stated.
    pub fn is_mesh(&self) -> bool {
        let stated = Self { unit: Some("m".into()), up: Some("z".into()), ..self.clone() };
        format_of(&stated).is_ok_and(|(format, _)| format.is_mesh())
    }
}

/// The format of a file, by its name, and its axes.
pub(super) fn format_of(file: &SceneFile) -> Result<(Format, Axes), Error> {
    let extension =
        file.path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let format = match extension.as_str() {
        "rad" => Format::Radiance,
        "json" => Format::CityJson,
        "jsonl" => Format::CityJsonSequence,
        "obj" => Format::Obj,
        "gltf" | "glb" => Format::Gltf,
        "ply" => Format::Ply,
        "stl" => Format::Stl,
        "asc" => Format::AsciiGrid,
        "tif" | "tiff" => Format::GeoTiff,
        other => {
            return Err(Error::Format {
                path: file.path.clone(),
                extension: other.to_owned(),
                hint: match other {
                    "gml" | "xml" => "; convert CityGML with citygml-tools",
                    "oct" => "; give the scene files that the octree was made of",
                    "rtm" => "; give the .obj that the mesh was made of",
                    "fbx" | "dae" | "3ds" | "skp" | "blend" | "dxf" | "dwg" | "ifc" => {
                        "; export it as glTF (.glb)"
                    }
                    _ => "",
                },
            });
        }
    };
    let wrong = |key, found: &str, expected| Error::Setting {
        path: file.path.clone(),
        key,
        found: found.to_owned(),
        expected,
    };
    let unit_m = match &file.unit {
        None => None,
        Some(name) => {
            let expected = "m, cm, mm, km, in or ft";
            Some(unit(name).ok_or_else(|| wrong("unit", name, expected))?)
        }
    };
    let up = match &file.up {
        None => None,
        Some(name) => Some(up(name).ok_or_else(|| wrong("up", name, "z, y or x"))?),
    };
    if !format.is_mesh() {
        if unit_m.is_some_and(|u| u != 1.0) {
            let found = file.unit.as_deref().unwrap_or_default();
            return Err(wrong("unit", found, "m: files of this format are in metres"));
        }
        if up.is_some_and(|u| u != Up::Z) {
            let found = file.up.as_deref().unwrap_or_default();
            return Err(wrong("up", found, "z: it points up in files of this format"));
        }
    } else if format != Format::Gltf && (unit_m.is_none() || up.is_none()) {
        return Err(Error::Unstated {
            path: file.path.clone(),
            format: format.name(),
            missing: match (unit_m, up) {
                (None, None) => "their unit and which axis points up",
                (None, _) => "their unit",
                _ => "which axis points up",
            },
        });
    }
    let usual = if format == Format::Gltf { Up::Y } else { Up::Z };
    Ok((format, Axes { unit_m: unit_m.unwrap_or(1.0), up: up.unwrap_or(usual) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_turn_and_never_mirror() {
        for up in [Up::X, Up::Y, Up::Z] {
            let axes = Axes { unit_m: 0.01, up };
            let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|v| axes.metres(v));
            assert!((x.cross(y).dot(z) - 1e-6).abs() < 1e-18, "{up:?}");
            let upward = [x, y, z][up as usize];
            assert!((upward - DVec3::Z * 0.01).length() < 1e-15);
        }
    }
}
