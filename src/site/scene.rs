use glam::{DVec3, Vec3};

use super::{Bvh, Crowns, Triangle};
use crate::base::{Aabb, Finding};

/// A surface as the source has it (a polygon, a sphere, a mesh): triangles share it.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Index into [`Site::objects`].
    pub object: u32,
    /// Index into [`Site::materials`].
    pub material: u32,
    /// The PV surface that it belongs to.
    pub pv: Option<u16>,
}

/// A thing with a name: a building of a city model, an identifier of a Radiance file.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The name in the source.
    pub id: String,
    /// What the source says it is: `RoofSurface`, `polygon`, `TINRelief`, or empty.
    pub kind: String,
}

/// A material of the scene, as far as the background picture and the checks need it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the source.
    pub name: String,
    /// Reflectance per colour channel, 0..1: the diffuse part, or a mirror's or pane's at normal
    /// incidence.
    pub reflectance: [f32; 3],
    /// Whether any of it is diffuse (`receivers = "diffuse"` keeps photons only there, as Radiance
    /// does).
    pub diffuse: bool,
}

/// A PV surface: one planar face of a `[[pv]]` entry; photons carry its index.
#[derive(Clone, Debug, PartialEq)]
pub struct PvSurface {
    /// The entry's name, with `/N` behind it where the entry selects several faces.
    pub name: String,
    /// Index of the `[[pv]]` entry.
    pub entry: usize,
    /// Its triangles, indices into [`Site::triangles`].
    pub triangles: Vec<u32>,
    /// Unit normal of the front.
    pub normal: DVec3,
    /// Area, m2.
    pub area_m2: f64,
    /// Whether the back emits as well.
    pub two_sided: bool,
}

/// The whole scene, ready for rays.
#[derive(Debug)]
pub struct Site {
    /// All triangles.
    pub triangles: Vec<Triangle>,
    /// All surfaces of the sources.
    pub faces: Vec<Face>,
    /// All named things.
    pub objects: Vec<Object>,
    /// All materials.
    pub materials: Vec<Material>,
    /// The PV, by surface number.
    pub pv: Vec<PvSurface>,
    /// Map coordinates of the local origin, m.
    pub origin: DVec3,
    /// Extent, metres from the local origin.
    pub bounds: Aabb,
    /// The rays.
    pub bvh: Bvh,
    /// Crowns that let light through in some months; `None`: all is opaque all year. [`Self::bvh`]
    /// holds them as opaque.
    pub crowns: Option<Crowns>,
    /// What was noticed while reading.
    pub findings: Vec<Finding>,
}

impl Site {
    /// Share of the light that passes from `origin` along `direction` as far as `max_m`, in a month
    /// from 0 (January): 0 or 1 where nothing changes with the season.
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, max_m: f32, month: usize) -> f32 {
        match &self.crowns {
            Some(crowns) => crowns.transmittance(origin, direction, max_m, month),
            None => f32::from(u8::from(!self.bvh.occluded(origin, direction, 0.0, max_m))),
        }
    }

    /// For each month the first one in which [`Self::transmittance`] is the same.
    pub fn months_alike(&self) -> [usize; 12] {
        self.crowns.as_ref().map_or([0; 12], Crowns::alike)
    }

    /// A scene from its parts: finds the extent and builds the hierarchy. The parts' indices
    /// must fit each other.
    pub fn from_parts(
        triangles: Vec<Triangle>,
        faces: Vec<Face>,
        objects: Vec<Object>,
        materials: Vec<Material>,
        pv: Vec<PvSurface>,
        origin: DVec3,
        findings: Vec<Finding>,
    ) -> Self {
        let bounds = Aabb::around(triangles.iter().flat_map(|t| t.corners));
        let bvh = Bvh::build(&triangles);
        let crowns = None;
        Self { triangles, faces, objects, materials, pv, origin, bounds, bvh, crowns, findings }
    }

    /// The face that a triangle is part of.
    pub fn face_of(&self, triangle: u32) -> &Face {
        &self.faces[self.triangles[triangle as usize].face as usize]
    }
}
