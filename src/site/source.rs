use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::format::Format;

/// A file of the scene, as it was read.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Source {
    /// The file, as the project names it.
    pub file: PathBuf,
    /// `Radiance scene`, `CityJSON 2.0`.
    pub format: String,
    /// Coordinate reference system, where it says.
    pub crs: Option<String>,
    /// Objects that have each level of detail (CityJSON).
    pub levels_of_detail: BTreeMap<String, usize>,
    /// Named things in it.
    pub objects: usize,
    /// Surfaces that are part of the scene.
    pub faces: usize,
    /// Their triangles.
    pub triangles: usize,
    /// Surfaces without area, which are left out.
    pub degenerate: usize,
    /// Smallest and largest coordinates in the file, m.
    pub extent_m: Option<[DVec3; 2]>,
    /// Whether its coordinates are those of a map.
    #[serde(skip)]
    pub(super) is_city: bool,
}

impl Source {
    pub(super) fn new(file: &Path, format: Format) -> Self {
        Self {
            file: file.to_owned(),
            format: format.name().to_owned(),
            crs: None,
            levels_of_detail: BTreeMap::new(),
            objects: 0,
            faces: 0,
            triangles: 0,
            degenerate: 0,
            extent_m: None,
            is_city: format.is_city() || format.is_terrain(),
        }
    }

    /// What no file holds.
    pub(super) fn named(name: &str, format: &str) -> Self {
        let source = Self::new(Path::new(name), Format::Radiance);
        Self { format: format.to_owned(), ..source }
    }

    pub(super) fn spelt(&self) -> String {
        let extent = self.extent_m.map_or_else(String::new, |[min, max]| {
            let size = max - min;
            format!(", {:.1} x {:.1} x {:.1} m", size.x, size.y, size.z)
        });
        let crs = self.crs.as_ref().map_or_else(String::new, |c| format!(", {c}"));
        format!(
            "{}: {} objects, {} faces, {} triangles{extent}{crs}",
            self.format, self.objects, self.faces, self.triangles
        )
    }
}
